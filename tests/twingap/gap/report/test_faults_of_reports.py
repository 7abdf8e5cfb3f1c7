"""What a reader was once misled by: each fault of a report, as a test."""

from __future__ import annotations

import dataclasses

import pytest

from tests.twingap.gap.conftest import MakeReport
from twingap.cli.gap import _print
from twingap.gap.report.advice import contradictions, next_steps, only_together, place_words, warnings
from twingap.gap.report.formats import number, value
from twingap.gap.report.model import REFERENCE, Curve, GapReport, Metric, ParameterValue, Place, TwoSampleTest
from twingap.gap.report.page import page
from twingap.gap.report.sections import calibration, confidence
from twingap.gap.report.sections.headline import headline
from twingap.gap.report.sections.parts import Table
from twingap.gap.report.sections.places import places_table


def test_orders_that_the_added_effect_made_are_not_looked_for_in_the_machine(make_report: MakeReport) -> None:
    made = Place("order", 3.0, 5.0, "shaft orders", 0.3, 0.001, sign="twin_higher", after="new")
    own = Place("order", 8.0, 9.0, "shaft orders", 0.2, 0.001, sign="records_higher")
    steps = next_steps(dataclasses.replace(make_report("partly_explained"), rest=(made, own)))
    (of_twin,) = [step for step in steps if "3 to 5 shaft orders" in step]
    (of_machine,) = [step for step in steps if "8 to 9 shaft orders" in step]
    assert "the values found are too large" in of_twin and "turns at these" not in of_twin
    assert "turns at these multiples" in of_machine and "8 to 9" not in of_twin


def test_where_nothing_was_added_a_stronger_twin_is_not_blamed_on_the_machine(make_report: MakeReport) -> None:
    place = Place("order", 3.0, 5.0, "shaft orders", 0.3, 0.001, sign="twin_higher")
    steps = next_steps(dataclasses.replace(make_report("unexplained"), places=(place,)))
    assert any("Check the twin's levels" in step for step in steps)
    assert not any("turns at these" in step for step in steps)


def test_a_measure_that_gets_worse_is_in_the_headline(make_report: MakeReport) -> None:
    report = make_report("partly_explained")
    assert not warnings(report)
    worse = Metric("gap in amplitude", 0.4, 0.9, 0.1, (0.7, 1.1))
    less_accurate = Metric("accuracy", 0.9, 0.5, 1.0, (0.4, 0.6), higher_is_better=True)
    (said,) = headline(dataclasses.replace(report, metrics=(*report.metrics, worse, less_accurate))).warnings
    assert "gap in amplitude 0.4 → 0.9" in said and "accuracy 0.9 → 0.5" in said
    assert "log-spectral" not in said


def test_a_resonance_far_below_the_records_peak_is_warned_of(make_report: MakeReport) -> None:
    x = (150.0, 1000.0, 4000.0, 7800.0)
    curve = Curve(x, "Hz", (-20.0, -22.0, -15.0, 3.0), (0.0,) * 4, None, "dB", "Spectrum", "frequency")
    report = dataclasses.replace(make_report("partly_explained"), curves={"spectrum": curve})
    for resonance, warned in ((173.0, True), (7000.0, False)):
        told = dataclasses.replace(report, calibration={"resonance_hz": ParameterValue(resonance, "Hz")})
        assert any("calibrated at 173 Hz" in w and "peaks at 7800 Hz" in w for w in warnings(told)) == warned


def test_a_small_p_value_beside_no_gap_is_explained(make_report: MakeReport) -> None:
    report = make_report("no_gap")
    two = (TwoSampleTest("AUC", 0.8, 0.008), TwoSampleTest("MMD^2", 0.1, 0.6))
    (said,) = contradictions(dataclasses.replace(report, tests=two))
    assert "One test alone" in said and "AUC (p = 0.008)" in said
    (said,) = contradictions(dataclasses.replace(report, tests=(TwoSampleTest("AUC", 0.9, 0.001), two[1])))
    assert said.startswith("Careful")
    assert not contradictions(dataclasses.replace(report, tests=two[1:]))


