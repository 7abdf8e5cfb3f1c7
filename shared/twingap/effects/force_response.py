"""Response of a simulator to a force at the bearing, from the spectra of finished waveforms.

mean density of records with defects less that of healthy ones --> power of the response --minimum phase--> response

Where single impacts do not stand out, their mean cannot be taken, but their power can: noise that passes the path has
the right spectrum, and impulses have the right power.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.signal import minimum_phase, welch

from twingap.effects.impact_train import BEFORE

Array = NDArray[np.float64]

_SEGMENT: Final = 512
"""Samples of a segment, and of the response. A longer one resolves lighter damping, with larger errors."""
_FEWEST: Final = 8
"""Segments of a record, at least. With fewer, its density is not known."""
_STANDS_OUT: Final = 0.3
"""Largest excess over the healthy density from which the response is known. A smaller value takes noise for it."""
_NOTHING: Final = 1e-3
"""Excess over its maximum that counts as none. A smaller value takes errors of densities for a response."""


def force_response(healthy: Sequence[Array], faulty: Sequence[Array]) -> Array | None:
    """Response to one impulse, of unit maximum at sample `BEFORE`; None where records with defects have no more power.

    Parameters
    ----------
    healthy, faulty : sequence of Array [samples]
        At one sampling rate.
    """
    of_healthy, of_faulty = _density(healthy), _density(faulty)
    if of_healthy is None or of_faulty is None:
        return None
    more = of_faulty - of_healthy
    if not (more > _STANDS_OUT * of_healthy).any():
        return None
    power = np.maximum(more, _NOTHING * float(more.max()))
    # The response of zero phase whose transform is the power has the minimum phase of its square root as a factor.
    even = np.roll(scipy.fft.irfft(power), _SEGMENT // 2)
    found = minimum_phase(np.append(even, even[0]), method="homomorphic", n_fft=16 * _SEGMENT, half=True)
    top = int(np.abs(found).argmax())
    found = np.concatenate((np.zeros(max(BEFORE - top, 0)), found[max(top - BEFORE, 0) :]))
    return np.asarray(found / found[BEFORE])


def _density(records: Sequence[Array]) -> Array | None:
    """[_SEGMENT / 2 + 1] Mean density of records."""
    known = [
        welch(x, nperseg=_SEGMENT, detrend="constant", return_onesided=False)[1][: _SEGMENT // 2 + 1]
        for x in records if x.size >= _FEWEST * _SEGMENT
    ]  # fmt: skip
    return np.asarray(np.mean(known, axis=0)) if known else None
