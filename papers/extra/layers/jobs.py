"""What the layers of paper 3's network keep of the classes.

task --prepared--> source (labelled), adapt, judge --train--> network --each layer--> level, modulation of each channel
    probe taught by simulated windows --+
    probe taught by true labels --------+--> windows of the judged recordings called right, by class
    every checkpoint ------------------------> the same

A linear probe (Alain and Bengio 2016, arXiv:1610.01644) that is taught by true labels says whether a layer still holds
the classes; taught by simulated windows it says how much of that simulation can teach.
"""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from papers.arrays import Array
from papers.framework import Result, Work
from papers.options import expect
from papers.paper3_zoa_dann.comparison.jobs import Cell, kept_modes, prepared
from papers.paper3_zoa_dann.comparison.jobs import read_options as read_comparison
from papers.paper3_zoa_dann.comparison.task_files import Material, windows_to_adapt_to
from papers.paper3_zoa_dann.comparison.trial import Trial
from papers.paper3_zoa_dann.inputs import options as frame
from papers.paper3_zoa_dann.source import simulate
from twingap.adapt import METHODS, Fitted, Windows, fit

LAYERS: Final = (
    "denoising.branches", "denoising.fusion", "denoising.gate", "lift", "attention", "feed_forward",
)  # fmt: skip
"""Layers that are probed, in the order of the network; a method has some of them."""
BATCH: Final = 128


@dataclass(frozen=True)
class Options:
    methods: tuple[str, ...]
    profiles: dict[str, frame.Size]

    def __post_init__(self) -> None:
        for name in self.methods:
            expect(name, [own for own in METHODS if METHODS[own].architecture is not None], "methods")


def results(work: Work) -> Iterator[tuple[str, Result[Trial]]]:
    """Every trial, with the title of its data; all bearings adapted to, balanced data."""
    comparison, judging, size = read_comparison(), frame.read_options().judging, work.size
    training = dataclasses.replace(comparison.training, steps=size.steps)
    seeds = tuple(range(work.seed, work.seed + size.seeds))
    for task, target in work["tasks"]:
        unseen = None if task.same_bearings else task.unseen(work.seed)
        for ready in prepared(work, task, target, [Cell("balanced", unseen, seeds, ())]):
            labelled = windows_to_adapt_to(task, target.records, "balanced", unseen)
            jobs = [
                Trial(task.name, "balanced", unseen, method, seed, None, training, comparison.inputs,
                      judging.criterion, judging.held_out, judging.false_alarm, ready.recipe)
                for seed in seeds for method in work.options.methods
            ]  # fmt: skip
            with kept_modes(work.out) as modes:
                inputs = ready.inputs | {"labelled": (labelled, None), "modes": (modes, None)}
                made = work.sweep(probe, jobs, inputs, lambda job: job.words)
            yield from ((target.title, own) for own in made)


def probe(job: Trial, material: Material, labelled: Windows, modes: Path | None = None) -> dict[str, Any]:
    """Train, and probe each layer and checkpoint: shares of the judged windows called right by class, of layers by who
    taught the probe; ``chosen`` is the place of the checkpoint chosen without labels."""
    source, truth = simulate(job.recipe), material.evaluate.labels
    assert source.labels is not None and labelled.labels is not None and truth is not None
    inputs = dataclasses.replace(job.inputs, cache=modes)
    fitted = fit(
        job.method, source, material.adapt, job.seed, n_classes=len(job.recipe.classes), settings=job.training,
        inputs=inputs, held_out=job.held_out, criterion=job.criterion, device="cpu",
    )  # fmt: skip
    held = [dict(_layers(fitted, inputs(windows))) for windows in (source, material.adapt, material.evaluate)]
    simulated, known, judged = held
    return {
        "chosen": fitted.place,
        "checkpoints": [
            _right(fitted.predict_proba(material.evaluate, place).argmax(axis=1), truth)
            for place in range(fitted.checkpoints)
        ],
        "layers": {
            name: {
                "simulated": _right(_probe(simulated[name], source.labels)(judged[name]), truth),
                "true labels": _right(_probe(known[name], labelled.labels)(judged[name]), truth),
            }
            for name in judged
        },
    }


def _layers(fitted: Fitted, x: NDArray[np.float32]) -> Iterator[tuple[str, Array]]:
    """Rows of features of the modes and of each layer [windows, features]."""
    import torch

    yield "modes", _rows(x)
    assert fitted.trained is not None
    net = fitted.trained.network(fitted.place)
    seen: dict[str, list[NDArray[np.float32]]] = {name: [] for name in LAYERS}
    for name, part in net.named_modules():
        if (own := name.removeprefix("extractor.")) in seen:
            part.register_forward_hook(lambda _, given, made, own=own: seen[own].append(made.numpy()))
    with torch.no_grad():
        for begin in range(0, len(x), BATCH):
            net(torch.from_numpy(x[begin : begin + BATCH]))
    yield from ((name, _rows(np.concatenate(parts))) for name, parts in seen.items() if parts)


def _rows(maps: NDArray[np.float32]) -> Array:
    """ln RMS and ln depth of modulation of each channel; features as they are, in logarithms."""
    x = maps.astype(np.float64)
    if x.ndim == 2:
        return np.asarray(np.log(x + 1e-2))
    depth = (x.std(axis=2) + 1e-6) / (np.abs(x).mean(axis=2) + 1e-6)
    return np.hstack([np.log(np.sqrt((x**2).mean(axis=2)) + 1e-6), np.log(depth)])


def _probe(rows: Array, labels: NDArray[np.int64]) -> Any:
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return make_pipeline(StandardScaler(), LogisticRegression(C=0.1, max_iter=500)).fit(rows, labels).predict


def _right(called: NDArray[np.int64], truth: NDArray[np.int64]) -> list[float]:
    """Share of the windows of each class that are called right."""
    return [float(np.mean(called[truth == c] == c)) for c in np.unique(truth)]
