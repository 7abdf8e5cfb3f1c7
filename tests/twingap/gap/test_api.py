"""The whole diagnosis, with a training small enough for tests: what must hold whatever was learnt."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import sklearn.ensemble  # noqa: F401  its threads are counted
import threadpoolctl

from twingap.bearing import BEARINGS
from twingap.effects import make_effect, trainable
from twingap.errors import TwingapError
from twingap.gap import api, diagnose
from twingap.gap.api import _calibration_after, _few_turns, _notes, _significant, _slip_not_named, _status
from twingap.gap.distance.closure import Closure
from twingap.gap.report.files import from_json, read_report, to_json
from twingap.gap.report.formats import number
from twingap.gap.report.model import REFERENCE
from twingap.gap.report.schema import problems
from twingap.records import Condition, RecordSet
from twingap.records.folder import read_record_set, write_record_set
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

FAULTS = ("healthy", "outer", "inner", "ball")


def machine(effects=(), count=16, seed=1, fs_hz=12000.0, n=6000, faults=FAULTS):
    parameters = PhenomenologicalParameters(resonance_hz=2600.0, damping_ratio=0.04, scale=0.3)
    twin = PhenomenologicalTwin(BEARINGS["6205"], parameters, effects, unit="g")
    speeds = (1500.0, 1800.0)
    conditions = [
        Condition(f"r{i}", speeds[(i // len(faults)) % 2], fs_hz, n, faults[i % len(faults)]) for i in range(count)
    ]
    return twin.simulate(conditions, np.random.default_rng(seed))


def openmp_threads():
    return max(pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "openmp")


def run(records, learnt, **options):
    spec = TwinSpec("phenomenological", bearing=BEARINGS["6205"])
    return diagnose(records, spec, learnt=learnt, **{"quick": True, **options})


@pytest.fixture(scope="module")
def clipped(learnt):
    return run(machine([make_effect("quantisation", {"step": 0.8})]), learnt, quick=False)


def test_a_plain_effect_is_named_and_adding_it_closes_the_gap(clipped):
    report = clipped.report
    assert report.verdict.status in ("explained", "partly_explained")
    assert report.verdict.effects[0] == "quantisation"
    candidate = report.candidates[0]
    assert candidate.effect == "quantisation"
    assert candidate.closure > 0.6
    assert candidate.parameters["step"].value == pytest.approx(0.8, rel=0.35)


def test_explained_is_said_where_nothing_points_to_a_further_effect(clipped):
    quiet = replace(clipped.explanation, rest_p=0.5)
    closed = Closure(1.0, 0.35, 0.1, 0.7, (0.6, 0.8))
    assert _status(quiet, closed, None) == "explained", "values that are a little off leave a rest"
    assert _status(quiet, replace(closed, closure=0.1, ci=(0.0, 0.4)), None) == "partly_explained"
    assert _status(replace(quiet, effects=()), closed, None) == "unexplained"
    assert _status(replace(quiet, gap=False), closed, None) == "no_gap"
    left = replace(quiet, rest_p=0.001)
    assert _status(left, closed, None) == "partly_explained"
    # A tenth that is left explains nothing away; nor does what real records leave.
    assert _status(left, replace(closed, closure=0.91), None) == "explained"
    assert _status(left, closed, 0.69) == "explained"
    assert _status(left, closed, 0.72) == "partly_explained"
    assert _status(left, closed, 0.2) == "partly_explained", "records that differ as much are no measure"
    whirl = replace(quiet, line_order=0.46)
    assert _status(whirl, closed, None) == "partly_explained", "a line that no effect has is a rest"
    assert _status(whirl, replace(closed, closure=0.91), None) == "explained", "and little of the gap is little"
    nothing = replace(whirl, effects=(), probability={}, p_value=0.04)
    unseen = replace(closed, before=0.5 * closed.floor)
    assert _significant(nothing, unseen, [], [])[0].gap, "no distance has to show a line"
    assert not _significant(replace(nothing, line_order=None), unseen, [], [])[0].gap


def test_statistics_of_tests_are_those_of_the_measures(clipped):
    before = {metric.metric: metric.before for metric in clipped.report.metrics}
    assert [test.statistic for test in clipped.report.tests] == [
        before["AUC of a classifier, records against twin"], before["MMD^2 between records and twin"]
    ]  # fmt: skip


def test_the_report_keeps_the_contract(clipped):
    assert problems(to_json(clipped.report)) == []
    assert {c.effect for c in clipped.report.candidates} == set(trainable())
    assert all(c.effect == "quantisation" or c.closure_ci[0] < 0.3 for c in clipped.report.candidates)
    assert 0.2 < math.fsum(place.share for place in clipped.report.places) <= 1 + 1e-9


def test_values_calibrated_with_the_named_effects_are_in_the_report_where_they_differ(clipped):
    before, after = clipped.report.calibration, clipped.report.calibration_after
    spec = clipped.explanation.after.simulator.spec.parameters
    assert after and set(after) <= set(before) - {REFERENCE}
    assert all(after[name].value == spec[name] for name in after if "." not in name)
    assert all(number(spec[name]) == number(before[name].value) for name in {"resonance_hz", "scale"} - set(after))
    assert from_json(to_json(clipped.report)).calibration_after == after
    calm = SimpleNamespace(before=clipped.explanation.before, after=clipped.explanation.before)
    assert _calibration_after(calm) == {}


def test_machine_and_twin_alike_leave_nothing_to_name(learnt):
    report = run(machine(seed=3, count=8), learnt).report
    assert report.verdict.status == "no_gap" and report.verdict.effects == ()


def test_two_records_are_enough_to_run(learnt):
    report = run(machine(count=2, faults=("healthy", "outer")), learnt).report
    assert problems(to_json(report)) == []


def test_healthy_records_alone_are_diagnosed(learnt, few_effects):
    few_effects("clipping")
    report = run(machine([make_effect("clipping", {"rail": 1.7})], count=8, faults=("healthy",)), learnt).report
    assert report.verdict.effects == ("clipping",)
    assert problems(to_json(report)) == []


def test_records_for_export_have_all_conditions(clipped):
    before, after = list(clipped.sim_before()), list(clipped.sim_after())
    assert len(before) == len(after) == 16
    assert {r.condition.name for r in after} == {f"r{i}" for i in range(16)}
    assert len(np.unique(np.round(after[0].samples, 9))) < len(np.unique(before[0].samples))


def test_a_diagnosis_is_written_whole_or_not_at_all(clipped, tmp_path):
    names = [path.name for path in clipped.write(tmp_path / "out", export=True)]
    assert names == ["gap.json", "report.html", "closest.toml", "sim_before", "sim_after", "sim_closest"]
    read = read_report(tmp_path / "out")
    assert replace(read, curves={}) == replace(clipped.report, curves={})
    for name, curve in clipped.report.curves.items():  # to six digits
        np.testing.assert_allclose(read.curves[name].real, curve.real, rtol=1e-5)
    assert read_record_set(tmp_path / "out" / "sim_after").unit == "g"
    stated = clipped.report.provenance
    assert (stated["seed"], stated["twin"], stated["n_records"]) == (0, "", 16)
    taken = tmp_path / "taken"
    (taken / "sim_after").mkdir(parents=True)
    (taken / "sim_after" / "mine").touch()
    with pytest.raises(TwingapError, match="exists already"):
        clipped.write(taken, export=True)
    assert [path.name for path in taken.iterdir()] == ["sim_after"]


def test_files_generators_and_progress_give_the_same_diagnosis(learnt, tmp_path):
    records = machine([make_effect("mains_interference", {"level": 0.6})], count=4)
    twin = tmp_path / "twin.toml"
    twin.write_text('[twin]\nmodel = "phenomenological"\n')
    one = diagnose(write_record_set(records, tmp_path / "set"), twin, seed=3, learnt=learnt, quick=True).report
    threads = []
    other = diagnose(
        records, TwinSpec("phenomenological"), seed=np.random.default_rng(3), learnt=learnt, quick=True,
        progress=lambda what, part: threads.append(openmp_threads()),
    ).report  # fmt: skip
    assert one.provenance["twin"] == "twin.toml" and one.provenance["seed"] == 3 and other.provenance["seed"] == -1
    tables = [to_json(report) for report in (one, other)]
    for table in tables:
        del table["provenance"]
    assert tables[0] == tables[1]
    assert set(threads) == {1}, "trees asked by many threads take minutes on a busy machine"


def test_own_simulated_records_of_the_same_machine_show_no_gap_worth_a_name(learnt):
    report = run(machine(seed=8, count=8), learnt, sim=machine(seed=9, count=8)).report
    assert problems(to_json(report)) == []
    assert report.verdict.status == "no_gap" and report.verdict.effects == ()


def test_another_level_with_the_named_effects_is_notes():
    def found(before, after):
        pair = [SimpleNamespace(simulator=SimpleNamespace(gain=gain, notes=())) for gain in (before, after)]
        return SimpleNamespace(gap=True, line_order=None, names=(), cannot={}, before=pair[0], after=pair[1])

    evidence = SimpleNamespace(calibrated=SimpleNamespace(speeds=SimpleNamespace(slip=0.0)))
    assert list(_notes(found(3.0, 3.02), evidence, 0.7)) == []
    (told,) = _notes(found(3.0, 4.5), evidence, 0.7)
    assert "by 3 as they are and by 4.5 with the named effects" in told


def test_a_slip_that_the_speeds_show_and_no_name_states_is_explained():
    def noted(slip=0.0099, gap=True, names=(), modelled=()):
        evidence = SimpleNamespace(calibrated=SimpleNamespace(speeds=SimpleNamespace(slip=slip)), modelled=modelled)
        found = SimpleNamespace(gap=gap, names=names, probability={"mean_slip": 0.384})
        return list(_slip_not_named(evidence, found, 0.7))

    assert noted(slip=0.0) == noted(names=("mean_slip",)) == []
    (note,) = noted()
    assert note.startswith("mean_slip is not named for this slip of 0.99 %: its probability is 38%")
    assert "an effect is named from 70%" in note
    assert noted(gap=False)[0].endswith("records and twin cannot be distinguished")
    assert noted(modelled=("mean_slip",))[0].endswith("the twin models it")


def test_the_note_on_a_slip_that_is_not_named_is_in_the_report(learnt, few_effects):
    few_effects("mean_slip")
    report = run(machine([make_effect("mean_slip", {"slip": 0.002})], count=8), learnt).report
    stated = [note for note in report.notes if "lags its kinematic speed by" in note]
    assert len(stated) == 1 and "mean_slip" not in report.verdict.effects
    assert report.notes[report.notes.index(stated[0]) + 1].startswith("mean_slip is not named for this slip of 0.")


@pytest.mark.parametrize(("speed_rpm", "duration_s", "advised"), [(300.0, 0.5, "0.8 s"), (1800.0, 0.1, "0.5 s")])
def test_records_of_few_turns_are_notes(speed_rpm, duration_s, advised):
    """However few turns come about: at low speed or in a short record."""

    def condition(speed, duration):
        return Condition("r", speed, 12000.0, round(12000 * duration))

    long = condition(1800.0, 0.5)
    assert list(_few_turns([long, long])) == []
    (note,) = _few_turns([long, condition(speed_rpm, duration_s), long])
    assert note.startswith("1 of 3 records hold fewer than 4 turns") and note.endswith(f"record {advised} or more")


def test_one_record_is_refused(learnt):
    with pytest.raises(TwingapError, match="at least 2 expected"):
        run(machine(count=1), learnt)


def test_many_records_are_thinned_and_said_so(learnt, monkeypatch):
    monkeypatch.setattr(api, "MOST_RECORDS", 8)
    few = machine(count=8, n=2000)
    many = RecordSet.from_records(
        "many", "g", few.bearing,
        (type(r)(Condition(f"m{k}", r.condition.speed_rpm, 12000.0, 2000, r.condition.fault), r.samples)
         for k in range(24) for r in (few[k % 8],)),
    )  # fmt: skip
    report = run(many, learnt).report
    assert any("8 of 24 records" in note for note in report.notes)
