"""Features of the amplitude distribution: moments, quantiles, and asymmetries in time and in sign.

samples / RMS --> moments, crest, quantiles; steps --> skewness of the steps; halves --> power above and below zero
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from twingap.signal.record_transforms import RecordTransforms

_QUANTILES: Final = (0.5, 0.9, 0.99, 0.999)
"""Quantiles of |x|. Higher ones depend on single samples."""


def measure_amplitudes(record: RecordTransforms, out: dict[str, float]) -> None:
    """Fill the features of the amplitude distribution: `rms_log` to `half_wave_asymmetry`."""
    scale, rms = max(record.frame.scale, 1e-300), math.sqrt(record.mean_square)
    z = record.centred / rms
    square = z * z
    out["rms_log"] = math.log10(rms / scale)
    out["kurtosis_log"] = math.log10(max(float(square @ square) / z.size / 3, 1e-6))
    out["skewness"] = math.tanh(float(square @ z) / z.size)
    size = np.sqrt(square)
    out["crest_log"] = math.log10(float(size.max()))
    places = [min(int(q * z.size), z.size - 1) for q in _QUANTILES]
    rest, values, passed = size, [], 0
    for place in places:  # each within the values above the last: faster than several places at once
        rest = np.partition(rest, place - passed)[place - passed :]
        values.append(rest[0])
        passed = place
    q = np.log10(np.maximum(values, 1e-6))
    out["quantile_50"] = float(q[0]) + out["rms_log"]
    out["quantile_90_50"], out["quantile_99_90"], out["quantile_999_99"] = (float(v) for v in np.diff(q))
    # Ring-down and saw teeth are asymmetric in time, one-sided forces in sign.
    step = np.diff(z)
    out["time_asymmetry"] = math.tanh(
        float(np.mean(step * step * step)) / max(float(step @ step) / step.size, 1e-200) ** 1.5
    )
    above = z > 0
    count, power = int(np.count_nonzero(above)), float(square @ above)
    if 0 < count < z.size:
        below = float(square.sum()) - power
        out["half_wave_asymmetry"] = math.log10(max(power / count / max(below / (z.size - count), 1e-300), 1e-6))
