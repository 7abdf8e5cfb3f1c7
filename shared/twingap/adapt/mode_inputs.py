"""Variational modes of windows as input channels of a network, with a cache of the decomposition.

windows [windows, N] --unit variance--> vmd --by frequency--> modes [windows, K, N] --quantity--> input, float32
                                         |  ^
                                    <digest>.npy in the cache
"""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twingap import files
from twingap.adapt.views import VIEWS, inputs, waveform
from twingap.adapt.windows import Windows
from twingap.errors import TwingapError
from twingap.provenance import digest_of_code, digest_of_value
from twingap.signal import vmd as vmd_function
from twingap.signal import vmd_kernel
from twingap.signal.envelope import envelope

Modes32 = NDArray[np.float32]


@dataclass(frozen=True)
class ModeInputs:
    """Options of the conversion of windows to network inputs.

    Parameters
    ----------
    n_modes : int
        Number K of modes.
    alpha : float
        Penalty on the bandwidth of modes; see `twingap.signal.vmd`.
    tol : float
        Tolerance of the decomposition, for windows of unit variance.
    max_iterations : int
        Most iterations of the decomposition.
    quantity : str
        Channel computed from each mode: "modes" (as in the paper) is its waveform in standard deviations of the window,
        "envelope" its standardised envelope, any other a view of `twingap.adapt.VIEWS`.
    cache : Path or None
        Folder of stored modes, with the content of the windows as key; None = no cache. It has no effect on results.

    Raises
    ------
    TwingapError
        For an unknown quantity.
    """

    n_modes: int = 4
    alpha: float = 2000.0
    tol: float = 1e-7
    max_iterations: int = 500
    quantity: str = "modes"
    cache: Path | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        known = ("modes", "envelope", *VIEWS)
        if self.quantity not in known:
            raise TwingapError(f"unknown quantity {self.quantity!r} of modes", mend=f"use one of {', '.join(known)}")

    @property
    def waveforms(self) -> bool:
        """Whether channels are waveforms, whose class does not depend on shift and sign."""
        return self.quantity in ("modes", "waveform")

    def __call__(self, windows: Windows) -> Modes32:
        """Network input [windows, K, points]. Labels are not used."""
        modes = self.modes(windows)
        if self.quantity == "modes":
            return modes
        if self.quantity == "envelope":
            found = envelope(modes.astype(np.float64), None)
            found -= found.mean(axis=-1, keepdims=True)
            return np.asarray(found / np.maximum(found.std(axis=-1, keepdims=True), 1e-12), dtype=np.float32)
        return np.concatenate(
            [
                inputs(dataclasses.replace(windows, samples=modes[:, k].astype(np.float64)), self.quantity)
                for k in range(self.n_modes)
            ],
            axis=1,
        )

    def modes(self, windows: Windows) -> Modes32:
        """Modes by ascending centre frequency [windows, K, N], in standard deviations of their window."""
        if self.cache is None:
            return self._decomposed(windows)
        path = self.cache / f"{self.key(windows)}.npy"
        if path.exists():
            try:
                held = np.load(path, allow_pickle=False)
                if held.shape == (len(windows), self.n_modes, windows.samples.shape[1]) and held.dtype == np.float32:
                    return np.asarray(held)
            except (OSError, ValueError, EOFError):  # a damaged file is computed again
                pass
        modes = self._decomposed(windows)
        with files.replacing(path) as target:
            files.save_npy(target, modes)
        return modes

    def key(self, windows: Windows) -> str:
        """Hex sha256 of samples, settings and code of the decomposition."""
        samples = np.ascontiguousarray(windows.samples, dtype="<f8")
        content = hashlib.sha256(samples.data).hexdigest()
        settings = [self.n_modes, self.alpha, self.tol, self.max_iterations]
        return digest_of_value({"of": content, "shape": samples.shape, "settings": settings, "code": _code()})

    def _decomposed(self, windows: Windows) -> Modes32:
        found = vmd_function(
            waveform(windows), self.n_modes, alpha=self.alpha, tol=self.tol, max_iterations=self.max_iterations
        )  # fmt: skip
        return found.in_order().values.astype(np.float32)


@cache
def _code() -> str:
    return digest_of_code(vmd_function, vmd_kernel, waveform)
