"""Training of the network for remaining life, on labelled simulated lives and the run's unlabelled records.

simulated: record, place, speed --> features --+--> regressor ------------> eq. 7, mean squared error
real, up to now: the same, no labels ----------+--> reversal --> discriminator --> eq. 15     (adversarial models)

Training seeks the saddle of L = L_r - lambda (L_d of simulated records + L_d of real ones), eq. 6: what is lowered is
L_r + L_d + L_d, with the domain logits from behind the reversal. Extractor and regressor then get the gradient of eq.
6, lambda included, and the discriminator that of L_d itself: by eq. 6 it would be lambda times as much, which only
changes its step. Labels are remaining revolutions over those of the longest simulated life, so from 0 to 1; one number
scales the samples of both domains. Checkpoints are chosen without a label of the real run (`judge_checkpoints`).
Source: sections 2.2, 3.7 and 4 of paper 1, after Ganin et al. 2016, arXiv:1505.07818.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from papers.arrays import Array
from papers.paper1_rul_varying_speed.methods.architecture import LifeArchitecture, positional_encoding, speed_position
from papers.paper1_rul_varying_speed.methods.network import LifeNetwork
from papers.paper1_rul_varying_speed.methods.simulated_lives import Snapshots
from twingap import TwingapError
from twingap.adapt import best_device, reproducible

State = dict[str, Tensor]
SIMULATED, REAL = 0.0, 1.0
"""Domain labels y of eq. 15."""


@dataclass(frozen=True)
class LifeTraining:
    steps: int = 1200  # gradient steps
    batch: int = 16  # simulated records per step, and as many real ones
    # learning_rate, weight_decay: of AdamW; the rate falls to 0 along a half cosine, so that the last states do not
    # hang on the last batches
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    checkpoints: int = 8  # states kept for selection, evenly spaced, the last at the end
    # Show every record, each time, with a random sign, and every batch shifted in time (cyclically) by a random amount:
    # neither where a record begins nor which way a sensor points matters. Not in the paper; without it networks learn a
    # thousand simulated records by heart within a hundred steps.
    vary: bool = True
    # Show the discriminator only those simulated records that are of no later row of a life than the real ones. Real
    # records are all of the first minutes after the anomaly: to separate them from whole simulated lives, the
    # discriminator learns the age, and its reversed gradient wipes that out. Not in the paper.
    alike: bool = False


@dataclass(frozen=True)
class LifeScales:
    """What numbers are divided by before a network sees them, and which speeds have a place of their own."""

    sample: float  # unit of the records; the same for simulated and real ones
    revolutions: float  # at which a label is 1
    speeds_rpm: tuple[float, ...]  # operating speeds, increasing


@dataclass(frozen=True)
class LifeCheckpoint:
    """The network after some steps."""

    step: int
    state: State  # weights, on the processor
    loss: float  # mean regression loss on simulated batches since the last checkpoint
    # share of records whose domain the discriminator classified correctly since then; NaN without one
    domain_accuracy: float


@dataclass(frozen=True)
class TrainedLife:
    architecture: LifeArchitecture
    scales: LifeScales
    checkpoints: tuple[LifeCheckpoint, ...]
    device: str = field(compare=False)  # where it was trained

    def network(self, place: int = -1) -> LifeNetwork:
        """The network of one checkpoint, on the processor, ready to predict."""
        net = LifeNetwork(self.architecture)
        net.load_state_dict(self.checkpoints[place].state)
        return net.eval()

    def predict(self, snapshots: Snapshots, place: int = -1, batch: int = 256) -> Array:
        """Remaining revolutions [records] by one checkpoint; each depends on its own record alone."""
        return self._run(snapshots, place, batch, LifeNetwork.life) * self.scales.revolutions

    def embed(self, snapshots: Snapshots, place: int = -1, batch: int = 256) -> Array:
        """The regressor's second layer [records, 32], which figure 13 shows."""
        return self._run(snapshots, place, batch, LifeNetwork.embed)

    def _run(
        self, snapshots: Snapshots, place: int, batch: int, wanted: Callable[[LifeNetwork, Tensor], Tensor]
    ) -> Array:
        net, out = self.network(place), []
        with reproducible(0), torch.no_grad():
            for start in range(0, len(snapshots), batch):
                part = snapshots.take(np.arange(start, min(start + batch, len(snapshots))))
                out.append(wanted(net, net.join(*_shown(part, self.architecture, self.scales))).numpy())
        return np.concatenate(out).astype(np.float64)


