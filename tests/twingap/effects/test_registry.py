"""The catalogue: complete, typed, referenced, open to users, and strict about parameters."""

from __future__ import annotations

import dataclasses
import math
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from twingap import BEARINGS, Condition, TwingapError
from twingap.effects import (
    Draft,
    Effect,
    SlipJitter,
    Stage,
    catalogue,
    in_order,
    load_effects,
    make_effect,
    measurements,
    parameter,
    register,
    registry,
    trainable,
)  # fmt: skip
from twingap.twins.phenomenological import PhenomenologicalTwin

SPECIFIED = {
    Stage.SHAFT: "speed_fluctuation mean_slip",
    Stage.EXCITATION: "slip_jitter impact_scatter load_zone cage_modulation entry_exit "
    "distributed_roughness speed_gain damage_growth impulsive_share ball_contact",
    Stage.PATH: "second_resonance sensor_rolloff transfer_path",
    Stage.DISTURBANCE: "shaft_harmonics looseness mains_interference drive_interference gear_mesh foreign_bearing "
    "coloured_noise impulsive_noise waviness line_spectrum background_spectrum",
    Stage.ACQUISITION: "clipping quantisation dropout sample_hold",
}
UNTRAINED = {
    "impulsive_share", "ball_contact", "transfer_path", "line_spectrum", "background_spectrum", "sample_hold",
}  # fmt: skip
NAMES = " ".join(SPECIFIED.values()).split()
GROUPS = {
    "kinematics", "impact statistics", "operation", "path", "lines", "other sources", "background", "acquisition",
}  # fmt: skip


def test_catalogue_is_the_specification() -> None:
    assert {name: kind.stage for name, kind in catalogue().items()} == {
        name: stage for stage, names in SPECIFIED.items() for name in names.split()
    }
    assert len(NAMES) == 30
    assert set(catalogue()) - set(trainable()) == UNTRAINED


@pytest.mark.parametrize("name", NAMES)
def test_every_effect_is_typed_and_referenced(name: str) -> None:
    kind: Any = catalogue()[name]
    assert dataclasses.is_dataclass(kind)
    assert kind.__dataclass_params__.frozen  # type: ignore[attr-defined]
    assert kind.__doc__
    assert kind.references
    assert any(re.search(r"\d", text) for text in kind.references), "a year, an equation or a standard's number"
    fields = dataclasses.fields(kind)
    assert fields
    for field in fields:
        about = field.metadata
        if "profile" in about:
            assert field.type == "tuple[float, ...]" and about["doc"] and about["unit"]
            continue
        low, high = about["plausible"]
        assert field.type in ("float", "int", "bool")
        assert isinstance(about["unit"], str)
        assert about["doc"]
        assert about["allowed"][0] <= low < high <= about["allowed"][1]
        assert low <= field.default <= high
        assert not about["log"] or low > 0, "a logarithmic range starts above 0"


@pytest.mark.parametrize("name", NAMES)
def test_plausible_corners_simulate(name: str) -> None:
    kind: Any = catalogue()[name]
    conditions = [
        Condition(f"{f}", 1500, 51200, 4000, f, time_s=60.0) for f in ("healthy", "inner", "outer", "ball", "cage")
    ]
    for side in (0, 1):
        values = {f.name: f.metadata["plausible"][side] for f in kind.parameters() if f.metadata["fitted"]}
        if name == "coloured_noise":
            values["high_hz"] = max(values["high_hz"], 2 * values["low_hz"])
        effect = kind(**values)
        twin = PhenomenologicalTwin(BEARINGS["6205"], effects=[effect])
        for record in twin.simulate(conditions, np.random.default_rng(0)):
            assert np.isfinite(record.samples).all()


@pytest.mark.parametrize("name", NAMES)
def test_out_of_range_is_refused(name: str) -> None:
    kind: Any = catalogue()[name]
    for field in kind.parameters():
        low, high = field.metadata["allowed"]
        wrong: list[Any] = [math.nan, math.inf, "3", None, low - 1]
        if math.isfinite(high):
            wrong.append(high * 2 + 1)
        for value in wrong:
            with pytest.raises(TwingapError, match=f"{name}: {field.name}"):
                kind(**{field.name: value})


def test_whole_numbers_stay_whole() -> None:
    assert make_effect("gear_mesh", {"teeth": 17}) == catalogue()["gear_mesh"](teeth=17)  # type: ignore[call-arg]
    with pytest.raises(TwingapError, match="a whole number between 1 and 100000 expected"):
        catalogue()["gear_mesh"](teeth=17.5)  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("slip_jiter", {}, "unknown effect 'slip_jiter'; did you mean 'slip_jitter'? "),
        ("clipping", {"rails": 3.0}, "effect clipping: unknown key 'rails'; known keys: rail"),
        ("clipping", {"rail": "3"}, "effect clipping: rail: '3' found, a finite number expected"),
        ("clipping", {"rail": -1.0}, "effect clipping: rail: -1.0 found, healthy rms between 1e-09 and 1e+09 expected"),
        ("mains_interference", {"mains_hz": 55.0}, "mains_interference: mains_hz: 55.0 found, 50 or 60 Hz expected"),
        ("coloured_noise", {"low_hz": 900.0, "high_hz": 300.0}, "low_hz = 900, below high_hz = 300 expected"),
    ],
)  # fmt: skip
def test_errors_say_what_and_where(name: str, parameters: dict[str, float], message: str) -> None:
    with pytest.raises(TwingapError) as caught:
        make_effect(name, parameters)
    assert message in str(caught.value)


