"""Registry of effects: those that ship with twingap, and a user's own.

A user's own effects come from three places: `register` in Python, a file (`load_effects`; ``--effects FILE.py`` on the
command line), and installed packages that name a module in the entry point group ``twingap.effects``. Files and
packages may also register twin models, such as functions (`twins.register_callable`).
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import importlib.metadata
import inspect
import linecache
import os
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Final, TypeVar

from twingap.bearing import FAULTS
from twingap.config import build
from twingap.effects.base import Effect, Stage, effect_name, snake_case
from twingap.effects.by_state import UNITS, State, by_state
from twingap.errors import TwingapError, one_of
from twingap.files import open_text

__all__ = [
    "EffectFile",
    "catalogue",
    "effect_name",
    "in_order",
    "irregular_impacts",
    "load_effects",
    "look_alikes",
    "make_effect",
    "measured_from_spectra",
    "register",
    "trainable",
]

E_ = TypeVar("E_", bound=type[Effect])

ENTRY_POINTS: Final = "twingap.effects"
"""Entry point group of packages that bring effects."""

_SHIPPED: dict[str, type[Effect]] = {}
_OWN: dict[str, type[Effect]] = {}
OWN_MODELS: Final[dict[str, Any]] = {}
"""Twin models of a user's own by name; `twins.register_model` adds them."""
_FILES: dict[str, tuple[EffectFile, dict[str, type[Effect]], dict[str, Any]]] = {}
"""Loaded files by name of the module that was made of them, with the effects and models that they registered."""


@dataclass(frozen=True)
class EffectFile:
    """A user's file of effects, of twin models, or of both.

    Parameters
    ----------
    path : str
        Where it was read.
    text : str
        Its source text, from which it can be loaded where the file is not.
    """

    path: str
    text: str

    @property
    def module(self) -> str:
        """Name of its module, one for each text, so that an edited file is another module."""
        return f"twingap_effects_{hashlib.sha256(self.text.encode()).hexdigest()[:16]}"


def register(kind: E_) -> E_:
    """Class decorator: make an effect known by its name.

    A later registration replaces an earlier one of the same name, unless that one ships with twingap.

    Raises
    ------
    TwingapError
        For a class that is no complete effect, or has the name of an effect that ships with twingap.
    """
    _check(kind)
    name = snake_case(kind)
    if kind.__module__.startswith("twingap.effects."):
        _SHIPPED[name] = kind
    elif name not in _SHIPPED:
        _OWN[name] = kind
    elif _SHIPPED[name] is not kind:
        raise TwingapError(f"effect {name} ships with twingap already", mend="give the class another name")
    kind._registered = True
    return kind


def catalogue() -> dict[str, type[Effect]]:
    """All known effects by name, in the order of their stages, then of registration, a user's own last."""
    _load_entry_points()
    return dict(_in_order_of_stages((*_SHIPPED.items(), *_OWN.items())))


@functools.lru_cache(maxsize=4)
def _in_order_of_stages(kinds: tuple[tuple[str, type[Effect]], ...]) -> Mapping[str, type[Effect]]:
    """Effects by name, in the order of their stages; kept, as every twin that is made reads the catalogue."""
    return dict(sorted(kinds, key=lambda item: item[1].stage))


def trainable() -> dict[str, type[Effect]]:
    """The effects of the catalogue for which detectors and estimators are trained."""
    return {name: kind for name, kind in catalogue().items() if kind.trained}


def measured_from_spectra() -> tuple[str, ...]:
    """Names of the effects whose profiles are measured from spectra, in the order of the catalogue."""
    return tuple(name for name, kind in catalogue().items() if kind.measured)


def irregular_impacts() -> tuple[Mapping[str, Mapping[str, float]], ...]:
    """Kinds of irregular impacts that effects of the catalogue make, those of fewest effects first."""
    kinds = (one for kind in catalogue().values() for one in kind.irregular_impacts)
    return tuple(sorted(kinds, key=lambda one: (len(one), sorted(one))))


def look_alikes(name: str) -> tuple[str, ...]:
    """Effects that this one is most easily taken for: those that it names, and those that name it."""
    known = catalogue()
    return tuple(
        dict.fromkeys((*known[name].look_alikes, *(n for n, kind in known.items() if name in kind.look_alikes)))
    )


