"""Frequency response of structure, mounting and sensor beyond the twin's own mode."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._filtering import fast_length, filtered
from twingap.effects._gains import check_places, minimum_phase
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.base import Effect, Stage, parameter, profile
from twingap.effects.by_state import ByState
from twingap.effects.draft import Draft
from twingap.effects.impact_train import train_of
from twingap.effects.modes import LEAD
from twingap.effects.registry import register

Array = NDArray[np.float64]

_GOLDEN: Final = 0.5 * (math.sqrt(5) - 1)
"""Step, modulo 1, of a sequence that fills its range evenly and whose neighbours lie far apart."""


@register
@dataclass(frozen=True)
class TransferPath(Effect):
    """A free frequency response in series with the twin's own mode: several modes, antiresonances, mounting, sensor.

    The gain is given in dB at some frequencies, with straight lines between them and constant beyond. The filter is
    that of minimum phase with this gain, so that an impact stays the beginning of its response, and then of bands
    that arrive with delays between 0 and `delay_spread_s`: waves of a large structure take several ways, and narrow
    modes ring longer than a smooth gain shows. Only the product of path and impact strength can be identified, so
    that a constant gain is left to the impacts. All vibration of the bearing passes it, noise of the measuring
    chain does not. Of a finished waveform impacts and force are read off (`impact_train`) and pass it; where its
    impacts are not known, or with `all_samples`, the whole waveform does: it is then the filter of another sensor,
    mounting or amplifier.
    """

    stage: ClassVar[Stage] = Stage.PATH
    references: ClassVar[tuple[str, ...]] = (
        RANDALL_ANTONI,
        "Oppenheim & Schafer 1989, Discrete-time signal processing, ch. 12: minimum phase from the cepstrum",
    )
    group: ClassVar[str] = "path"
    look_alikes: ClassVar[tuple[str, ...]] = ("second_resonance", "sensor_rolloff", "coloured_noise")
    deciding_measurement: ClassVar[str] = measurements.HAMMER
    trained: ClassVar[bool] = False
    measured: ClassVar[bool] = True

    depth: float = parameter(
        1.0, unit="", plausible=(0.05, 1.5), allowed=(0, 3.0), strength=True, searched=False,
        doc="factor on all gains in dB",
    )  # fmt: skip
    inverted: bool = parameter(
        False,
        unit="",
        plausible=(0, 1),
        allowed=(0, 1),
        searched=False,
        doc="whether the sign of the response is turned",
    )
    delay_spread_s: float = parameter(
        0.0, unit="s", plausible=(0.0, 0.012), allowed=(0.0, 0.05), searched=False,
        doc="largest delay of a band, which spreads an impact over this time",
    )  # fmt: skip
    all_samples: bool = parameter(
        False,
        unit="",
        plausible=(0, 1),
        allowed=(0, 1),
        searched=False,
        doc="whether all of a finished waveform passes it, not its impacts and force alone",
    )
    frequencies_hz: tuple[float, ...] = profile(
        (500.0, 1500.0, 3000.0, 5000.0, 9000.0), unit="Hz", doc="frequencies of the gains, increasing"
    )
    gains_db: tuple[float, ...] = profile(
        (0.0, 8.0, -8.0, 6.0, -10.0), unit="dB", allowed=(-150.0, 150.0), doc="gain at each frequency"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_places(self, self.frequencies_hz, self.gains_db, "gains_db")

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        flat = not self.frequencies_hz or self.depth == 0
        if flat and not self.inverted and not self.delay_spread_s:
            return
        if draft.excitation == "waveform" and not self.all_samples and (train := train_of(draft)) is not None:
            vibration = np.pad(train.impacts + train.forced(rng), (LEAD, 0), mode="reflect")
            draft.x = draft.x + filtered(vibration, self._response(vibration.size, draft) - 1)[LEAD:]
            return
        draft.filters.append(lambda x: filtered(x, self._response(x.size, draft)))

    def _response(self, n: int, draft: Draft) -> NDArray[np.complex128]:
        """Response at the frequencies of the transform that filters n samples."""
        n, fs_hz = fast_length(n), draft.condition.fs_hz
        places, gains = (self.frequencies_hz, self.gains_db) if self.frequencies_hz else ((0.0,), (0.0,))
        response = minimum_phase(n, fs_hz, places, gains, self.depth)
        if self.delay_spread_s:
            response = response * scattered_delays(n, fs_hz, self.delay_spread_s)
        return -response if self.inverted else response


def passed_by_all_samples(path: Effect | None) -> bool:
    """Whether a path is a filter of whole waveforms."""
    plain = _plain(path)
    return plain is not None and plain.all_samples


def delay_spread_s(path: Effect | None) -> float:
    """Largest delay of a band of a path; 0 without a path."""
    plain = _plain(path)
    return 0.0 if plain is None else plain.delay_spread_s


def gain_spread_db(path: Effect) -> float:
    """Standard deviation over frequency of a path's gain, dB; 0 for an effect that is none."""
    plain = _plain(path)
    return 0.0 if plain is None or not plain.gains_db else plain.depth * float(np.std(plain.gains_db))


def _plain(path: Effect | None) -> TransferPath | None:
    """A path, that of all states where it has values by state."""
    plain = path.base if isinstance(path, ByState) else path
    return plain if isinstance(plain, TransferPath) else None


@lru_cache(maxsize=32)
def scattered_delays(n: int, fs_hz: float, spread_s: float) -> NDArray[np.complex128]:
    """[n // 2 + 1] Response of gain 1 whose bands arrive with delays between 0 and `spread_s`.

    Bands are as wide as a delay of that size resolves, 1 / `spread_s`. The delay is linear in frequency between their
    middles; it is the same in each call.
    """
    f = scipy.fft.rfftfreq(n, 1 / fs_hz)
    bands = np.arange(1, max(math.ceil(fs_hz / 2 * spread_s), 2) + 1)
    delays_s = np.interp(f, (bands - 0.5) / spread_s, spread_s * (bands * _GOLDEN % 1))
    return np.asarray(np.exp(-2j * math.pi * np.cumsum(delays_s) * (fs_hz / n)))