def test_effects_act_in_the_order_of_the_chain() -> None:
    named = tuple(make_effect(name) for name in reversed(NAMES))
    assert [effect.name for effect in in_order(named)] == NAMES


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Effects registered by a test are gone after it."""
    monkeypatch.setattr(registry, "_OWN", {})


def test_user_adds_an_effect_in_five_lines(own: None) -> None:
    @register
    @dataclass(frozen=True)
    class Hum(Effect):
        "A tone that nobody modelled."

        stage: ClassVar[Stage] = Stage.DISTURBANCE
        level: float = parameter(0.1, unit="healthy rms", plausible=(0.01, 1.0), doc="amplitude of the tone")

        def apply(self, draft: Draft, rng: np.random.Generator) -> None:
            draft.x += self.level * draft.reference_rms * np.sin(2 * np.pi * 100.0 * draft.t)

    assert catalogue()["hum"] is Hum
    condition = Condition("a", 1800, 12000, 12000, "healthy")
    plain, hummed = (
        PhenomenologicalTwin(BEARINGS["6205"], effects=chain).simulate([condition], np.random.default_rng(1))[0].samples
        for chain in ([], [make_effect("hum", {"level": 0.5})])
    )
    np.testing.assert_allclose(hummed - plain, 0.5 * np.sin(2 * np.pi * 100 * np.arange(12000) / 12000), atol=1e-12)
    with pytest.raises(TwingapError, match="hum: level"):
        make_effect("hum", {"level": -1.0})


class Stageless(Effect):
    def apply(self, draft: Draft, rng: np.random.Generator) -> None: ...


class Still(Effect):
    stage: ClassVar[Stage] = Stage.DISTURBANCE


class Bare(Effect):
    stage: ClassVar[Stage] = Stage.DISTURBANCE

    def apply(self, draft: Draft, rng: np.random.Generator) -> None: ...


@dataclass(frozen=True)
class Unbounded(Bare):
    level: float = 0.1


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (int, "int is not a subclass of Effect"),
        (3, "3 is not a subclass of Effect"),
        (Stageless, "Stageless has no stage"),
        (Still, "Still has no apply"),
        (Bare, "Bare has no parameters: put @dataclass"),
        (Unbounded, r"Unbounded has no range for level: write  level: float = parameter"),
    ],
)
def test_registering_what_is_no_effect_says_why(own: None, kind: Any, message: str) -> None:
    with pytest.raises(TwingapError, match=" ".join(message.split())):
        register(kind)


FILE = """
from dataclasses import dataclass
from typing import ClassVar

from twingap.effects import Effect, SlipJitter, Stage, parameter, register

LEVEL = 0.5


@register
@dataclass(frozen=True)
class Hum(Effect):
    "A tone that nobody modelled."

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    level: float = parameter(LEVEL, unit="healthy rms", plausible=(0.01, 1.0), doc="amplitude of the tone")

    def apply(self, draft, rng):
        draft.x += self.level


register(SlipJitter)
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "meine Effekte ä.py"
    path.write_text(text, encoding="utf-8")
    return path


