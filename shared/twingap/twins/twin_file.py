"""Twin files: the modelled part of a machine, in TOML.

::

    [twin]
    model = "phenomenological"              # or "contact", or a registered model (`register_model`)
    preset = "paper"                        # optional; contact: "paper" or "physical"
    effects = ["slip_jitter", "load_zone"]  # effects that the twin already has

    [parameters]                            # optional fixed values; absent ones are identified from the records
    resonance_hz = 3400.0
    [parameters.impact_amplitude]           # one value per fault
    inner = 1.5
    [parameters.slip_jitter]                # parameters of an effect
    sigma = 0.02

    [bearing]                               # optional; used for records without a geometry
    name = "6205"
    n_rollers = 9
    roller_diameter_mm = 7.94
    pitch_diameter_mm = 39.04

    [intervals]                             # written by identification: parameter = [lo, hi]
    [identified]                            # written by identification: provenance of the values
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from twingap.bearing import Bearing
from twingap.config import build, read_toml, to_toml
from twingap.effects import Effect, catalogue, make_effect
from twingap.effects.registry import OWN_MODELS
from twingap.errors import TwingapError
from twingap.files import replacing
from twingap.twins.base import Twin

Parameters = Mapping[str, Any]
"""Parameter -> number, or table of numbers (impact amplitude per fault, parameters of an effect)."""

EMPTY: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Model:
    """Twin model that twin files can name.

    Parameters
    ----------
    name : str
        Name for ``[twin] model``.
    parameters : type
        Frozen dataclass of its parameters, every field with a default: numbers, and ``dict[str, float]`` where there
        is one number per fault. Its ``__post_init__`` raises `TwingapError` for invalid values.
    build : callable
        ``build(parameters, bearing, effects, unit) -> Twin``.
    presets : Mapping[str, parameters]
        Parameters by name for ``[twin] preset``.
    unit : {"m/s^2", "g", ""}
        Unit of its samples at a `scale` of 1; "" where amplitudes are relative.
    """

    name: str
    parameters: type[Any]
    build: Callable[[Any, Bearing, tuple[Effect, ...], str], Twin]
    presets: Mapping[str, Any] = field(default_factory=lambda: EMPTY)
    unit: str = ""


MODELS: dict[str, Model] = {}
"""Built-in models by name."""


def register_model(model: Model) -> Model:
    """Register a model of the user's own for twin files; it replaces an earlier one of the same name."""
    OWN_MODELS[model.name] = model
    return model


@dataclass(frozen=True)
class Provenance:
    """Provenance of identified values: table ``[identified]``.

    Parameters
    ----------
    records_sha256 : str
        Digest of the records used.
    unit : str
        Of those records: the unit that amplitudes and scale are in.
    level : float
        Coverage that the intervals claim.
    version : str
        Version of twingap.
    method : str
        How the resonance was found.
    seed : int
        Seed of the run, -1 when a generator was passed in.
    notes : tuple[str, ...]
        What could not be identified, and what was done instead.
    """

    records_sha256: str = ""
    unit: str = "m/s^2"
    level: float = 0.9
    version: str = ""
    method: str = ""
    seed: int = -1
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class TwinSpec:
    """Content of a twin file.

    Parameters
    ----------
    model : str
        Name of a registered `Model`.
    effects : tuple[str, ...]
        Effects beyond the baseline, by name.
    preset : str or None
        Starting point of the defaults.
    parameters : Mapping
        Values that the file gives; what is absent is free.
    bearing : Bearing or None
        Geometry for records that bring none.
    intervals : Mapping[str, (float, float)]
        Parameter (dotted for one within a table: ``impact_amplitude.inner``) -> interval.
    identified : Provenance or None
        Where identified values come from; None before identification.

    Raises
    ------
    TwingapError
        For an unknown model, preset, effect or parameter, and for values out of range.
    """

    model: str
    effects: tuple[str, ...] = ()
    preset: str | None = None
    parameters: Parameters = field(default_factory=lambda: EMPTY)
    bearing: Bearing | None = None
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=lambda: EMPTY)
    identified: Provenance | None = None

    def __post_init__(self) -> None:
        _check(self, "twin")

    def given(self, name: str) -> bool:
        """Whether the file states this parameter (dotted name within tables)."""
        return name in flat(self.parameters)

    def with_values(
        self, values: Mapping[str, float], intervals: Mapping[str, tuple[float, float]], identified: Provenance
    ) -> TwinSpec:
        """The same twin with these parameters (dotted names); intervals of others are kept."""
        merged = nested({**flat(self.parameters), **values})
        kept = {name: ends for name, ends in self.intervals.items() if name not in values}
        return dataclasses.replace(self, parameters=merged, intervals=kept | dict(intervals), identified=identified)


