"""Study of what the network is given of each variational mode: its waveform, or its envelope spectrum.

tasks --prepared--> cell, material, recipe --quantity x method x seed--> trials --> accuracy, paired by task and seed

The comparison found that waveforms of simulated modes teach little about CWRU's. A mode's carrier is the structure's,
which no twin knows; how fast strikes follow each other is the bearing's, and an envelope spectrum shows nothing else.
Everything but the quantity is the comparison's: tasks, split, source, network, loop, label-free choice. Balanced data,
no noise added; windows are shifted and turned about only where they are waveforms.

Run alone: ``python -m papers.paper3_zoa_dann.quantities --profile broad --out DIR``; interrupted, it goes on where it
was.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from papers.paper3_zoa_dann.comparison import Cell, Prepared, cells, kept_modes, prepared, version
from papers.paper3_zoa_dann.comparison_study import CONFIG, ComparisonOptions, read_comparison
from papers.paper3_zoa_dann.options import read_options
from papers.paper3_zoa_dann.significance import sign_flip
from papers.paper3_zoa_dann.task_files import FOLDER, TaskFile, load_recordings, read_task
from papers.paper3_zoa_dann.trial import CLOSED, Trial, run_trial
from papers.studies import Count, Progress, command, keep_tables, profile_of
from twingap.sweep import Result, sweep

if TYPE_CHECKING:
    from papers.paper3_zoa_dann.options import Options
    from papers.paper3_zoa_dann.tasks import Target
    from twingap.track import Run

QUANTITIES: Final = ("modes", "envelope_spectrum")
"""The paper's first: gains are over it."""
METHODS: Final = ("Non-DA", "Non-DA, gap closed", "DANN", "Proposed")


@dataclass(frozen=True)
class Quantities:
    """What came out.

    Parameters
    ----------
    tables : dict of str to DataFrame
        quantities (a row per trial), quantities-mean (by data set, method and quantity).
    missing : tuple of str
        Tasks whose data are not at hand.
    computed : int
        Trials that ran now; the others came from the store.
    """

    tables: dict[str, pd.DataFrame]
    missing: tuple[str, ...]
    computed: int


def trials(ready: Prepared, task: TaskFile, options: ComparisonOptions, common: Options, steps: int) -> Iterator[Trial]:
    """Each quantity under each method, at each seed of the cell."""
    judging, cell = common.judging, ready.cell
    for seed in cell.seeds:
        for method in METHODS:
            closed = options.closed[task.family] if method in CLOSED else ()
            for quantity in QUANTITIES:
                inputs = dataclasses.replace(options.inputs, quantity=quantity)
                training = dataclasses.replace(options.training, steps=steps, vary=inputs.waveforms)
                yield Trial(
                    task.name, cell.available, cell.unseen, method, seed, None, training, inputs, judging.criterion,
                    judging.held_out, judging.false_alarm, dataclasses.replace(ready.recipe, closed=closed),
                )  # fmt: skip


def table(found: Sequence[tuple[str, Result[Trial]]]) -> pd.DataFrame:
    """A row per trial, with the data set's title."""
    return pd.DataFrame(
        {
            "data": data, "task": own.job.task, "method": own.job.method,
            "quantity": own.job.inputs.quantity, "seed": own.job.seed, "accuracy": own.value["accuracy"],
            "oracle": own.value["oracle_accuracy"], "source_accuracy": own.value["source_accuracy"],
            "seconds": own.seconds,
        }
        for data, own in found
    )  # fmt: skip


