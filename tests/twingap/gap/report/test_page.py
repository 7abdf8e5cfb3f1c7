"""The page: whole, offline, escaped, and of use whatever parts a report has."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest

from twingap.effects import make_effect
from twingap.gap.distance.two_sample_tests import AUC_TEST, MMD_TEST
from twingap.gap.report.advice import condition_words, contradictions, next_steps, place_words, snippet, undecided
from twingap.gap.report.figures import MOST_POINTS, all_figures, curve_figure
from twingap.gap.report.formats import parameters
from twingap.gap.report.model import (
    Candidate,
    Ceiling,
    ClosestEffect,
    ClosestTwin,
    Curve,
    EffectShare,
    GapReport,
    GroupShare,
    Metric,
    ParameterValue,
    Place,
    TwoSampleTest,
    Verdict,
)
from twingap.gap.report.page import page, plotly_library
from twingap.gap.report.status import meaning_of
from twingap.twins.twin_file import read_twin

MakeReport = Callable[..., GapReport]
STATUSES = ("no_gap", "explained", "partly_explained", "unexplained")
VOID = {"meta", "link", "br", "img", "hr", "input"}


class Reader(HTMLParser):
    """Reads a page: tags with their attributes, visible text; fails where tags do not close in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words, self._open = "", list[str]()
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not {"script", "style"} & set(self._open):
            self.words += f" {data}"


def own(text: str) -> str:
    """The page without plotly's own code."""
    return text.replace(plotly_library(), "")


def assert_states_the_verdict(report: GapReport, words: str) -> None:
    """The sentence of the verdict is there, its first part as the title."""
    title, _, rest = report.sentence.partition(": ")
    assert title in words and rest[1:] in words


