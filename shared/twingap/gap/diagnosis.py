"""A finished diagnosis: its report, simulators of the twin before and after, and the files that it writes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from twingap.effects import Effect
from twingap.files import replacing, replacing_folder
from twingap.gap.closest import CLOSEST_FILE
from twingap.gap.report.files import write_report
from twingap.gap.report.model import GapReport
from twingap.gap.search.closest_twin import closest_spec
from twingap.gap.search.effect_search import Explanation
from twingap.gap.search.evidence import Compared
from twingap.identification.calibrate import Calibrated
from twingap.records import Record
from twingap.records.folder import write_records
from twingap.twins.simulator import Simulator
from twingap.twins.twin_file import Provenance, TwinSpec, write_twin

Progress = Callable[[str, float], None]
"""progress(what, fraction): description of the current step and the completed part, 0 to 1."""
FilePath = str | os.PathLike[str]


def no_progress(what: str, fraction: float) -> None:
    """Progress callback that does nothing."""


@dataclass(frozen=True)
class Diagnosis:
    """A finished diagnosis: its report, and simulators of the twin before and after.

    Parameters
    ----------
    root : int
        Entropy that all simulated records derive from.
    closest : Compared or None
        The closest twin; None where it was not requested, or there is no gap.
    write_closest : bool
        Whether `write` writes the closest twin too.
    """

    report: GapReport
    explanation: Explanation
    calibrated: Calibrated
    root: int
    closest: Compared | None = None
    write_closest: bool = False

    def sim_before(self) -> Iterator[Record]:
        """Records of the calibrated twin as given, for the conditions of all records used."""
        return self._simulated(self.explanation.before.simulator, ())

    def sim_after(self) -> Iterator[Record]:
        """The same with the verdict's effects added."""
        after = self.explanation.after if self.explanation.gap else self.explanation.before
        return self._simulated(after.simulator, after.effects)

    def sim_closest(self) -> Iterator[Record]:
        """The same for the closest twin; equal to `sim_after` where there is none."""
        return self._simulated(self._closest.simulator, self._closest.effects)

    def closest_twin(self) -> TwinSpec | None:
        """The closest twin, or that of the verdict; None for an external simulator."""
        spec = closest_spec(self._closest)
        if spec is None:
            return None
        stated = self.report.provenance
        source = Provenance(
            str(stated["records_sha256"]), self.calibrated.fit.unit, version=str(stated["version"]),
            method="twingap gap", seed=int(stated["seed"]),
        )  # fmt: skip
        return replace(spec, bearing=self.calibrated.frame.bearing, identified=source)

    def write(self, folder: FilePath, *, export: bool = False, progress: Progress | None = None) -> tuple[Path, ...]:
        """Write gap.json and report.html into a folder, all files or none.

        Also closest.toml, unless the diagnosis was quick or of finished simulated records.

        Parameters
        ----------
        folder : path-like
            Made when missing.
        export : bool
            Also write the record sets sim_before, sim_after and, unless it was quick, sim_closest.
        progress : callable, optional
            Called with a description of the current step and the completed part, 0 to 1.

        Returns
        -------
        tuple of Path
            The written files and folders, gap.json first.

        Raises
        ------
        TwingapError
            When the folder cannot be written, or holds one of the record sets already.
        """
        folder, progress = Path(folder), progress or no_progress
        sets = {"sim_before": self.sim_before, "sim_after": self.sim_after, "sim_closest": self.sim_closest}
        names = tuple(sets)[: 3 if self.write_closest else 2] if export else ()
        twin = self.closest_twin() if self.write_closest else None
        records, bearing = self.calibrated.fit, self.calibrated.frame.bearing
        further = [*([folder / CLOSEST_FILE] if twin is not None else []), *(folder / name for name in names)]
        with ExitStack() as places:
            if twin is not None:
                write_twin(places.enter_context(replacing(folder / CLOSEST_FILE)), twin)
            for done, name in enumerate(names):
                progress(f"write {name}", done / len(names))
                label = f"{self.report.provenance['records']}, {name.removeprefix('sim_')}"
                place = places.enter_context(replacing_folder(folder / name))
                write_records(place, label, records.unit, bearing, None, sets[name]())
            return (*write_report(self.report, folder), *further)

    def __str__(self) -> str:
        """The verdict, and what the closest twin closes."""
        return str(self.report)

    def _repr_html_(self) -> str:
        """The report's verdict and effects, for notebooks."""
        return self.report._repr_html_()

    @property
    def _closest(self) -> Compared:
        found = self.explanation
        return self.closest or (found.after if found.gap else found.before)

    def _simulated(self, simulator: Simulator, effects: tuple[Effect, ...]) -> Iterator[Record]:
        parts = (self.calibrated.fit, self.calibrated.held_out)
        by_name = {condition.name: condition for part in parts for condition in part.conditions}
        for name in self.calibrated.names:
            if name in by_name:
                yield from simulator.simulate(effects, (by_name[name],), self.root, 1)
