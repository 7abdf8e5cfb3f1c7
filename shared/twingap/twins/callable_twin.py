"""A user's function as a twin, diagnosed and closed like the twins of this package.

function(conditions, rng) --scale--> waveforms --effects that can act on finished waveforms--> records
"""

from __future__ import annotations

import math
import traceback
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import FAULTS, Bearing
from twingap.effects import Draft, Effect, Stage, catalogue
from twingap.effects.angle import at_angles
from twingap.effects.force_response import force_response
from twingap.effects.impact_train import response_of
from twingap.effects.modes import LEAD
from twingap.errors import TwingapError
from twingap.records import Condition
from twingap.streams import Streams
from twingap.twins.base import Twin
from twingap.twins.twin_file import Model, register_model

Array = NDArray[np.float64]

Function = Callable[[list[Condition], np.random.Generator], Sequence[Array]]
"""Conditions, generator -> one array of samples per condition."""


@dataclass(frozen=True)
class CallableParameters:
    """Settings in a twin file of a function registered as a twin.

    Parameters
    ----------
    scale : float
        Factor on all that it makes, positive; calibration brings it to the records.
    healthy_rms : float
        RMS of its healthy vibration before that factor, positive; effects are relative to it. Calibration measures it.
    """

    scale: float = 1.0
    healthy_rms: float = 1.0

    def __post_init__(self) -> None:
        for name, value in (("scale", self.scale), ("healthy_rms", self.healthy_rms)):
            if not (math.isfinite(value) and value > 0):
                raise TwingapError(f"{name} = {value!r}, a positive number expected", where="parameters")


class CallableTwin(Twin):
    """A function as a twin, with effects that can act on finished waveforms."""

    model: ClassVar[str] = "callable"
    excitation: ClassVar[Literal["impacts", "rollers", "waveform"]] = "waveform"

    def __init__(
        self,
        function: Function,
        bearing: Bearing,
        parameters: CallableParameters,
        effects: Sequence[Effect],
        unit: str,
        inherent: frozenset[str] = frozenset(),
    ) -> None:
        super().__init__(bearing, effects, unit)
        self.function, self.parameters = function, parameters
        self.inherent_effects = inherent  # type: ignore[misc]  # what this function models is its own

    @property
    def reference_rms(self) -> float:
        """RMS of the healthy vibration, in `unit`."""
        return self.parameters.scale * self.parameters.healthy_rms

    @property
    def white_noise_rms(self) -> float:
        """0: no noise is added to the waveforms of the function."""
        return 0.0

    def excite(self, draft: Draft, streams: Streams) -> None:
        """Call the function for the waveform."""
        condition = draft.condition
        where = f"model {self.model!r}, record {condition.name!r}"
        try:
            made = self.function([condition], streams("simulator"))
        except TwingapError as error:
            raise TwingapError(error.what, where=where, mend=error.mend) from error
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            what = f"the function failed in {last.filename}, line {last.lineno}: {type(error).__name__}: {error}"
            raise TwingapError(what, where=where) from error
        try:
            if np.iscomplexobj(made[0]):
                raise TypeError("complex")
            x = np.array(made[0], dtype=float)
        except (TypeError, ValueError, IndexError, KeyError) as error:
            raise TwingapError(
                "the function gave no array of numbers per condition", where=where, mend="return a list of arrays"
            ) from error
        if x.shape != (condition.n_samples,):
            raise TwingapError(
                f"the function gave samples of shape {x.shape}, ({condition.n_samples},) expected",
                where=where, mend="make condition.n_samples samples at condition.fs_hz",
            )  # fmt: skip
        if not np.isfinite(x).all():
            raise TwingapError("the function gave samples that are not finite numbers", where=where)
        if not np.ptp(x) > 0:
            raise TwingapError("the function gave samples that are all equal", where=where)
        draft.x = self.parameters.scale * x
        draft.impact_response = lambda: _responses(self.function, self.bearing, condition)[0]
        draft.force_response = lambda: _responses(self.function, self.bearing, condition)[1]
        # Resampled first, so that angles of later effects refer to the resampled waveform.
        evenly = draft.t * draft.shaft_hz
        if any(e.stage == Stage.SHAFT for e in self.effects) and not np.array_equal(draft.turns, evenly):
            draft.x = at_angles(draft.x, evenly, draft.turns)

    def respond(self, drafts: Sequence[Draft]) -> None:
        """Apply delay, gain and filters to the waveform, as `effects.apply_to_waveform` does."""
        for draft in drafts:
            if draft.cage_lag is not None:
                draft.x = at_angles(draft.x, draft.turns, draft.turns - draft.cage_lag)
            if draft.gain is not None:
                draft.x = draft.x * draft.gain
            if draft.filters:
                x = np.pad(draft.x, (LEAD, 0), mode="reflect")
                for act in draft.filters:
                    x = act(x)
                draft.x = x[LEAD:].copy()


