"""The closest twin under stated splits: what is fitted and judged, what is seen, classifiers, the section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import catalogue, make_effect, trainable
from twingap.effects.by_state import unit_of
from twingap.gap.distance.feature_vectors import FeatureVectors
from twingap.gap.search import evidence
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.identification.calibrate import calibrate, prepare
from twingap.records import Condition, Record, RecordSet
from twingap.rigs import make_rig
from twingap.study import public_closest
from twingap.study.public_closest import Split, recognised, splits
from twingap.study.public_closest_report import closest_section, closure_rows
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

OWN = PhenomenologicalParameters(2400.0, 0.05, {"inner": 6.0, "outer": 8.0}, 0.7, 0.6, 1.5)
SPEC = TwinSpec("phenomenological", bearing=BEARINGS["6205"])


def parts_of(split: Split, records: RecordSet) -> tuple[list[Condition], list[Condition]]:
    return [c for c in records.conditions if split.fitted(c)], [c for c in records.conditions if not split.fitted(c)]


# --------------------------------------------------------------------------------------------------------------- splits


def test_loads_are_fitted_and_judged_in_turn() -> None:
    records = make_rig("virtual_cwru", duration_s=2.0).records(0)
    by_load = [split for split in splits(records) if not split.new_bearings]
    loads = [[{c.extra["load_hp"] for c in part} for part in parts_of(split, records)] for split in by_load]
    assert loads == [[{0, 2}, {1, 3}], [{1, 3}, {0, 2}]]
    assert by_load[0].name == "0 and 2 hp fitted, 1 and 3 judged"


def test_every_bearing_is_left_out_once_and_its_fault_is_fitted_from_others() -> None:
    records = make_rig("virtual_cwru", duration_s=2.0).records(0)
    left_out: list[str] = []
    for split in (split for split in splits(records) if split.new_bearings):
        fit, judged = parts_of(split, records)
        assert not {unit_of(c) for c in fit} & {unit_of(c) for c in judged}
        assert {c.fault for c in judged} == {"inner", "outer", "ball"} < {c.fault for c in fit}
        assert sum(c.fault == "healthy" for c in fit) == 4
        left_out += dict.fromkeys(unit_of(c) for c in judged)
    assert len(left_out) == 9 == len(set(left_out))


def test_healthy_records_are_fitted_where_the_fit_part_would_have_none() -> None:
    conditions = [
        Condition(f"{fault}{hp}", 1800.0 - 20 * hp, 4096.0, 4096, fault, group=f"{fault}{hp}", extra={"load_hp": hp})
        for fault in ("healthy", "inner") for hp in range(4) if fault == "inner" or hp == 2
    ]  # fmt: skip
    records = RecordSet.from_records("few", "g", None, [Record(c, np.ones(4096)) for c in conditions])
    first, second = splits(records)
    assert [[c.name for c in parts_of(s, records)[1]] for s in (first, second)] == [
        ["inner1", "inner3"],
        ["inner0", "inner2"],
    ]


def test_one_operating_point_and_one_bearing_of_each_fault_have_no_split() -> None:
    conditions = [Condition(f, 1800.0, 4096.0, 4096, f, group=f, extra={"bearing_id": f}) for f in ("healthy", "inner")]
    assert splits(RecordSet.from_records("one", "g", None, [Record(c, np.ones(4096)) for c in conditions])) == []


# ----------------------------------------------------------------------------------------------------- the closest twin


def machine(hum: float = 0.0) -> RecordSet:
    """Healthy records and two bearings at two speeds, in a housing with a second mode; a hum in the faster records."""
    made: list[Record] = []
    for unit in range(2):
        chain = (
            make_effect("second_resonance", {"frequency_hz": 900.0, "damping_ratio": 0.04, "gain": 1.5 + 0.5 * unit}),
            make_effect("impact_scatter", {"sigma": 0.7}),
        )
        conditions = [
            Condition(
                f"{fault}{unit}-{speed}-{piece}", float(speed), 8000.0, 6000, fault, group=f"{fault}{unit}-{speed}",
                extra={"bearing_id": "healthy" if fault == "healthy" else f"{fault}{unit}"},
            )
            for fault in ("healthy", "inner") for speed in (1500, 1800) for piece in range(3)
        ]  # fmt: skip
        made += PhenomenologicalTwin(BEARINGS["6205"], OWN, chain).simulate(conditions, np.random.default_rng(unit))
    tone = hum * np.sin(2 * np.pi * 50.0 * np.arange(6000) / 8000.0)
    heard = [Record(r.condition, r.samples + tone * (r.condition.speed_rpm > 1600)) for r in made]
    return RecordSet.from_records("machine", "g", BEARINGS["6205"], heard)


@pytest.mark.slow
def test_the_closest_twin_sees_the_fitted_records_alone_and_closes_the_gap_of_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(evidence, "TRIALS", (6, 6))
    found = []
    for hum in (0.0, 5.0):
        records, rng = machine(hum), np.random.default_rng(0)
        split = splits(records)[0]
        prepared = prepare(records, SPEC, rng, fitted=split.fitted)
        assert set(prepared.fit.groups) == split.groups
        found.append((*public_closest._found(prepared, SPEC, rng, detectors_alone=False), rng))
    (held_out, now, rng), (_, again, _) = found
    assert again.effects == now.effects, "the hum is in judged records alone"
    row = public_closest._judged(held_out, now, rng)
    assert 0.7 < row["closure"]["closest"][0] < 1.3
    assert 0.6 < row["by_bearing"]["same bearing"] <= 1.1
    assert ("population" in row["closure"]) == (row["by"] == "unit")
    accuracy = public_closest._taught(held_out, now, rng)
    assert accuracy["closest"] == accuracy["real"] == accuracy["real and closest"] == 1.0


def test_effects_without_a_detector_can_be_left_out() -> None:
    records = machine()
    calibrated = calibrate(records, SPEC, np.random.default_rng(0))
    every, few = (
        kind(calibrated, simulator_of(calibrated), SPEC, 7) for kind in (Evidence, public_closest.WithDetectorsAlone)
    )
    added = {name for name in catalogue() if every.can_add(name) is None}
    assert added - set(trainable()) >= {"transfer_path", "background_spectrum", "line_spectrum"}
    assert {name for name in catalogue() if few.can_add(name) is None} == added & set(trainable())


def test_a_set_that_cannot_be_split_is_refused_in_its_row() -> None:
    records = machine()
    row = public_closest.closest_row(records, SPEC, np.random.default_rng(0), Split("none", False, frozenset()))
    assert "without records" in row["refused"] and row["split_by"] == "none"


# ---------------------------------------------------------------------------------------------------------- classifiers


def vectors(rows: Sequence[tuple[float, str, str]]) -> FeatureVectors:
    """One feature: value, fault, recording."""
    conditions = tuple(
        Condition(f"{k}", 1800.0, 4096.0, 4096, fault, group=group) for k, (_, fault, group) in enumerate(rows)
    )
    return FeatureVectors({"frequency": np.array([[value] for value, _, _ in rows])}, {}, conditions)


def test_recordings_are_named_by_the_mean_of_their_records() -> None:
    taught = vectors([(0.0, "inner", "a"), (1.0, "outer", "b")])
    judged = vectors([(0.0, "inner", "c"), (0.0, "inner", "c"), (1.0, "inner", "c"), (0.0, "outer", "d")])
    assert recognised([[taught]], judged, 0) == 0.5


def test_sources_weigh_the_same_whatever_their_numbers() -> None:
    right = vectors([(0.0, "inner", "a"), (1.0, "outer", "b")])
    wrong = vectors([(0.0, "outer", f"{k}") for k in range(50)] + [(1.0, "inner", f"{k}") for k in range(50)])
    judged = vectors([(0.0, "inner", "c"), (1.0, "outer", "d")])
    assert recognised([[right], [right], [wrong]], judged, 0) == 1.0
    assert recognised([[right], [wrong, wrong], [wrong]], judged, 0) == 0.0


# ---------------------------------------------------------------------------------------------------------- the section


def row(split: str, *, new: bool, closest: float, population: float | None, other: float | None) -> dict[str, Any]:
    accuracy = {"bare": 0.25, "closest": closest, "real": 0.75, "real and bare": 0.75, "real and closest": 1.0}
    more = {} if population is None else {"population": population}
    return {
        "title": "CWRU", "set": "cwru", "split_by": split, "new_bearings": new, "detectors_alone": False, "refused": "",
        "fitted": 40, "judged": 36, "recordings": 12, "named": [], "effects": ["transfer_path"], "by": "unit",
        "gap": {"before": 2.0, "floor": 0.1}, "closure": {"verdict": [0.1, 0.0, 0.2], "closest": [closest, 0.4, 0.6]},
        "by_bearing": {"verdict": 0.05, "closest": closest, **more, "same bearing": 0.8, "other bearings": other},
        "accuracy": accuracy,
    }  # fmt: skip


def test_the_section_shows_closures_their_means_and_accuracies() -> None:
    rows = [
        row("0 and 2 hp fitted, 1 and 3 judged", new=False, closest=0.5, population=None, other=0.2),
        row("a left out", new=True, closest=0.1, population=0.3, other=0.2),
        row("b left out", new=True, closest=0.2, population=0.5, other=0.1),
        {"title": "HIT-SM", "split_by": "c left out", "new_bearings": True, "detectors_alone": False, "refused": "why"},
    ]
    page = "\n".join(closest_section(rows))
    assert [one["closest closes"] for one in closure_rows(rows)][::3] == ["0.50 (0.40 to 0.60)", "why"]
    assert "0.50 (0.40 to 0.60)" in page and "Not found: HIT-SM, c left out (why)." in page
    (mean,) = (line for line in page.splitlines() if "| mean of 2 |" in line)
    assert [cell.strip() for cell in mean.split("|")[3:-1]] == ["0.05", "0.15", "0.40", "0.15"]
    (taught,) = (line for line in page.splitlines() if "new bearings, 24 recordings" in line)
    assert [cell.strip() for cell in taught.split("|")[3:-1]] == ["0.25", "0.15", "", "0.75", "0.75", "1.00", ""]
