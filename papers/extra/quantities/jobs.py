"""Study of what the network is given of each variational mode: its waveform, or its envelope spectrum.

tasks --prepared--> cell, material, recipe --quantity x method x seed--> trials --> accuracy, paired by task and seed

The comparison found that waveforms of simulated modes teach little about CWRU's. A mode's carrier is the structure's,
which no twin knows; how fast strikes follow each other is the bearing's, and an envelope spectrum shows nothing else.
Everything but the quantity is the comparison's: tasks, split, source, network, loop, label-free choice. Balanced data,
no noise added; windows are shifted and turned about only where they are waveforms.
"""

import dataclasses
import itertools
from collections.abc import Iterator
from typing import Final

from papers.framework import Result, Work
from papers.paper3_zoa_dann.comparison.jobs import Options, Prepared, balanced_cells, kept_modes, prepared
from papers.paper3_zoa_dann.comparison.task_files import TaskFile
from papers.paper3_zoa_dann.comparison.trial import CLOSED, Trial, run_trial
from papers.paper3_zoa_dann.inputs import options as frame

QUANTITIES: Final = ("modes", "envelope_spectrum")  # the paper's first: gains are over it
METHODS: Final = ("Non-DA", "Non-DA, gap closed", "DANN", "Proposed")


def trials(ready: Prepared, task: TaskFile, options: Options, common: frame.Options, steps: int) -> Iterator[Trial]:
    """Each quantity under each method, at each seed of the cell."""
    judging, cell = common.judging, ready.cell
    for seed, method, quantity in itertools.product(cell.seeds, METHODS, QUANTITIES):
        closed = options.closed[task.family] if method in CLOSED else ()
        inputs = dataclasses.replace(options.inputs, quantity=quantity)
        training = dataclasses.replace(options.training, steps=steps, vary=inputs.waveforms)
        yield Trial(
            task.name, cell.available, cell.unseen, method, seed, None, training, inputs, judging.criterion,
            judging.held_out, judging.false_alarm, dataclasses.replace(ready.recipe, closed=closed),
        )  # fmt: skip


def networks(work: Work) -> Iterator[tuple[str, Result[Trial]]]:
    options, common, size = work.options, frame.read_options(), work.size
    for task, target in work["tasks"]:
        chosen = [cell for cell in balanced_cells(task, work) if (cell.unseen is None) == task.same_bearings]
        for ready in prepared(work, task, target, chosen):
            jobs = trials(ready, task, options, common, size.steps)
            with kept_modes(work.out) as modes:
                inputs = ready.inputs | {"device": (work.device, None), "modes": (modes, None)}
                trained = work.sweep(
                    run_trial, jobs, inputs, lambda job: f"{job.words}, {job.inputs.quantity}", f"task {task.name}"
                )
            yield from ((target.title, own) for own in trained)
