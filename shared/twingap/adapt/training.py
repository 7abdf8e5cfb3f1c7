"""Training loop of all networks and alignments.

labelled source ----> extractor -> classifier -> cross-entropy
                          |
unlabelled target ------> + -> alignment (discriminators, discrepancies) -> loss      (optional)

With the same seed, two alignments of one network have the same initial weights and source batches and differ only in
the added loss. With its weight at 0 the results are equal to the bit; a test verifies this.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from twingap.adapt.alignment import Aligner, Alignment, BatchOutputs
from twingap.adapt.dann import adversarial_schedule
from twingap.adapt.mode_network import Architecture, ModeNetwork
from twingap.adapt.nets import PlainCNN, best_device

Inputs = NDArray[np.float32]
Labels = NDArray[np.int64]
Method = Literal["source_only", "dann"]
State = dict[str, Tensor]
Network = PlainCNN | ModeNetwork

ALIGNMENTS: Final[dict[Method, Alignment]] = {"source_only": Alignment(), "dann": Alignment(("features",))}
"""Alignments of the plain network by name."""


@dataclass(frozen=True)
class Training:
    """Options of the training.

    Parameters
    ----------
    steps : int
        Gradient steps.
    batch : int
        Source samples per step, and as many target samples.
    learning_rate, weight_decay : float
        Options of AdamW.
    checkpoints : int
        Number of states kept for selection, evenly spaced, the last at the end.
    adversarial_weight : float
        Final weight of the reversed gradient or of the discrepancy.
    vary : bool
        Whether samples are shifted cyclically by a random amount and get a random sign at each use, since begin of a
        window and orientation of the sensor carry no information. For waveforms only.
    """

    steps: int = 1200
    batch: int = 64
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    checkpoints: int = 8
    adversarial_weight: float = 1.0
    vary: bool = False


@dataclass(frozen=True)
class Checkpoint:
    """State of the network after some steps.

    Parameters
    ----------
    step : int
    state : State
        Weights of the network, on the CPU.
    source_loss : float
        Mean cross-entropy on source batches since the last checkpoint.
    domain_accuracy : float
        Fraction of samples whose domain was classified correctly since then; NaN without a discriminator.
    """

    step: int
    state: State
    source_loss: float
    domain_accuracy: float


@dataclass(frozen=True)
class Trained:
    """Result of a training.

    Parameters
    ----------
    checkpoints : tuple[Checkpoint, ...]
    length, channels, n_classes : int
        Shape of the network.
    device : str
        Device of the training.
    architecture : Architecture or None
        None = `PlainCNN`.
    """

    checkpoints: tuple[Checkpoint, ...]
    length: int
    channels: int
    n_classes: int
    device: str = field(compare=False)
    architecture: Architecture | None = None

    def network(self, place: int = -1) -> Network:
        """Network of one checkpoint on the CPU, in evaluation mode."""
        net = _network(self.architecture, self.length, self.channels, self.n_classes)
        net.load_state_dict(self.checkpoints[place].state)
        return net.eval()


@contextmanager
def reproducible(seed: int) -> Iterator[None]:
    """Context in which torch draws from `seed`, on one thread, with deterministic algorithms.

    Global state (random state, number of threads, determinism) is restored at its end. Sums depend on the number of
    threads, so one thread is used; trainings can run in parallel.
    """
    threads, deterministic = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    cudnn = (torch.backends.cudnn.deterministic, torch.backends.cudnn.benchmark)
    gpus = list(range(torch.cuda.device_count())) if torch.cuda.is_available() else []
    with torch.random.fork_rng(devices=gpus):
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        torch.use_deterministic_algorithms(True, warn_only=True)
        torch.backends.cudnn.deterministic, torch.backends.cudnn.benchmark = True, False
        try:
            yield
        finally:
            torch.set_num_threads(threads)
            torch.use_deterministic_algorithms(deterministic)
            torch.backends.cudnn.deterministic, torch.backends.cudnn.benchmark = cudnn


def train(
    source: Inputs,
    labels: Labels,
    target: Inputs,
    method: Method | Alignment,
    settings: Training,
    seed: int,
    n_classes: int,
    device: str = "auto",
    architecture: Architecture | None = None,
) -> Trained:
    """Train on labelled source windows and, where there is an alignment, on unlabelled target windows.

    Parameters
    ----------
    source : Inputs [windows, channels, length]
    labels : Labels [windows]
    target : Inputs [windows, channels, length]
        Not used without an alignment. Target labels cannot be given.
    method : {"source_only", "dann"} or Alignment
    settings : Training
    seed : int
        Seed of weights and order of batches.
    n_classes : int
    device : str
        "auto", "cpu" or "cuda".
    architecture : Architecture or None
        None = `PlainCNN`.

    Returns
    -------
    Trained
        The same seed gives the same bytes on the same kind of device.
    """
    place = best_device(device)
    alignment = method if isinstance(method, Alignment) else ALIGNMENTS[method]
    with reproducible(seed):
        net = _network(architecture, source.shape[2], source.shape[1], n_classes).to(place)
        aligner = Aligner(alignment, n_classes).to(place)
        parameters = [*net.parameters(), *aligner.parameters()]
        optimiser = torch.optim.AdamW(parameters, lr=settings.learning_rate, weight_decay=settings.weight_decay)
        x, y = torch.from_numpy(source).to(place), torch.from_numpy(labels).to(place)
        other = torch.from_numpy(target).to(place)
        # Separate streams, so that source batches do not depend on target batches.
        source_batches = _batches(x, settings, seed, 0)
        target_batches = _batches(other, settings, seed, 1)
        class_loss = nn.CrossEntropyLoss()
        marks = {round((i + 1) * settings.steps / settings.checkpoints) for i in range(settings.checkpoints)}
        kept: list[Checkpoint] = []
        losses: list[Tensor] = []
        correct: list[Tensor] = []
        for step in range(settings.steps):
            chosen, batch = next(source_batches)
            labelled = _batch_outputs(net, batch)
            loss = class_loss(labelled.logits, y[chosen])
            losses.append(loss.detach())
            if alignment.active:
                weight = adversarial_schedule(step / settings.steps, settings.adversarial_weight)
                added, right = aligner(labelled, y[chosen], _batch_outputs(net, next(target_batches)[1]), weight)
                loss = loss + added
                if right is not None:
                    correct.append(right)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
            if step + 1 in marks:
                state = {name: value.detach().cpu().clone() for name, value in net.state_dict().items()}
                accuracy = float(torch.stack(correct).mean()) if correct else float("nan")
                kept.append(Checkpoint(step + 1, state, float(torch.stack(losses).mean()), accuracy))
                losses, correct = [], []
    return Trained(tuple(kept), source.shape[2], source.shape[1], n_classes, str(place), architecture)


def _network(architecture: Architecture | None, length: int, channels: int, n_classes: int) -> Network:
    if architecture is None:
        return PlainCNN(length, n_classes, channels)
    return ModeNetwork(architecture, length, channels, n_classes)


def _batch_outputs(net: Network, x: Tensor) -> BatchOutputs:
    features = net.extractor(x)
    return BatchOutputs(features, net.classifier(features))


def _batches(x: Tensor, settings: Training, seed: int, stream: int) -> Iterator[tuple[Tensor, Tensor]]:
    """Endless batches as (indices, samples): every sample once before any repeats."""
    rng, varying = np.random.default_rng([seed, stream]), np.random.default_rng([seed, 10 + stream])
    pool = np.empty(0, dtype=np.int64)
    while True:
        while pool.size < settings.batch:
            pool = np.concatenate([pool, rng.permutation(len(x))])
        chosen = torch.from_numpy(pool[: settings.batch].copy()).to(x.device)
        pool = pool[settings.batch :]
        yield chosen, varied(x[chosen], varying) if settings.vary else x[chosen]


def varied(x: Tensor, rng: np.random.Generator) -> Tensor:
    """Samples [batch, channels, length], each shifted cyclically by a random amount and times a random sign."""
    shift = torch.from_numpy(rng.integers(0, x.shape[2], len(x)))
    sign = torch.from_numpy(rng.choice(np.array([-1.0, 1.0], dtype=np.float32), len(x)))
    place = (torch.arange(x.shape[2])[None] + shift[:, None]) % x.shape[2]
    rolled = x.gather(2, place[:, None].expand(-1, x.shape[1], -1).to(x.device))
    return rolled * sign[:, None, None].to(x.device)


@dataclass(frozen=True)
class Outputs:
    """Outputs of a network for some windows.

    Parameters
    ----------
    logits : NDArray[float32] [windows, classes]
    features : NDArray[float32] [windows, 100]
    """

    logits: NDArray[np.float32]
    features: NDArray[np.float32]

    @property
    def probabilities(self) -> NDArray[np.float64]:
        """Softmax of the logits [windows, classes]."""
        shifted = self.logits.astype(np.float64) - self.logits.max(axis=1, keepdims=True)
        raised = np.exp(shifted)
        return np.asarray(raised / raised.sum(axis=1, keepdims=True))

    @property
    def predicted(self) -> Labels:
        """Most probable class [windows]."""
        return np.asarray(self.logits.argmax(axis=1), dtype=np.int64)


def outputs(net: Network, inputs: Inputs, batch: int = 256) -> Outputs:
    """Outputs of a network for windows, on one thread, so that they do not depend on the number of cores."""
    logits, features = [], []
    with reproducible(0), torch.no_grad():
        for start in range(0, len(inputs), batch):
            found = _batch_outputs(net, torch.from_numpy(inputs[start : start + batch]))
            features.append(found.features.numpy())
            logits.append(found.logits.numpy())
    return Outputs(np.concatenate(logits), np.concatenate(features))
