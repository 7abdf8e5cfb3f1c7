"""Where to begin looking for an effect's values: estimates may be far off, and a search goes to the nearest valley.

features --read off--> places that a signature names by itself -----------------------+
healthy spectrum --low-pass x mode, in closed form, all over a grid--> the likeliest --+--each simulated--> least misfit
spectra --two modes, with or against each other--> the likeliest ----------------------+
the estimate, where it drives records and twin apart --weaker and weaker--> places -------+

A low-pass of the wrong order is made up for by a mode of the wrong damping, and no single step leads out of that: so
its order, corner and background are sought together with the mode that goes with them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import Effect, SecondResonance, SensorRolloff, SlipJitter, make_effect
from twingap.gap.baseline import BANDS, mode_density, sides_of
from twingap.gap.calibrate import thinned
from twingap.gap.comparison import feature_names
from twingap.gap.evidence import values_of
from twingap.gap.signatures.path import two_modes
from twingap.gap.training.parameters import Setting, coordinates, to_effect, to_number
from twingap.twins.twin_file import flat

if TYPE_CHECKING:
    from twingap.bearing import Bearing
    from twingap.gap.evidence import Evidence

Array = NDArray[np.float64]

_ORDERS: Final = (1, 2, 3, 5)
_CORNERS: Final = np.geomspace(0.02, 0.8, 14)
"""Of the sampling rate."""
_BACKGROUNDS: Final = (0.0, 0.8, 0.95, 0.985, 1.0)
_PLACES: Final = (-0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1)
"""Of the mode, about where it was calibrated to be and about the highest peak: logarithms."""
_WIDTHS: Final = (0.01, 0.018, 0.03, 0.05, 0.09, 0.16)
"""Damping ratios of the mode."""
_LIKELIEST: Final = 5
_DAMPINGS: Final = (0.02, 0.06)
_GAINS: Final = (0.1, 0.4, 1.6)
_FINALISTS: Final = 4
_WEAKER: Final = (0.5, 0.25, 0.12, 0.06)
"""Factors on an effect's strength where the estimate is too much: with a baseline that makes room for it, no single
step leads back."""
_STRENGTHS: Final = frozenset(
    ("level", "level_1x", "level_2x", "level_3x", "gain", "sigma", "depth", "exponent", "slip", "rate_per_s", "step")
)
_BETTER: Final = 0.99
"""Factor on the misfit from which another place is a better one to begin at."""


def better_start(
    evidence: Evidence, effects: tuple[Effect, ...], name: str, features: Array, now: float
) -> Effect | None:
    """The effect at values that come nearer to the fit part than the given ones do; None where there are none.

    Parameters
    ----------
    evidence : Evidence
    effects : tuple of Effect
        All that are added to the twin.
    name : str
        The one to look for.
    features : Array [features]
        Of the fit part, before it was added.
    now : float
        Misfit with the given values.
    """
    (given,) = (effect for effect in effects if effect.name == name)
    others = tuple(effect for effect in effects if effect.name != name)
    found: list[tuple[float, int, Effect]] = []
    for place in places(given, features, evidence):
        if evidence.fits(place):
            chain = (*others, place)
            found.append((evidence.misfit(evidence.matched(chain), chain), len(found), place))
    finalists = [place for _, _, place in sorted(found)[:_FINALISTS]]
    if isinstance(given, SensorRolloff):
        finalists += likeliest_losses(evidence, given)
    if isinstance(given, SecondResonance):
        finalists += likeliest_modes(evidence, given)
    if now > evidence.misfit(evidence.against(others).simulator, others):
        finalists += [place for place in weaker(given) if evidence.fits(place)]
    # Levels alone were matched so far; the few that came nearest are given a mode of their own, as the given one was.
    least, best = _BETTER * now, None
    for place in finalists:
        chain = (*others, place)
        misfit = evidence.misfit(evidence.against(chain).simulator, chain)
        if misfit < least:
            least, best = misfit, place
    return best


def places(given: Effect, features: Array, evidence: Evidence) -> Iterator[Effect]:
    """Where else the effect's values may be."""
    found = dict(zip(feature_names(), features, strict=True))
    for numbers in _read(given.name, found, evidence.frame.bearing):
        yield _moved(given, numbers, evidence.setting)
    if isinstance(given, SlipJitter):  # of a random walk, strikes a little apart differ less, and those far apart more
        for factor in (1.0, 0.5, 0.25):
            yield dataclasses.replace(given, sigma=factor * given.sigma, accumulating=not given.accumulating)
    if isinstance(given, SecondResonance):
        for opposed in (False, True):
            for damping in _DAMPINGS:
                for gain in _GAINS:
                    yield dataclasses.replace(given, opposed=opposed, damping_ratio=damping, gain=gain)


def weaker(given: Effect) -> list[Effect]:
    """The effect at parts of its strength; none where its strength is not one factor."""
    strengths = {f.name: getattr(given, f.name) for f in dataclasses.fields(given) if f.name in _STRENGTHS}  # type: ignore[arg-type]
    return [
        make_effect(given.name, values_of(given) | {name: factor * value for name, value in strengths.items()})
        for factor in (_WEAKER if strengths else ())
    ]