@dataclass(frozen=True)
class _TwinTable:
    """Table [twin]."""

    model: str
    effects: tuple[str, ...] = ()
    preset: str | None = None


def read_twin(path: str | os.PathLike[str]) -> TwinSpec:
    """Read a twin file.

    Raises
    ------
    TwingapError
        Naming file, key, value and what was expected.
    """
    tables = read_toml(path)
    known = ("twin", "parameters", "bearing", "intervals", "identified")
    for name, value in tables.items():
        if name not in known:
            raise TwingapError(f"unknown key {name!r}", where=path, mend=f"known tables: {', '.join(known)}")
        if not isinstance(value, Mapping):
            raise TwingapError(f"{value!r} found, a table expected", where=f"{path}: {name}", mend=f"write [{name}]")
        _check_numbers(value, f"{path}: [{name}]")
    if "twin" not in tables:
        raise TwingapError("table [twin] is missing", where=path, mend='add [twin] with model = "phenomenological"')
    twin = build(_TwinTable, tables["twin"], f"{path}: [twin]")
    with _located(path):
        bearing = build(Bearing, tables["bearing"], f"{path}: [bearing]") if "bearing" in tables else None
        identified = (
            build(Provenance, tables["identified"], f"{path}: [identified]") if "identified" in tables else None
        )
        intervals = {
            name: _interval(value, f"{path}: [intervals] {name}")
            for name, value in flat(tables.get("intervals", {})).items()
        }
        return TwinSpec(
            twin.model, twin.effects, twin.preset, tables.get("parameters", {}), bearing, intervals, identified
        )


def write_twin(path: str | os.PathLike[str], spec: TwinSpec) -> None:
    """Write a twin file atomically; `read_twin` returns the same spec."""
    with replacing(path) as temporary:
        temporary.write_text(to_toml(tables_of(spec)), encoding="utf-8", newline="\n")


def build_twin(spec: TwinSpec, bearing: Bearing | None = None, unit: str = "m/s^2") -> Twin:
    """Twin from a spec; parameters that it does not state have their defaults.

    Parameters
    ----------
    spec : TwinSpec
    bearing : Bearing or None
        Geometry of the records, which has priority over that of the spec.
    unit : {"m/s^2", "g", ""}
        Unit of the samples to simulate. Without a stated `scale` its default is used for every unit; `scaled_for`
        converts it.

    Returns
    -------
    Twin

    Raises
    ------
    TwingapError
        When neither the records nor the spec bring a geometry.
    """
    bearing = bearing or spec.bearing
    if bearing is None:
        raise TwingapError(
            "the bearing's geometry is not known",
            where="twin",
            mend="add a [bearing] table to recordset.toml or to the twin file",
        )
    model = model_of(spec)
    effects = tuple(make_effect(name, spec.parameters.get(name), "twin") for name in spec.effects)
    return model.build(model_parameters(spec), bearing, effects, unit)


STANDARD_GRAVITY: Final = 9.80665
"""m/s^2."""
_IN_M_S2: Final = MappingProxyType({"m/s^2": 1.0, "g": STANDARD_GRAVITY})


def in_unit(spec: TwinSpec, unit: str) -> TwinSpec:
    """Spec of an identified twin for records in another unit, with `scale` and its interval converted.

    Parameters
    ----------
    spec : TwinSpec
        As it is returned where nothing was identified, where the units agree, or where either is not known.
    unit : str
        Of the records.
    """
    own = None if spec.identified is None else spec.identified.unit
    if own is None or own == unit or not {own, unit} <= _IN_M_S2.keys():
        return spec
    factor = _IN_M_S2[own] / _IN_M_S2[unit]
    values, intervals = flat(spec.parameters), dict(spec.intervals)
    if "scale" in values:
        values["scale"] *= factor
    if "scale" in intervals:
        intervals["scale"] = (intervals["scale"][0] * factor, intervals["scale"][1] * factor)
    assert spec.identified is not None
    return spec.with_values(values, intervals, dataclasses.replace(spec.identified, unit=unit))


