"""Layout of the records of a world: bearing, sampling, and each record's fault, speeds, load, time and group.

Case, random draws --> Layout --> stated conditions and true speeds

The draw does not depend on the effects, except that the layout has what an effect needs; every such property also
occurs without the effect, so that it does not reveal it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import BEARINGS, Bearing
from twingap.errors import TwingapError
from twingap.records import Condition
from twingap.rigs.worlds.case import ON_FAULTS, Case

Array = NDArray[np.float64]
RATES_HZ: Final = (10_000.0, 12_800.0, 16_000.0, 20_000.0, 25_600.0, 32_000.0)
LOWEST_RPM, HIGHEST_RPM = 600.0, 3600.0
GREATEST_SPEED_ERROR = 0.03
"""Largest relative error of a stated speed; larger makes calibration harder."""

TEST_BEARINGS: Final[dict[str, Bearing]] = {
    bearing.name: bearing
    for bearing in (
        BEARINGS["6205"],
        BEARINGS["ZA-2115"],
        BEARINGS["UER204"],
        # Typical internal dimensions of their series; manufacturers differ by a few per cent.
        Bearing("6308", 8, 15.08, 65.0, 0.0),
        Bearing("NU205", 13, 7.5, 38.5, 0.0),
        Bearing("7210B", 14, 12.7, 70.0, 40.0),  # angular contact
        Bearing("32008", 21, 7.2, 54.5, 14.2),  # tapered
        Bearing("22212", 17, 10.9, 85.2, 9.4),  # spherical roller
        Bearing("61908", 14, 5.95, 51.0, 0.0),  # thin section
    )
}
"""Bearings of the worlds, by name."""


@dataclass(frozen=True)
class Layout:
    """All properties of a world's records except their samples.

    Parameters
    ----------
    bearing : Bearing
    fs_hz : float
    n_samples : int
        Samples of each record.
    fault, group : tuple of str [records]
    speed_rpm, stated_rpm : tuple of float [records]
        True and stated mean speed.
    load_n : tuple of float [records]
        Radial load, N.
    load_stated : bool
        Whether the records state the load.
    time_s : tuple of float [records] or None
        Time from the start of the run, s.
    """

    bearing: Bearing
    fs_hz: float
    n_samples: int
    fault: tuple[str, ...]
    group: tuple[str, ...]
    speed_rpm: tuple[float, ...]
    stated_rpm: tuple[float, ...]
    load_n: tuple[float, ...]
    load_stated: bool
    time_s: tuple[float, ...] | None

    def __len__(self) -> int:
        return len(self.fault)

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults that occur, without healthy."""
        return tuple(f for f in ("inner", "outer", "ball") if f in self.fault)

    @property
    def mean_rpm(self) -> float:
        """Geometric mean of the true speeds."""
        return float(np.exp(np.mean(np.log(self.speed_rpm))))

    def conditions(self) -> tuple[Condition, ...]:
        """Stated conditions of each record."""
        return tuple(
            Condition(
                name=f"r{i:03d}",
                speed_rpm=self.stated_rpm[i],
                fs_hz=self.fs_hz,
                n_samples=self.n_samples,
                fault=self.fault[i],
                load_n=self.load_n[i] if self.load_stated else None,
                time_s=None if self.time_s is None else self.time_s[i],
                group=self.group[i],
            )
            for i in range(len(self))
        )