def likeliest_losses(evidence: Evidence, given: SensorRolloff) -> list[Effect]:
    """The low-passes that explain the healthy spectra best, each with the mode and the levels that suit it.

    The spectrum of a twin with a low-pass is known in closed form: loss times (structure noise through its mode, and
    the part of the white noise that the sensor hears), plus white noise behind it; that of a simulator of the user's
    own, loss times what it has. What other effects add is not in it.
    """
    spec = evidence.calibrated.spec
    sides = [s for s in sides_of(list(thinned(evidence.calibrated.fit, 6)), evidence.frame) if s.fault == "healthy"]
    if not sides:
        return []
    side = max(sides, key=lambda s: len(s.conditions))
    inside = slice(2, int(0.92 * BANDS))
    f = (np.arange(BANDS) + 0.5) / (2 * BANDS)
    wanted = side.psd[inside] * side.fs_hz
    if not wanted.max() > 0:
        return []
    wanted = np.maximum(wanted, 1e-9 * wanted.max())  # a band in which a coarse converter shows nothing
    if spec is not None and spec.model == "phenomenological":
        centres = (float(flat(spec.parameters)["resonance_hz"]), side.peak_hz)
        modes = np.array([
            mode_density(centre * math.exp(shift), width, side.fs_hz)[inside] * side.fs_hz
            for centre in centres for shift in _PLACES for width in _WIDTHS
        ])  # fmt: skip
    else:  # waveforms that are finished, or another model's: whatever is in them passes the sensor
        modes = None
        bare = np.maximum(evidence.bare_psd(side)[inside] * side.fs_hz, 1e-300)
    scored: list[tuple[float, int, float, float]] = []
    for order in _ORDERS:
        for corner in _CORNERS:
            loss = 1 / (1 + (f[inside] / corner) ** (2 * order))
            if modes is None:
                scored.append((_misfit_at_any_level(bare * loss, wanted), order, float(corner), given.background))
                continue
            for background in _BACKGROUNDS:
                white = 2 * (background * loss + 1 - background)
                scored.append((_misfit(modes * loss, white, wanted), order, float(corner), background))
    return [
        dataclasses.replace(given, order=order, corner_hz=corner * side.fs_hz, background=background)
        for _, order, corner, background in sorted(scored)[:_LIKELIEST]
    ]


def likeliest_modes(evidence: Evidence, given: SecondResonance) -> list[SecondResonance]:
    """The second modes that explain the spectra best, in step with the first and opposed; either may be the twin's."""
    spec = evidence.calibrated.spec
    if spec is None or spec.model != "phenomenological":
        return []
    fs_hz = min(c.fs_hz for c in evidence.fit.conditions)
    out = []
    for pair in two_modes(evidence.fit.outlines):
        for place, damping, gain in zip(pair.places, pair.dampings, (1 / pair.gain, pair.gain), strict=True):
            one = dataclasses.replace(
                given, frequency_hz=place * fs_hz, damping_ratio=damping, gain=abs(gain), opposed=gain < 0
            )
            out += [one] if evidence.fits(one) else []
    return out


def _misfit(modes: Array, white: Array, wanted: Array) -> float:
    """Least mean square log ratio of `wanted` [bands] to sums of a row of `modes` [modes, bands] and of white noise."""
    weight = 1 / wanted
    a, b = modes * weight, white * weight
    aa, ab, bb = (a * a).sum(axis=1), a @ b, float(b @ b)
    sa, sb = a.sum(axis=1), float(b.sum())
    determinant = np.maximum(aa * bb - ab**2, 1e-300)
    structure, noise = (sa * bb - sb * ab) / determinant, (sb * aa - sa * ab) / determinant
    # Neither power is negative: where one would be, the other stands alone.
    structure, noise = (
        np.where(noise < 0, sa / aa, np.maximum(structure, 0.0)),
        np.where(structure < 0, sb / bb, np.maximum(noise, 0.0)),
    )
    model = structure[:, None] * a + noise[:, None] * b
    return float(np.minimum(np.log(np.maximum(model, 1e-6)) ** 2, 1.0).mean(axis=1).min())


def _misfit_at_any_level(model: Array, wanted: Array) -> float:
    """Mean square log ratio [bands] of `wanted` to the multiple of `model` that most bands suit."""
    rest = np.log(wanted / model)
    return float(np.minimum((rest - np.median(rest)) ** 2, 1.0).mean())


def _read(name: str, found: Mapping[str, float], bearing: Bearing) -> Iterator[dict[str, float]]:
    """Comparable numbers that single signatures give, see `training.parameters`."""
    if name == "entry_exit":
        arcs = [found["answer|comb_arc_log"], found["events.arc_log|all.level"]]
        part = found["events.cycle_rise_part|all.level"]
        if part > 0:
            arcs += [math.log(part * 360 / bearing.n_rollers), math.log(part * 180)]
        for arc in (arc for arc in arcs if math.isfinite(arc)):
            yield from ({"arc_deg": arc, "exit_ratio": 0.0, "turned": turned} for turned in (0.0, 1.0))
    if name == "speed_gain":
        for trend in ("trend|speed_strikes", "trend|speed_alone"):
            if math.isfinite(found[trend]):
                yield from ({"exponent": found[trend], "on_noise": part} for part in (0.0, 1.0))
    if name == "damage_growth":
        for trend in ("trend|time_strikes", "trend|time_alone"):
            if found[trend] > 0:
                yield {"rate_per_s": math.log(found[trend]), "onset_s": 0.0}
    if name == "mean_slip" and math.isfinite(found["context|slip_seen"]):
        yield {"slip": found["context|slip_seen"]}


def _moved(given: Effect, numbers: Mapping[str, float], setting: Setting) -> Effect:
    kept = {p: to_number(given, p, setting) for name, p in coordinates() if name == given.name}
    return to_effect(given.name, kept | dict(numbers), setting)
