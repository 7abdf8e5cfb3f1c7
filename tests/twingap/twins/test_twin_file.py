"""Twin files: what is written is read back, what is wrong is named in one line."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from twingap.bearing import BEARINGS, Bearing
from twingap.config import to_toml
from twingap.effects import catalogue, make_effect
from twingap.effects.registry import OWN_MODELS
from twingap.errors import TwingapError
from twingap.records import Condition
from twingap.twins.contact_parameters import PRESETS
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import (
    Model,
    Provenance,
    TwinSpec,
    build_twin,
    in_unit,
    model_parameters,
    overruled,
    read_twin,
    register_model,
    scaled_for,
    tables_of,
    write_twin,
)

HEAD = '[twin]\nmodel = "phenomenological"\n'


def reading(tmp_path: Path, text: str) -> TwinSpec:
    path = tmp_path / "zwölf twins.toml"
    path.write_text(text, encoding="utf-8")
    return read_twin(path)


def test_the_example_of_the_specification(tmp_path: Path) -> None:
    text = HEAD + 'effects = ["slip_jitter", "load_zone"]\n[parameters]\nresonance_hz = 3400.0\n'
    spec = reading(tmp_path, text)
    assert spec.model == "phenomenological"
    assert spec.effects == ("slip_jitter", "load_zone")
    assert spec.given("resonance_hz") and not spec.given("damping_ratio")
    twin = build_twin(spec, BEARINGS["6205"])
    assert isinstance(twin, PhenomenologicalTwin)
    assert {effect.name for effect in twin.effects} == {"slip_jitter", "load_zone"}
    assert twin.parameters == PhenomenologicalParameters(resonance_hz=3400.0)


def test_what_a_table_leaves_out_keeps_its_default(tmp_path: Path) -> None:
    spec = reading(tmp_path, HEAD + "[parameters.impact_amplitude]\ninner = 1.5\n")
    own = model_parameters(spec)
    assert own.impact_amplitude == {**PhenomenologicalParameters().impact_amplitude, "inner": 1.5}


def test_parameters_of_an_effect(tmp_path: Path) -> None:
    name, kind = "slip_jitter", catalogue()["slip_jitter"]
    key = next(f.name for f in fields(kind) if f.type == "float")  # type: ignore[arg-type]
    value = getattr(make_effect(name), key)
    spec = reading(tmp_path, HEAD + f'effects = ["{name}"]\n[parameters.{name}]\n{key} = {value / 2}\n')
    (effect,) = build_twin(spec, BEARINGS["6205"]).effects
    assert getattr(effect, key) == value / 2


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_presets_of_the_contact_twin(tmp_path: Path, preset: str) -> None:
    text = f'[twin]\nmodel = "contact"\npreset = "{preset}"\n[parameters]\ndamping = 77.0\n'
    own = model_parameters(reading(tmp_path, text))
    assert own.damping == 77.0
    assert own.stiffness == PRESETS[preset].stiffness


def test_bearing_of_the_records_comes_before_the_files(tmp_path: Path) -> None:
    spec = TwinSpec("phenomenological", bearing=BEARINGS["6203"])
    assert build_twin(spec).bearing == BEARINGS["6203"]
    assert build_twin(spec, BEARINGS["6205"]).bearing == BEARINGS["6205"]
    with pytest.raises(TwingapError, match=r"geometry.*\[bearing\]"):
        build_twin(TwinSpec("phenomenological"))


def test_a_model_of_ones_own() -> None:
    @dataclass(frozen=True)
    class Loudness:
        loudness: float = 2.0

    def build(own: Loudness, bearing: Bearing, effects: Iterable[object], unit: str) -> PhenomenologicalTwin:
        return PhenomenologicalTwin(bearing, PhenomenologicalParameters(scale=own.loudness), unit=unit)

    register_model(Model("loud", Loudness, build))
    try:
        twin = build_twin(TwinSpec("loud", parameters={"loudness": 3.0}), BEARINGS["6205"])
        assert isinstance(twin, PhenomenologicalTwin) and twin.parameters.scale == 3.0
        with pytest.raises(TwingapError, match="known parameters: loudness"):
            TwinSpec("loud", parameters={"resonance_hz": 3.0})
    finally:
        del OWN_MODELS["loud"]


numbers = st.floats(1e-3, 1e4)
names = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)


@st.composite
def specs(draw: st.DrawFn) -> TwinSpec:
    parameters = draw(
        st.fixed_dictionaries(
            {},
            optional={
                "resonance_hz": numbers,
                "damping_ratio": st.floats(1e-3, 0.9),
                "scale": numbers,
                "white_noise_rms": numbers,
                "impact_amplitude": st.dictionaries(st.sampled_from(["inner", "outer", "ball", "cage"]), numbers),
            },
        )
    )
    effects = tuple(draw(st.lists(st.sampled_from(sorted(catalogue())), unique=True, max_size=4)))
    lo = draw(st.floats(-1e6, 1e6))
    intervals = draw(st.sampled_from([{}, {"resonance_hz": (lo, lo + 1.5)}, {"impact_amplitude.inner": (lo, lo)}]))
    identified = draw(st.none() | st.builds(Provenance, records_sha256=names, notes=st.lists(names).map(tuple)))
    bearing = draw(st.none() | st.sampled_from([*BEARINGS.values(), Bearing('a "b" \x7f\\ü', 9, 7.94, 39.04)]))
    return TwinSpec("phenomenological", effects, None, parameters, bearing, intervals, identified)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(spec=specs())
def test_written_is_read_back(tmp_path: Path, spec: TwinSpec) -> None:
    path = tmp_path / "a twin.toml"
    write_twin(path, spec)
    assert read_twin(path) == spec


WRONG = {
    "empty": ("", r"\[twin\] is missing"),
    "no model": ("[twin]\n", "'model' is missing"),
    "model of another type": ("[twin]\nmodel = 3\n", "model: 3 found"),
    "unknown model": ('[twin]\nmodel = "magic"\n', "'magic' found.*phenomenological, contact"),
    "unknown key": (HEAD + 'efects = ["slip_jitter"]\n', "unknown key 'efects'"),
    "unknown table": (HEAD + "[parametres]\n", "unknown key 'parametres'.*known tables"),
    "table that is none": ("twin = 3\n", "3 found, a table expected"),
    "effects as text": (HEAD + 'effects = "slip_jitter"\n', "effects: 'slip_jitter' found, a list"),
    "unknown effect": (HEAD + 'effects = ["slip"]\n', "unknown effect 'slip'.*slip_jitter"),
    "effect twice": (HEAD + 'effects = ["load_zone", "load_zone"]\n', "'load_zone' is named twice"),
    "preset without presets": (HEAD + 'preset = "paper"\n', "preset: 'paper' found, no preset"),
    "unknown preset": ('[twin]\nmodel = "contact"\npreset = "papre"\n', "'papre' found, one of 'paper', 'physical'"),
    "text for a number": (HEAD + '[parameters]\nresonance_hz = "3 kHz"\n', "resonance_hz: '3 kHz' found"),
    "truth for a number": (HEAD + "[parameters]\nresonance_hz = true\n", "resonance_hz: True found"),
    "nan": (HEAD + "[parameters]\nresonance_hz = nan\n", "resonance_hz: nan found, a finite number"),
    "infinite": (HEAD + "[parameters]\nresonance_hz = inf\n", "resonance_hz: inf found, a finite number"),
    "huge": (HEAD + f"[parameters]\nresonance_hz = 1{'0' * 400}\n", "resonance_hz: a number beyond 1e300"),
    "endless": (HEAD + f"[parameters]\nresonance_hz = 1{'0' * 5000}\n", "not valid TOML"),
    "date": (HEAD + "[parameters]\nresonance_hz = 1979-05-27\n", r"resonance_hz: datetime.date"),
    "negative": (HEAD + "[parameters]\nresonance_hz = -3\n", r"resonance_hz = -3.0, a positive number"),
    "damping above one": (HEAD + "[parameters]\ndamping_ratio = 1.5\n", "damping_ratio = 1.5, below 1"),
    "unknown parameter": (HEAD + "[parameters]\nresonance = 3\n", "unknown parameter 'resonance'.*resonance_hz"),
    "number for a table": (HEAD + "[parameters]\nimpact_amplitude = 3\n", "impact_amplitude: 3 found, a table"),
    "unknown fault": (HEAD + "[parameters.impact_amplitude]\niner = 3\n", "unknown key 'iner'.*inner, outer"),
    "table for a number": (HEAD + "[parameters.impact_amplitude.inner]\nx = 3\n", "inner: {'x': 3} found"),
    "effect not named": (HEAD + "[parameters.slip_jitter]\n", "'slip_jitter' has parameters but is not among"),
    "unknown parameter of an effect": (
        HEAD + 'effects = ["slip_jitter"]\n[parameters.slip_jitter]\nsgma = 1\n',
        "slip_jitter.*unknown key 'sgma'",
    ),
    "effect as number": (HEAD + 'effects = ["slip_jitter"]\n[parameters]\nslip_jitter = 1\n', "1 found, a table"),
    "half a bearing": (HEAD + '[bearing]\nname = "x"\n', r"\[bearing\].*'n_rollers' is missing"),
    "impossible bearing": (
        HEAD + '[bearing]\nname = "x"\nn_rollers = 2\nroller_diameter_mm = 3.0\npitch_diameter_mm = 9.0\n',
        "n_rollers = 2",
    ),
    "interval upside down": (HEAD + "[intervals]\nresonance_hz = [2, 1]\n", r"resonance_hz: \[2.0, 1.0\] found"),
    "interval of one": (HEAD + "[intervals]\nresonance_hz = [2]\n", r"resonance_hz: \[2\] found, \[lo, hi\]"),
    "interval of nothing": (HEAD + "[intervals]\nfoo = [1, 2]\n", "unknown parameter 'foo'"),
    "unknown provenance": (HEAD + "[identified]\nwhen = 3\n", "unknown key 'when'"),
    "no TOML": ("[twin\n", "not valid TOML"),
}


@pytest.mark.parametrize(("text", "says"), WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_named(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(TwingapError, match=says) as caught:
        reading(tmp_path, text)
    line = str(caught.value)
    assert "zwölf twins.toml" in line and "\n" not in line


def test_places_that_cannot_be_read(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "nowhere.toml"):
        with pytest.raises(TwingapError, match=path.name):
            read_twin(path)
    (tmp_path / "latin.toml").write_bytes(b'[twin]\nmodel = "\xe4"\n')
    with pytest.raises(TwingapError, match="UTF-8"):
        read_twin(tmp_path / "latin.toml")


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.data())
def test_any_table_gives_a_twin_or_one_line(tmp_path: Path, data: st.DataObject) -> None:
    """A value anywhere in a good file is replaced by anything, or anything is added."""
    good = TwinSpec(
        "phenomenological", ("slip_jitter",), None, {"resonance_hz": 3e3, "impact_amplitude": {"inner": 1.0}},
        BEARINGS["6205"], {"resonance_hz": (2.9e3, 3.1e3)}, Provenance("00"),
    )  # fmt: skip
    tables = tables_of(good)
    table = data.draw(st.sampled_from(sorted(tables)))
    if data.draw(st.booleans()):
        tables[table] = dict(tables[table])
        key = data.draw(st.sampled_from(sorted(tables[table])) | st.text(max_size=8))
        tables[table][key] = data.draw(values)
    else:
        tables[data.draw(st.sampled_from([table, "other"]))] = data.draw(values)
    path = tmp_path / "fuzz.toml"
    try:
        path.write_text(to_toml(_without_none(tables)), encoding="utf-8")
    except TypeError:
        return  # not TOML at all
    try:
        spec = read_twin(path)
    except TwingapError as error:
        assert "fuzz.toml" in str(error) and "\n" not in str(error)
    else:
        build_twin(spec, BEARINGS["6205"])
        write_twin(path, spec)
        assert read_twin(path) == spec


def _without_none(value: object) -> object:
    if isinstance(value, dict):
        return {k: _without_none(v) for k, v in value.items() if v is not None}
    if isinstance(value, (list, tuple)):
        return [_without_none(v) for v in value if v is not None]
    return value


def test_simulating_from_a_file_equals_simulating_from_code(tmp_path: Path) -> None:
    conditions = [Condition("a", 1797.0, 12000.0, 512, "inner")]
    spec = reading(tmp_path, HEAD + "[parameters]\nscale = 0.5\nresonance_hz = 2500\n")
    one = build_twin(spec, BEARINGS["6205"]).simulate(conditions, np.random.default_rng(3))
    own = PhenomenologicalParameters(resonance_hz=2500.0, scale=0.5)
    other = PhenomenologicalTwin(BEARINGS["6205"], own).simulate(conditions, np.random.default_rng(3))
    assert np.array_equal(one[0].samples, other[0].samples)
    assert math.isclose(build_twin(spec, BEARINGS["6205"]).reference_rms, 0.5)


def test_another_bearing_than_the_records_is_said_and_a_name_alone_is_none() -> None:
    spec = TwinSpec("phenomenological", bearing=Bearing("mine", 12, 7.94, 39.04))
    assert "12 rollers of 7.94 on 39.04 mm" in (overruled(spec, BEARINGS["6205"]) or "")
    assert overruled(spec, Bearing("theirs", 12, 7.94, 39.04)) is None
    assert overruled(spec, None) is None and overruled(TwinSpec("contact"), BEARINGS["6205"]) is None


def test_a_scale_that_was_identified_in_one_unit_is_converted_for_records_in_another() -> None:
    known = TwinSpec(
        "phenomenological", parameters={"scale": 2.0, "damping_ratio": 0.03}, intervals={"scale": (1.0, 3.0)},
        identified=Provenance(unit="g"),
    )  # fmt: skip
    there = in_unit(known, "m/s^2")
    assert there.parameters == {"scale": pytest.approx(2 * 9.80665), "damping_ratio": 0.03}
    assert there.intervals["scale"] == pytest.approx((9.80665, 3 * 9.80665)) and there.identified is not None
    assert there.identified.unit == "m/s^2" and in_unit(there, "g").parameters["scale"] == pytest.approx(2.0)
    for spec, unit in ((known, "g"), (known, ""), (dataclasses.replace(known, identified=None), "m/s^2")):
        assert in_unit(spec, unit) is spec


def test_a_contact_twin_that_leaves_its_scale_open_is_scaled_for_the_unit_wanted() -> None:
    spec, conditions = TwinSpec("contact", (), "physical"), [Condition("a", 1797.0, 12000.0, 512, "inner")]
    scaled, told = scaled_for(spec, "g")
    assert told is not None and "0.102 leads from its m/s^2 to the records' g" in told
    in_m_s2, in_g = (
        build_twin(each, BEARINGS["6205"], unit).simulate(conditions, np.random.default_rng(3))[0].samples
        for each, unit in ((spec, "m/s^2"), (scaled, "g"))
    )
    assert np.allclose(in_m_s2, 9.80665 * in_g)
    same, told = scaled_for(spec, "")
    assert same is spec and told is not None and "in m/s^2" in told
    given = dataclasses.replace(spec, parameters={"scale": 0.5})
    known = dataclasses.replace(spec, identified=Provenance(unit="g"))
    for each, unit in ((spec, "m/s^2"), (given, "g"), (known, "g"), (TwinSpec("phenomenological"), "g")):
        assert scaled_for(each, unit) == (each, None)
