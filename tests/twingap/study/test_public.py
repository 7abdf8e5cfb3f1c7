"""The study of real records: halves, effects left out and added, naming of effects, plain indicators, the page."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.data import load
from twingap.effects import make_effect
from twingap.errors import TwingapError
from twingap.gap.report.model import (
    Candidate,
    ClosestEffect,
    ClosestTwin,
    EffectShare,
    GapReport,
    GroupShare,
    Metric,
    ParameterValue,
    Place,
    Verdict,
)
from twingap.records import Condition, Record, RecordSet
from twingap.rigs import make_rig
from twingap.study import public, public_indicators, public_jobs, public_report, public_sets
from twingap.study.public_jobs import PublicJob, run_job
from twingap.study.sweeps import swept
from twingap.study.tracking import track_public
from twingap.track import FolderTracker
from twingap.twins.phenomenological import PhenomenologicalTwin
from twingap.twins.twin_file import build_twin

FS = 4096.0
needs_data = pytest.mark.skipif("TWINGAP_DATA" not in os.environ, reason="TWINGAP_DATA names no data root")


def record_set(speeds: dict[str, list[float]], pieces: int = 2) -> RecordSet:
    """Noise of one recording per bearing and speed; a bearing is named by its fault and a number."""
    rng = np.random.default_rng(0)
    made = []
    for bearing, own in speeds.items():
        for speed in own:
            group = f"{bearing}-{speed:g}"
            for piece in range(pieces):
                condition = Condition(
                    f"{group}+{piece}", speed, FS, int(FS), bearing.split("-")[0], group=group,
                    extra={"bearing_id": bearing},
                )  # fmt: skip
                made.append(Record(condition, rng.standard_normal(int(FS))))
    return RecordSet.from_records("set", "g", BEARINGS["6205"], made)


NEAR = {"healthy": [1797.0, 1750.0], "inner-7": [1797, 1772, 1750, 1730.0], "inner-14": [1797, 1772, 1750.0]}


# --------------------------------------------------------------------------------------------------------------- halves


@pytest.mark.parametrize("seed", range(8))
def test_halves_share_no_recording_and_hold_the_same_bearings(seed: int) -> None:
    records = record_set(NEAR)
    one, other, by = public_sets.halves(records, np.random.default_rng(seed))
    assert by == "recording"
    assert not one.common_groups(other)
    assert len(one) + len(other) == len(records)
    assert {public_sets.bearing_of(c) for c in one.conditions} == {public_sets.bearing_of(c) for c in other.conditions}
    assert abs(len(one) - len(other)) <= 2  # one recording more at most


def test_halvings_differ_from_seed_to_seed_and_agree_for_one() -> None:
    records = record_set(NEAR)
    drawn = {public_sets.halves(records, np.random.default_rng(s))[0].groups for s in range(20)}
    assert len(drawn) > 5
    assert public_sets.halves(records, np.random.default_rng(3))[0].groups in drawn


@pytest.mark.parametrize("speeds", [{"healthy": [600.0, 1200.0]}, {"healthy": [1797.0, 1750.0], "ball-7": [1797.0]}])
def test_recordings_that_cannot_stand_for_each_other_are_cut_in_time(speeds: dict[str, list[float]]) -> None:
    records = record_set(speeds)
    one, other, by = public_sets.halves(records, np.random.default_rng(0))
    assert by == "time within recordings"
    assert set(one.groups) == set(other.groups) == set(records.groups)
    assert not {c.name for c in one.conditions} & {c.name for c in other.conditions}
    with pytest.raises(TwingapError, match="halved"):
        public_sets.halves(record_set(speeds, pieces=1), np.random.default_rng(0))


def test_real_records_in_place_of_simulated_ones_turn_at_the_speeds_that_they_show() -> None:
    conditions = [Condition(f"{f}{i}", 1500.0 + 60 * i, 12000.0, 24000, f) for i in (0, 1) for f in ("inner", "outer")]
    effects = [make_effect("shaft_harmonics", {"level_1x": 1.0})]
    made = PhenomenologicalTwin(BEARINGS["6205"], effects=effects).simulate(conditions, np.random.default_rng(0))
    stated = [Record(dataclasses.replace(r.condition, speed_rpm=0.99 * r.condition.speed_rpm), r.samples) for r in made]
    records = RecordSet.from_records("real", "m/s^2", BEARINGS["6205"], stated)
    sim = public_jobs._as_simulated(records, "the other half")
    assert sim.name == "the other half"
    assert [c.speed_rpm for c in sim.conditions] == pytest.approx([c.speed_rpm for c in conditions], rel=1e-3)
    np.testing.assert_array_equal(sim[1].samples, records[1].samples)


# ---------------------------------------------------------------------------------------------------------------- twins


def test_the_papers_twins_for_records_without_time() -> None:
    records = record_set(NEAR)
    spec, left_out = public_jobs.twin_spec("paper1", records)
    assert spec.effects == ("speed_gain", "slip_jitter", "load_zone", "impact_scatter")
    assert len(left_out) == 1 and "damage_growth" in left_out[0]
    assert spec.parameters["load_zone"] == {"depth": 0.3, "extent": 1.0, "rotating": False}
    assert public_jobs.twin_spec("paper2", records)[0].preset == "paper"
    assert public_jobs.twin_spec("paper3", records)[0].effects == ("slip_jitter",)
    with pytest.raises(TwingapError, match="paper1"):
        public_jobs.twin_spec("paper9", records)


def test_an_effect_left_out_is_gone_with_its_parameters_and_the_rest_stays() -> None:
    spec, _ = public_jobs.twin_spec("paper1", record_set(NEAR))
    chain = {"clipping": {"rail": 3.0}, "looseness": {"level": 0.2}}
    whole = public_jobs.with_effects(spec, chain)
    assert set(whole.effects) == {*spec.effects, *chain}
    for name in whole.effects:
        less = public_jobs.with_effects(spec, chain, name)
        assert set(whole.effects) - set(less.effects) == {name}
        assert name not in less.parameters
        assert all(less.parameters[other] == whole.parameters[other] for other in less.effects)


def test_the_chain_of_a_verdict_holds_what_could_be_added_with_the_catalogues_types() -> None:
    values = {"level": 0.5, "decay": 0.6, "n_harmonics": 4.0, "inner": 1.0}
    rows = [
        {"effect": "waviness", "cannot": None, "parameters": values},
        {"effect": "mean_slip", "cannot": "no", "parameters": {"slip": 0.01}},
        {"effect": "clipping", "cannot": None, "parameters": {"rail": 3.0}},
    ]
    chain = public_jobs.chain_of({"which": rows, "effects": ["waviness", "mean_slip"]})
    assert chain == {"waviness": {**values, "n_harmonics": 4, "inner": True}}
    assert type(chain["waviness"]["inner"]) is bool and type(chain["waviness"]["n_harmonics"]) is int
    make_effect("waviness", chain["waviness"])


def test_a_report_becomes_a_row_and_its_verdict_a_chain_for_the_twin() -> None:
    values = {"rail": ParameterValue(3.0, "x", (2.0, 4.0))}
    report = GapReport(
        verdict=Verdict(
            "partly_explained", ("clipping", "mean_slip"), (("clipping", "mean_slip"),), 0.01, 0.5, (0.4, 0.6)
        ),
        places=(Place("frequency", 10.0, 20.0, "Hz", 0.3, 0.001),),
        candidates=(
            Candidate("clipping", 0.9, 2.0, 1.0, 0.5, (0.4, 0.6), values),
            Candidate("mean_slip", 0.8, 2.0, 2.0, 0.0, (0.0, 0.0), {}, "it cannot"),
            Candidate("looseness", 0.01, 2.0, 2.0, 0.0, (0.0, 0.0), {}),
        ),
        metrics=(
            Metric("overall gap", 2.0, 1.0, 0.1, (0.9, 1.1)),
            Metric("accuracy on the records of a classifier", 0.4, 0.6, 0.9, (0.5, 0.7), higher_is_better=True),
        ),
        provenance={},
        closest=ClosestTwin(
            (ClosestEffect("looseness", {"level": ParameterValue(0.2)}),),
            0.7,
            (0.6, 0.8),
            (GroupShare("lines", (EffectShare("looseness", 0.7),), 0.7, (0.6, 0.8), 0.01),),
            metrics=(Metric("overall gap", 2.1, 0.7, 0.1, (0.6, 0.8)),),
        ),
    )
    row = public_jobs.summary(report)
    json.dumps(row)
    assert row["gap"] == {"before": 2.0, "after": 1.0, "floor": 0.1}
    assert row["accuracy"] == {"before": 0.4, "after": 0.6, "floor": 0.9}
    assert [one["effect"] for one in row["which"]] == ["clipping", "mean_slip"]
    assert row["closest"]["gap"]["after"] == 0.7 and row["closest"]["accuracy"] is None
    assert row["closest"]["shares"] == {"lines": 0.7}
    assert row["closest"]["effects"] == ["looseness"] and row["closest"]["parameters"] == {"looseness": {"level": 0.2}}
    assert public_jobs.summary(dataclasses.replace(report, closest=ClosestTwin()))["closest"] is None
    assert "10 to 20 Hz" in row["where"][0]["place"]
    chain = public_jobs.chain_of(row)
    assert chain == {"clipping": {"rail": 3.0}}
    spec = public_jobs.with_effects(public_jobs.twin_spec("bare", record_set(NEAR))[0], chain)
    build_twin(spec, BEARINGS["6205"], "g")


def test_the_best_twin_has_the_smallest_gap_afterwards_and_was_not_refused() -> None:
    rows: dict[str, dict[str, Any]] = {
        "bare": {"refused": "", "gap": {"before": 3.0, "after": 2.0}},
        "paper1": {"refused": "", "gap": {"before": 2.5, "after": 2.4}},
        "paper2": {"refused": "too slow", "gap": None},
    }
    assert public.best_twin(rows) == "bare"
    assert public.best_twin({"paper2": rows["paper2"]}) == ""


# -------------------------------------------------------------------------------------------------------- effects added


def test_an_effect_is_added_in_units_of_healthy_vibration_and_only_where_it_can_act() -> None:
    records = record_set(NEAR)
    loud = RecordSet.from_records(
        "loud", "g", records.bearing,
        [Record(r.condition, r.samples * (1 if r.condition.fault == "healthy" else 100)) for r in records],
    )  # fmt: skip
    made, share, change, _ = public_jobs.injected(loud, make_effect("clipping", {"rail": 2.0}), BEARINGS["6205"], 0)
    assert share == 1.0 and change > 0.5
    assert max(float(np.abs(r.samples).max()) for r in made) == pytest.approx(2.0, rel=0.05)
    same, share, change, why = public_jobs.injected(loud, make_effect("mean_slip"), BEARINGS["6205"], 0)
    assert (share, change) == (0.0, 0.0) and "waveform" in why
    assert all(np.array_equal(a.samples, b.samples) for a, b in zip(same, loud, strict=True))


def test_effects_that_can_be_added_to_waveforms() -> None:
    names = public_jobs.can_be_injected(record_set(NEAR, pieces=1))
    assert {"quantisation", "looseness", "slip_jitter", "sensor_rolloff"} <= set(names)
    assert not {"mean_slip", "distributed_roughness", "damage_growth"} & set(names)


# ---------------------------------------------------------------------------------------------------- naming of effects


def answer(effects: list[str], sets: list[list[str]] | None = None, status: str = "explained") -> dict[str, Any]:
    return {
        "title": "CWRU", "real": True, "refused": "", "status": status, "effects": effects, "p_value": 0.01,
        "confidence_set": [effects] if sets is None else sets, "closure": 0.5, "closure_ci": [0.4, 0.6],
        "accuracy": None, "seconds": 1.0, "split_by": "recording", "changed": 0.1, "acts_on": 1.0, "parameters": {},
    }  # fmt: skip


def test_naming_is_computed_against_the_effect_and_the_others_that_are_missing() -> None:
    row = answer(["looseness", "clipping"], [["looseness", "clipping"], ["clipping"]])
    assert public.naming(row, "clipping") == {"first": False, "named": True, "covers": True, "in_a_set": True}
    assert public.naming(row, "looseness") == {"first": True, "named": True, "covers": False, "in_a_set": True}
    assert public.naming(row, "looseness", ["clipping"])["covers"]
    assert public.naming({"refused": "why"}, "clipping")["named"] is None


def test_a_withheld_effect_is_expected_beside_what_the_whole_twin_lacks() -> None:
    chain = json.dumps({"clipping": {"rail": 3.0}})
    jobs = [PublicJob("withheld", "cwru", "bare", 0, 2, effect, chain) for effect in ("", "clipping")]
    rows = public.withheld_rows(
        dict(zip(jobs, [answer(["gear_mesh"]), answer(["clipping", "gear_mesh"])], strict=True))
    )
    assert len(rows) == 1
    assert rows[0]["rest"] == ["gear_mesh"] and rows[0]["covers"] and rows[0]["first"] and rows[0]["from_verdict"]


def test_an_added_effect_that_is_named_without_it_is_marked() -> None:
    calm = PublicJob("nothing", "cwru", "bare", 0, 2, split=1)
    added = [PublicJob("injected", "cwru", "bare", 0, 2, name, split=1) for name in ("clipping", "looseness")]
    rows = public.injected_rows({
        calm: answer(["looseness"]), added[0]: answer(["clipping", "looseness"]), added[1]: answer(["looseness"]),
    })  # fmt: skip
    assert [r["named_without_it"] for r in rows] == [False, True]
    assert rows[0]["covers"] and rows[0]["rest"] == ["looseness"]


def test_false_alarms_are_counted_among_what_was_not_refused() -> None:
    answers = {
        PublicJob("nothing", "cwru", "bare", 0, 2, split=i): row
        for i, row in enumerate([
            answer([], status="no_gap"), answer(["clipping"]), answer([], status="unexplained"),
            {"title": "CWRU", "real": True, "refused": "why", "split_by": "recording"},
        ])
    }  # fmt: skip
    (row,) = public.nothing_rows(answers)
    assert (row["alarms"], row["splits"], row["named"]) == (2, 3, {"clipping": 1})
    assert row["interval"][0] < row["rate"] < row["interval"][1]
    assert row["refused"] == ["why"]


# ---------------------------------------------------------------------------------------------------------- plain looks


def test_a_fault_shows_when_its_own_comb_is_clear_and_highest() -> None:
    assert public_indicators.shows_fault({"inner": 20.0, "outer": 7.0, "ball": 0.0}, "inner") is True
    assert public_indicators.shows_fault({"inner": 20.0, "outer": 7.0, "ball": 0.0}, "outer") is False
    assert public_indicators.shows_fault({"inner": 3.0, "outer": 1.0, "ball": 0.0}, "inner") is False
    assert public_indicators.shows_fault({"inner": 20.0, "outer": 1.0, "ball": 0.0}, "healthy") is None


def test_bursts_are_seen_in_the_top_of_the_band_and_steady_noise_has_none() -> None:
    x = np.random.default_rng(0).standard_normal(8192)
    patch = x.copy()
    patch[3000:3400] *= 6
    assert public_indicators.burst_db(x) < 3 < public_indicators.BURST_DB < public_indicators.burst_db(patch)


def test_outlying_signatures_are_those_that_were_moved() -> None:
    rng = np.random.default_rng(1)
    size = len(public_indicators.NAMES)
    others = [rng.standard_normal(size) * 0.3 for _ in range(11)]
    moved, place = (
        next(i for i, name in enumerate(public_indicators.NAMES) if name.endswith(public_indicators.PLACES) == what)
        for what in (False, True)
    )
    own = np.zeros(size)
    own[[moved, place]] = 9.0
    own[moved + 1] = np.nan
    assert list(public_indicators.outlying(own, others, [*others, own])) == [public_indicators.NAMES[moved]]
    assert public_indicators.outlying(own, others[:3], [*others, own]) == {}
    # The same step is nothing where all other recordings vary as much.
    spread = [*others, *(rng.standard_normal(size) * 30 for _ in range(40))]
    assert public_indicators.outlying(own, others, spread) == {}


# ------------------------------------------------------------------------------------------------------------- the page


def table(title: str, real: bool) -> dict[str, Any]:
    twin = answer(["clipping"]) | {
        "title": title, "set": "cwru", "twin": "bare", "sentence": "The twin lacks clipping.", "left_out": [],
        "gap": {"before": 2.0, "after": 1.0, "floor": 0.1}, "accuracy": {"before": 0.4, "after": 0.5, "floor": 0.9},
        "where": [{"place": "frequency: 10 to 20 Hz", "share": 0.3, "p_value": 0.001}], "notes": ["a note"],
        "which": [{"effect": "clipping", "probability": 0.9, "closure": 0.5, "ci": [0.4, 0.6], "cannot": None,
                   "parameters": {"rail": 3.0}}],
        "closest": {"effects": ["looseness"], "closure": 0.72, "closure_ci": [0.66, 0.78], "gap": None,
                    "accuracy": {"before": 0.41, "after": 0.53, "floor": 0.91},
                    "parameters": {"looseness": {"level": 0.25}}},
    }  # fmt: skip
    looks = [{
        "recording": "118", "fault": "ball", "size_inch": 0.007, "load_hp": 0, "speed_rpm": 1797.0,
        "comb": {"inner": 0.0, "outer": 0.0, "ball": 1.0}, "shows_fault": False, "at_extremes": 1, "clipped": False,
        "burst_db": 1.0, "bursts": False, "kurtosis": 3.0, "half_orders": float("nan"), "high_orders": 0.0,
        "outlying": {"lines.half_mean": 8.0},
    }]  # fmt: skip
    answers = {
        PublicJob("looks", "cwru", "bare", 0, 2): {"title": title, "recordings": looks},
        PublicJob("recording", "cwru", "bare", 0, 2, recording="118"): answer([], status="no_gap") | {"title": title},
        PublicJob("nothing", "cwru", "bare", 0, 2): answer([], status="no_gap") | {"title": title},
        PublicJob("injected", "cwru", "bare", 0, 2, "clipping"): answer(["clipping"]) | {"title": title},
    }
    return {
        "schema": public.SCHEMA, "skipped": {"hit_sm": "not there"}, "best": {"cwru": "bare"}, "twins": [twin],
        "sets": [{"name": "cwru", "title": title, "real": real, "records": 2, "recordings": ["118"], "sha256": "0"}],
        "withheld": [], "injected": public.injected_rows(answers), "nothing": public.nothing_rows(answers),
        "single": public.single_rows(answers), "documented": [], "closest": [], "filtered": [],
        "provenance": {"command": "twingap study public", "plan": {"seed": 0, "pieces": 2},
                       "versions": {"twingap": "0"},
                       "code_sha256": "c" * 64, "data": {"learnt": "d" * 64}, "diagnoses": 4, "computed_s": 4.0,
                       "runtime_s": 5.0},
    }  # fmt: skip


def test_the_page_and_the_numbers_of_real_records(tmp_path: Path) -> None:
    paths = public_report.write_public(table("CWRU", True), tmp_path)
    held = json.loads(paths[0].read_text())
    assert held["single"][0]["half_orders"] is None  # NaN is no JSON
    assert held["single"][0]["agrees"] is True and held["single"][0]["reported_unclear"]
    page = paths[1].read_text()
    nearest = ("72% (66% to 78%)", "0.41 to 0.53 (0.91)", "level 0.25")
    verdict = ("0.40 to 0.50 (0.90)", "Left out: hit_sm (not there).", "clipping", "0 of 1", "a note", "rail 3")
    for part in (*verdict, *nearest):
        assert part in page
    assert "virtual" not in page


def test_it_is_a_run_with_one_inside_for_each_twin(tmp_path: Path) -> None:
    track_public(FolderTracker(tmp_path), table("CWRU", True))
    (parent,) = (path for path in tmp_path.iterdir() if path.is_dir())
    metrics = (parent / "metrics.csv").read_text(encoding="utf-8").splitlines()
    assert "injected/first,0,1.0" in metrics and "gap claimed with nothing added/cwru,0,0.0" in metrics
    assert not any(line.startswith("withheld") for line in metrics)  # nothing was
    (inside,) = (parent / "runs").iterdir()
    parameters = json.loads((inside / "parameters.json").read_text(encoding="utf-8"))
    assert (parameters["set"], parameters["twin"], parameters["effects"]) == ("cwru", "bare", "clipping")
    assert "before/gap,0,2.0" in (inside / "metrics.csv").read_text(encoding="utf-8")


def test_a_surrogate_is_labelled_and_has_no_documented_findings() -> None:
    made = table("virtual rig, not CWRU", False)
    assert made["single"][0]["findings"] == [] and made["single"][0]["agrees"] is None
    page = public_report.markdown(made)
    assert "a surrogate for CWRU" in page and "virtual rig, not CWRU" in page


# -------------------------------------------------------------------------------------------------------------- records


def test_sets_that_nobody_has_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match="none of the sets is available"):
        public.run_public(tmp_path / "out", public.Plan(("hit_sm",)), root=str(tmp_path))
    assert not (tmp_path / "out").exists()


@pytest.mark.data
@needs_data
def test_pieces_are_spread_evenly_over_whole_recordings() -> None:
    own = public_sets.public_set("cwru", None, 2)
    assert own.real and own.title == "CWRU"
    counts = {g: sum(c.group == g for c in own.records.conditions) for g in own.records.groups}
    assert set(counts.values()) == {2}
    assert all(c.n_samples == c.fs_hz for c in own.records.conditions)
    assert "98" not in counts  # windows of a tenth of a second


@pytest.mark.data
@needs_data
def test_what_is_documented_names_recordings_of_the_fault_it_speaks_of() -> None:
    at_hand = {str(c.group): c for c in public_sets.public_set("cwru", None, 2).records.conditions}
    for one in public_sets.DOCUMENTED:
        own = [at_hand[name] for name in one.recordings if name in at_hand]
        for word in ("ball", "inner", "outer"):
            if f"{word}" in one.finding:
                assert {c.fault for c in own} == {word}
        if "0.014" in one.finding:
            assert {c.extra["fault_size_inch"] for c in own} == {0.014}


@pytest.fixture
def short_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    """Recordings of two seconds from the virtual rig."""

    def loaded(name: str, root: str | None = None) -> RecordSet:
        return make_rig(name, duration_s=2.0).records(0) if name == "virtual_cwru" else load(name, root)

    monkeypatch.setattr(public_sets, "load", loaded)


@pytest.mark.slow
@pytest.mark.usefixtures("short_rig")
def test_what_was_answered_is_taken_from_the_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """On the virtual rig: halves of the same records, diagnosed once."""
    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    work = [PublicJob("nothing", "cwru", "bare", 0, 2)]

    def run() -> tuple[list[dict[str, Any]], list[tuple[int, int]]]:
        calls: list[tuple[int, int]] = []
        found = swept(
            run_job, work, lambda done, total: calls.append((done, total)), lambda job: job.description,
            store=tmp_path, version="one", data={"learnt": "0"}, n_jobs=1,
        )  # fmt: skip
        return found, calls

    first, _ = run()
    held = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.json")}
    again, calls = run()
    assert again == first and calls[-1] == (1, 1)
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.json")} == held
    assert first[0]["title"] == "virtual rig, not CWRU" and not first[0]["real"]
    assert first[0]["refused"] == "" and first[0]["status"] in (
        "no_gap",
        "explained",
        "partly_explained",
        "unexplained",
    )


def test_what_cannot_be_computed_or_written_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TWINGAP_HOME", str(tmp_path / "home"))
    with pytest.raises(TwingapError, match="no data set 'hitsm'"):
        public.run_public(tmp_path / "out", public.Plan(("cwru", "hitsm")))
    with pytest.raises(TwingapError, match="unknown part 'closer'"):
        public.run_public(tmp_path / "out", public.Plan(("cwru",), parts=("closer",)))
    (tmp_path / "out").write_text("a file", encoding="utf-8")
    with pytest.raises(TwingapError, match="a folder expected"):
        public.run_public(tmp_path / "out", public.Plan(("cwru",)))
    assert not (tmp_path / "home").exists()


@pytest.mark.usefixtures("short_rig")
def test_nothing_stands_in_for_records_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cwru").mkdir()
    (tmp_path / "cwru" / "97.mat").write_bytes(b"cut short")
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    with pytest.raises(TwingapError, match=r"97\.mat"):
        public_sets.public_set("cwru", None, 1)
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path / "nowhere"))
    assert not public_sets.public_set("cwru", None, 1).real