def scaled_for(spec: TwinSpec, unit: str) -> tuple[TwinSpec, str | None]:
    """Spec of a twin without a stated scale, with the scale of a unit, and a note on it.

    Parameters
    ----------
    spec : TwinSpec
        Returned unchanged where it states `scale`, where it was identified (in a unit, see `in_unit`), and where
        amplitudes of the model are relative.
    unit : {"m/s^2", "g", ""}
        Unit of the samples to simulate.

    Returns
    -------
    TwinSpec
    str or None
        A note for the user, or None.
    """
    own = model_of(spec).unit
    if own == unit or not own or spec.identified is not None or spec.given("scale"):
        return spec, None
    if unit not in _IN_M_S2:
        return spec, f"the unit of the records is not known: the samples of this {spec.model} twin are in {own}"
    scale = model_parameters(spec).scale * _IN_M_S2[own] / _IN_M_S2[unit]
    note = f"the twin gives no scale: {scale:.4g} leads from its {own} to the records' {unit}"
    return dataclasses.replace(spec, parameters={**spec.parameters, "scale": scale}), note


def overruled(spec: TwinSpec, bearing: Bearing | None, whose: str = "twin file") -> str | None:
    """Note where the geometry of the records, which is used, differs from that of the spec; else None."""
    if bearing is None or spec.bearing is None:
        return None
    ours, theirs = (
        (b.n_rollers, b.roller_diameter_mm, b.pitch_diameter_mm, b.contact_angle_deg) for b in (spec.bearing, bearing)
    )
    if ours == theirs:
        return None
    return (
        f"the {whose}'s bearing ({ours[0]} rollers of {ours[1]:g} on {ours[2]:g} mm) is not that of the records "
        f"({theirs[0]} of {theirs[1]:g} on {theirs[2]:g} mm): the records' is used"
    )


def model_of(spec: TwinSpec) -> Model:
    """Registered model of a spec.

    Raises
    ------
    TwingapError
        When no model of that name is registered.
    """
    _load_built_in_models()
    known: dict[str, Model] = {**MODELS, **OWN_MODELS}
    if spec.model not in known:
        catalogue()  # installed packages may bring models
        known.update(OWN_MODELS)
    if spec.model not in known:
        raise TwingapError(
            f"{spec.model!r} found, a known model expected",
            where="[twin] model",
            mend=f"use one of {', '.join(known)}; for a function of your own, name the Python file that registers it "
            "(--effects FILE.py, or load_effects in Python)",
        )
    return known[spec.model]


def model_parameters(spec: TwinSpec) -> Any:
    """Parameters of the model: preset or defaults, with the values of the spec.

    Raises
    ------
    TwingapError
        For an unknown preset, parameter or key, and for a value of another type or out of range.
    """
    model = model_of(spec)
    if spec.preset is not None and spec.preset not in model.presets:
        names = ", ".join(repr(name) for name in model.presets)
        raise TwingapError(
            f"{spec.preset!r} found, {f'one of {names}' if names else 'no preset'} expected",
            where="[twin] preset",
            mend=None if names else f"leave it out: model {model.name!r} has no presets",
        )
    start = model.parameters() if spec.preset is None else model.presets[spec.preset]
    defaults = {f.name: getattr(start, f.name) for f in dataclasses.fields(start) if f.init}
    table = dict(defaults)
    for name, value in spec.parameters.items():
        if name in spec.effects:
            continue
        if name not in defaults:
            raise _unknown_parameter(name, spec, defaults)
        default = defaults[name]
        if isinstance(default, Mapping):
            if not isinstance(value, Mapping):
                raise TwingapError(
                    f"{value!r} found, a table expected",
                    where=f"[parameters] {name}",
                    mend=f"write [parameters.{name}] with {', '.join(default)}",
                )
            for key in value:
                if key not in default:
                    raise TwingapError(
                        f"unknown key {key!r}", where=f"[parameters.{name}]", mend=f"known keys: {', '.join(default)}"
                    )
            table[name] = {**default, **value}
        else:
            table[name] = value
    return build(model.parameters, {k: v for k, v in table.items() if v is not None}, "[parameters]")


def _unknown_parameter(name: str, spec: TwinSpec, defaults: Mapping[str, Any]) -> TwingapError:
    if name in catalogue():
        return TwingapError(
            f"effect {name!r} has parameters but is not among the twin's effects",
            where=f"[parameters.{name}]",
            mend=f"add {name!r} to effects, or remove the table",
        )
    known = ", ".join((*defaults, *spec.effects))
    return TwingapError(f"unknown parameter {name!r}", where="[parameters]", mend=f"known parameters: {known}")


