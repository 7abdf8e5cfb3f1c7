"""Scores against counts made by hand and intervals against published ones."""

import math
from dataclasses import replace

import numpy as np
import pytest

from twingap.study import scores
from twingap.study.intervals import of_median, of_rate
from twingap.study.parameters import parameter_errors
from twingap.study.verdicts import Found, Row, Was, found_in


def row(kind: str, true: tuple[str, ...], named: tuple[str, ...], status: str = "explained", **more: object) -> Row:
    strength = dict.fromkeys(true, str(more.pop("strength", "medium")))
    was = Was("w", kind, str(more.pop("arm", "twin")), true, strength, tuple(more.pop("uncatalogued", ())))  # type: ignore[arg-type]
    sets = more.pop("sets", (named,))
    return Row(was, Found(status, named, sets, **more))  # type: ignore[arg-type]


def by_name(found: list[scores.Score]) -> dict[tuple[str, str], scores.Score]:
    return {(s.name, s.among): s for s in found}


@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    # Exact binomial 95 % limits as tabled by Clopper and Pearson (1934) and in every handbook since.
    [(0, 10, 0.0, 0.3085), (1, 10, 0.0025, 0.4450), (5, 10, 0.1871, 0.8129), (10, 10, 0.6915, 1.0), (0, 0, 0.0, 1.0)],
)
def test_clopper_pearson_as_tabled(k: int, n: int, low: float, high: float) -> None:
    assert of_rate(k, n) == pytest.approx((low, high), abs=6e-5)


@pytest.mark.parametrize("rate", [0.02, 0.3, 0.9])
def test_clopper_pearson_covers(rate: float) -> None:
    """Over all outcomes, by their probabilities: at least 95 %."""
    n = 60
    held = 0.0
    for k in range(n + 1):
        low, high = of_rate(k, n)
        held += math.comb(n, k) * rate**k * (1 - rate) ** (n - k) * (low <= rate <= high)
    assert held >= 0.95


def test_interval_of_a_median_covers() -> None:
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(400):
        low, high = of_median(rng.exponential(size=25).tolist())
        held += low <= math.log(2) <= high
    assert held / 400 >= 0.93
    assert of_median([1.0, 2.0, 3.0]) == (-math.inf, math.inf)


def test_headline_counts() -> None:
    rows = [
        *[row("none", (), (), "no_gap")] * 19,
        row("none", (), ("dropout",), "explained"),
        *[row("single", ("clipping",), ("clipping",), strength="medium")] * 3,
        row("single", ("clipping",), ("dropout", "clipping"), sets=(("dropout",), ("clipping",)), strength="strong"),
        row("single", ("dropout",), (), "no_gap", strength="weak"),
        row("pair", ("dropout", "clipping"), ("clipping", "dropout")),
        row("pair", ("dropout", "clipping"), ("clipping",)),
        row("crowd", ("a", "b", "c"), ("a", "b", "x")),
        row("crowd", ("a", "b", "c", "d"), ("a",)),
        row("outside", (), (), "unexplained", uncatalogued=("echo",)),
        row("outside_plus", ("a",), ("a",), "partly_explained", uncatalogued=("echo",)),
        row("outside", (), ("a",), "explained", uncatalogued=("echo",)),
    ]
    found = by_name(scores.headline(rows))
    counts = {
        ("false alarms", "none"): (1, 20),
        ("first-named right", "single, medium or strong"): (3, 4),
        ("first-named right", "single, weak"): (0, 1),
        ("confidence set covers", "single, medium or strong"): (4, 4),
        ("exact set", "pair"): (1, 2),
        ("precision", "crowd"): (3, 4),
        ("recall", "crowd"): (3, 7),
        ("outside recognised", "outside, outside_plus"): (2, 3),
        # A world whose set is of one group holds every other effect of it; a refused or silent one holds what it says.
        ("confidence set by groups covers", "single, pair, crowd"): (6, 9),
        ("explained", "single, pair, crowd, named exactly"): (4, 4),
        ("explained", "single, pair, crowd, called a gap"): (8, 8),
        ("not explained", "outside, outside_plus, called a gap"): (2, 3),
    }
    assert {key: (found[key].k, found[key].n) for key in counts} == counts
    assert found["false alarms", "none"].met is True
    assert found["false alarms, upper bound", "none"].met is False  # 1 of 20: up to a quarter
    assert found["first-named right", "single, medium or strong"].met is False
    assert found["size of confidence set", "single, medium or strong"].value == pytest.approx(1.25)
    assert [s["kind"] for s in scores.statuses(rows)] == ["none", "single", "pair", "crowd", "outside", "outside_plus"]
    assert sum(s["worlds"] for s in scores.statuses(rows)) == len(rows)


