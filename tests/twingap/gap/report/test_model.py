"""Reports: they come back as they were written, and nothing against the contract is ever written."""

from __future__ import annotations

import copy
import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twingap.errors import TwingapError
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.report.files import dumped, from_json, read_report, to_json, write_report
from twingap.gap.report.model import (
    Candidate,
    Ceiling,
    ClosestEffect,
    ClosestTwin,
    Curve,
    EffectShare,
    GapReport,
    GroupName,
    GroupShare,
    Metric,
    ParameterValue,
    Place,
    TwoSampleTest,
    Verdict,
)
from twingap.gap.report.schema import problems

MakeReport = Callable[..., GapReport]
DOMAINS = get_args(DomainName)
STATUSES = ("no_gap", "explained", "partly_explained", "unexplained")

numbers = st.floats(-1e9, 1e9)
parts = st.floats(0, 1)
names = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=12)
intervals = st.tuples(numbers, numbers).map(lambda pair: (min(pair), max(pair)))
values = st.builds(ParameterValue, numbers, names, st.none() | intervals)
places = st.builds(
    lambda domain, ends, share, p, condition: Place(domain, *ends, "Hz", share, p, condition),
    st.sampled_from(DOMAINS),
    intervals | st.just((None, None)),
    parts,
    parts,
    st.none() | st.dictionaries(names, numbers | names, min_size=1, max_size=2),
)
candidates = st.lists(
    st.builds(
        Candidate, names, parts, numbers, numbers, numbers, intervals, st.dictionaries(names, values, max_size=2),
        st.none() | names, st.lists(names, max_size=2).map(tuple),
    ),
    unique_by=lambda c: c.effect,
    max_size=3,
).map(tuple)  # fmt: skip
metrics = st.builds(Metric, names, numbers, numbers, numbers, intervals, st.none() | intervals, names, st.booleans())
effect_sets = st.lists(names, unique=True, max_size=3).map(tuple)
verdicts = st.builds(
    lambda clear, effects, sets, p, closure: Verdict(
        ("explained" if clear else "partly_explained") if effects else ("no_gap" if clear else "unexplained"),
        effects, sets, p, closure, groups=tuple(GroupName(group, (group,), p) for group in effects),
    ),
    st.booleans(), effect_sets, st.lists(effect_sets, unique_by=frozenset, max_size=3).map(tuple), parts,
    st.none() | numbers,
)  # fmt: skip
lines = st.floats(-1e6, 1e6).map(lambda v: float(f"{v:.6g}")) | st.just(math.nan)


@st.composite
def curves(draw: st.DrawFn) -> Curve:
    n = draw(st.integers(0, 5))
    line = st.lists(lines, min_size=n, max_size=n)
    x = draw(st.lists(names, min_size=n, max_size=n) | line) if n else []
    bands = {"real": (draw(line), draw(line))} if draw(st.booleans()) else {}
    after = draw(st.none() | line)
    return Curve(x, "Hz", draw(line), draw(line), after, "dB", draw(names), draw(st.sampled_from(DOMAINS)), bands)  # type: ignore[arg-type]


shares = st.lists(
    st.builds(
        GroupShare, names, st.lists(st.builds(EffectShare, names, numbers), max_size=2).map(tuple), numbers, intervals,
        parts, st.booleans(),
    ),
    max_size=3,
).map(lambda found: tuple(sorted(found, key=lambda share: -share.share)))  # fmt: skip
closest = st.builds(
    ClosestTwin, st.lists(st.builds(ClosestEffect, names, st.dictionaries(names, values)), max_size=2).map(tuple),
    numbers, intervals, shares, st.builds(Ceiling, st.none() | numbers, st.none() | numbers),
    st.just("") | st.just("closest.toml"), st.lists(metrics, max_size=2).map(tuple),
)  # fmt: skip


reports = st.builds(
    GapReport, verdicts, st.lists(places, max_size=3).map(tuple), candidates, st.lists(metrics, max_size=2).map(tuple),
    st.just({"seed": 0, "version": "0", "records_sha256": "", "runtime_s": 1.0}),
    st.lists(names, max_size=2).map(tuple),
    st.dictionaries(names, values, max_size=2), st.lists(places, max_size=2).map(tuple),
    st.lists(st.builds(TwoSampleTest, names, numbers, parts), max_size=2).map(tuple),
    st.dictionaries(names, curves(), max_size=2), closest,
)  # fmt: skip