def test_file_brings_effects_and_its_edit_replaces_them(own: None, tmp_path: Path) -> None:
    path = written(tmp_path, FILE)
    assert load_effects(path) == ("hum",)
    first = catalogue()["hum"]
    assert load_effects(path) == ("hum",)
    assert catalogue()["hum"] is first, "the same text is the same class"
    assert list(catalogue())[-5:] == ["hum", "clipping", "quantisation", "dropout", "sample_hold"]
    written(tmp_path, FILE.replace("LEVEL = 0.5", "LEVEL = 0.25"))
    load_effects(path)
    assert make_effect("hum") == catalogue()["hum"](level=0.25)  # type: ignore[call-arg]
    assert catalogue()["hum"] is not first
    written(tmp_path, FILE)
    load_effects(path)
    assert catalogue()["hum"] is first, "and back"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n", r"ä.py: registers no effect or simulator of its own; put @register"),
        ("from twingap.effects import *\nregister(SlipJitter)\n", "registers no effect or simulator of its own"),
        ("x = 1\nif x\n", r"ä.py: line 2: syntax error: expected ':'"),
        ("def f():\n    return 1 / 0\n\nf()\n", r"ä.py: line 2: ZeroDivisionError: division by zero"),
        ("import neighbour_that_is_not_there\n", "line 1: ModuleNotFoundError: No module named"),
        ("import sys\nsys.exit('no')\n", "line 2: SystemExit: no"),
        ("a\0b", "null bytes"),
        (FILE.replace("(Effect)", "(object)"), "line 10: Hum is not a subclass of Effect"),
        (FILE.replace("    stage: ClassVar[Stage] = Stage.DISTURBANCE\n", ""), "line 10: Hum has no stage"),
        (
            FILE.replace("Hum", "Clipping"),
            "line 10: effect clipping ships with twingap already; give the class another",
        ),
        (FILE + "\n1 / 0\n", "ZeroDivisionError"),
    ],
)
def test_file_at_fault_is_refused_in_one_line(own: None, tmp_path: Path, text: str, message: str) -> None:
    before = catalogue()
    with pytest.raises(TwingapError, match=message) as caught:
        load_effects(written(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert catalogue() == before, "nothing of it is kept"


def test_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(TwingapError, match=r"none\.py: cannot be read: No such file"):
        load_effects(tmp_path / "none.py")
    with pytest.raises(TwingapError, match="cannot be read: Is a directory"):
        load_effects(tmp_path)
    (tmp_path / "latin.py").write_bytes(b"# \xe4\n")
    with pytest.raises(TwingapError, match="not UTF-8"):
        load_effects(tmp_path / "latin.py")


def test_shipped_effect_is_not_replaced(own: None) -> None:
    impostor = type("SlipJitter", (SlipJitter,), {"__module__": __name__})
    with pytest.raises(TwingapError, match="slip_jitter ships with twingap"):
        register(impostor)
    assert register(SlipJitter) is catalogue()["slip_jitter"] is SlipJitter


@pytest.mark.parametrize(("broken", "code"), [(False, 0), (True, 1)])
def test_installed_package_brings_effects(tmp_path: Path, broken: bool, code: int) -> None:
    """A real distribution on the path of another process: found when the catalogue is asked for, not before."""
    about = tmp_path / "plugin-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: plugin\nVersion: 1\n")
    (about / "entry_points.txt").write_text("[twingap.effects]\nhum = plugin\n")
    (tmp_path / "plugin.py").write_text(FILE.replace("(Effect)", "(object)") if broken else FILE)
    code_text = "import sys, twingap.effects as e; assert 'plugin' not in sys.modules; e.make_effect('hum')"
    done = subprocess.run(
        [sys.executable, "-c", code_text],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    if broken:
        assert "package plugin: effects cannot be loaded: Hum is not a subclass of Effect; mend" in done.stderr


@pytest.mark.parametrize("name", NAMES)
def test_every_effect_says_what_it_may_be_taken_for_and_what_decides(name: str) -> None:
    kind = catalogue()[name]
    assert kind.look_alikes
    assert set(kind.look_alikes) <= set(NAMES) - {name}
    assert kind.group in GROUPS
    assert kind.features or not kind.trained
    assert kind.deciding_measurement in vars(measurements).values()
    assert kind.draw_weight > 0


def test_estimates_are_told_what_kind_of_number_each_parameter_is() -> None:
    kinds = {(name, field.name): field.metadata for name in NAMES for field in catalogue()[name].parameters()}
    assert {key for key, about in kinds.items() if about["exact"] and not about["searched"]} == {
        ("gear_mesh", "teeth"), ("mains_interference", "mains_hz"), ("foreign_bearing", "order"),
        ("drive_interference", "carrier_hz"), ("drive_interference", "sideband_order"),
    }  # fmt: skip
    assert {key for key, about in kinds.items() if about["relative_to"] in ("run", "speed")} == {
        ("damage_growth", "rate_per_s"), ("damage_growth", "onset_s"), ("speed_gain", "reference_speed_rpm"),
    }  # fmt: skip
    assert all(about["unit"] == "Hz" for about in kinds.values() if about["relative_to"] == "rate")
    assert not kinds["speed_fluctuation", "bandwidth_hz"]["relative_to"]


def test_effects_state_what_is_measured_of_them_and_which_impacts_they_make(own: None) -> None:
    assert registry.measured_from_spectra() == ("transfer_path", "line_spectrum", "background_spectrum")
    assert all(catalogue()[name].profiles() for name in registry.measured_from_spectra())

    @register
    @dataclass(frozen=True)
    class Rattle(SlipJitter):
        """Impacts at random moments."""

        irregular_impacts: ClassVar[Any] = ({"rattle": {"sigma": 0.2}},)

    kinds = registry.irregular_impacts()
    assert {"rattle": {"sigma": 0.2}} in kinds
    assert [len(kind) for kind in kinds] == sorted(len(kind) for kind in kinds)
    for kind in kinds:
        for name, values in kind.items():
            assert make_effect(name, values).stage is Stage.EXCITATION