def test_balanced_accuracy_of_the_status_is_of_gaps_alone() -> None:
    rows = [
        *[row("single", ("clipping",), ("clipping",))] * 3,
        row("single", ("clipping",), ("dropout",), "partly_explained"),
        row("single", ("clipping",), (), "no_gap"),
        row("outside", (), (), "unexplained"),
        row("outside", (), ("a",), "explained"),
        row("outside", (), (), "no_gap"),
    ]
    score = by_name(scores.headline(rows))["balanced accuracy of the status", "single to crowd, outside"]
    assert score.value == pytest.approx((3 / 4 + 1 / 2) / 2) and score.n == 6 and score.met is False
    assert score.low < score.value < score.high


def test_rich_worlds_have_scores_of_their_own() -> None:
    plain = [row("single", ("clipping",), ("clipping",)), row("none", (), (), "no_gap")]
    rich = [
        row("lines", ("line_spectrum",), ("drive_interference",)),
        row("lines", ("line_spectrum",), ("line_spectrum",)),
        row("path", ("transfer_path",), ("clipping",)),
        row("rich", ("transfer_path", "dropout"), ("dropout",)),
        row("rich_none", (), ("dropout",)),
    ]
    before, found = by_name(scores.headline(plain)), by_name(scores.headline(plain + rich))
    assert {key: found[key].row for key in before} == {key: score.row for key, score in before.items()}
    counts = {
        ("first-named right", "lines"): (1, 2),
        ("first-named of the right group", "lines"): (2, 2),
        ("first-named of the right group", "path"): (0, 1),
        ("exact set", "rich"): (0, 1),
        ("recall", "rich"): (1, 2),
        ("false alarms", "rich_none"): (1, 1),
    }
    assert {key: (found[key].k, found[key].n) for key in counts} == counts
    details = by_name(scores.detailed(plain + rich))
    assert details["detected", "all"].n == 1 and details["detected", "rich"].n == 1
    assert [s["kind"] for s in scores.statuses(rich)] == ["path", "lines", "rich", "rich_none"]


def test_a_refused_diagnosis_is_neither_alarm_nor_detection() -> None:
    rows = [row("none", (), (), "refused"), row("single", ("a",), (), "refused")]
    found = by_name(scores.detailed(rows))
    assert found["false alarms", "none"].k == 0
    assert found["detected", "single"].k == 0


def test_no_worlds_of_a_kind_is_no_met_target() -> None:
    assert all(score.met is None for score in scores.headline([]) if not score.name.startswith("false"))
    assert by_name(scores.headline([]))["exact set", "pair"].row["value"] is None


def test_confusion_has_each_single_world_once() -> None:
    rows = [
        row("single", ("a",), ("b", "a")),
        row("single", ("a",), ("a",)),
        row("single", ("b",), (), "no_gap"),
        row("pair", ("a", "b"), ("a",)),
    ]
    assert scores.confusion(rows, ["a", "b"]).tolist() == [[1, 1, 0], [0, 0, 1]]


def test_closure_ratio_counts_silence_as_nothing_closed() -> None:
    was = Was("w", "single", "twin", ("a",), closure=0.8)
    assert scores.closure_ratio(Row(was, Found("explained", ("a",), closure=0.6))) == pytest.approx(0.75)
    assert scores.closure_ratio(Row(was, Found("no_gap"))) == 0.0
    assert math.isnan(scores.closure_ratio(Row(Was("w", "single", "twin", ("a",)), Found("no_gap"))))
    assert scores.closure_ratio(Row(replace(was, closure=1.7), Found("explained", ("a",), closure=1.2))) == 1.0
    assert math.isnan(scores.closure_ratio(Row(replace(was, closure=0.05), Found("explained", ("a",), closure=0.5))))


