"""Jobs of a study on all cores or a cluster, with progress; results of the same code on the same data are reused."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any


def swept(
    function: Callable[[Any], Any], work: Sequence[Any], progress: Callable[[int, int], None],
    describe: Callable[[Any], str], **options: Any,
) -> list[Any]:  # fmt: skip
    """Results of the jobs in their order, with progress(done, total); `options` are those of `twingap.sweep.sweep`."""
    from twingap.sweep import sweep

    done = itertools.count(1)
    progress(0, len(work))
    results = sweep(function, work, on_result=lambda _: progress(next(done), len(work)), describe=describe, **options)
    return [result.value for result in results]