@lru_cache(maxsize=64)
def _responses_at(
    function: Function, bearing: Bearing, speed_rpm: float, fs_hz: float, n_samples: int
) -> tuple[Array | None, Array | None]:
    """Responses of a function to one impact and to a force, from a record of each state that it can simulate."""
    made: dict[str, Array] = {}
    for fault in FAULTS:
        condition = Condition("response", speed_rpm, fs_hz, n_samples, fault)
        try:
            (x,) = function([condition], np.random.default_rng(0))
            x = np.array(x, dtype=float)
        except Exception:  # a fault that it does not simulate
            continue
        if x.shape == (n_samples,) and np.isfinite(x).all() and np.ptp(x) > 0:
            made[fault] = x
    healthy = [made.pop("healthy")] if "healthy" in made else []
    passes = [fs_hz / (bearing.fault_order(fault) * speed_rpm / 60) for fault in made]
    faulty = list(made.values())
    response = response_of(faulty, passes) if faulty else None
    return response, force_response(healthy, faulty) if response is None else response


def _responses(function: Function, bearing: Bearing, condition: Condition) -> tuple[Array | None, Array | None]:
    """As `_responses_at`, at the speed of a condition, rounded so that few records are simulated."""
    speed_rpm = float(f"{condition.speed_rpm:.1g}")
    return _responses_at(function, bearing, speed_rpm, condition.fs_hz, condition.n_samples)


def register_callable(name: str, function: Function, *, has: Sequence[str] = ()) -> Model:
    """Register a function as a twin model for twin files: ``[twin] model = "name"``.

    Parameters
    ----------
    name : str
    function : callable
        ``function(conditions, rng) -> arrays``: the samples of each condition, drawn from `rng` alone. It is called for
        one record at a time, each with its own generator.
    has : sequence of str
        Effects that it models already.

    Returns
    -------
    Model

    Raises
    ------
    TwingapError
        For a name that twingap's own models have, or no function.
    """
    if name in ("phenomenological", "contact"):
        raise TwingapError(f"{name!r} is a built-in model", where="register_callable", mend="choose another name")
    if not callable(function):
        raise TwingapError(f"{function!r} found, a function expected", where="register_callable")
    inherent = frozenset(has)
    if unknown := sorted(inherent - catalogue().keys()):
        raise TwingapError(f"unknown effect {unknown[0]!r}", where="register_callable: has")
    kind = type(f"Callable_{zlib.crc32(name.encode()):08x}", (CallableTwin,), {"model": name})

    def build(parameters: Any, bearing: Bearing, effects: tuple[Effect, ...], unit: str) -> Twin:
        twin: Twin = kind(function, bearing, parameters, effects, unit, inherent)
        return twin

    return register_model(Model(name, CallableParameters, build, _NO_PRESETS))


_NO_PRESETS: Mapping[str, Any] = {}