def draw_layout(case: Case, rng: np.random.Generator) -> Layout:
    """Random layout of a world's records.

    Raises
    ------
    TwingapError
        For an unknown bearing, or an effect on faults where no fault occurs.
    """
    needs = set(case.effect_names) | set(case.modelled)
    name = case.bearing or str(rng.choice(list(TEST_BEARINGS)))
    if name not in TEST_BEARINGS:
        mend = f"use one of {', '.join(TEST_BEARINGS)}"
        raise TwingapError(f"unknown bearing {name!r}", where=f"case {case.name!r}", mend=mend)
    fs_hz = float(case.fs_hz or rng.choice(RATES_HZ))
    faults = case.faults or _draw_faults(needs, case.n_records, rng)
    if not set(faults) - {"healthy"} and (invisible := needs & set(ON_FAULTS)):
        raise TwingapError(f"{', '.join(sorted(invisible))} shows on faults only", where=f"case {case.name!r}: faults")
    speeds = _draw_speeds(rng)
    size, groups = _draw_groups(case.n_records, len(faults), rng)
    n = case.n_records

    run = bool(rng.random() < 0.35) or "damage_growth" in needs
    healthy_first = bool(rng.random() < 0.6) and run and len(faults) == 2 and faults[0] == "healthy"
    fault: list[str] = []
    speed_at: list[int] = []
    for j in range(groups):
        # Every fault has every speed once before any pair repeats.
        which = j % len(faults)
        if healthy_first:
            which = int(j >= max(2, groups // 3))
        fault.append(faults[which])
        speed_at.append((j if healthy_first else j // len(faults) + which) % len(speeds))
    if not run:
        order = rng.permutation(groups)
        fault, speed_at = [fault[j] for j in order], [speed_at[j] for j in order]
    of = [min(i // size, groups - 1) for i in range(n)]

    wander = 1 + 0.003 * rng.standard_normal(groups)
    true = np.clip([speeds[speed_at[j]] * wander[j] for j in of], LOWEST_RPM, HIGHEST_RPM)
    true = true * (1 + 3e-4 * rng.standard_normal(n))
    common = rng.uniform(-0.025, 0.025) if rng.random() < 0.7 else 0.0
    single = rng.uniform(0.001, 0.005) * rng.standard_normal(n) if rng.random() < 0.6 else np.zeros(n)
    error = np.clip(common + single, -0.97 * GREATEST_SPEED_ERROR, 0.97 * GREATEST_SPEED_ERROR)
    stated = np.round(true * (1 + error), int(rng.integers(0, 2)))

    load_stated = bool(rng.random() < 0.4)
    # A load that is not stated is constant.
    levels = np.exp(rng.uniform(np.log(300), np.log(4000), int(rng.integers(1, 4)) if load_stated else 1))
    loads = np.round(levels[rng.integers(0, levels.size, groups)])
    step_s = float(rng.choice([60.0, 600.0, 3600.0]))
    return Layout(
        bearing=TEST_BEARINGS[name],
        fs_hz=fs_hz,
        n_samples=round(case.duration_s * fs_hz),
        fault=tuple(fault[j] for j in of),
        group=tuple(f"g{j:02d}" for j in of),
        speed_rpm=tuple(float(v) for v in true),
        stated_rpm=tuple(float(v) for v in stated),
        load_n=tuple(float(loads[j]) for j in of),
        load_stated=load_stated,
        time_s=tuple(step_s * i for i in range(n)) if run else None,
    )


def _draw_faults(needs: set[str], n_records: int, rng: np.random.Generator) -> tuple[str, ...]:
    """Healthy and one, two or three faults, each in at least two groups."""
    count = int(rng.choice([1, 2, 3], p=[0.3, 0.25, 0.45]))
    if "mean_slip" in needs:  # with a single fault, slip and a wrong speed cannot be told apart
        return ("healthy", "inner", "outer", "ball")[: 4 if count == 3 and n_records >= 8 else 3]
    count = max(1, min(count, n_records // 2 - 1))
    while True:
        chosen = {str(f) for f in rng.permutation(["inner", "outer", "ball"])[:count]}
        if "load_zone" in needs and chosen == {"outer"}:
            continue
        return ("healthy", *(f for f in ("inner", "outer", "ball") if f in chosen))


def _draw_speeds(rng: np.random.Generator) -> Array:
    """Two to four speeds, the highest at least 1.4 times the lowest."""
    count = int(rng.integers(2, 5))
    ratio = float(np.exp(rng.uniform(np.log(1.4), np.log(2.8))))
    lowest = float(np.exp(rng.uniform(np.log(LOWEST_RPM * 1.02), np.log(HIGHEST_RPM / ratio / 1.02))))
    inner = np.sort(rng.uniform(0.15, 0.85, count - 2))
    return np.asarray(lowest * ratio ** np.concatenate([[0.0], inner, [1.0]]))


def _draw_groups(n_records: int, faults: int, rng: np.random.Generator) -> tuple[int, int]:
    """Records per group and number of groups, with at least two groups per fault where possible."""
    size = int(rng.choice([1, 2, 3], p=[0.4, 0.35, 0.25]))
    while size > 1 and n_records // size < 2 * faults:
        size -= 1
    return size, max(1, n_records // size)