def own_effects() -> dict[str, type[Effect]]:
    """The effects that do not ship with twingap, by name, in the order of registration."""
    _load_entry_points()
    return dict(_OWN)


def make_effect(name: str, parameters: Mapping[str, float] | None = None, where: object = None) -> Effect:
    """An effect by its name, with its default parameters except for those given.

    A table named by a fault holds the values of records with that fault, its tables of units those of single bearings
    (`by_state`).

    Raises
    ------
    TwingapError
        For an unknown effect or parameter, or a value out of range.
    """
    known = catalogue()
    kind = known.get(name)
    if kind is None:
        raise TwingapError(f"unknown effect {name!r}", where=where, mend=one_of(name, known, "effects"))
    own: dict[str, Any] = dict(parameters or {})
    place = f"{where}: {name}" if where is not None else f"effect {name}"
    tables = {fault: dict(own.pop(fault)) for fault in FAULTS if isinstance(own.get(fault), Mapping)}
    base = build(kind, own, place)
    states: dict[State, Effect] = {}
    for fault, table in tables.items():
        units = table.pop(UNITS, {})
        states[State(fault)] = build(kind, {**own, **table}, f"{place}.{fault}")
        if not isinstance(units, Mapping):
            raise TwingapError(f"{units!r} found, a table expected", where=f"{place}.{fault}.{UNITS}")
        for unit, values in units.items():
            if not isinstance(values, Mapping):
                where = f"{place}.{fault}.{UNITS}.{unit}"
                raise TwingapError(f"{values!r} found, a table expected", where=where)
            states[State(fault, unit)] = build(kind, {**own, **table, **values}, f"{place}.{fault}.{UNITS}.{unit}")
    return by_state(base, states)