def _check(spec: TwinSpec, where: object) -> None:
    """Raise for a spec that cannot be built; needs no bearing."""
    seen: set[str] = set()
    for name in spec.effects:
        if name in seen:
            raise TwingapError(f"effect {name!r} is named twice", where="[twin] effects", mend="name it once")
        seen.add(name)
        given = spec.parameters.get(name, {})
        if not isinstance(given, Mapping):
            raise TwingapError(
                f"{given!r} found, a table expected", where=f"[parameters] {name}", mend=f"write [parameters.{name}]"
            )
        make_effect(name, given, "[parameters]" if name in catalogue() else "[twin] effects")
    parameters = model_parameters(spec)
    if not spec.intervals:
        return
    known = flat(dataclasses.asdict(parameters))
    known |= {f"{n}.{f.name}": 0 for n in seen for f in dataclasses.fields(catalogue()[n])}  # type: ignore[arg-type]
    for name, (lo, hi) in spec.intervals.items():
        if name not in known:
            raise TwingapError(f"unknown parameter {name!r}", where="[intervals]", mend="remove it")
        if not lo <= hi:
            raise TwingapError(f"[{lo!r}, {hi!r}] found, lo <= hi expected", where=f"[intervals] {name}")


def _check_numbers(value: Any, where: str) -> None:
    """Raise for numbers that are not finite, and for integers too large for floating point."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            _check_numbers(item, f"{where} {key}")
    elif isinstance(value, list):
        for item in value:
            _check_numbers(item, where)
    elif isinstance(value, (int, float)) and not abs(value) < 1e300:
        shown = f"{value!r}" if isinstance(value, float) else "a number beyond 1e300"
        raise TwingapError(f"{shown} found, a finite number expected", where=where)


def _interval(value: Any, where: str) -> tuple[float, float]:
    if (
        isinstance(value, (list, tuple))
        and len(value) == 2
        and all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value)
    ):
        return float(value[0]), float(value[1])
    raise TwingapError(f"{value!r} found, [lo, hi] expected", where=where)


@contextmanager
def _located(path: str | os.PathLike[str]) -> Iterator[None]:
    """Add the file to errors that do not name it."""
    try:
        yield
    except TwingapError as error:
        place = str(Path(path))
        if place in str(error):
            raise
        inner = str(error.where or "")
        where = f"{place}: {inner}" if inner else place
        raise TwingapError(error.what, where=where, mend=error.mend) from error


def flat(table: Mapping[str, Any]) -> dict[str, Any]:
    """Table with one level of nesting as dotted names."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            out.update({f"{key}.{name}": item for name, item in value.items()})
        else:
            out[key] = value
    return out


def nested(dotted: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted names as a table with one level of nesting."""
    out: dict[str, Any] = {}
    for key, value in dotted.items():
        outer, _, inner = key.partition(".")
        if inner:
            out.setdefault(outer, {})[inner] = value
        else:
            out[outer] = value
    return out


def tables_of(spec: TwinSpec) -> dict[str, Any]:
    """Tables of a twin file from a spec, without absent values."""
    tables: dict[str, Any] = {"twin": {"model": spec.model, "preset": spec.preset, "effects": spec.effects}}
    if spec.parameters:
        tables["parameters"] = dict(spec.parameters)
    if spec.bearing is not None:
        tables["bearing"] = dataclasses.asdict(spec.bearing)
    if spec.intervals:
        tables["intervals"] = nested(spec.intervals)
    if spec.identified is not None:
        tables["identified"] = dataclasses.asdict(spec.identified)
    return tables


def _load_built_in_models() -> None:
    """Register the built-in models on first use, so that reading a twin file compiles nothing."""
    if "phenomenological" not in MODELS:
        from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

        MODELS["phenomenological"] = Model(
            "phenomenological",
            PhenomenologicalParameters,
            lambda parameters, bearing, effects, unit: PhenomenologicalTwin(bearing, parameters, effects, unit),
        )
    if "contact" not in MODELS:
        from twingap.twins.contact import ContactTwin
        from twingap.twins.contact_parameters import PRESETS, ContactParameters

        MODELS["contact"] = Model(
            "contact",
            ContactParameters,
            lambda parameters, bearing, effects, unit: ContactTwin(bearing, parameters, effects, unit),
            PRESETS,
            "m/s^2",
        )


def all_parameters(spec: TwinSpec) -> dict[str, Any]:
    """Parameters of the model, including defaults."""
    return dataclasses.asdict(model_parameters(spec))