def test_reliability_of_honest_probabilities() -> None:
    """Effects there with the probabilities given lie on the diagonal; overconfident ones do not."""
    rng = np.random.default_rng(3)

    def study(power: float) -> list[Row]:
        rows = []
        for _ in range(800):
            p = rng.uniform(size=4)
            true = tuple(f"e{i}" for i in range(4) if rng.random() < p[i])
            predicted = p**power / (p**power + (1 - p) ** power)
            rows.append(
                Row(
                    Was("w", "crowd", "twin", true),
                    Found("explained", (), probability={f"e{i}": predicted[i] for i in range(4)}),
                )
            )
        return rows

    honest, sure = scores.reliability(study(1.0)), scores.reliability(study(4.0))
    assert sum(r["n"] for r in honest) == 3200
    assert max(abs(r["value"] - r["mean_probability"]) for r in honest) < 0.08
    assert max(abs(r["value"] - r["mean_probability"]) for r in sure) > 0.15


def test_by_effect_counts_alone_and_in_company() -> None:
    rows = [
        row("single", ("clipping",), ("clipping",)),
        row("single", ("clipping",), (), "no_gap"),
        row("pair", ("clipping", "dropout"), ("dropout",)),
    ]
    table = {(r["effect"], r["strength"], r["score"]): (r["k"], r["n"]) for r in scores.by_effect(rows)}
    assert table["clipping", "medium", "detected"] == (1, 2)
    assert table["clipping", "medium", "found in company"] == (0, 1)
    assert table["dropout", "medium", "found in company"] == (1, 1)


def test_the_closest_twin_counts_also_where_nothing_is_named() -> None:
    one = row("single", ("clipping",), (), "unexplained", closest=0.6)
    one = replace(one, was=replace(one.was, closure=0.8))
    assert scores.closest_ratio(one) == pytest.approx(0.75) and scores.closure_ratio(one) == 0.0
    assert math.isnan(scores.closest_ratio(replace(one, found=replace(one.found, closest=None))))
    assert scores.closest_ratio(replace(one, found=replace(one.found, closest=1.4))) == pytest.approx(1 / 0.8)
    headline = by_name(scores.headline([one]))
    assert headline["closest twin's closure over true closure", "single, pair, crowd"].value == pytest.approx(0.75)


def test_closable_ratio_asks_no_more_than_the_twin_can_close() -> None:
    was = Was("w", "single", "twin", ("a",), closure=1.0, left=0.5)
    found = Found("explained", ("a",), gaps=(2.0, 0.8, 0.1))
    assert scores.closable_ratio(Row(was, found)) == pytest.approx(0.8)
    assert scores.closable_ratio(Row(was, replace(found, gaps=(2.0, 0.3, 0.1)))) == 1.0
    assert scores.closable_ratio(Row(replace(was, left=-0.2), found)) == pytest.approx(1.2 / 1.9)
    assert scores.closable_ratio(Row(was, Found("no_gap", gaps=(2.0, 2.0, 0.1)))) == 0.0
    assert math.isnan(scores.closable_ratio(Row(replace(was, left=1.9), found)))
    assert math.isnan(scores.closable_ratio(Row(replace(was, left=None), found)))
    assert math.isnan(scores.closable_ratio(Row(was, Found("refused"))))


def test_found_in_reads_a_gap_report() -> None:
    report = {
        "verdict": {"status": "explained", "effects": ["a"], "confidence_set": [["a"], ["b"]], "p_value": 0.01},
        "which": [
            {"effect": "a", "probability": 0.9, "parameters": {"x": {"value": 2.0, "unit": "", "ci": [1.0, 3.0]}}},
            {"effect": "b", "probability": 0.3, "parameters": {"y": {"value": 1.0}}},
        ],
        "shrink": {"metrics": [{"metric": "gap", "before": 1.0, "after": 0.4, "floor": 0.2}]},
    }
    found = found_in(report, 3.0, 200.0)
    assert found.first == "a" and found.closure == pytest.approx(0.75) and set(found.parameters) == {"a"}
    assert found.gaps == (1.0, 0.4, 0.2)
    assert found.covers == (frozenset("a"), frozenset("b"))


def test_parameter_errors_relative_and_covered() -> None:
    was = Was("w", "single", "twin", ("mean_slip",), parameters={"mean_slip": {"cage_speed_change": -0.02}})

    def estimated(value: float, ci: list[float]) -> Row:
        values = {"mean_slip": {"slip": {"value": value, "unit": "", "ci": ci}}}
        return Row(was, Found("explained", ("mean_slip",), parameters=values))

    (line,) = parameter_errors([estimated(0.022, [0.01, 0.03]), estimated(-0.02, [-0.03, -0.01])])
    assert line["median_relative_error"] == pytest.approx((0.1 + 2.0) / 2)  # a slip of the wrong sign is wrong
    assert line["ci_covers"] == 0.5 and line["n"] == 2
