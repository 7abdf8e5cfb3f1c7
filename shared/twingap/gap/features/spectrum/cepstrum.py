"""Features of the cepstrum: an echo of fixed delay, at a lag that neither shaft nor fault explains.

log spectrum, its own shape and its tones taken out --> cepstrum --> peak and lag
"""

from __future__ import annotations

import math

import numpy as np
import scipy.fft

from twingap.gap.features.tones.envelope_lines import fault_hz
from twingap.gap.features.tones.tones import lines_of
from twingap.signal.record_transforms import RecordTransforms, band_medians, medians


def measure_ripple(record: RecordTransforms, out: dict[str, float]) -> None:
    """Fill `echo_peak`, `echo_lag_log`: the highest cepstral peak at a lag that neither shaft nor fault explains."""
    power = record.transform.real**2 + record.transform.imag**2
    log_power = np.log(np.maximum(power, 1e-300 + 1e-12 * float(power.mean())))
    coarse = band_medians(log_power[1:], 48)
    centres = (np.arange(48) + 0.5) * ((power.size - 1) / 48)
    log_power -= np.interp(np.arange(power.size), centres, coarse)
    log_power[0] = 0.0
    # Tones are no ripple.
    cepstrum = scipy.fft.irfft(np.clip(log_power, -4, 2.5), record.x.size)
    last = int(min(0.1 * record.fs_hz, record.x.size // 4))
    if last < 160:
        return
    lags = np.arange(128, last)
    z = cepstrum[lags] * math.sqrt(record.x.size)
    rates = [lines_of(record).shaft_hz]
    if record.fault_order is not None:
        rates.append(fault_hz(record))
    for rate in rates:
        period = record.fs_hz / rate
        k = np.maximum(np.rint(lags / period), 1)
        z[np.abs(lags - k * period) < 2.5 + 0.01 * lags] = 0.0
    best = int(np.argmax(z))
    free = np.abs(z[z != 0])
    spread = float(medians(free)) / 0.6745 if free.size else 1.0
    out["echo_peak"] = math.log10(max(float(z[best]), 0.0) / max(spread, 1e-9) + 1.0)
    out["echo_lag_log"] = math.log10(lags[best] / record.fs_hz)
