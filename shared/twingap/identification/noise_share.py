"""Fraction of noise in the power that was fitted as structure noise, for records with defects only.

record --band of the mode--> power over time --median over mean--> evenness over time ---------------+
twin: noise + impacts, mixed --same------------------------------> evenness of every mixture --------+--> noise share

Impacts with slightly irregular spacing look like noise between the lines of a spectrum, but not over time: noise is
stationary, whereas the response to impacts decays. The median of the squared envelope of Gaussian noise is ln 2 of its
mean (Rayleigh), and less for power in bursts.

In a mode so sharp that the response to an impact has not decayed at the next one, both are equally even. There the
squared envelope of a band with several lines is modulated at the impact rate in proportion to the power of the impacts
(Antoni 2009, Cyclostationarity by examples, doi:10.1016/j.ymssp.2008.10.010), while that of noise is not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.identification.impacts import actual_speed, fault_order, ringing_power, silent_twin
from twingap.identification.resonance import HealthyFit
from twingap.records import Record
from twingap.streams import Streams
from twingap.twins.phenomenological import PhenomenologicalTwin

Array = NDArray[np.float64]

_PARTS: Final = np.array([0.003, 0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
_LINES: Final = 1.8
"""Half width of the band of the modulated envelope, in impact rates; wider bands contain more lines and more noise."""
_LEAST_MODULATION: Final = 0.25
"""Smallest relative modulation by impacts alone for which modulation is used; larger uses it less often."""
_SURE: Final = 0.3
"""Smallest fraction of the modulated power between the lines; below it, all is assumed to be noise."""
_LEAST_SHARE: Final = 0.03
"""Lower bound of the fraction estimated by modulation."""
_SMEAR: Final = 0.012
"""Relative width of lines due to irregular spacings and varying speed."""
_DISTINCT: Final = 0.3
"""Smallest difference in log evenness between noise and impacts for which evenness is used; larger uses it less
often."""
MOST: Final = 8
"""Most records that are used; more reduce the scatter of the median and are slower."""


def noise_share(twin: PhenomenologicalTwin, fit: HealthyFit, records: Sequence[Record], root: int) -> float:
    """Fraction of structure noise in the power that was fitted as structure noise to records with defects.

    Parameters
    ----------
    twin : PhenomenologicalTwin
        Twin with effects that act on impacts.
    fit : HealthyFit
        Mode, and noises that may include impacts.
    records : sequence of Record
        Records with defects; a few of each suffice.
    root : int
        Entropy of the simulations.

    Returns
    -------
    float
        Median over records, at most 1; 1 where neither evenness nor modulation separates noise from impacts.
    """
    mixtures = [_Mixture.of(twin, fit, record, Streams(root, place)) for place, record in enumerate(records)]
    for estimate in (_Mixture.by_evenness, _Mixture.by_modulation):
        known = [share for share in map(estimate, mixtures) if share is not None]
        if known:
            return float(np.clip(np.median(known), 1e-4, 1.0))
    return 1.0


@dataclass(frozen=True)
class _Mixture:
    """A record with simulated noise and impacts under its condition."""

    fit: HealthyFit
    measured: Array
    structure: Array
    white: Array
    impacts: Array
    fs_hz: float
    rate_hz: float

    @classmethod
    def of(cls, twin: PhenomenologicalTwin, fit: HealthyFit, record: Record, streams: Streams) -> _Mixture:
        """Simulate noise and impacts, at the impact rate estimated from the record."""
        silent = silent_twin(twin, fit)
        speed_rpm = actual_speed(silent, fit, record)
        (impacts,) = silent.make([replace(record.condition, speed_rpm=speed_rpm)], [streams])
        parameters = replace(
            silent.parameters, impact_amplitude=dict.fromkeys(silent.parameters.impact_amplitude, 0.0),
            structure_noise_rms=fit.structure_noise_rms, white_noise_rms=0.0,
        )  # fmt: skip
        (noise,) = PhenomenologicalTwin(twin.bearing, parameters, (), twin.unit).make(
            [replace(record.condition, fault="healthy")], [streams]
        )
        white = fit.white_noise_rms * streams("white of a mixture").standard_normal(record.samples.size)
        rate_hz = fault_order(silent, record.condition) * speed_rpm / 60
        return cls(fit, record.samples, noise.samples, white, impacts.samples, record.condition.fs_hz, rate_hz)

    def by_evenness(self) -> float | None:
        """Fraction of noise in the mixture with the same evenness; None where impacts are equally even."""
        half = self._narrow
        total, of_noise, of_impacts = self._means(half)
        if min(of_noise, of_impacts) <= 0:
            return None
        noise = np.sqrt(total / of_noise) * (self.structure + self.white)
        impacts = np.sqrt(total / of_impacts) * self.impacts
        mixed = [np.sqrt(part) * noise + np.sqrt(1 - part) * impacts for part in _PARTS]
        even = np.maximum.accumulate([_evenness(self._power(x, half)) for x in mixed])
        if even[-1] - even[0] < _DISTINCT:
            return None
        part = float(np.interp(_evenness(self._power(self.measured, half)), even, _PARTS))
        return max(part * total - self._mean(self.white, half), 0.0) / self._mean(self.structure, half)

    def by_modulation(self) -> float | None:
        """The same by modulation; None where impacts hardly modulate the envelope, or only in lines."""
        half = max(self._narrow, _LINES * self.rate_hz)
        total, of_noise, of_impacts = self._means(half)
        if min(of_noise, of_impacts) <= 0:
            return None
        swing, least, most = (
            _pulse(self._power(x, half), self.rate_hz / self.fs_hz)
            for x in (self.measured, self.structure + self.white, self.impacts)
        )
        if most < max(_LEAST_MODULATION, 3 * least):
            return None
        # Modulation by noise is subtracted.
        part = min(math.sqrt(max(swing**2 - least**2, 0.0) / (most**2 - least**2)), 1.0)
        of_structure, of_white = self._mean(self.structure, half), self._mean(self.white, half)
        # Power in lines was not fitted as noise; only modulated power beyond it was.
        beyond = part * total - (total - of_structure - of_white)
        return max(1 - beyond / of_structure, _LEAST_SHARE) if beyond > _SURE * part * total else None

    @property
    def _narrow(self) -> float:
        return max(3 * self.fit.damping_ratio * self.fit.resonance_hz, 8 * self.fs_hz / self.measured.size)

    def _means(self, half: float) -> tuple[float, float, float]:
        return (
            self._mean(self.measured, half), self._mean(self.structure + self.white, half),
            self._mean(self.impacts, half),
        )  # fmt: skip

    def _mean(self, samples: Array, half: float) -> float:
        return float(self._power(samples, half).mean())

    def _power(self, samples: Array, half: float) -> Array:
        return ringing_power(samples, self.fs_hz, self.fit.resonance_hz, half)


def _pulse(power: Array, rate: float) -> float:
    """Amplitude of the first harmonics of `rate` in a squared envelope, over its mean."""
    n = power.size
    spectrum = np.abs(np.fft.rfft((power / power.mean() - 1) * np.hanning(n))) ** 2 * (8 / (1.5 * n**2))
    found = 0.0
    for place in rate * n * np.arange(1, 4):
        reach = 2 + _SMEAR * place
        found += float(spectrum[max(int(place - reach), 1) : int(place + reach) + 2].sum())
    return math.sqrt(found)


def _evenness(power: Array) -> float:
    """ln of the median over the mean; ln ln 2 for Gaussian noise."""
    return float(np.log(max(float(np.median(power)), 1e-300) / max(float(power.mean()), 1e-300)))
