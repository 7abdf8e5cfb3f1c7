"""A small laboratory for signatures: paired simulations, and lines in spectra, by SciPy alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import hilbert

from twingap.bearing import BEARINGS
from twingap.effects import Effect, make_effect
from twingap.records import Condition
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lab:
    """Simulates with and without an effect from the same random numbers, and reads spectra at exact frequencies."""

    fs_hz: float = 12000.0
    n_samples: int = 48000
    speed_rpm: float = 1800.0
    seed: int = 5
    parameters: PhenomenologicalParameters = field(
        default_factory=lambda: PhenomenologicalParameters(resonance_hz=3000.0)
    )
    bearing = BEARINGS["6205"]

    def where(self, **changes: object) -> Lab:
        """The same laboratory with other settings."""
        return replace(self, **changes)  # type: ignore[arg-type]

    @property
    def fr(self) -> float:
        """Shaft speed, Hz."""
        return self.speed_rpm / 60

    def conditions(self, fault: str, count: int, time_s: float | None = None) -> list[Condition]:
        one = Condition("r", self.speed_rpm, self.fs_hz, self.n_samples, fault, time_s=time_s)
        return [replace(one, name=f"r{i}", group=None) for i in range(count)]

    def make(
        self, effects: Sequence[Effect | str], fault: str = "outer", count: int = 1, time_s: float | None = None
    ) -> Array:
        """Records [count, samples] of the phenomenological twin with these effects."""
        chain = [make_effect(effect) if isinstance(effect, str) else effect for effect in effects]
        twin = PhenomenologicalTwin(self.bearing, self.parameters, chain)
        made = twin.stream(self.conditions(fault, count, time_s), np.random.default_rng(self.seed))
        return np.stack([record.samples for record in made])

    def pair(self, effect: Effect | str, fault: str = "outer", count: int = 1, **more: float) -> tuple[Array, Array]:
        """The same records without and with the effect."""
        return self.make([], fault, count, **more), self.make([effect], fault, count, **more)

    def added(self, effect: Effect | str, fault: str = "healthy", count: int = 1) -> Array:
        """What the effect adds to the records."""
        without, with_it = self.pair(effect, fault, count)
        return with_it - without

    def envelope(self, x: Array, low_hz: float = 2000.0, high_hz: float = 4000.0) -> Array:
        """Squared envelope of a band, mean removed."""
        spectrum, f = np.fft.rfft(x), np.fft.rfftfreq(x.shape[-1], 1 / self.fs_hz)
        band = np.fft.irfft(spectrum * ((f > low_hz) & (f < high_hz)), x.shape[-1])
        envelope = np.abs(hilbert(band)) ** 2
        return np.asarray(envelope - envelope.mean(axis=-1, keepdims=True))

    def line(self, x: Array, frequency_hz: float) -> float:
        """Amplitude of the tone at exactly this frequency (Hann window), averaged over records."""
        n = x.shape[-1]
        window = np.hanning(n)
        tone = np.exp(-2j * np.pi * frequency_hz / self.fs_hz * np.arange(n))
        return float(np.mean(2 * np.abs((x * window) @ tone) / window.sum()))

    def floor(self, x: Array, frequency_hz: float) -> float:
        """Median amplitude 5 to 30 bins to either side."""
        n = x.shape[-1]
        window = np.hanning(n)
        bins = 2 * np.abs(np.fft.rfft(x * window)).reshape(-1, n // 2 + 1).mean(axis=0) / window.sum()
        middle = round(frequency_hz / self.fs_hz * n)
        off = np.concatenate((np.arange(-30, -4), np.arange(5, 31)))
        return float(np.median(bins[np.abs(middle + off)]))

    def prominence(self, x: Array, frequency_hz: float) -> float:
        """A line's amplitude over the floor about it: below about 3 there is none."""
        return self.line(x, frequency_hz) / self.floor(x, frequency_hz)


@pytest.fixture(scope="session")
def lab() -> Lab:
    return Lab()


@pytest.fixture(scope="session")
def quiet(lab: Lab) -> Lab:
    """A machine whose noise is a millionth of its impacts."""
    still = PhenomenologicalParameters(
        resonance_hz=3000.0,
        impact_amplitude=dict.fromkeys(("inner", "outer", "ball", "cage"), 1e6),
        structure_noise_rms=1.0,
        white_noise_rms=0.0,
    )
    return lab.where(parameters=still)
