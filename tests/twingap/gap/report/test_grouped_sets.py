"""Confidence sets by groups: as few lines as groups need, each explanation in one of them."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twingap.effects import catalogue
from twingap.gap.report.grouped_sets import by_groups, group_of

NAMES = sorted(catalogue())


def test_effects_that_stand_in_for_each_other_are_one_line() -> None:
    impacts = ("slip_jitter", "impact_scatter", "load_zone")
    some = [one for size in (1, 2, 3) for one in itertools.combinations(impacts, size)]
    sets = [("mean_slip", *one) for one in some]
    (line,) = by_groups(sets, {})
    assert [(c.group, c.how) for c in line.choices] == [("kinematics", "all"), ("impact statistics", "some")]
    assert "; ".join(map(str, line.choices)) == (
        "mean slip; one or more of impact statistics (slip jitter, impact scatter or load zone)"
    )
    assert line.explanations == 7 and line.weight == pytest.approx(1)


def test_a_certain_member_is_told_from_its_companions() -> None:
    (line,) = by_groups([("load_zone",), ("load_zone", "slip_jitter")], {})
    assert [str(choice) for choice in line.choices] == ["load zone", "perhaps slip jitter"]


def test_lines_are_ordered_by_probability() -> None:
    sets = [("clipping",), ("gear_mesh",), ()]
    lines = by_groups(sets, {"clipping": 0.1, "gear_mesh": 0.8})
    assert [str(line.choices[0]) if line.choices else "nothing" for line in lines] == [
        "gear mesh",
        "nothing",
        "clipping",
    ]
    odds = {"gear mesh": 0.9 * 0.8, "nothing": 0.9 * 0.2, "clipping": 0.1 * 0.2}
    assert [line.weight for line in lines] == pytest.approx([odds[n] / sum(odds.values()) for n in odds])


def test_the_least_probable_lines_are_left_out() -> None:
    sets = [("clipping",), ("clipping", "gear_mesh"), ("clipping", "mean_slip")]
    probability = {"clipping": 0.99, "gear_mesh": 0.4, "mean_slip": 0.01}
    kept = by_groups(sets, probability)
    assert [len(line.choices) for line in kept] == [1, 2] and sum(line.weight for line in kept) > 0.98
    assert len(by_groups(sets, probability, part=1.0)) == 3
    assert len(by_groups(sets, probability, part=0.5)) == 1


def test_an_effect_of_ones_own_is_a_group_of_its_own() -> None:
    assert group_of("my_effect") == "my_effect"
    assert len(by_groups([("my_effect",), ("clipping",)], {})) == 2


@settings(max_examples=50, deadline=None)
@given(st.lists(st.frozensets(st.sampled_from(NAMES), max_size=4), min_size=1, max_size=12, unique=True))
def test_every_explanation_is_in_the_line_of_its_groups(sets: list[frozenset[str]]) -> None:
    lines = by_groups([tuple(sorted(one)) for one in sets], dict.fromkeys(NAMES, 0.4), part=1.0)
    assert sum(line.explanations for line in lines) == len(sets)
    assert sum(line.weight for line in lines) == pytest.approx(1)
    held = [{choice.group for choice in line.choices} for line in lines]
    assert len(held) == len({frozenset(one) for one in held})
    for one in sets:
        (line,) = (line for line, groups in zip(lines, held, strict=True) if groups == set(map(group_of, one)))
        assert one <= {name for choice in line.choices for name in choice.effects}
        assert {n for c in line.choices if c.how == "all" for n in c.effects} <= one
