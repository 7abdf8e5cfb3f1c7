"""One training and its evaluation: the job that the sweep runs for each bearing, model and seed."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from papers.arrays import Array
from papers.embedding import embed
from papers.paper1_rul_varying_speed.cases import Case, Known
from papers.paper1_rul_varying_speed.lives.options import Options
from papers.paper1_rul_varying_speed.methods import training as learning
from papers.paper1_rul_varying_speed.methods.architecture import LifeArchitecture
from papers.paper1_rul_varying_speed.methods.degradation import Trajectory
from papers.paper1_rul_varying_speed.methods.metrics import rmse
from papers.paper1_rul_varying_speed.methods.simulated_lives import LifeSimulator, SignalModel, Snapshots, joined
from twingap import Condition, Record
from twingap.effects import apply_to_waveform, make_effect
from twingap.streams import Streams
from twingap.sweep import Result


@dataclass(frozen=True)
class Added:
    """Effects that the simulated records get besides, as a gap diagnosis named them."""

    effects: tuple[tuple[str, tuple[tuple[str, float], ...]], ...]
    reference_rms: float  # their yardstick: RMS of the run's healthy vibration, as the diagnosis took it


@dataclass(frozen=True)
class Job:
    bearing: str
    variant: str  # of the twin
    model: str
    architecture: LifeArchitecture  # the model's
    seed: int  # of simulated records, weights and order
    training: learning.LifeTraining
    signal: SignalModel
    copies: int  # records simulated per row of a life
    most_records: int  # simulated records in all
    criterion: str  # by which a checkpoint is chosen
    embedded: bool = False  # whether to embed the judged records by t-SNE
    added: Added | None = None


def job_of(
    case: Case, options: Options, variant: str, model: str, shape: LifeArchitecture, seed: int, size: Any, **more: Any
) -> Job:  # fmt: skip
    """A training of a model on a twin of the configuration, as long and with as many records as the profile has."""
    chosen = options.variants[variant]
    return Job(
        case.name, variant, model, replace(shape, length=case.known.real.samples.shape[1]), seed,
        replace(options.training, steps=size.steps, alike=chosen.alike), chosen.signal, getattr(size, "copies", 1),
        size.most_records, options.judging.criterion, **more,
    )  # fmt: skip


_held: dict[str, tuple[Snapshots, Snapshots]] = {}
"""The last simulated records: five models of a seed share them."""


def simulate(job: Job, known: Known, digest: str = "") -> tuple[Snapshots, Snapshots]:
    """Labelled records of lives, for training and held out, the same for all models of a seed; with the digest of the
    run they may be taken from those made last."""
    rates = tuple(life.rate for life in (*known.twin.lives, *known.twin.held_out))
    key = repr((digest, known.name, rates, job.seed, job.signal, job.copies, job.most_records, job.added))
    if not digest or key not in _held:
        rng = np.random.default_rng([job.seed, 2])
        twin, n_samples = known.twin, known.real.samples.shape[1]
        make = LifeSimulator(
            twin, known.bearing, known.fault, known.fs_hz, n_samples, rng, job.signal, known.unit,
            healthy=known.healthy, faulty=known.real,
        )  # fmt: skip

        def several(lives: tuple[Trajectory, ...], copies: int) -> Snapshots:
            return joined([make.snapshots(lives, rng, job.most_records // copies) for _ in range(copies)])

        made = several(twin.lives, job.copies), several(twin.held_out, 1)
        if job.added is not None:
            made = altered(made[0], job.added, known, job.seed), altered(made[1], job.added, known, job.seed + 1)
        _held.clear()
        _held[key] = made
    return _held[key]


def altered(made: Snapshots, added: Added, known: Known, seed: int) -> Snapshots:
    """Simulated records with effects on the finished waveform, each brought back to its peak to peak, S(k) D(k)."""
    effects = tuple(make_effect(name, dict(values)) for name, values in added.effects)
    samples = np.empty_like(made.samples)
    for i, (row, speed) in enumerate(zip(made.samples, made.speed_rpm, strict=True)):
        condition = Condition(str(i), float(speed), known.fs_hz, row.size, known.fault)
        record = Record(condition, row.astype(float))
        changed = apply_to_waveform(effects, record, known.bearing, added.reference_rms, Streams(seed, i)).samples
        samples[i] = changed * (np.ptp(row) / max(float(np.ptp(changed)), 1e-12))
    return replace(made, samples=samples)


def fit(job: Job, known: Known, digest: str = "") -> tuple[learning.TrainedLife, Snapshots]:
    """Train; also the simulated records held out. Nothing of the run after now can reach here."""
    simulated, held_out = simulate(job, known, digest)
    scales = learning.scales_of(simulated, known.twin.influence.speeds_rpm)
    return learning.train_life(simulated, known.real, job.architecture, scales, job.training, job.seed), held_out


def train_and_judge(job: Job, case: Case) -> dict[str, Any]:
    """Train, choose a checkpoint without labels of the run, judge: predicted ``revolutions`` [judged rows] of the
    chosen one, scores and choice by criterion, ``rmse_min`` per checkpoint (known only to the judge), curves of
    training, number of simulated records, embedding if asked for."""
    trained, held_out = fit(job, case.known, case.digest)
    evidence = learning.judge_checkpoints(trained, held_out, case.known.real, case.known.dt_s)
    chosen = {name: learning.choose(evidence, name) for name in learning.CRITERIA}
    place = chosen[job.criterion]
    # Only from here on is the rest of the run looked at.
    shown = case.judged.unlabelled()
    predicted = [trained.predict(shown, k) for k in range(len(trained.checkpoints))]
    result: dict[str, Any] = {
        "revolutions": predicted[place],
        "criteria": {name: [rule(e) for e in evidence] for name, rule in learning.CRITERIA.items()}, "chosen": chosen,
        "place": place, "rmse_min": [rmse(case.true_min, case.minutes(p)) for p in predicted],
        "steps": [c.step for c in trained.checkpoints], "loss": [c.loss for c in trained.checkpoints],
        "domain_accuracy": [None if np.isnan(c.domain_accuracy) else c.domain_accuracy for c in trained.checkpoints],
        "simulated": len(simulate(job, case.known, case.digest)[0]), "device": trained.device,
    }  # fmt: skip
    if job.embedded:
        result["embedding"] = embed(trained.embed(shown, place), job.seed)
    return result


@dataclass(frozen=True)
class CaseResult:
    """Results of one run to failure."""

    case: Case
    variant: str  # of the twin
    trainings: list[Result[Job]]  # in the order seed, model

    def of(self, model: str) -> list[Result[Job]]:
        return [t for t in self.trainings if t.job.model == model]

    @property
    def models(self) -> list[str]:
        return list(dict.fromkeys(t.job.model for t in self.trainings))

    def predicted_min(self, trained: Result[Job]) -> Array:
        """Remaining time at the present speed [judged rows], min, by the chosen checkpoint."""
        return self.case.minutes(np.asarray(trained.value["revolutions"], float))
