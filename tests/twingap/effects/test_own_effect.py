"""An effect of a user's own, of a stage, parameters and `apply` alone, is diagnosed like any other."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import (
    Draft,
    Effect,
    Stage,
    catalogue,
    effect_name,
    make_effect,
    measurements,
    parameter,
    registry,
)
from twingap.effects.observations import Observations
from twingap.errors import TwingapError
from twingap.gap.knowledge.effect_features import columns
from twingap.gap.knowledge.machines import draw_machine
from twingap.gap.knowledge.simulated_gaps import draw_effects, maybe_variant
from twingap.gap.report.advice import next_steps
from twingap.gap.search.parameter_scale import Setting, coordinates, to_effect, to_number, with_errors
from twingap.records import Condition
from twingap.twins.phenomenological import PhenomenologicalTwin

MODULE = '''
from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from twingap.effects import Draft, Effect, Stage, parameter, register


@register
@dataclass(frozen=True)
class BeltTones(Effect):
    """Tones of a belt drive."""

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    level: float = parameter(0.1, unit="healthy rms", plausible=(0.01, 1.0), log=True, doc="amplitude of a tone")
    tone_hz: float = parameter(900.0, unit="Hz", plausible=(100.0, 2000.0), allowed=(1.0, 1e6), doc="its frequency")
    count: int = parameter(2, unit="", plausible=(1, 4), allowed=(1, 9), doc="number of tones")
    odd: bool = parameter(False, unit="", plausible=(0, 1), allowed=(0, 1), doc="odd multiples alone")

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        for k in range(1, self.count + 1):
            order = 2 * k - 1 if self.odd else k
            draft.x += self.level * draft.reference_rms * np.cos(2 * np.pi * order * self.tone_hz * draft.t)
'''
SETTING = Setting(fs_hz=12_000.0, begin_s=0.0, span_s=1.0, speed_rpm=1500.0)
MACHINE = draw_machine(np.random.default_rng(0), own_simulator=False, most_records=4)


@pytest.fixture
def belt_tones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> type[Effect]:
    """The effect, registered from a file of its own."""
    coordinates()  # whatever was asked before the effect was known
    monkeypatch.setattr(registry, "_OWN", {})
    (tmp_path / "belt_tones.py").write_text(MODULE)
    (name,) = registry.load_effects(tmp_path / "belt_tones.py")
    return catalogue()[name]


def observations(bearing: object) -> Observations:
    return Observations({}, {}, bearing, frozenset(), 12_000.0, 0.0, 1.0, 1500.0, None, lambda: None, list, list)  # type: ignore[arg-type]


def test_it_is_drawn_from_what_is_plausible(belt_tones: type[Effect]) -> None:
    rng = np.random.default_rng(1)
    drawn = [draw_effects(rng, MACHINE, 1, ("belt_tones",))[0] for _ in range(200)]
    assert {type(one) for one in drawn} == {belt_tones}
    values = {name: [vars(one)[name] for one in drawn] for name in vars(drawn[0])}
    assert 0.01 <= min(values["level"]) < 0.02
    assert 0.5 < max(values["level"]) <= 1.0
    assert np.median(values["level"]) == pytest.approx(0.1, rel=0.4)  # on a logarithmic scale
    assert set(values["count"]) == {1, 2, 3, 4}
    assert set(values["odd"]) == {False, True}
    assert maybe_variant(drawn[0], MACHINE, rng) is drawn[0]


def test_it_is_drawn_with_others_in_their_order(belt_tones: type[Effect]) -> None:
    assert list(catalogue())[-5:] == ["belt_tones", "clipping", "quantisation", "dropout", "sample_hold"]
    names = {one.name for seed in range(60) for one in draw_effects(np.random.default_rng(seed), MACHINE, 4)}
    assert "belt_tones" in names


def test_its_values_compare_between_machines(belt_tones: type[Effect]) -> None:
    known = {p for name, p in coordinates() if name == "belt_tones"}
    assert known == {"level", "tone_hz", "count", "odd"}
    effect = make_effect("belt_tones", {"level": 0.2, "tone_hz": 1800.0, "count": 3, "odd": True})
    numbers = {p: to_number(effect, p, SETTING) for p in known}
    assert numbers == {"level": pytest.approx(math.log(0.2)), "tone_hz": pytest.approx(0.15), "count": 3.0, "odd": 1.0}
    assert to_effect("belt_tones", numbers, SETTING) == effect
    beyond = to_effect("belt_tones", {"tone_hz": 0.7, "count": 40.0}, SETTING)
    assert vars(beyond) | {"level": 0.1} == {"level": 0.1, "tone_hz": 0.48 * 12_000, "count": 9, "odd": False}
    off = [with_errors(effect, 0.1, SETTING, np.random.default_rng(k)) for k in range(50)]
    assert np.std([math.log(vars(one)["level"]) for one in off]) == pytest.approx(0.1, rel=0.35)


def test_it_has_initial_values_and_weaker_ones(belt_tones: type[Effect]) -> None:
    given = make_effect("belt_tones")
    found = [vars(one) for one in given.initial_values(observations(MACHINE.bearing))]
    assert {one["count"] for one in found} == {1, 2, 4}
    assert {one["odd"] for one in found} == {False, True}
    assert min(one["tone_hz"] for one in found) < 300 < 1700 < max(one["tone_hz"] for one in found)
    assert len({tuple(one.items()) for one in found} | {tuple(vars(given).items())}) == len(found) + 1
    assert [vars(one)["level"] for one in given.weaker()] == pytest.approx([0.05, 0.025, 0.012, 0.006])
    assert not given.spectral_values(observations(MACHINE.bearing))


def test_any_feature_may_tell_of_it(belt_tones: type[Effect]) -> None:
    features = ("lines.peaks_log|all.level", "lines.peaks_log|on_speed", "context|anything", "shape|healthy_1")
    assert columns("belt_tones", features) == (0, 1, 2, 3)
    assert columns("shaft_harmonics", features) == (0,)
    assert columns("speed_gain", ("impacts.level|on_speed", "impacts.level|on_time")) == (0,)


def test_a_measurement_that_isolates_its_stage_decides(belt_tones: type[Effect]) -> None:
    assert belt_tones.deciding_measurement == measurements.OTHER_SPEED
    verdict = SimpleNamespace(
        status="explained", effects=(), closure=None, confidence_set=(("belt_tones",), ("waviness",))
    )
    steps = next_steps(SimpleNamespace(verdict=verdict, tests=(), candidates=(), provenance={}))  # type: ignore[arg-type]
    (decides,) = (step for step in steps if "To decide" in step)
    assert "belt tones" in decides
    assert decides.count(measurements.OTHER_SPEED) == 1


def test_a_form_of_a_known_effect_bears_its_name_unless_it_is_registered() -> None:
    @dataclasses.dataclass(frozen=True)
    class WornClipping(catalogue()["clipping"]):  # type: ignore[misc]
        """Not registered."""

    assert effect_name(WornClipping) == "clipping"
    assert WornClipping().name == "clipping"


def test_a_registered_form_of_a_known_effect_is_another_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_OWN", {})

    @registry.register
    @dataclasses.dataclass(frozen=True)
    class WornClipping(catalogue()["clipping"]):  # type: ignore[misc]
        """Registered."""

    assert WornClipping().name == "worn_clipping"
    assert catalogue()["clipping"]().name == "clipping"


@pytest.mark.parametrize("stage", list(Stage))
def test_every_stage_has_a_deciding_measurement(stage: Stage) -> None:
    class Nothing(Effect):
        def apply(self, draft: Draft, rng: np.random.Generator) -> None: ...

    kind = type("Something", (Nothing,), {"stage": stage})
    assert kind.deciding_measurement in vars(measurements).values()
    assert not Nothing.deciding_measurement


def test_a_range_that_ends_before_it_begins_is_refused() -> None:
    with pytest.raises(TwingapError, match=r"plausible=\(5, 0.2\) of a parameter ends before it begins"):
        parameter(1.0, unit="", plausible=(5.0, 0.2), doc="of no use")


def test_an_effect_that_changes_the_number_of_samples_is_named(
    belt_tones: type[Effect], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(belt_tones, "apply", lambda self, draft, rng: setattr(draft, "x", draft.x[1:]))
    twin = PhenomenologicalTwin(BEARINGS["6205"], effects=[make_effect("belt_tones")])
    with pytest.raises(TwingapError, match=r"effect belt_tones: makes samples of shape \(499,\), \(500,\) expected"):
        twin.simulate([Condition("a", 1500.0, 12000.0, 500, "healthy")], np.random.default_rng(0))


def test_a_file_that_needs_one_beside_it_says_how(tmp_path: Path) -> None:
    (tmp_path / "helpers_of_mine.py").write_text("LEVEL = 1.0\n")
    (tmp_path / "own.py").write_text("import helpers_of_mine\n")
    with pytest.raises(TwingapError, match=r"line 1: .*helpers_of_mine.*files beside it are not found"):
        registry.load_effects(tmp_path / "own.py")
