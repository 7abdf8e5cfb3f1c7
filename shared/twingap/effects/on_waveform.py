"""A chain of effects on a finished waveform: simulated records of a foreign simulator, or measured ones.

x --> SHAFT: resampled over the new angle --> EXCITATION: impacts delayed over the angle, times a gain --> PATH: filters
  --> DISTURBANCE: added to --> ACQUISITION: what the converter does --> Record
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.effects.angle import at_angles
from twingap.effects.background import amplified
from twingap.effects.base import Effect, Stage, apply_effect
from twingap.effects.draft import Draft
from twingap.effects.modes import LEAD
from twingap.effects.registry import in_order
from twingap.errors import TwingapError
from twingap.records import Record
from twingap.streams import Streams

Array = NDArray[np.float64]


def apply_to_waveform(
    effects: Iterable[Effect],
    record: Record,
    bearing: Bearing,
    reference_rms: float,
    streams: Streams,
    background: Array | None = None,
    impact_response: Callable[[], Array | None] = lambda: None,
    force_response: Callable[[], Array | None] = lambda: None,
) -> Record:
    """The record with these effects added to what it holds already.

    Parameters
    ----------
    effects : iterable of Effect
        In any order; they act in the order of the chain.
    record : Record
        Left as it is.
    bearing : Bearing
        Geometry of the bearing under test.
    reference_rms : float
        RMS of the machine's healthy vibration in the record's unit: the amplitude scale of disturbances and of the
        converter.
    streams : Streams
        The record's random streams; each effect draws from its own.
    background : Array [samples], optional
        The part of a record with a defect that is not impacts, see `Background`; effects on impacts leave it unchanged.
        None: they act on the whole record.
    impact_response : callable, optional
        The simulator's response to one impact, see `impact_train.response_of`; None where unknown.
    force_response : callable, optional
        The same, or where impacts do not stand out a response of the same power; see `force_response.force_response`.

    Returns
    -------
    Record
        Of the same condition.

    Raises
    ------
    TwingapError
        When an effect cannot act on a finished waveform (see `Effect.cannot_act_on`), or `reference_rms` is not
        positive.
    """
    if not (np.isfinite(reference_rms) and reference_rms > 0):
        raise TwingapError(f"reference_rms = {reference_rms!r}, a positive number expected")
    condition = record.condition
    t = np.arange(condition.n_samples) / condition.fs_hz
    evenly = t * (condition.speed_rpm / 60)
    x = np.array(record.samples, dtype=float)
    draft = Draft(
        condition, bearing, reference_rms, t, evenly.copy(), excitation="waveform",
        impact_response=impact_response, force_response=force_response, x=x,
    )  # fmt: skip
    chain, impacts = in_order(tuple(effects)), x
    for stage in Stage:
        if stage is Stage.EXCITATION and background is not None and draft.faulty:
            draft.x, draft.background = draft.x - background, background
            impacts = draft.x
        for effect in chain:
            if effect.stage == stage:
                apply_effect(effect, draft, streams(effect.name), f"record {condition.name!r}")
        if stage is Stage.SHAFT and not np.array_equal(draft.turns, evenly):
            draft.x = at_angles(draft.x, evenly, draft.turns)
            background = None if background is None else at_angles(background, evenly, draft.turns)
        elif stage is Stage.EXCITATION:
            if draft.cage_lag is not None:
                draft.x = at_angles(draft.x, draft.turns, draft.turns - draft.cage_lag)
                if draft.background is not None:  # noise that comes a little later is as good as before
                    draft.background = at_angles(draft.background, draft.turns, draft.turns - draft.cage_lag)
            draft.x, draft.background = _gained(draft, impacts, background), None
        elif stage is Stage.PATH and draft.filters:
            # The signal before the record is unknown; its mirrored beginning is used.
            x = np.pad(draft.x, (LEAD, 0), mode="reflect")
            for act in draft.filters:
                x = act(x)
            draft.x = x[LEAD:].copy()
    return Record(condition, draft.x)


def _gained(draft: Draft, impacts: Array, background: Array | None) -> Array:
    """[samples] The waveform with its gain, and with the background that effects on impacts left as it is.

    `impacts` and `background` are the parts of the waveform before these effects.
    """
    gain = np.ones(1) if draft.gain is None else draft.gain
    if draft.background is None or background is None:
        return draft.x * gain
    mean = float(gain.mean())
    if draft.x is not impacts or not mean > 0:
        return np.asarray(draft.x * gain + draft.background)
    # Changes within a record leave its mean power about as it is; the mean of the gain does not.
    on_background = float(np.sqrt(np.mean(draft.background**2) / max(float(np.mean(background**2)), 1e-300)))
    varied = impacts * (gain / mean)
    return amplified(varied + background, varied, mean, on_background)