def test_no_effect_at_all_is_no_alternative_where_there_is_a_gap(make_report: MakeReport) -> None:
    for status, words in (
        ("explained", "no effect of the catalogue, but something outside it"),
        ("no_gap", "no missing effect at all"),
    ):
        report = make_report(status)
        sets = ((), ("slip_jitter",))
        section = confidence.section(
            dataclasses.replace(report, verdict=dataclasses.replace(report.verdict, confidence_set=sets)), {}
        )
        assert section is not None and words in section.parts[0].items  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("p_value", "p_floor", "words"),
    [
        (0.0058, 0.0058, "p < 0.006"),
        (0.0058, 0.004, "p = 0.0058"),
        (0.031, 0.0058, "p = 0.031"),
        (0.0004, 0.0001, "p < 0.001"),
        (0.006, 0.006, "p < 0.006"),
    ],
)
def test_a_p_value_at_its_floor_is_a_bound(make_report: MakeReport, p_value: float, p_floor: float, words: str) -> None:
    verdict = dataclasses.replace(make_report("explained").verdict, p_value=p_value, p_floor=p_floor)
    assert f"({words} of no gap at all)" in verdict.sentence


def test_a_level_that_differs_throughout_is_called_a_level() -> None:
    assert place_words(Place("time", None, None, "", 0.32, 0.001)) == "throughout the record"
    assert place_words(Place("time", 0.0, 0.25, "s", 0.32, 0.001)) == "0 to 0.25 s"


def test_the_table_says_who_has_more_and_what_became_of_a_place() -> None:
    places = [Place("order", 3.0, 5.0, "shaft orders", 0.3, 0.001, sign="twin_higher", after="larger")]
    table = places_table(places)
    assert "twin" in table.rows[0] and "larger" in table.rows[0]
    assert "with the effects" not in places_table([dataclasses.replace(places[0], after=None)]).head


def test_effects_that_close_the_gap_only_together_are_said_to(
    make_report: MakeReport, capsys: pytest.CaptureFixture[str]
) -> None:
    report = make_report("explained")  # from 4.1 to 0.8 dB
    named = report.verdict.effects

    def of(**alone: float) -> GapReport:
        """The report with these distances where one of the named effects is left out."""
        one = (dataclasses.replace(c, gap_before=alone.get(c.effect, c.gap_before)) for c in report.candidates)
        return dataclasses.replace(report, candidates=tuple(one))

    worse = of(second_resonance=4.6, slip_jitter=5.2)
    said = only_together(worse)
    assert said == (
        "Second resonance and slip jitter close the gap only together, from 4.1 to 0.8: either of them alone widens "
        "it, to 4.6 or more."
    )
    assert said in page(worse) and said not in page(report)
    _print(worse)
    assert said in " ".join(capsys.readouterr().out.split())
    assert not only_together(of(second_resonance=4.6))
    wide = dataclasses.replace(report.metrics[0], ci_before=(3.6, 4.8))  # 4.6 may be no larger
    assert not only_together(dataclasses.replace(worse, metrics=(wide,)))
    not_closed = dataclasses.replace(report.metrics[0], ci_after=(0.7, 4.3))
    assert not only_together(dataclasses.replace(worse, metrics=(not_closed,)))
    three = dataclasses.replace(worse, verdict=dataclasses.replace(report.verdict, effects=(*named, "sensor_rolloff")))
    rolloff = dataclasses.replace(worse.candidates[2], gap_before=4.4)
    third = dataclasses.replace(three, candidates=(*worse.candidates[:2], rolloff))
    assert "without any one of them the others widen it, to 4.4 or more" in only_together(third)


def test_values_that_the_named_effects_change_stand_beside_those_before(make_report: MakeReport) -> None:
    report = make_report("explained")
    given = {**report.calibration, REFERENCE: ParameterValue(0.52, "g")}
    before = calibration.section(dataclasses.replace(report, calibration=given), {})
    assert before is not None and isinstance(before.parts[0], Table)
    assert list(before.parts[0].head) == ["parameter", "value (90 % interval)"]
    assert before.parts[0].rows[-1] == ("healthy vibration", number(0.52, "g"))

    changed = {"resonance_hz": ParameterValue(3355.0, "Hz")}
    after = calibration.section(dataclasses.replace(report, calibration=given, calibration_after=changed), {})
    assert after is not None and isinstance(after.parts[0], Table)
    assert after.parts[0].head[-1] == "with the named effects"
    shown = {row[0]: tuple(row[1:]) for row in after.parts[0].rows}
    assert shown["resonance"] == (value(given["resonance_hz"]), number(3355.0, "Hz"))
    assert shown["unit gain"] == ("9.81", "")  # does not differ
    assert shown["healthy vibration"] == ("", number(0.52, "g"))  # of the twin with the effects alone
