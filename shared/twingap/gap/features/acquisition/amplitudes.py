"""Shape of the amplitude distribution, and asymmetries in time and in sign.

samples / RMS --> moments, crest, quantiles; steps --> skewness of the steps; halves --> power above and below zero
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.signal.record_transforms import RecordView

Array = NDArray[np.float64]

_QUANTILES: Final = (0.5, 0.9, 0.99, 0.999)


def measure_amplitudes(view: RecordView, out: dict[str, float]) -> None:
    """Shape of the amplitude distribution."""
    scale, rms = max(view.frame.scale, 1e-300), math.sqrt(view.mean_square)
    z = view.centred / rms
    square = z * z
    out["rms_log"] = math.log10(rms / scale)
    out["kurtosis_log"] = math.log10(max(float(square @ square) / z.size / 3, 1e-6))
    out["skewness"] = math.tanh(float(square @ z) / z.size)
    size = np.sqrt(square)
    out["crest_log"] = math.log10(float(size.max()))
    places = [min(int(q * z.size), z.size - 1) for q in _QUANTILES]
    rest, values, passed = size, [], 0
    for place in places:  # each in what lies above the last: several places at once take longer
        rest = np.partition(rest, place - passed)[place - passed :]
        values.append(rest[0])
        passed = place
    q = np.log10(np.maximum(values, 1e-6))
    out["quantile_50"] = float(q[0]) + out["rms_log"]
    out["quantile_90_50"], out["quantile_99_90"], out["quantile_999_99"] = (float(v) for v in np.diff(q))
    # Time reversed, a ringing or a saw tooth is another signal; upside down, a one-sided force is.
    step = np.diff(z)
    out["time_asymmetry"] = math.tanh(
        float(np.mean(step * step * step)) / max(float(step @ step) / step.size, 1e-200) ** 1.5
    )
    above = z > 0
    count, power = int(np.count_nonzero(above)), float(square @ above)
    if 0 < count < z.size:
        below = float(square.sum()) - power
        out["half_wave_asymmetry"] = math.log10(max(power / count / max(below / (z.size - count), 1e-300), 1e-6))
