"""Nested runs of trainings in the tracker: "task · method", and in each "task · method · seed"."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from twingap.sweep import Result
from twingap.track import Run


def log_method(
    log: Run, settings: Mapping[str, str], trainings: Sequence[Result[Any]], metric: str, values: Sequence[float],
    log_training: Callable[[Run, Result[Any]], None],
) -> None:  # fmt: skip
    """Log a method on a task, named by `settings`, into the task's run: mean and deviation of `values`, one a training,
    and each training (by `log_training`) in a run that shows the time it took."""
    words = " · ".join(settings.values())
    with log.run(words, settings) as of_method:
        of_method.parameters(settings)
        spread = float(np.std(values, ddof=1)) if len(values) > 1 else None
        of_method.metrics({metric: float(np.mean(values)), f"{metric} std": spread})
        for training in trainings:
            name = f"{words} · seed {training.job.seed}"
            with of_method.run(name, {"store key": training.key}, duration_s=training.seconds) as of_seed:
                of_seed.parameters(settings)
                log_training(of_seed, training)


def log_checkpoints(log: Run, value: Mapping[str, Any], names: Mapping[str, str]) -> None:
    """Log curves over checkpoints: every label-free criterion, and entries of a training's `value` by `names` (metric
    -> entry)."""
    for place, at in enumerate(value["steps"]):
        curves = {f"criterion {name}": scores[place] for name, scores in value["criteria"].items()}
        log.metrics({metric: value[entry][place] for metric, entry in names.items()} | curves, step=at)