def in_order(effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """The effects in the order in which they act, whatever the order in which they were named."""
    order = {name: place for place, name in enumerate(catalogue())}
    return tuple(sorted(effects, key=lambda effect: (effect.stage, order.get(effect.name, len(order)))))


def load_effects(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Import a Python file that registers effects or twin models.

    The file stands alone: it may import installed packages, not its neighbours, so that worker processes and clusters
    can load it from its text. Loaded again after an edit, its effects replace the earlier ones.

    Parameters
    ----------
    path : path-like
        A Python file that calls `register`, or `twins.register_callable`.

    Returns
    -------
    tuple of str
        Names of the effects that it registered.

    Raises
    ------
    TwingapError
        When the file cannot be read or run, registers nothing, or registers what is no effect of the user's own.
    """
    with open_text(path) as stream:
        text = stream.read()
    return tuple(load_file(EffectFile(os.fspath(Path(path).absolute()), text)))


def load_file(file: EffectFile) -> dict[str, type[Effect]]:
    """Register effects and models of a file from its text, and return its effects by name; see `load_effects`."""
    before, models_before = dict(_OWN), dict(OWN_MODELS)
    # What an earlier version of the file registered goes.
    earlier = [model for known, _, models in _FILES.values() if known.path == file.path for model in models.values()]
    other_models = {name: model for name, model in models_before.items() if not any(model is one for one in earlier)}
    others = {
        name: kind for name, kind in before.items() if (known := file_of(kind)) is None or known.path != file.path
    }
    if file.module in _FILES:
        _, kinds, models = _FILES[file.module]
        replace_own({**others, **kinds})
        _replace_models({**other_models, **models})
        return dict(kinds)
    _OWN.clear()
    OWN_MODELS.clear()
    module = ModuleType(file.module)
    module.__file__ = file.path
    # Tracebacks and `inspect.getsource` find the text that runs, also where the file is not or has been edited since.
    linecache.cache[file.path] = (len(file.text), None, file.text.splitlines(keepends=True), file.path)
    sys.modules[file.module] = module
    try:
        exec(compile(file.text, file.path, "exec", dont_inherit=True), vars(module))
        kinds, models = dict(_OWN), dict(OWN_MODELS)
        if not (kinds or models):
            mend = (
                "put @register (from twingap.effects) above each effect's class, or call register_callable (from "
                "twingap.twins) for a simulator"
            )
            raise TwingapError("registers no effect or simulator of its own", where=file.path, mend=mend)
        replace_own({**others, **kinds})
        _replace_models({**other_models, **models})
    except BaseException as error:
        del sys.modules[file.module]
        replace_own(before)
        _replace_models(models_before)
        if isinstance(error, (Exception, SystemExit)):
            raise _located(error, file) from error
        raise
    _FILES[file.module] = file, kinds, models
    return dict(kinds)


def files_of_models() -> tuple[EffectFile, ...]:
    """The loaded files that twin models were registered in."""
    return tuple(
        file for file, _, models in _FILES.values() if any(OWN_MODELS.get(n) is model for n, model in models.items())
    )


def file_of(kind: type[Effect]) -> EffectFile | None:
    """The loaded file that an effect was defined in."""
    return _FILES[kind.__module__][0] if kind.__module__ in _FILES else None


def replace_own(kinds: Mapping[str, type[Effect]]) -> None:
    """Know these effects of a user's own, in this order, and no others."""
    _OWN.clear()
    _OWN.update(kinds)


def _replace_models(models: Mapping[str, Any]) -> None:
    OWN_MODELS.clear()
    OWN_MODELS.update(models)


def _located(error: BaseException, file: EffectFile) -> TwingapError:
    """What went wrong in a user's file, and in which line."""
    if isinstance(error, TwingapError) and error.where == file.path:
        return error
    if isinstance(error, SyntaxError) and error.filename == file.path:
        return TwingapError(f"syntax error: {error.msg}", where=f"{file.path}: line {error.lineno}")
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file.path]
    where = f"{file.path}: line {lines[-1]}" if lines else file.path
    if isinstance(error, TwingapError):
        return TwingapError(error.what, where=where, mend=error.mend)
    what, mend = f"{type(error).__name__}: {error}", None
    if isinstance(error, ModuleNotFoundError) and Path(file.path).with_name(f"{error.name}.py").exists():
        mend = "files beside it are not found: put what it needs into it, or install them as a package"
    return TwingapError(what, where=where, mend=mend)


def _check(kind: object) -> None:
    """Raise an error for a class that is not a complete effect, naming what it lacks."""
    if not (isinstance(kind, type) and issubclass(kind, Effect)):
        raise TwingapError(f"{getattr(kind, '__name__', kind)} is not a subclass of Effect")
    lacks = None
    if not isinstance(getattr(kind, "stage", None), Stage):
        lacks = "stage: add  stage: ClassVar[Stage] = Stage.DISTURBANCE"
    elif inspect.isabstract(kind):
        lacks = "apply: add  def apply(self, draft: Draft, rng: np.random.Generator) -> None"
    elif not dataclasses.is_dataclass(kind):
        lacks = "parameters: put @dataclass(frozen=True) between @register and the class"
    else:
        for field in dataclasses.fields(kind):
            if "plausible" not in field.metadata and "profile" not in field.metadata:
                lacks = f"range for {field.name}: write  {field.name}: float = parameter(...)"
    if lacks is not None:
        raise TwingapError(f"{kind.__name__} has no {lacks}")


_entry_points_loaded = False


def without_entry_points() -> None:
    """Leave out installed packages: in a worker process those of the process count that the work comes from."""
    global _entry_points_loaded
    _entry_points_loaded = True


def _load_entry_points() -> None:
    """Register the effects of installed packages, once."""
    global _entry_points_loaded
    if _entry_points_loaded:
        return
    _entry_points_loaded = True  # a package may read the catalogue while it is imported
    for point in importlib.metadata.entry_points(group=ENTRY_POINTS):
        try:
            found = point.load()
            if isinstance(found, type):
                register(found)
        except Exception as error:
            _entry_points_loaded = False
            package = point.dist.name if point.dist is not None else point.value
            what = error.what if isinstance(error, TwingapError) else f"{type(error).__name__}: {error}"
            mend = "mend the package or uninstall it"
            raise TwingapError(f"effects cannot be loaded: {what}", where=f"package {package}", mend=mend) from error
