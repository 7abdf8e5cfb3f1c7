"""One training and its evaluation: the job that the sweep runs for each task, input, method and seed."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from papers.framework import Work
from papers.paper3_zoa_dann.inputs.options import IdentificationOptions, SourceOptions
from papers.paper3_zoa_dann.source import Recipe, identify, simulate
from twingap import Bearing
from twingap import adapt as adaptation
from twingap.adapt import CRITERIA, Evidence, Method, Trained, Training, Windows, inputs, outputs, score


@dataclass(frozen=True)
class Job:
    task: str
    view: str  # what the network is shown, a key of `twingap.adapt.VIEWS`
    method: Method  # one of "source_only", "dann"
    seed: int
    training: Training
    criterion: str  # by which a checkpoint is chosen
    held_out: float  # share of virtual bearings kept for source validation
    recipe: Recipe  # of the simulated windows


@dataclass(frozen=True)
class Measured:
    adapt: Windows  # unlabelled
    evaluate: Windows  # labelled: looked at after training and selection

    def __post_init__(self) -> None:
        if self.adapt.labels is not None or set(self.adapt.group) & set(self.evaluate.group):
            raise AssertionError("adaptation must be unlabelled and share no recording with evaluation")

    @property
    def digest(self) -> str:
        return windows_digest((self.adapt, self.evaluate))


def fit(job: Job, adapt: Windows) -> tuple[Trained, Windows]:
    """Train; also the simulated windows held out for validation. Target labels cannot reach here."""
    rng = np.random.default_rng([job.seed, 2])
    fitted, held = adaptation.split_by_group(simulate(job.recipe), job.held_out, rng)
    assert fitted.labels is not None
    x, x_adapt, n_classes = inputs(fitted, job.view), inputs(adapt.unlabelled(), job.view), len(job.recipe.classes)
    return adaptation.train(x, fitted.labels, x_adapt, job.method, job.training, job.seed, n_classes), held


def train_and_judge(job: Job, measured: Measured) -> dict[str, Any]:
    """Train, choose a checkpoint without target labels, judge it: scores and choice by criterion, ``accuracy`` per
    checkpoint (known only to the judge), figures of the checkpoint chosen by ``job.criterion`` and of training."""
    trained, held = fit(job, measured.adapt)
    assert held.labels is not None
    x_held, x_adapt = inputs(held, job.view), inputs(measured.adapt, job.view)
    nets = [trained.network(place) for place in range(len(trained.checkpoints))]
    evidence = [Evidence(outputs(net, x_held), held.labels, outputs(net, x_adapt)) for net in nets]
    criteria = {name: [rule(e) for e in evidence] for name, rule in CRITERIA.items()}
    chosen = {name: adaptation.select(evidence, name) for name in CRITERIA}
    place = chosen[job.criterion]
    # Only from here on are target labels looked at.
    labels = measured.evaluate.labels
    assert labels is not None
    x_evaluate = inputs(measured.evaluate, job.view)
    judged = [outputs(net, x_evaluate) for net in nets]
    scores = [score(o.probabilities, labels, measured.evaluate.group) for o in judged]
    return {
        "criteria": criteria, "chosen": chosen, "place": place, "accuracy": [s.accuracy for s in scores],
        "balanced_accuracy": [s.balanced_accuracy for s in scores], "confusion": scores[place].confusion,
        "recordings_right": scores[place].recordings_right, "recordings": scores[place].recordings,
        "probabilities": judged[place].probabilities.astype(np.float32),
        "source_accuracy": float(np.mean(evidence[place].source.predicted == held.labels)),
        "steps": [c.step for c in trained.checkpoints], "source_loss": [c.source_loss for c in trained.checkpoints],
        "domain_accuracy": [None if np.isnan(c.domain_accuracy) else c.domain_accuracy for c in trained.checkpoints],
        "device": trained.device,
    }  # fmt: skip


def spread(n: int, wanted: int) -> NDArray[np.int64]:
    """At most `wanted` places, evenly spread over n."""
    return np.unique(np.linspace(0, n - 1, min(n, wanted)).astype(np.int64))


@dataclass(frozen=True)
class Identification:
    task: str
    bearing: Bearing
    classes: tuple[str, ...]
    source: SourceOptions
    options: IdentificationOptions
    evaluations: int


def identify_twin(job: Identification, adapt: Windows) -> dict[str, float]:
    """The twin's free parameters from the unlabelled windows of one task; see `source.identify`."""
    return identify(adapt, job.bearing, job.classes, job.source, job.options, job.evaluations)


def windows_digest(parts: Sequence[Windows]) -> str:
    """Hex sha256 of windows, in steps of 1e-6 of the unit, so that it does not depend on a processor's last bit."""
    whole = hashlib.sha256()
    for w in parts:
        whole.update(repr((w.samples.shape, sorted(set(w.fs_hz)), w.labels is None)).encode())
        whole.update(np.round(w.samples * 1e6).astype("<i8").tobytes())
        whole.update(np.round(w.speed_rpm * 1e3).astype("<i8").tobytes())
        whole.update("\n".join(w.group).encode())
        if w.labels is not None:
            whole.update(w.labels.astype("<i8").tobytes())
    return whole.hexdigest()


def identified(work: Work, job: Identification, adapt: Windows, what: str) -> Mapping[str, float]:
    """Identify the twin; a single job, which needs no workers."""
    inputs = {"adapt": (adapt, windows_digest([adapt]))}
    (found,) = work.sweep(identify_twin, [job], inputs, what=f"identifying the twin, {what}", backend="sequential")
    return dict(found.value)