def means(rows: pd.DataFrame) -> pd.DataFrame:
    """Mean over tasks and seeds; gain over the paper's quantity by pairs of task and seed, with sign-flip p."""
    out = []
    pair = ["task", "seed"]
    for (data, method), own in rows.groupby(["data", "method"], sort=False):
        first = own[own["quantity"] == QUANTITIES[0]].set_index(pair)["accuracy"]
        for quantity, of in own.groupby("quantity", sort=False):
            gain = (of.set_index(pair)["accuracy"] - first).dropna()
            plain = quantity == QUANTITIES[0]
            out.append(
                {
                    "data": data, "method": method, "quantity": quantity, "accuracy": of["accuracy"].mean(),
                    "std": of["accuracy"].std(), "oracle": of["oracle"].mean(),
                    "source_accuracy": of["source_accuracy"].mean(), "gain": np.nan if plain else gain.mean(),
                    "pairs_won": np.nan if plain else int((gain > 0).sum()), "pairs": len(gain),
                    "p": np.nan if plain else sign_flip(gain.to_numpy()),
                }
            )  # fmt: skip
    return pd.DataFrame(out)


def _asked(cell: Cell, same_bearings: bool) -> bool:
    return cell.available == "balanced" and (cell.unseen is None) == same_bearings


def run(
    profile: str = "smoke",
    *,
    out: Path,
    root: Path | None = None,
    seed: int = 0,
    backend: str = "loky",
    address: str | None = None,
    log: Run | None = None,
    progress: Progress = lambda what, done, total: None,
    config: Path = CONFIG,
    folder: Path = FOLDER,
) -> Quantities:
    """Train what is missing, and compare.

    Parameters
    ----------
    profile : str
        Of ``comparison.toml``: its tasks, seeds, steps and simulated bearings.
    out : Path
        Folder for ``tables/`` and ``results/``.
    root : Path or None
        Data root; TWINGAP_DATA when None. Without CWRU records the virtual rig is taken, and every number says so.
    seed : int
    backend, address
        See `twingap.sweep`.
    log : Run or None
        Of a tracker: tables go there as well.
    progress : callable
    config, folder : Path
        The configuration, and where task files are.
    """
    options, common = read_comparison(config), read_options()
    size = profile_of(options.profiles, profile, config)
    at_hand: list[tuple[TaskFile, Target, list[Cell]]] = []
    for name in size.tasks:
        task = read_task(name, folder)
        if (target := load_recordings(task, root, common.target, size.rig_duration_s)) is not None:
            at_hand.append((task, target, [c for c in cells(task, size, seed) if _asked(c, task.same_bearings)]))
    total = sum(len(cell.seeds) for *_, chosen in at_hand for cell in chosen) * len(METHODS) * len(QUANTITIES)
    count = Count("networks by what they read", total, progress)
    found: list[tuple[str, Result[Trial]]] = []
    for task, target, chosen in at_hand:
        for ready in prepared(task, target, common, size, seed, out, chosen):
            with kept_modes(out) as modes:
                swept = sweep(
                    functools.partial(run_trial, material=ready.material, modes=modes),
                    list(trials(ready, task, options, common, size.steps)),
                    data={"material": ready.material.digest}, store=out / "results", backend=backend, address=address,
                    version=version(), on_result=count, describe=lambda job: f"{job.words}, {job.inputs.quantity}",
                )  # fmt: skip
            found += [(target.title, own) for own in swept]
    rows = table(found)
    made = {"quantities": rows, "quantities-mean": means(rows)} if found else {}
    keep_tables(made, out, log, ", ".join(dict.fromkeys(data for data, _ in found)))
    missing = tuple(name for name in size.tasks if name not in {task.name for task, *_ in at_hand})
    return Quantities(made, missing, sum(bool(own.why) for _, own in found))


def main(arguments: Sequence[str] | None = None) -> None:
    """The study from the command line."""

    def shown(study: Quantities) -> dict[str, pd.DataFrame]:
        return {name: frame for name, frame in study.tables.items() if name == "quantities-mean"}

    command(run, "Paper 3's network on waveforms and on envelope spectra.", shown, arguments, takes=("root", "seed"))


if __name__ == "__main__":
    # Under its own name, so that workers find its functions.
    from papers.paper3_zoa_dann.quantities import main as start

    start()