def scales_of(simulated: Snapshots, speeds_rpm: Sequence[float] | Array) -> LifeScales:
    """Scales from the simulated records alone: their RMS, the longest remaining life."""
    if simulated.revolutions is None:
        raise TwingapError("simulated records without labels", where="training")
    rms = float(np.sqrt(np.mean(np.square(simulated.samples, dtype=np.float64))))
    return LifeScales(rms, float(simulated.revolutions.max()), tuple(float(s) for s in speeds_rpm))


def domain_loss(logits: Tensor, domain: float) -> Tensor:
    """L_d of eqs. 7 and 15, averaged: -y log p - (1 - y) log(1 - p) with p = sigmoid(logit), y the records' domain."""
    return functional.binary_cross_entropy_with_logits(logits, logits.new_full(logits.shape, domain))


def train_life(
    simulated: Snapshots, real: Snapshots, architecture: LifeArchitecture, scales: LifeScales,
    settings: LifeTraining | None = None, seed: int = 0,
) -> TrainedLife:  # fmt: skip
    """Train one model; `seed` is of weights and batches: same seed, same bytes on the same kind of device. `real`
    records, of the run up to now, serve adversarial models alone. Raises `TwingapError` when simulated records lack
    labels, or real ones bring them."""
    settings = settings or LifeTraining()
    if simulated.revolutions is None:
        raise TwingapError("simulated records without labels", where="training")
    if real.revolutions is not None:
        raise TwingapError("labels of the real run may not reach training", where="training", mend="use unlabelled()")
    place = best_device("auto")
    with reproducible(seed):
        net = LifeNetwork(architecture).to(place)
        optimiser = torch.optim.AdamW(net.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay)
        falling = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings.steps)
        shown = [t.to(place) for t in _shown(simulated, architecture, scales)]
        labels = torch.from_numpy((simulated.revolutions / scales.revolutions).astype(np.float32)).to(place)
        other = [t.to(place) for t in _shown(real, architecture, scales)]
        # Streams of their own: simulated batches are the same whether or not real ones are drawn.
        batches = _batches(len(simulated), settings.batch, np.random.default_rng([seed, 0]))
        real_batches = _batches(len(real), settings.batch, np.random.default_rng([seed, 1]))
        last = real.position.max() if settings.alike else np.inf
        alike = torch.from_numpy(simulated.position <= last).to(place)
        varying, real_varying = (np.random.default_rng([seed, s]) if settings.vary else None for s in (10, 11))
        marks = {round((i + 1) * settings.steps / settings.checkpoints) for i in range(settings.checkpoints)}
        kept: list[LifeCheckpoint] = []
        losses: list[Tensor] = []
        correct: list[Tensor] = []
        for step in range(settings.steps):
            chosen = next(batches).to(place)
            joined = net.join(*_taken(shown, chosen, varying))
            loss = functional.mse_loss(net.life(joined), labels[chosen])
            losses.append(loss.detach())
            if architecture.adversarial:
                away = net.domain(joined[alike[chosen]])
                here = net.domain(net.join(*_taken(other, next(real_batches).to(place), real_varying)))
                correct.append(torch.cat((away.detach() < 0, here.detach() > 0)).float().mean())
                told_apart = domain_loss(away, SIMULATED) if len(away) else loss.new_zeros(())
                loss = loss + told_apart + domain_loss(here, REAL)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            falling.step()
            if step + 1 in marks:
                state = {name: value.detach().cpu().clone() for name, value in net.state_dict().items()}
                accuracy = float(torch.stack(correct).mean()) if correct else float("nan")
                kept.append(LifeCheckpoint(step + 1, state, float(torch.stack(losses).mean()), accuracy))
                losses, correct = [], []
    return TrainedLife(architecture, scales, tuple(kept), str(place))


