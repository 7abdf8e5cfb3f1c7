"""Frequency response of structure, mounting and sensor beyond the twin's own mode."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.effects import measurements
from twingap.effects._filtering import fast_length, filtered
from twingap.effects._references import RANDALL_ANTONI
from twingap.effects.base import Effect, Stage, parameter, profile
from twingap.effects.by_state import ByState
from twingap.effects.draft import Draft
from twingap.effects.impact_train import train_of
from twingap.effects.modes import LEAD
from twingap.effects.registry import register
from twingap.errors import TwingapError

Array = NDArray[np.float64]

MOST_PLACES: Final = 512
"""Largest number of frequencies of a response."""


@register
@dataclass(frozen=True)
class TransferPath(Effect):
    """A free frequency response in series with the twin's own mode: several modes, antiresonances, mounting, sensor.

    The gain is given in dB at some frequencies, with straight lines between them and constant beyond. The filter is
    that of minimum phase with this gain, so that an impact stays the beginning of its response. Only the product of
    path and impact strength can be identified, so that a constant gain is left to the impacts. All vibration of the
    bearing passes it, noise of the measuring chain does not. Of a finished waveform impacts and force are read off
    (`impact_train`) and pass it; where its impacts are not known, or with `all_samples`, the whole waveform does: it is
    then the filter of another sensor, mounting or amplifier.
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
        if not self.frequencies_hz or (self.depth == 0 and not self.inverted):
            return
        fs_hz, sign = draft.condition.fs_hz, -1.0 if self.inverted else 1.0
        if draft.excitation == "waveform" and not self.all_samples and (train := train_of(draft)) is not None:
            vibration = np.pad(train.impacts + train.forced(rng), (LEAD, 0), mode="reflect")
            gain = minimum_phase(fast_length(vibration.size), fs_hz, self.frequencies_hz, self.gains_db, self.depth)
            draft.x = draft.x + filtered(vibration, sign * gain - 1)[LEAD:]
            return
        draft.filters.append(
            lambda x: filtered(
                x, sign * minimum_phase(fast_length(x.size), fs_hz, self.frequencies_hz, self.gains_db, self.depth)
            )
        )


def passed_by_all_samples(path: Effect | None) -> bool:
    """Whether a path is a filter of whole waveforms."""
    plain = path.base if isinstance(path, ByState) else path
    return isinstance(plain, TransferPath) and plain.all_samples


def check_places(effect: Effect, places: tuple[float, ...], values: tuple[float, ...], name: str) -> None:
    """Raise an error unless there is one value at each of few enough, increasing places."""
    where = f"effect {effect.name}"
    if len(places) != len(values):
        raise TwingapError(f"{len(places)} frequencies and {len(values)} {name}, as many expected", where=where)
    if len(places) > MOST_PLACES:
        raise TwingapError(f"{len(places)} frequencies, at most {MOST_PLACES} expected", where=where)
    if any(later <= earlier for earlier, later in itertools.pairwise(places)):
        raise TwingapError("frequencies do not increase", where=where, mend="sort them, each once")


@lru_cache(maxsize=32)
def minimum_phase(
    n: int, fs_hz: float, frequencies_hz: tuple[float, ...], gains_db: tuple[float, ...], depth: float = 1.0
) -> NDArray[np.complex128]:
    """[n // 2 + 1] Response of minimum phase with these gains, at the frequencies of a real transform of n samples."""
    f = scipy.fft.rfftfreq(n, 1 / fs_hz)
    log_gain = depth * math.log(10) / 20 * np.interp(f, frequencies_hz, gains_db)
    cepstrum = scipy.fft.irfft(log_gain, n)
    # The causal part twice: the imaginary part of its transform is the phase that belongs to the gain.
    cepstrum[1 : (n + 1) // 2] *= 2
    cepstrum[n // 2 + 1 :] = 0
    return np.asarray(np.exp(scipy.fft.rfft(cepstrum)))