@pytest.mark.parametrize("status", STATUSES)
def test_a_page_is_whole_and_asks_nothing_of_the_network(make_report: MakeReport, status: str) -> None:
    report = make_report(status)
    text = page(report)
    assert len(text.encode()) < 1_500_000
    assert text.count(plotly_library()) == 1
    read = Reader(own(text))
    for tag, attributes in read.tags:
        assert tag not in {"link", "iframe", "img", "object", "embed", "base"}
        assert not attributes.get("src")
        assert (attributes.get("href") or "#").startswith("#")
    assert not re.search(r"https?://|@import|url\(", own(text))
    # Even what plotly might try is shut off: only what stands in the page may load.
    (policy,) = [a["content"] for tag, a in read.tags if a.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None and policy.startswith("default-src 'none'") and "http" not in policy
    assert_states_the_verdict(report, read.words)
    anchors = {a["href"] for tag, a in read.tags if tag == "a"}
    assert anchors == {f"#{a['id']}" for tag, a in read.tags if tag == "section"}


@pytest.mark.parametrize(
    ("closure", "ci", "says"),
    [
        (0.8, (0.7, 0.9), "They shrink the gap significantly."),
        (0.0, (0.0, 0.7), "is uncertain"),
        (-0.4, (-0.5, -0.3), "they widen the gap"),
        (None, None, "cannot be added to the simulated records"),
    ],
)
def test_what_names_close_is_not_claimed_beyond_its_interval(
    make_report: MakeReport, closure: float | None, ci: tuple[float, float] | None, says: str
) -> None:
    report = make_report("partly_explained")
    verdict = dataclasses.replace(report.verdict, closure=closure, closure_ci=ci)
    shown = page(dataclasses.replace(report, verdict=verdict))
    every = (
        "They shrink the gap significantly.",
        "is uncertain",
        "they widen the gap",
        "cannot be added to the simulated records",
    )
    assert [one for one in every if one in shown] == [says]


def test_the_closest_twin_is_shown_apart_from_the_verdict(make_report: MakeReport) -> None:
    report = make_report("partly_explained")
    effects = tuple(
        ClosestEffect(name, {"depth": ParameterValue(0.3171)}) for name in ("second_resonance", "load_zone")
    )
    shares = (
        GroupShare("path", (EffectShare("second_resonance", 0.45),), 0.45, (0.4, 0.5), 0.001),
        GroupShare("impact statistics", (EffectShare("load_zone", 0.15),), 0.15, (0.0, 0.3), 0.3, shown=False),
    )
    metrics = (dataclasses.replace(report.metrics[0], after=0.7654),)
    near = ClosestTwin(effects, 0.6, (0.5, 0.7), shares, Ceiling(0.94, 0.2), "closest.toml", metrics)
    told = dataclasses.replace(report, closest=near)
    before, shown = (" ".join(Reader(own(page(one))).words.split()) for one in (report, told))
    assert "The closest twin" not in before and "leave out --quick" in before
    assert "The closest twin closes 60 % of the gap (90 % interval 50 % to 70 %): path 45 %; all others 15 %." in shown
    assert "0.7654" in shown and "0.3171" in shown and "not shown to close any" in shown
    assert "other real records of the same bearing" in shown and "94" in shown
    assert "leave out --quick" not in shown and "use the closest one, closest.toml" in shown
    better, no_more = "a classifier then names", "does not improve a classifier"
    for after, says in ((0.97, better), (0.9, no_more), (0.5, no_more)):  # the verdict's twin teaches 0.95
        accuracy = Metric("accuracy", 0.6, after, 1.0, (0.4, 0.95), higher_is_better=True)
        taught = dataclasses.replace(report, closest=dataclasses.replace(near, metrics=(*metrics, accuracy)))
        (said,) = (step for step in next_steps(taught) if "classifier" in step)
        assert says in said and f"{100 * after:.0f} % of held-out records; 60 %" in said
    assert told.sentence == report.sentence


def test_many_places_unfold_and_keep_their_numbers(make_report: MakeReport) -> None:
    places = tuple(Place("frequency", 10.0 * i, 10.0 * i + 5, "Hz", 0.5 / i, 0.001) for i in range(1, 41))
    shown, _, folded = page(dataclasses.replace(make_report(), places=places)).partition("28 more places</summary>")
    assert "<td>12</td>" in shown and "<td>13</td>" not in shown and "130 to 135 Hz" not in shown.rpartition("<h2>")[2]
    assert "<td>13</td>" in folded and "<td>40</td>" in folded


def test_names_from_the_data_are_shown_and_never_run(make_report: MakeReport) -> None:
    hostile = '<img src=x onerror="alert(1)"></script><script>alert(2)</script>'
    report = make_report(records=hostile)
    report = dataclasses.replace(
        report,
        places=(Place("condition", None, None, "", 0.5, 0.01, {hostile: hostile}), *report.places),
        candidates=(Candidate(hostile, 1.0, 1.0, 0.5, 0.5, (0.4, 0.6), {hostile: ParameterValue(1.0, hostile)}),),
        notes=(hostile,),
        calibration={hostile: ParameterValue(1.0, hostile)},
        curves={hostile: Curve((hostile, "b"), hostile, (1.0, 2.0), (1.0, 2.0), None, hostile, hostile, "condition")},
    )
    read = Reader(own(page(report)))
    assert "img" not in {tag for tag, _ in read.tags}
    assert not any(name.startswith("on") for _, attributes in read.tags for name in attributes)
    calm = Reader(own(page(make_report(records="calm"))))
    scripts = sum(tag == "script" for tag, _ in read.tags)
    figures = sum(tag == "figure" for tag, _ in read.tags)
    calm_scripts = sum(tag == "script" for tag, _ in calm.tags)
    assert scripts - figures * 2 <= calm_scripts  # one for the library, at most two a figure
    assert read.words.count("alert(2)") >= 4


@pytest.mark.parametrize(
    "missing", ["places", "candidates", "metrics", "notes", "calibration", "rest", "tests", "curves", "everything"]
)
def test_any_part_may_be_missing(make_report: MakeReport, missing: str) -> None:
    empty = {
        "places": (), "candidates": (), "metrics": (), "notes": (), "calibration": {}, "rest": (), "tests": (),
        "curves": {},
    }  # fmt: skip
    for status in STATUSES if missing == "everything" else ("partly_explained",):
        report = dataclasses.replace(
            make_report(status), **(empty if missing == "everything" else {missing: empty[missing]})
        )
        read = Reader(own(page(report)))
        assert_states_the_verdict(report, read.words)
        assert not re.search(r"\b(nan|inf|None)\b", read.words)
        drawn = sum(tag == "figure" for tag, _ in read.tags)
        assert drawn == len(list(all_figures(report)))
        assert (drawn == 0) == (missing == "everything")


def test_the_same_report_makes_the_same_bytes(make_report: MakeReport) -> None:
    slower = make_report()
    slower = dataclasses.replace(slower, provenance={**slower.provenance, "runtime_s": 99.0})
    assert page(make_report()) == page(slower)


def test_places_are_marked_on_the_curves_of_their_domain(make_report: MakeReport) -> None:
    report = make_report()
    spectrum = curve_figure(report.curves["spectrum"], report.places)
    (shape,) = spectrum.layout.shapes
    assert (shape.x0, shape.x1) == (1010.0, 1400.0)
    assert spectrum.layout.annotations[0].text == "<b>1</b>"  # the largest share
    outside = curve_figure(report.curves["spectrum"], (Place("frequency", 5e4, 6e4, "Hz", 1.0, 0.01),))
    assert len(outside.layout.shapes) == 0
    point = curve_figure(report.curves["spectrum"], (Place("frequency", 1e3, 1e3, "Hz", 1.0, 0.01),))
    assert point.layout.shapes[0].x1 - point.layout.shapes[0].x0 > 10  # a line is widened to be seen


@pytest.mark.parametrize(
    ("low", "high", "shaded"),
    [(100.0, 3400.0, False), (None, 3000.0, False), (1000.0, None, True), (50.0, 2700.0, True)],
)
def test_a_place_over_the_whole_axis_is_numbered_and_not_shaded(
    make_report: MakeReport, low: float | None, high: float | None, shaded: bool
) -> None:
    """A band over all of the axis, from 100 to 3400 Hz, hides the curves and tells nothing."""
    figure = curve_figure(make_report().curves["spectrum"], (Place("frequency", low, high, "Hz", 1.0, 0.01),))
    (shape,) = figure.layout.shapes
    assert figure.layout.annotations[0].text == "<b>1</b>"
    opacity = float(shape.fillcolor.removesuffix(")").rpartition(",")[2])
    assert (opacity > 0) == shaded


def test_long_lines_are_thinned_and_keep_their_peaks() -> None:
    n = 40 * MOST_POINTS + 7
    line = [0.0] * n
    line[12345] = 1.0
    curve = Curve(tuple(map(float, range(n))), "Hz", tuple(line), tuple(line), None, "", "c", "frequency")
    real = curve_figure(curve).data[0]
    assert len(real.x) <= MOST_POINTS
    assert max(real.y) == 1.0 and real.x[list(real.y).index(1.0)] == 12345.0


def test_the_snippet_is_a_twin_file_with_the_fitted_parameters(make_report: MakeReport, tmp_path: Path) -> None:
    report = make_report()
    whole = dataclasses.replace(
        report,
        verdict=Verdict("explained", ("sensor_rolloff", "waviness", "second_resonance"), (), 0.01),
        candidates=(
            *report.candidates,
            Candidate(
                "waviness",
                0.9,
                1,
                0.5,
                0.5,
                (0, 1),
                {
                    "inner": ParameterValue(1.0),
                    "level": ParameterValue(0.2),
                    "amplitudes.1": ParameterValue(1.0),
                    "amplitudes.2": ParameterValue(0.25),
                },
            ),
        ),
    )
    path = tmp_path / "twin.toml"
    path.write_text(snippet(whole) or "", encoding="utf-8")
    spec = read_twin(path)
    assert spec.model == "phenomenological"
    assert spec.effects == ("load_zone", "sensor_rolloff", "waviness", "second_resonance")
    assert spec.parameters["second_resonance"]["frequency_hz"] == 1203.0  # four digits
    made = make_effect("waviness", spec.parameters["waviness"], "test")
    assert made.inner is True and made.level == 0.2  # type: ignore[attr-defined]
    assert made.amplitudes == (1.0, 0.25)  # type: ignore[attr-defined]
    lines = parameters(next(c for c in whole.candidates if c.effect == "waviness").parameters)
    assert lines[-1] == "amplitudes = 1, 0.25" and len(lines) == 3
    assert spec.parameters["sensor_rolloff"] == {"order": 3}


def test_without_effects_to_add_there_is_no_snippet(make_report: MakeReport) -> None:
    assert snippet(make_report("no_gap")) is None
    assert snippet(make_report("unexplained")) is None
    stuck = dataclasses.replace(make_report(), verdict=Verdict("explained", ("clipping",), (("clipping",),), 0.01))
    assert snippet(stuck) is None
    assert any("cannot be added to your simulator" in step for step in next_steps(stuck))


def test_a_search_that_found_nothing_closer_is_not_advised_again(make_report: MakeReport) -> None:
    report = make_report("unexplained")
    quick, searched = (
        next_steps(dataclasses.replace(report, closest=ClosestTwin((), 0.0, (0.0, 0.0), twin=twin)))
        for twin in ("", "closest.toml")
    )
    assert any("leave out `--quick`" in step for step in quick)
    assert not any("--quick" in step for step in searched) and any("`closest.toml` is" in step for step in searched)


@pytest.mark.parametrize("names", [("background_spectrum",), ("background_spectrum", "waviness")])
def test_spectra_are_taken_from_the_twin_file(make_report: MakeReport, names: tuple[str, ...]) -> None:
    """Their values are too many for a page: the advice says where they are, and the rest is stated."""
    lists = {"densities_db": ParameterValue(122.0, "values")}
    values = [lists if name == "background_spectrum" else {"level": ParameterValue(0.2)} for name in names]
    found = tuple(Candidate(n, 0.9, 1, 0.5, 0.5, (0.4, 0.6), v) for n, v in zip(names, values, strict=True))
    verdict = Verdict("explained", names, (names,), 0.01, 0.5, (0.4, 0.6))
    report = dataclasses.replace(make_report(), verdict=verdict, candidates=found)
    step = next_steps(report)[0]
    assert "Background spectrum is a spectrum of many values" in step and "closest.toml" in step
    assert ("Add waviness to your twin" in step) == (len(names) == 2)
    assert "densities_db" not in (snippet(report) or "")


def test_what_brings_records_and_twin_no_nearer_is_not_advised_to_be_added(make_report: MakeReport) -> None:
    report = make_report()
    worse = dataclasses.replace(report.verdict, closure=-0.32, closure_ci=(-0.4, -0.2))
    steps = next_steps(dataclasses.replace(report, verdict=worse))
    assert "no closer" in steps[0] and not any("should shrink" in step for step in steps)
    assert any("should shrink" in step for step in next_steps(report))


def test_faults_of_a_place_are_no_range() -> None:
    assert condition_words({"fault": ["outer", "ball"], "speed_rpm": [1500.0, 1800.0]}) == (
        "outer, ball, 1500 to 1800 rpm"
    )


def test_advice_names_what_would_decide(make_report: MakeReport) -> None:
    open_ones = make_report("explained")
    assert undecided(open_ones) == ("slip_jitter", "speed_fluctuation")
    assert any("tacho" in step for step in next_steps(open_ones))
    settled = dataclasses.replace(
        open_ones, verdict=dataclasses.replace(open_ones.verdict, confidence_set=(open_ones.verdict.effects,))
    )
    assert not any("To decide" in step for step in next_steps(settled))
    assert any("1010 to 1400 Hz" in step for step in next_steps(make_report("unexplained")))
    assert any("0.9 to 1.1 orders" in step for step in next_steps(make_report("partly_explained")))
    calm = dataclasses.replace(make_report("no_gap"), tests=())
    assert "Use the twin" in next_steps(calm)[0]


@pytest.mark.parametrize(
    ("place", "words"),
    [
        (Place("frequency", 100.0, 250.5, "Hz", 0.1, 0.1), "100 to 250.5 Hz"),
        (Place("frequency", 100.0, None, "Hz", 0.1, 0.1), "above 100 Hz"),
        (Place("frequency", 9500.0, 25600.0, "Hz", 0.1, 0.1), "9500 to 25600 Hz"),
        (Place("order", None, 3.0, "orders", 0.1, 0.1, {"fault": "inner"}), "below 3 orders (inner)"),
        (Place("condition", None, None, "", 0.1, 0.1, {"speed_rpm": 1797.0, "load_n": 10}), "1797 rpm, 10 N"),
        (Place("amplitude", 0.0, 1.0, "1", 0.1, 0.1), "0 to 1"),
        (Place("condition", None, None, "", 0.1, 0.1), "everywhere"),
    ],
)
def test_places_in_words(place: Place, words: str) -> None:
    assert place_words(place) == words
    assert condition_words(place.condition) in words


def test_a_verdict_of_no_gap_that_a_test_contradicts_is_flagged(make_report: MakeReport) -> None:
    calm = dataclasses.replace(make_report("no_gap"), tests=(TwoSampleTest("MMD", 0.01, 0.3),))
    assert contradictions(calm) == () and "Careful" not in own(page(calm))
    torn = dataclasses.replace(calm, tests=(TwoSampleTest("MMD", 0.4, 0.001),))
    assert "MMD (p = 0.001)" in contradictions(torn)[0]
    assert own(page(torn)).count("Careful") == 1 and "Compare the curves" in next_steps(torn)[0]
    assert not any("Use the twin" in step for step in next_steps(torn))
    found = dataclasses.replace(make_report("explained"), tests=torn.tests)
    assert contradictions(found) == ()


def test_the_headline_says_what_the_statistics_of_tests_mean(make_report: MakeReport) -> None:
    tests = (TwoSampleTest(AUC_TEST, 0.5123, 0.4), TwoSampleTest(MMD_TEST, 0.00712, 0.3))
    shown = " ".join(Reader(own(page(dataclasses.replace(make_report("no_gap"), tests=tests)))).words.split())
    assert "0.5123, p = 0.4 (0.5 where a classifier cannot tell records from simulated ones, 1 where it always" in shown
    assert "0.00712, p = 0.3 (0 where both have the same distribution)" in shown


def test_an_effect_of_the_users_own_that_is_not_confirmed_is_remarked(make_report: MakeReport) -> None:
    report = make_report("partly_explained")
    remark = "An effect of your own, fitted and tested: held-out records do not confirm it."

    def remarks(*own_effects: str) -> int:
        stated = {**report.provenance, "own_effects": dict.fromkeys(own_effects, "ab" * 32)}
        return Reader(own(page(dataclasses.replace(report, provenance=stated)))).words.count(remark)

    assert remarks() == 0
    assert remarks("slip_jitter") == 1
    assert remarks("second_resonance") == 0, "it is named"
    assert remarks("clipping") == 0, "it could not be added, so nothing was tested"


def test_values_that_the_records_do_not_determine_are_marked_and_counted(make_report: MakeReport) -> None:
    loose, tight = ParameterValue(824.0, "Hz", (672.0, 1444.0)), ParameterValue(0.5, "", (0.2, 0.7))
    candidate = Candidate("second_resonance", 0.9, 1, 0.5, 0.5, (0, 1), {"frequency_hz": loose, "gain": tight})
    verdict = Verdict("explained", ("second_resonance",), (), 0.01, 0.5, (0.4, 0.6))
    report = dataclasses.replace(make_report(), verdict=verdict, candidates=(candidate,))
    lines = (snippet(report) or "").splitlines()
    assert "# frequency_hz = 824.0  # not determined: 672 to 1444" in lines and "gain = 0.5  # 0.2 to 0.7" in lines
    assert "do not determine `second_resonance.frequency_hz`:" in next_steps(report)[0]
    assert "\nfrequency_hz" not in (snippet(report) or "")


def test_a_closest_twin_that_closes_no_more_is_said_to(make_report: MakeReport) -> None:
    report = make_report()
    share = GroupShare("path", (EffectShare("second_resonance", 0.3),), 0.3, (0.2, 0.4), 0.01, True)
    closest = dataclasses.replace(report.closest, closure=0.3, closure_ci=(0.2, 0.4), attribution=(share,))
    for closed, words in ((0.3, "closes no more, 30 %"), (0.1, "closes 30 %")):
        verdict = dataclasses.replace(report.verdict, closure=closed, closure_ci=(0.0, 0.5))
        assert words in dataclasses.replace(report, verdict=verdict, closest=closest).closest_sentence


@pytest.mark.parametrize(
    ("closure", "ci", "replayed", "says"),
    [
        (0.95, (0.9, 1.0), None, "at most a tenth of the gap is left"),
        (0.7, (0.6, 0.8), 0.65, "no more of the gap is left than real records in place of the twin leave"),
        (0.7, (0.6, 0.8), 0.3, "no more of the gap is left than values that are a little off leave"),
    ],
)
def test_the_headline_states_the_reason_that_holds(
    make_report: MakeReport, closure: float, ci: tuple[float, float], replayed: float | None, says: str
) -> None:
    report = make_report("explained")
    report = dataclasses.replace(
        report, verdict=dataclasses.replace(report.verdict, closure=closure, closure_ci=ci),
        closest=dataclasses.replace(report.closest, ceiling=Ceiling(replayed)),
    )  # fmt: skip
    assert meaning_of(report) == f"Nothing points to a further effect: once the named ones are added, {says}."
    partly = dataclasses.replace(report, verdict=dataclasses.replace(report.verdict, status="partly_explained"))
    left = "more is left than values that are a little off leave"
    assert meaning_of(partly) == f"Once the named effects are added, {left}."
    far = dataclasses.replace(partly, verdict=dataclasses.replace(partly.verdict, closure_ci=(0.1, 0.5)))
    assert "at least 30 % of the gap is left" in meaning_of(far)


def test_places_over_whole_records_are_no_change_over_time(make_report: MakeReport) -> None:
    report = make_report("unexplained")
    seconds, level = tuple((k + 0.5) / 16 for k in range(16)), (0.0,) * 16
    curves = {"time": Curve(seconds, "s", level, level, None, "dB", "Level within the record", "time")}

    def advice(hi: float) -> str:
        place = Place("time", 0.0, hi, "s", 0.4, 0.001, None, "records_higher")
        return " ".join(next_steps(dataclasses.replace(report, places=(place,), rest=(), curves=curves)))

    assert "bursts stand out more" in advice(1.0) and "change over time" not in advice(1.0)
    assert "The records change over time" in advice(0.5)


def test_what_cannot_be_added_is_not_said_to_close_anything(make_report: MakeReport) -> None:
    report = make_report("explained")
    first, second = report.verdict.effects[:2]
    parts = [dataclasses.replace(c, acts="not here") if c.effect == first else c for c in report.candidates]
    told = dataclasses.replace(report, candidates=tuple(parts)).sentence
    assert f"adding {second.replace('_', ' ')}" in told and "adding them" not in told
    assert "adding them" in report.sentence


def test_a_gap_that_the_distance_hardly_shows_is_explained_for_another_reason(make_report: MakeReport) -> None:
    report = make_report("explained")
    faint = dataclasses.replace(report, verdict=dataclasses.replace(report.verdict, closure=0.1, closure_ci=(0.0, 0.3)))
    assert "effects as faint as these hardly change the distance" in meaning_of(faint)