def _shown(snapshots: Snapshots, architecture: LifeArchitecture, scales: LifeScales) -> tuple[Tensor, ...]:
    """Scaled records and the two encodings: what a network is shown."""
    speeds = speed_position(snapshots.speed_rpm, np.array(scales.speeds_rpm))
    encodings = (positional_encoding(p, architecture.d_model) for p in (snapshots.position, speeds))
    samples = snapshots.samples / np.float32(scales.sample)
    return (torch.from_numpy(samples), *(torch.from_numpy(e.astype(np.float32)) for e in encodings))


def _taken(tensors: Sequence[Tensor], chosen: Tensor, varying: np.random.Generator | None) -> list[Tensor]:
    """A batch; its records shifted and turned over where they are to vary."""
    x, *encodings = (t[chosen] for t in tensors)
    if varying is not None:
        sign = torch.from_numpy(varying.choice(np.array([-1.0, 1.0], dtype=np.float32), len(x))).to(x.device)
        x = torch.roll(x, int(varying.integers(x.shape[1])), dims=1) * sign[:, None]
    return [x, *encodings]


def _batches(count: int, batch: int, rng: np.random.Generator) -> Iterator[Tensor]:
    """Endless batches of places: every record once before any comes again."""
    pool = np.empty(0, dtype=np.int64)
    while True:
        while pool.size < batch:
            pool = np.concatenate([pool, rng.permutation(count)])
        yield torch.from_numpy(pool[:batch].copy())
        pool = pool[batch:]


@dataclass(frozen=True)
class LifeEvidence:
    """Input of a selection criterion, over the label scale: without labels of the real run."""

    held_out: Array  # [records] predicted less true remaining revolutions of simulated lives that were not trained on
    # [real records] revolutions since the first real record plus those predicted to remain: the whole life, which is
    # one number, however often it is predicted
    real_total: Array


CRITERIA: Final[dict[str, Callable[[LifeEvidence], float]]] = {
    # Both in quadrature: a constant answer is steady, and a network that knows simulated records alone is exact there.
    "error_and_steadiness": lambda e: float(np.hypot(np.sqrt(np.mean(e.held_out**2)), np.std(e.real_total))),
    "simulated_error": lambda e: float(np.sqrt(np.mean(e.held_out**2))),
    "steadiness": lambda e: float(np.std(e.real_total)),
}
"""Label-free criteria by name; lower is better."""


def judge_checkpoints(trained: TrainedLife, held_out: Snapshots, real: Snapshots, dt_s: float) -> list[LifeEvidence]:
    """Evidence on every checkpoint, from labelled records of simulated lives that were not trained on and from
    unlabelled real ones in order of time, `dt_s` from row to row."""
    if held_out.revolutions is None:
        raise TwingapError("held-out simulated records without labels", where="checkpoints")
    scale = trained.scales.revolutions
    turned = np.concatenate(([0.0], np.cumsum(real.speed_rpm[1:] * np.diff(real.position)) * dt_s / 60))
    return [
        LifeEvidence(
            (trained.predict(held_out, place) - held_out.revolutions) / scale,
            (trained.predict(real, place) + turned) / scale,
        )
        for place in range(len(trained.checkpoints))
    ]


def choose(evidence: Sequence[LifeEvidence], criterion: str = "error_and_steadiness") -> int:
    """Place of the checkpoint that the criterion prefers; the latest of equals."""
    if criterion not in CRITERIA:
        raise TwingapError(f"no criterion {criterion!r}", where="checkpoints", mend=f"use {', '.join(CRITERIA)}")
    scores = np.array([CRITERIA[criterion](e) for e in evidence])
    return int(len(scores) - 1 - np.argmin(scores[::-1]))
