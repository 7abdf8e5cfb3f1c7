"""One more structural mode on the path."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._features import SHAPE
from twingap.effects._filtering import fast_length, filtered
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.base import Effect, Stage, parameter
from twingap.effects.draft import Draft
from twingap.effects.drawing import healthy_density, log_uniform
from twingap.effects.impact_train import train_of
from twingap.effects.machine import Machine
from twingap.effects.modes import PAST, Mode, modal_response
from twingap.effects.observations import Observations, SpectrumRatio
from twingap.effects.registry import register

Array = NDArray[np.float64]

_DAMPINGS: Final = (0.02, 0.06)
_GAINS: Final = (0.1, 0.4, 1.6)
_FINE_GAINS: Final = (0.04, 0.1, 0.25, 0.6, 1.5)
"""Trial values of a search, all combinations, in phase with the first mode and in opposition; finer gains where a hump
shows the others. More are slower."""
_APART: Final = 0.2
"""Log ratio of both frequencies below which two modes cannot be distinguished. A larger value draws fewer."""

_HUMPS: Final = 2
"""Modes that are proposed from a ratio of spectra. More take a simulation each."""
_HUMP_DAMPINGS: Final = (0.012, 0.025, 0.05, 0.1)
_HUMP_GAINS: Final = (0.15, 40.0, 14)
"""Damping ratios, and ends and number of the gains, that are fitted to it. More fit better and take longer."""
_HUMP_TRIED: Final = (0.1, 0.4, 1.6, -0.4)
"""Gains that are tried at the best place, negative in opposition."""
_LOWEST, _HIGHEST = 0.02, 0.96
"""Ends of the frequencies that are fitted, as parts of the highest one."""

_CLEAR: Final = 5.0
"""z from which a narrow hump is certain. A smaller value finds weaker modes, and more by chance."""
_BEYOND_DOUBT: Final = 9.0
"""z from which it shows a gap that no test shows."""
_RIVAL: Final = 0.5
"""Part of it that z of another hump, or of a dip, may reach: spectra that differ in many places differ for another
reason. A larger value takes errors of calibrated values and forms of paths for one mode."""
_NARROW: Final = 0.055
"""Largest damping ratio of a certain mode. A larger value takes bands of noise for modes."""
_STEADY: Final = 0.7
"""Largest scatter of the height over records, over its mean. A larger value takes bursts, squeal and smeared lines for
modes."""
_OWN_MODE: Final = 0.22
"""Log ratio to the twin's own mode within which a hump is due to this mode, which may be elsewhere or drift. A larger
value misses modes that are near."""
_IMAGE: Final = 0.06
"""The same about twice its frequency, where distortion repeats it, and about its image above half the sampling rate."""


@register
@dataclass(frozen=True)
class SecondResonance(Effect):
    """A second structural mode: a peak that stays at its frequency whatever the speed.

    Impacts, rollers' contacts and broadband forces pass through both modes in parallel. Where the sensor is not at the
    point of the force, a mode may have the opposite sign: the two then cancel on the other sides of their peaks. A
    finished waveform has passed a path already: impacts and force are read off it (`impact_train`) and pass the second
    mode too; where its impacts are not known, its spectrum around the frequency is raised by up to 1 + gain.
    """

    stage: ClassVar[Stage] = Stage.PATH
    references: ClassVar[tuple[str, ...]] = (RANDALL_ANTONI,)
    group: ClassVar[str] = "path"
    look_alikes: ClassVar[tuple[str, ...]] = ("sensor_rolloff", "coloured_noise", "distributed_roughness")
    deciding_measurement: ClassVar[str] = measurements.HAMMER
    features: ClassVar[tuple[str, ...]] = SHAPE
    draw_weight: ClassVar[float] = 1.8

    frequency_hz: float = parameter(
        1600.0, unit="Hz", plausible=(300.0, 20000.0), allowed=(1.0, 1e7), log=True, doc="natural frequency"
    )
    damping_ratio: float = parameter(
        0.04, unit="", plausible=(0.01, 0.2), allowed=(1e-4, 0.99), log=True, doc="damping ratio zeta"
    )
    gain: float = parameter(
        0.6, unit="", plausible=(0.1, 5.0), log=True, strength=True,
        doc="its response to an impact over that of the first mode",
    )  # fmt: skip
    opposed: bool = parameter(
        False, unit="", plausible=(0, 1), allowed=(0, 1), doc="whether it moves the sensor against the first mode"
    )

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        gain = -self.gain if self.opposed else self.gain
        if draft.excitation != "waveform":
            draft.modes.append(Mode(self.frequency_hz, self.damping_ratio, gain))
            return
        if (train := train_of(draft)) is not None:
            n, mode = draft.x.size, Mode(self.frequency_hz, self.damping_ratio, gain)
            force, past = train.force(rng), train.force_rms * rng.standard_normal(PAST)
            added = modal_response([mode], draft.condition.fs_hz, n, train.times_s, train.amplitudes, force, past)
            draft.x = draft.x + added
            return
        fs_hz, band = draft.condition.fs_hz, (self.frequency_hz, self.damping_ratio, gain)
        draft.filters.append(lambda x: filtered(x, _raised(fast_length(x.size), fs_hz, *band)))

    def cannot_act_on(self, draft: Draft) -> str | None:
        return draft.beyond_nyquist(self.frequency_hz)

    @classmethod
    def certain(cls, seen: Observations) -> bool:
        """Where the spectra of all states have one narrow hump over the twin's, far from the twin's own mode."""
        return _is_mode(seen, seen.features, _CLEAR)

    @classmethod
    def shows_gap(cls, seen: Observations) -> bool:
        return _is_mode(seen, seen.features, _BEYOND_DOUBT)

    @classmethod
    def shown(cls, seen: Observations) -> Mapping[str, float]:
        """Frequency and damping of such a hump, also where other effects of the twin hide it."""
        for features in (seen.features, seen.held_out):
            if _is_mode(seen, features, _CLEAR):
                frequency_hz = features["pooled|hump_fs"] * seen.fs_hz
                return {"frequency_hz": frequency_hz, "damping_ratio": features["pooled|hump_damping"]}
        return {}

    @classmethod
    def shown_errors(cls) -> Mapping[str, float]:
        return {"frequency_hz": 0.03, "damping_ratio": 0.4}

    @classmethod
    def draw(cls, machine: Machine, rng: np.random.Generator) -> Mapping[str, float] | None:
        first, fs_hz = machine.parameters.resonance_hz, machine.conditions[0].fs_hz
        second, damping = log_uniform(rng, 0.02, 0.46) * fs_hz, log_uniform(rng, 0.01, 0.15)
        if abs(np.log(second / first)) < _APART:
            return None
        wanted, opposed = 10 ** (rng.uniform(1.0, 14.0) / 10), bool(rng.random() < 0.5)
        for gain in np.geomspace(0.02, 8.0, 72):  # the least that raises the healthy spectrum there by as much
            more = (second, damping, -float(gain) if opposed else float(gain))
            if healthy_density(machine, second, more) > wanted * healthy_density(machine, second):
                return {"frequency_hz": second, "damping_ratio": damping, "gain": float(gain), "opposed": opposed}
        return None

    def initial_values(self, seen: Observations) -> Iterator[Effect]:
        shown = bool(self.shown(seen))
        for opposed in (False, True):
            for damping in (self.damping_ratio,) if shown else _DAMPINGS:
                for gain in _FINE_GAINS if shown else _GAINS:
                    yield dataclasses.replace(self, opposed=opposed, damping_ratio=damping, gain=gain)

    def spectral_values(self, seen: Observations) -> Sequence[Effect]:
        """The second modes that explain the spectra best, in phase and in opposition.

        Of two modes of the records either may be the twin's. A twin without a mode as a parameter has it at the humps
        of the records' spectra over its own.
        """
        if shown := self.shown(seen):
            return [self.moved(**shown, gain=abs(gain), opposed=gain < 0) for gain in _HUMP_TRIED]
        if seen.own_mode is None:
            first, *others = list(_humps(seen.spectrum_ratio()))
            # Gains of a filter, as fitted, and those of impacts through a mode beside the path.
            choices = [first, *((*first[:2], gain) for gain in _HUMP_TRIED), *((*o[:2], _GAINS[1]) for o in others)]
            return [
                self.moved(frequency_hz=place_hz, damping_ratio=damping, gain=abs(gain), opposed=gain < 0)
                for place_hz, damping, gain in choices
            ]
        return [
            self.moved(frequency_hz=place_hz, damping_ratio=damping, gain=abs(gain), opposed=gain < 0)
            for pair in seen.mode_pairs()
            for place_hz, damping, gain in zip(
                pair.frequencies_hz, pair.dampings, (1 / pair.gain, pair.gain), strict=True
            )
        ]


def _is_mode(seen: Observations, features: Mapping[str, float], least: float) -> bool:
    """Whether all records have one such hump: high, narrow, steady, and not due to the twin's own mode.

    A twin whose spectrum is not highest at its own mode has not been calibrated to the records' mode: then a hump may
    be that mode.
    """
    z, rival, place, damping, unsteady, peak = (
        features.get(f"pooled|hump{what}", math.nan)
        for what in ("", "_rival", "_fs", "_damping", "_unsteady", "_peak_fs")
    )
    if not (z >= least and rival <= _RIVAL * z and damping <= _NARROW and unsteady <= _STEADY):
        return False
    if seen.own_mode is not None:
        own = seen.own_mode[0] / seen.fs_hz
        if abs(math.log(peak / own)) > _OWN_MODE or abs(math.log(place / own)) < _OWN_MODE:
            return False
    return not any(abs(math.log(place / at)) < _IMAGE for at in (2 * peak, max(0.5 - peak, 1e-9)))


def _humps(of: SpectrumRatio) -> Iterator[tuple[float, float, float]]:
    """Frequency (Hz), damping ratio and gain of the modes that explain a ratio of spectra best, the best first."""
    f, top_hz = of.middles_hz, float(of.middles_hz[-1])
    gains = np.geomspace(*_HUMP_GAINS)
    choices = [
        (float(centre), damping, sign * float(gain))
        for centre in f[(f > _LOWEST * top_hz) & (f < _HIGHEST * top_hz)]
        for damping in _HUMP_DAMPINGS for gain in gains for sign in (1, -1)
    ]  # fmt: skip
    centre, damping, gain = np.array(choices).T[:, :, None]
    band = 2j * damping * f * centre
    curves = 2 * np.log(np.abs(1 + gain * band / (centre**2 - f**2 + band)))
    rest = of.log_ratio - curves
    rest = rest - np.median(rest, axis=1, keepdims=True)
    misfit = np.minimum(np.abs(rest), 2.0).mean(axis=1)
    found: list[float] = []
    for place in np.argsort(misfit, kind="stable"):
        here = choices[place]
        if all(abs(np.log(here[0] / other)) > _APART for other in found):
            found.append(here[0])
            yield here
        if len(found) == _HUMPS:
            return


@lru_cache(maxsize=16)
def _raised(n: int, fs_hz: float, centre_hz: float, damping_ratio: float, gain: float) -> Array:
    """1 + gain times a resonance of unit height, at the frequencies of a real transform of n samples."""
    f = scipy.fft.rfftfreq(n, 1 / fs_hz)
    band = 2j * damping_ratio * f * centre_hz
    return np.asarray(1 + gain * band / (centre_hz**2 - f**2 + band))
