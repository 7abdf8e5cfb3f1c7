"""Causal filters given by their response at the frequencies of a transform."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Array = NDArray[np.float64]


def filtered(x: Array, response: NDArray[Any]) -> Array:
    """A causal filter given by its response at the frequencies of a transform of `fast_length(x.size)` samples.

    The end runs into the beginning: into what the caller made before the record for the filter to settle, and cuts off.
    """
    length = fast_length(x.size)
    spectrum = scipy.fft.rfft(x, length)
    spectrum *= response
    return np.asarray(scipy.fft.irfft(spectrum, length)[: x.size])


def fast_length(n: int) -> int:
    """Length of a fast transform of at least n samples."""
    return int(scipy.fft.next_fast_len(n, real=True))
