"""How much of what rings is noise, where every record is of a defect.

record --band of the mode--> power over time --median over mean--> how evenly it is spread ----------+
twin: noise + impacts, mixed --same------------------------------> the same for every mixture -------+--> noise's part

Between the lines of a spectrum, impacts whose spacing is not quite even look like noise. Over time they do not: noise
is there always, impacts ring seldom. The median of the squared envelope of Gaussian noise is ln 2 of its mean
(Rayleigh), and less by all that comes seldom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.identify.impacts import actual_speed, ringing_power, silent_twin
from twingap.identify.resonance import HealthyFit
from twingap.records import Record
from twingap.streams import Streams
from twingap.twins.phenomenological import PhenomenologicalTwin

Array = NDArray[np.float64]

_PARTS: Final = np.array([0.003, 0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
_TELLING: Final = 0.3
"""By how much the logarithm of median over mean has to differ between noise alone and impacts alone."""
MOST: Final = 8
"""Records that are looked at."""


def noise_share(twin: PhenomenologicalTwin, fit: HealthyFit, records: Sequence[Record], root: int) -> float:
    """Power of structure noise over what was fitted to struck records.

    Parameters
    ----------
    twin : PhenomenologicalTwin
        Whose effects act on its impacts.
    fit : HealthyFit
        The mode, and noises that may hold impacts.
    records : sequence of Record
        Of defects; a few of each do.
    root : int
        Entropy of the simulations.

    Returns
    -------
    float
        At most 1; the median over records. 1 where ringing overlaps so much that time does not tell.
    """
    found = [_share(twin, fit, record, Streams(root, place)) for place, record in enumerate(records)]
    known = [share for share in found if share is not None]
    return float(np.clip(np.median(known), 1e-4, 1.0)) if known else 1.0


def _share(twin: PhenomenologicalTwin, fit: HealthyFit, record: Record, streams: Streams) -> float | None:
    fs_hz, n = record.condition.fs_hz, record.samples.size
    half = max(3 * fit.damping_ratio * fit.resonance_hz, 8 * fs_hz / n)

    def power(samples: Array) -> Array:
        return ringing_power(samples, fs_hz, fit.resonance_hz, half)

    silent = silent_twin(twin, fit)
    speed_rpm = actual_speed(silent, fit, record)
    (struck,) = silent.make([replace(record.condition, speed_rpm=speed_rpm)], [streams])
    parameters = replace(
        silent.parameters, impact_amplitude=dict.fromkeys(silent.parameters.impact_amplitude, 0.0),
        structure_noise_rms=fit.structure_noise_rms, white_noise_rms=0.0,
    )  # fmt: skip
    (noise,) = PhenomenologicalTwin(twin.bearing, parameters, (), twin.unit).make(
        [replace(record.condition, fault="healthy")], [streams]
    )
    white = fit.white_noise_rms * streams("white of a mixture").standard_normal(n)
    whole = noise.samples + white
    measured = power(record.samples)
    of_noise, of_impacts = float(power(whole).mean()), float(power(struck.samples).mean())
    if min(of_noise, of_impacts) <= 0:
        return None
    total = float(measured.mean())
    mixed = [
        np.sqrt(part * total / of_noise) * whole + np.sqrt((1 - part) * total / of_impacts) * struck.samples
        for part in _PARTS
    ]
    even = np.maximum.accumulate([_evenness(power(x)) for x in mixed])
    if even[-1] - even[0] < _TELLING:
        return None
    part = float(np.interp(_evenness(measured), even, _PARTS))
    of_structure, of_white = (float(power(x).mean()) for x in (noise.samples, white))
    return max(part * total - of_white, 0.0) / of_structure


def _evenness(power: Array) -> float:
    """ln of the median over the mean; ln ln 2 for Gaussian noise."""
    return float(np.log(max(float(np.median(power)), 1e-300) / max(float(power.mean()), 1e-300)))
