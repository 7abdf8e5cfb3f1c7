"""The papers, each a list of studies that run one after the other, so that each has all cores."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from papers.framework import Work, load_study
from twingap import TwingapError
from twingap.track import NullTracker, Tracker

FOLDERS: Final = {
    "paper1": "papers.paper1_rul_varying_speed",
    "paper2": "papers.paper2_digital_twin",
    "paper3": "papers.paper3_zoa_dann",
    "extra": "papers.extra",
}
"""Paper -> package that its studies lie in. Those of ``extra`` answer questions that no paper asks."""
BOTH: Final = ("smoke", "full")
PAPERS: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "paper1": {
        "paper1.lives": BOTH,
        "extra.femto": ("full",),
        "extra.femto_score": ("full",),
        "extra.rig_lives": ("full",),
        "paper1.ablation": ("full",),
        "extra.life_gap": ("full",),
        "extra.femto_lives": ("full",),
    },
    "paper2": {
        "paper2.dynamics": BOTH,
        "paper2.live": BOTH,
        "paper2.degradation": BOTH,
        "extra.lines": BOTH,
        "paper2.availability": BOTH,
        "extra.transfer_gap": BOTH,
    },
    "paper3": {
        "paper3.identification": BOTH,
        "paper3.comparison": BOTH,
        "paper3.inputs": BOTH,
        "extra.quantities": (),
        "extra.baselines": (),
        "extra.layers": (),
        "extra.pdm_bench": (),
    },
}
"""Paper -> its studies in the order of running -> profiles of the paper that include them."""


@dataclass(frozen=True)
class Outcome:
    """A paper's results."""

    works: dict[str, Work]  # by name of the study
    missing: tuple[str, ...]  # studies whose data are not at hand
    out: Path
    run_id: str | None  # of the tracker's run

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Rows of all headline tables; each names its study and table, other columns are the table's own."""
        return [row for work in self.works.values() for row in work.rows]

    def notes(self) -> Iterator[str]:
        for work in self.works.values():
            yield from work.notes()
        if self.missing:
            yield f"left out, since data are not available: {', '.join(self.missing)}"


def run(
    paper: str, profile: str = "smoke", *, out: Path, tracker: Tracker | None = None, root: Path | None = None,
    seed: int = 0, only: Collection[str] | None = None, **given: Any,
) -> Outcome:  # fmt: skip
    """Run a paper's studies of a profile, or those named by `only`; what an interrupted run has finished is taken up
    again. Raises `TwingapError` for a profile, study, backend, data root or folder that cannot be used. All else is
    `given` to `papers.framework.Study.run`."""
    if profile not in BOTH:
        raise TwingapError(f"unknown profile {profile!r}", mend=f"use one of {', '.join(BOTH)}")
    studies = {name.rpartition(".")[2]: package_of(name) for name, when in PAPERS[paper].items() if profile in when}
    if unknown := sorted(set(only or ()) - studies.keys()):
        raise TwingapError(f"unknown study {unknown[0]!r}", mend=f"use one of {', '.join(studies)}")
    works: dict[str, Work] = {}
    missing = []
    with (tracker or NullTracker()).run(
        f"{paper} · {profile} · seed {seed}", {"paper": paper, "profile": profile}
    ) as log:
        log.parameters({"profile": profile, "seed": seed, "studies": list(only or studies)})
        for name, package in studies.items():
            if only is not None and name not in only:
                continue
            study = load_study(package)
            if not study.at_hand(root):
                missing.append(name)
                continue
            with log.run(name, {"paper": paper, "study": name, "profile": profile}) as of_study:
                works[name] = study.run(profile, out=out, root=root, seed=seed, log=of_study, **given)
        return Outcome(works, tuple(missing), out, getattr(log, "id", None))


def package_of(name: str) -> str:
    """Dotted name of a study's package, by ``paper2.dynamics``, ``extra.lines``, or that name itself."""
    first, _, rest = name.partition(".")
    return f"{FOLDERS[first]}.{rest}" if first in FOLDERS else name


def paper_of(package: str) -> str:
    """Paper that a study's package belongs to; "" for none."""
    return next((paper for paper, own in PAPERS.items() if package in map(package_of, own)), "")


def short_names() -> dict[str, str]:
    """Every study: ``paper2.dynamics`` -> the dotted name of its package."""
    return {name: package_of(name) for own in PAPERS.values() for name in own}


def check_configurations(name: str | None = None) -> list[str]:
    """Read the configuration of a study, or of every one of the project, and run nothing; a line for each.

    Raises `TwingapError` for the first that is wrong: file, key, value and what was expected.
    """
    asked = short_names() if name is None else {name: package_of(name)}
    return [f"{name}: profiles {', '.join(load_study(package).read().profiles)}" for name, package in asked.items()]