@settings(max_examples=25, deadline=None)
@given(reports)
def test_what_is_written_comes_back(report: GapReport) -> None:
    assert from_json(json.loads(dumped(to_json(report)))) == report


@pytest.mark.parametrize("status", STATUSES)
def test_a_folder_holds_both_files_and_reads_back(make_report: MakeReport, tmp_path: Path, status: str) -> None:
    report = make_report(status)
    written = write_report(report, tmp_path / "Ergebnis ü")
    assert [p.name for p in written] == ["gap.json", "report.html"]
    assert sorted(p.name for p in (tmp_path / "Ergebnis ü").iterdir()) == ["gap.json", "report.html"]
    assert read_report(tmp_path / "Ergebnis ü") == read_report(written[0]) == report
    table = json.loads(written[0].read_text(encoding="utf-8"), parse_constant=lambda word: pytest.fail(word))
    assert set(table) >= {"schema", "verdict", "where", "which", "shrink", "provenance"}
    assert table["schema"] == "twingap.gap/2"
    # Absent means "all conditions"; null would be neither.
    assert all("condition" not in p or p["condition"] for p in table["where"])


def _at(*path: Any, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(table: Any) -> None:
        for key in path[:-1]:
            table = table[key]
        if value is DELETED:
            del table[path[-1]]
        else:
            table[path[-1]] = value

    return change


DELETED = object()
CLOSEST = ClosestTwin(
    (ClosestEffect("load_zone", {"depth": ParameterValue(0.3)}),),
    0.6,
    (0.5, 0.7),
    (
        GroupShare("impact statistics", (EffectShare("load_zone", 0.4),), 0.4, (0.3, 0.5), 0.01),
        GroupShare("path", (EffectShare("transfer_path", 0.2),), 0.2, (0.1, 0.3), 0.2, shown=False),
    ),
    Ceiling(0.9, None),
    "closest.toml",
    (Metric("gap", 2.0, 0.8, 0.1, (0.7, 0.9)),),
)
BREACHES = {
    "schema": _at("schema", value="twingap.gap/1"),
    "verdict.status": _at("verdict", "status", value="fine"),
    "verdict.effects": _at("verdict", "effects", value=[]),
    "verdict.effects: ['a', 'a'] has non-unique": _at("verdict", "effects", value=["a", "a"]),
    "verdict.confidence_set": _at("verdict", "confidence_set", value=["a"]),
    "stands there twice": _at("verdict", "confidence_set", value=[["a", "b"], ["b", "a"]]),
    "verdict.p_value": _at("verdict", "p_value", value=1.01),
    "where[0].domain": _at("where", 0, "domain", value="cepstrum"),
    "where[0].lo: missing": _at("where", 0, "lo", value=DELETED),
    "is above hi": _at("where", 0, "lo", value=1e9),
    "where[1].share": _at("where", 1, "share", value=-0.1),
    "where: shares do not fall": _at("where", 2, "share", value=0.9),
    "where[0].condition": _at("where", 0, "condition", value="inner"),
    "where[0].unit": _at("where", 0, "unit", value=None),
    "which[0].probability": _at("which", 0, "probability", value=True),
    "which: probabilities do not fall": _at("which", 1, "probability", value=0.001),
    "'slip_jitter' stands there twice": _at("which", 0, "effect", value="slip_jitter"),
    "which[0].closure_ci": _at("which", 0, "closure_ci", value=[0.7, 0.5]),
    "which[2].gap_after": _at("which", 2, "gap_after", value=None),
    "not a finite number": _at("which", 0, "closure", value=math.nan),
    "which[0].gap_before: not a finite": _at("which", 0, "gap_before", value=math.inf),
    "which[0].parameters.damping_ratio": _at("which", 0, "parameters", "damping_ratio", value=0.03),
    "which[0].parameters.damping_ratio.unit": _at("which", 0, "parameters", "damping_ratio", value={"value": 1}),
    "shrink": _at("shrink", value={}),
    "shrink.metrics[0].floor": _at("shrink", "metrics", 0, "floor", value=DELETED),
    "shrink.metrics[0].ci_after": _at("shrink", "metrics", 0, "ci_after", value=None),
    "provenance.seed": _at("provenance", "seed", value=DELETED),
    "provenance: missing": _at("provenance", value=DELETED),
    "tests[0].p_value": _at("tests", 0, "p_value", value=2),
    "closest: 3 is not of type 'object'": _at("closest", value=3),
    "closest: missing": _at("closest", value=DELETED),
    "closest.twin: missing": _at("closest", "twin", value=DELETED),
    "closest.closure: 'much' is not of type 'number'": _at("closest", "closure", value="much"),
    "closest.closure_ci": _at("closest", "closure_ci", value=[0.7, 0.5]),
    "closest.effects[0].parameters.depth": _at("closest", "effects", 0, "parameters", "depth", value=0.3),
    "closest.attribution: shares do not fall": _at("closest", "attribution", 0, "share", value=0.1),
    "closest.attribution[0].share_ci": _at("closest", "attribution", 0, "share_ci", value=[0.5, 0.3]),
    "closest.attribution[1].p_value": _at("closest", "attribution", 1, "p_value", value=1.2),
    "closest.ceiling: missing": _at("closest", "ceiling", value=DELETED),
    "closest.metrics[0].after": _at("closest", "metrics", 0, "after", value=DELETED),
    "verdict.groups: missing": _at("verdict", "groups", value=DELETED),
}


@pytest.mark.parametrize("says", BREACHES)
def test_every_breach_of_the_contract_is_found_and_named(make_report: MakeReport, tmp_path: Path, says: str) -> None:
    table = to_json(dataclasses.replace(make_report(), closest=CLOSEST))
    assert problems(table) == []
    broken = copy.deepcopy(table)
    BREACHES[says](broken)
    found = problems(broken)
    assert any(says in problem for problem in found), found
    path = tmp_path / "gap.json"
    path.write_text(json.dumps(broken), encoding="utf-8")
    with pytest.raises(TwingapError, match="is not a gap report"):
        read_report(path)


@pytest.mark.parametrize("value", [None, [], 3, "x", {}, {"schema": "twingap.gap/2"}])
def test_what_is_no_report_at_all_is_said_to_be_none(value: Any) -> None:
    assert problems(value)


def test_a_report_with_a_number_that_is_none_writes_nothing(make_report: MakeReport, tmp_path: Path) -> None:
    report = make_report()
    bad = dataclasses.replace(report, metrics=(Metric("m", math.nan, 1.0, 0.0, (0.0, 1.0)),))
    with pytest.raises(ValueError, match=r"shrink.metrics\[0\].before: not a finite number"):
        write_report(bad, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_curves_whose_lines_differ_in_length_are_refused() -> None:
    with pytest.raises(ValueError, match="2 expected"):
        Curve((1.0, 2.0), "Hz", (1.0, 2.0, 3.0), (1.0, 2.0), None, "", "c", "frequency")


def test_numpy_numbers_and_curves_of_arrays_are_taken() -> None:
    curve = Curve(np.arange(3), "Hz", np.ones(3), np.array([1, np.inf, np.nan]), None, "", "c", "frequency")  # type: ignore[arg-type]
    report = GapReport(
        Verdict("no_gap", (), ((),), np.float64(0.5)), (), (),
        (Metric("m", np.float64(1), np.float32(0.5), 0, (np.float64(0.25), np.float64(0.75))),),  # type: ignore[arg-type]
        {"seed": np.int64(1), "version": "0", "records_sha256": "", "runtime_s": 0.1}, curves={"spectrum": curve},
    )  # fmt: skip
    table = json.loads(dumped(to_json(report)))
    assert table["curves"]["spectrum"]["before"] == [1.0, None, None]
    assert table["shrink"]["metrics"][0]["ci_after"] == [0.25, 0.75]


def test_closures_count_towards_the_better_end() -> None:
    falling = Metric("distance", 4.0, 2.5, 1.0, (2.0, 3.0))
    rising = Metric("accuracy", 0.6, 0.7, 1.0, (0.6, 0.8), higher_is_better=True)
    assert falling.closure == pytest.approx(0.5)
    assert rising.closure == pytest.approx(0.25)
    assert Metric("nothing", 1.0, 0.9, 1.0, (0.8, 1.0)).closure is None
    assert Metric("below", 0.9, 0.8, 1.0, (0.7, 1.0)).closure is None


def test_data_frames_hold_the_rows_in_order(make_report: MakeReport) -> None:
    report = make_report()
    assert list(report.where["share"]) == [0.6, 0.3, 0.1]
    assert list(report.which["effect"]) == ["second_resonance", "slip_jitter", "sensor_rolloff", "clipping"]
    assert report.which["parameters"][0]["frequency_hz"] == 1203.4
    assert list(report.shrink["closure"].round(3)[:2]) == [0.943, 0.944]
    assert math.isnan(report.shrink["closure"][2])
    empty = dataclasses.replace(report, places=(), candidates=(), metrics=())
    for frame, full in ((empty.where, report.where), (empty.which, report.which), (empty.shrink, report.shrink)):
        assert len(frame) == 0 and list(frame.columns) == list(full.columns)


def test_a_notebook_shows_the_verdict_and_the_named_effects_escaped(make_report: MakeReport) -> None:
    report = make_report()
    hostile = Candidate("<b>", 1.0, 1.0, 0.5, 0.5, (0.4, 0.6), {"<i>": ParameterValue(1203.4, "Hz")})
    verdict = dataclasses.replace(report.verdict, effects=("<b>", "slip_jitter"))
    shown = dataclasses.replace(report, verdict=verdict, candidates=(hostile, *report.candidates))._repr_html_()
    for part in ("The twin lacks &lt;b&gt;", "50 % (40 % to 60 %)", "&lt;i&gt; = 1203 Hz", "slip_jitter"):
        assert part in shown
    assert "<b>" not in shown and "sensor_rolloff" not in shown  # which the verdict does not name
    assert "<table" not in make_report("no_gap")._repr_html_()


@pytest.mark.parametrize(
    ("status", "parts"),
    [
        ("no_gap", ["cannot be distinguished", "p = 0.4"]),
        (
            "explained",
            ["lacks second resonance and slip jitter", "closes 93 %", "86 % to 97 %", "p < 0.001", "one other"],
        ),
        ("partly_explained", ["lacks second resonance", "a significant rest remains", "one other explanation "]),
        ("unexplained", ["differs", "no effect of the catalogue"]),
    ],
)
def test_the_sentence_says_what_how_far_and_how_sure(make_report: MakeReport, status: str, parts: list[str]) -> None:
    sentence = make_report(status).sentence
    assert sentence.count("\n") == 0 and sentence.endswith(".")
    for part in parts:
        assert part in sentence


def test_a_printed_report_is_its_sentences(make_report: MakeReport) -> None:
    report = make_report("explained")
    assert str(report) == "\n".join(filter(None, (report.sentence, report.closest_sentence)))
    assert "\n" not in str(dataclasses.replace(report, closest=ClosestTwin()))


def test_what_closes_is_said_by_group_and_what_is_not_shown_is_left_out() -> None:
    said = CLOSEST.sentence
    assert said.startswith(
        "The closest twin closes 60 % of the gap (90 % interval 50 % to 70 %): impact statistics 40 %; all others 20 %."
    )
    assert "path" not in said and said.endswith("Other real records of the same bearing close 90 %.")
    both = (EffectShare("load_zone", 0.3), EffectShare("slip_jitter", 0.1))
    alike = dataclasses.replace(CLOSEST.attribution[0], effects=both)
    several = dataclasses.replace(CLOSEST, attribution=(alike,)).sentence
    assert "impact statistics 40 % (load zone or slip jitter cannot be told apart)" in several
    assert ClosestTwin().sentence == ""


def test_a_verdict_that_widens_the_gap_says_so(make_report: MakeReport) -> None:
    verdict = dataclasses.replace(make_report("partly_explained").verdict, closure=-0.33, closure_ci=(-0.39, -0.28))
    assert "at the values found widens the gap by 33 % (90 % interval 28 % to 39 %)" in verdict.sentence
    assert "closes" not in verdict.sentence
    hardly = dataclasses.replace(verdict, closure=-0.002, closure_ci=(-0.012, 0.011)).sentence
    assert "closes 0 % of the gap (90 % interval -1 % to 1 %)" in hardly


def test_without_a_closure_of_its_own_the_verdict_takes_the_first_metric(make_report: MakeReport) -> None:
    report = make_report()
    bare = dataclasses.replace(report, verdict=dataclasses.replace(report.verdict, closure=None, closure_ci=None))
    assert "closes 94 %" in bare.sentence
    assert "could not be measured" in bare.verdict.sentence
    metrics = tuple(dataclasses.replace(m, after=m.before) for m in bare.metrics)
    assert (
        "how far adding them would shrink the gap could not be measured"
        in dataclasses.replace(bare, metrics=metrics).sentence
    )


@pytest.mark.parametrize(
    ("text", "says"), [(None, "cannot be read"), ("{", "is not JSON"), ("[]", "is not a gap report")]
)
def test_a_file_that_is_no_report_is_refused_in_one_line(tmp_path: Path, text: str | None, says: str) -> None:
    path = tmp_path / "gap.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(TwingapError, match=says) as refused:
        read_report(path)
    assert str(path) in str(refused.value) and "\n" not in str(refused.value)
