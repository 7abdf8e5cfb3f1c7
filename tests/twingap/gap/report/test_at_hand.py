"""Advice looks at what the records have: what they have already is not advised to be recorded."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from tests.twingap.gap.conftest import MakeReport
from twingap.effects import catalogue, measurements
from twingap.gap.report.advice import next_steps
from twingap.gap.report.at_hand import RECORDS_HAVE, records_have
from twingap.gap.report.model import GapReport, Place
from twingap.records import Condition


def condition(speed_rpm: float, fault: str = "healthy", load_n: float | None = None, **extra: Any) -> Condition:
    return Condition(f"{speed_rpm} {fault} {load_n}", speed_rpm, 12000.0, 12000, fault, load_n, extra=extra)


def test_speeds_and_loads_count_where_they_differ_within_a_state() -> None:
    two = [condition(1200.0), condition(1500.0), condition(1501.0, "inner"), condition(1510.0, "inner")]
    assert records_have(two) == {"speed_rpm": [1200.0, 1500.0]}
    assert records_have(two[1:]) == {}  # the healthy record and the faulty ones are at one speed each
    loads = [condition(1500.0, "inner", load_n) for load_n in (0.0, 500.0, 250.0)]
    assert records_have(loads) == {"load_n": [0.0, 500.0]}


@pytest.mark.parametrize(
    ("extra", "had"),
    [
        ({"speed_from": "tacho 'Drehzahl'"}, "column speed_from of records.csv"),
        ({"Encoder_file": "a.csv"}, "column Encoder_file of records.csv"),
        ({"tacho": ""}, None),
        ({"tacho": False}, None),
        ({"mounting": "stud"}, None),
    ],
)
def test_a_column_states_that_the_shaft_was_measured(extra: dict[str, Any], had: str | None) -> None:
    assert records_have([condition(1500.0, **extra)]).get("tacho") == had


OPEN = {"speed_rpm": "mains_interference", "load_n": "cage_modulation", "tacho": "speed_fluctuation"}
"""What records have, and an effect that it would decide."""


def open_between(report: GapReport, effect: str, had: dict[str, Any]) -> str:
    """What is advised where it is open whether an effect is missing, and the records have this."""
    sets = (report.verdict.effects, (*report.verdict.effects, effect))
    of = dataclasses.replace(
        report,
        verdict=dataclasses.replace(report.verdict, confidence_set=sets),
        provenance={**report.provenance, RECORDS_HAVE: had},
    )
    (step,) = [step for step in next_steps(of) if "leave open" in step]
    return step


@pytest.mark.parametrize(
    ("had", "instead"),
    [
        ({"speed_rpm": [1200.0, 1500.0]}, "compare records at the speeds that you have, 1200 to 1500 rpm"),
        ({"load_n": [0.0, 500.0]}, "compare records at the loads that you have, 0 to 500 N"),
        ({"tacho": "column speed_from of records.csv"}, "you have (column speed_from of records.csv)"),
    ],
)
def test_what_records_have_is_not_advised(make_report: MakeReport, had: dict[str, Any], instead: str) -> None:
    (name,) = had
    measurement = catalogue()[OPEN[name]].deciding_measurement
    report = make_report("partly_explained")
    assert measurement in open_between(report, OPEN[name], {})
    step = open_between(report, OPEN[name], had)
    assert measurement not in step and instead in step
    others = {key: value for key, value in OPEN.items() if key != name}
    assert all(catalogue()[one].deciding_measurement in open_between(report, one, had) for one in others.values())


def test_advice_on_a_place_looks_at_the_records_too(make_report: MakeReport) -> None:
    place = Place("order", 8.0, 9.0, "shaft orders", 0.2, 0.001, sign="records_higher")
    report = dataclasses.replace(make_report("unexplained"), places=(place,))
    assert any(measurements.OTHER_SPEED in step for step in next_steps(report))
    had = {**report.provenance, RECORDS_HAVE: {"speed_rpm": [1200.0, 1500.0]}}
    steps = next_steps(dataclasses.replace(report, provenance=had))
    assert not any(measurements.OTHER_SPEED in step for step in steps)
    assert any("at the speeds that you have" in step for step in steps)
