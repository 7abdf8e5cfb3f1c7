"""Summary of a fleet: one row per machine, effects that machines share, and how far each machine differs from the rest.

GapReport, GapReport, ... --Machine.of--> rows --fleet_of--> Fleet: shared effects, probabilities with the fleet,
                                                             rows by difference from the fleet
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from twingap.fleet.prevalence import LEVEL, prevalence, training_prevalence
from twingap.gap.report.model import GapReport, Interval

if TYPE_CHECKING:
    import pandas as pd

NOT_DIAGNOSED: Final = "not_diagnosed"
STATUSES: Final = ("unexplained", "partly_explained", "explained", "no_gap", NOT_DIAGNOSED)


@dataclass(frozen=True)
class Machine:
    """One machine of a fleet.

    Parameters
    ----------
    path : str
        Of its record set, relative to the folder of the fleet.
    status : str
        That of the verdict, or "not_diagnosed".
    reason : str
        Why it could not be diagnosed.
    effects : tuple of str
        Named as missing.
    sentence : str
        The verdict.
    p_value : float or None
        Of no gap at all.
    p_words : str
        The same in words.
    before, after, floor : float or None
        Gap without and with the named effects, and that of records against records: the metric that closures refer to.
    closure, closure_ci : float and (float, float), or None
        Part of the gap that the named effects close, with its 90 % interval.
    closest, closest_ci : float and (float, float), or None
        Part of the gap that the closest twin closes, with its 90 % interval; None where it was not requested.
    shares : Mapping[str, float]
        Group of effects -> its share in that, for groups that are shown to close something.
    probability : Mapping[str, float]
        Effect -> probability that the twin lacks it, from this machine alone.
    with_fleet : Mapping[str, float]
        The same, given all machines of the fleet.
    difference : float or None
        Difference from the fleet's typical machine; see `fleet_of`.
    n_records : int or None
    records_sha256 : str
    """

    path: str
    status: str
    reason: str = ""
    effects: tuple[str, ...] = ()
    sentence: str = ""
    p_value: float | None = None
    p_words: str = ""
    before: float | None = None
    after: float | None = None
    floor: float | None = None
    closure: float | None = None
    closure_ci: Interval | None = None
    closest: float | None = None
    closest_ci: Interval | None = None
    shares: Mapping[str, float] = field(default_factory=dict)
    probability: Mapping[str, float] = field(default_factory=dict)
    with_fleet: Mapping[str, float] = field(default_factory=dict)
    difference: float | None = None
    n_records: int | None = None
    records_sha256: str = ""

    @classmethod
    def of(cls, path: str, report: GapReport) -> Machine:
        """Row of a diagnosed machine."""
        verdict, stated = report.verdict, report.provenance
        first = report.metrics[0] if report.metrics else None
        near = report.closest if report.closest.attribution else None
        return cls(
            path,
            verdict.status,
            effects=verdict.effects,
            sentence=report.sentence,
            p_value=verdict.p_value,
            p_words=verdict.p_words,
            before=None if first is None else first.before,
            after=None if first is None else first.after,
            floor=None if first is None else first.floor,
            closure=verdict.closure,
            closure_ci=verdict.closure_ci,
            closest=None if near is None else near.closure,
            closest_ci=None if near is None else near.closure_ci,
            shares={} if near is None else {share.group: share.share for share in near.attribution if share.shown},
            probability={c.effect: c.probability for c in sorted(report.candidates, key=lambda c: c.effect)},
            n_records=stated.get("n_records"),
            records_sha256=str(stated["records_sha256"]),
        )

    @property
    def diagnosed(self) -> bool:
        """Whether there is a report."""
        return self.status != NOT_DIAGNOSED

    @property
    def gap(self) -> float | None:
        """Gap without the named effects as a multiple of its floor."""
        return self._over_floor(self.before)

    @property
    def gap_after(self) -> float | None:
        """Gap with the named effects as a multiple of its floor."""
        return self._over_floor(self.after)

    def _over_floor(self, value: float | None) -> float | None:
        return value / self.floor if value is not None and self.floor else None


@dataclass(frozen=True)
class SharedEffect:
    """An effect in a fleet.

    Parameters
    ----------
    effect : str
    named, of : int
        Machines for which it is named, and machines diagnosed.
    rate_ci : (float, float)
        90 % Clopper-Pearson interval of named / of.
    prevalence : float or None
        Estimated part of the machines that have it; None for an effect that nothing was learnt of.
    prevalence_ci : (float, float) or None
        90 % interval.
    """

    effect: str
    named: int
    of: int
    rate_ci: Interval
    prevalence: float | None = None
    prevalence_ci: Interval | None = None


class SharedGroup(NamedTuple):
    """A group of effects in a fleet.

    Parameters
    ----------
    group : str
    machines, of : int
        Machines whose gap it is shown to close in part, and machines with a closest twin.
    share : float
        Mean over the latter of its share of the gap, 0 where it is not shown.
    """

    group: str
    machines: int
    of: int
    share: float


@dataclass(frozen=True)
class Fleet:
    """A diagnosed fleet.

    Parameters
    ----------
    machines : tuple of Machine
        The largest difference first, those that could not be diagnosed last.
    effects : tuple of SharedEffect
        The most often named first.
    groups : tuple of SharedGroup
        The largest share first; empty where diagnoses were quick.
    about : Mapping
        Folder, twin, seed and versions.
    """

    machines: tuple[Machine, ...]
    effects: tuple[SharedEffect, ...]
    groups: tuple[SharedGroup, ...]
    about: Mapping[str, Any]

    @property
    def statuses(self) -> dict[str, int]:
        """Number of machines by status."""
        counts = Counter(machine.status for machine in self.machines)
        return {status: counts[status] for status in STATUSES}

    @property
    def diagnosed(self) -> tuple[Machine, ...]:
        """Machines with a report."""
        return tuple(machine for machine in self.machines if machine.diagnosed)

    @property
    def frame(self) -> pd.DataFrame:
        """One row per machine, in the order of `machines`."""
        import pandas as pd

        rows = [
            {
                "machine": m.path, "status": m.status, "effects": ", ".join(m.effects), "p_value": m.p_value,
                "gap_before": m.before, "gap_after": m.after, "gap_floor": m.floor, "closure": m.closure,
                "closure_lo": None if m.closure_ci is None else m.closure_ci[0],
                "closure_hi": None if m.closure_ci is None else m.closure_ci[1],
                "closest_closure": m.closest, "likely_with_the_fleet": ", ".join(likely(m)), "difference": m.difference,
                "n_records": m.n_records, "records_sha256": m.records_sha256, "reason": m.reason,
            }
            for m in self.machines
        ]  # fmt: skip
        return pd.DataFrame(rows).astype({"n_records": "Int64"})


def likely(machine: Machine) -> list[str]:
    """Effects that are more probable than not, given the fleet; the most probable first."""
    return sorted((n for n, p in machine.with_fleet.items() if p > 0.5), key=lambda n: (-machine.with_fleet[n], n))


def fleet_of(machines: Sequence[Machine], about: Mapping[str, Any]) -> Fleet:
    """Fleet of its machines.

    The difference of a machine from the fleet is the number of effects by which it differs from the typical machine
    (over all effects, the sum of the differences of its probability from the fleet's median) plus the number of
    doublings between its gap and the fleet's median gap, both as multiples of the floor.
    """
    diagnosed = [machine for machine in machines if machine.diagnosed]
    effects = sorted({name for machine in diagnosed for name in machine.probability})
    trained = training_prevalence()
    shared, given = [], {}
    for effect in effects:
        known = [machine for machine in diagnosed if effect in machine.probability]
        named = sum(effect in machine.effects for machine in known)
        row = SharedEffect(effect, named, len(known), _clopper_pearson(named, len(known)))
        if effect in trained:
            found = prevalence([machine.probability[effect] for machine in known], trained[effect])
            row = replace(row, prevalence=found.mean, prevalence_ci=found.ci)
            given[effect] = {m.path: float(p) for m, p in zip(known, found.probability, strict=True)}
        shared.append(row)
    differences = _differences(diagnosed, effects)
    rows = [
        replace(
            machine,
            with_fleet={name: given[name][machine.path] for name in machine.probability if name in given},
            difference=differences.get(machine.path),
        )
        for machine in machines
    ]
    rows.sort(key=lambda m: (not m.diagnosed, -(m.difference or 0.0), m.path))
    shared.sort(key=lambda row: (-row.named, -(row.prevalence or 0.0), row.effect))
    return Fleet(tuple(rows), tuple(shared), _groups(diagnosed), about)


def _groups(diagnosed: Sequence[Machine]) -> tuple[SharedGroup, ...]:
    """Groups of effects that close gaps, the largest share first."""
    closer = [machine.shares for machine in diagnosed if machine.closest is not None]
    counts = Counter(group for shares in closer for group in shares)
    rows = [
        SharedGroup(group, count, len(closer), sum(shares.get(group, 0.0) for shares in closer) / len(closer))
        for group, count in counts.items()
    ]
    return tuple(sorted(rows, key=lambda row: (-row.share, row.group)))


def _differences(diagnosed: Sequence[Machine], effects: Sequence[str]) -> dict[str, float]:
    """Path -> difference from the typical machine."""
    if not diagnosed:
        return {}
    table = np.array([[machine.probability.get(name, 0.0) for name in effects] for machine in diagnosed])
    away = np.abs(table - np.median(table, axis=0)).sum(axis=1)
    gaps = [machine.gap for machine in diagnosed if machine.gap]
    typical = statistics.median(gaps) if gaps else 1.0
    doublings = [abs(float(np.log2(machine.gap / typical))) if machine.gap else 0.0 for machine in diagnosed]
    return {m.path: float(a) + d for m, a, d in zip(diagnosed, away, doublings, strict=True)}


def _clopper_pearson(k: int, n: int) -> Interval:
    from scipy.stats import binomtest

    found = binomtest(k, n).proportion_ci(LEVEL, "exact")
    return float(found.low), float(found.high)
