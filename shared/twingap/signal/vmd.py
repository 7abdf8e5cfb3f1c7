"""Variational mode decomposition of many signals at once, in agreement with vmdpy.

signals -> cosine transform of the mirrored signal -> kernel (per signal, until still) -> modes, centre frequencies

Source: Dragomiretskiy and Zosso, Variational mode decomposition, IEEE Trans. Signal Process. 62 (2014) 531,
doi:10.1109/TSP.2013.2288675, in the conventions of vmdpy 0.2 (after the authors' MATLAB code):

- the filter of a mode is 1 / (1 + alpha (f - f_k)^2), f in cycles/sample and without the paper's factor 2;
- the tolerance is absolute: on the sum over modes and mirrored samples of the squared change of an iteration, so it
  depends on the unit of the signal (`relative=True` mends that);
- at most 500 iterates, the zero one included; modes and centre frequencies are those of the iterate before the last;
- the Nyquist bin, zero for a mirrored signal, is given the value of its neighbour (kept for even lengths alone).

Mirrored at both ends, a signal is one period of a function that is even about half a sample before its first. So its
spectrum is its cosine transform times a known phase, and as every step of the method multiplies spectra by real
numbers, the phase never changes: the iteration runs on real numbers, half as many as the spectrum has, exactly. For the
same reason a signal of odd length needs no special care; vmdpy drops its last sample, here it is kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from twingap.errors import TwingapError
from twingap.signal._input import Array, as_signals, positive, whole

Start = Literal["zero", "uniform", "random"]
_STARTS: tuple[Start, ...] = ("zero", "uniform", "random")
_TASK_SAMPLES = 16384
"""Short signals are handed to a thread in groups of about this many samples."""


@dataclass(frozen=True)
class Modes:
    """Signals taken apart.

    Parameters
    ----------
    values : Array [..., K, samples]
        The modes, in the unit of the signal, in the order of their starting frequencies (not sorted afterwards).
    centres : Array [..., K]
        Centre frequencies, cycles/sample (`vmd`) or Hz (`vmd_hz`).
    iterations : int array [...]
        Iterations done.
    converged : bool array [...]
        Whether the tolerance was met within them.
    """

    values: Array
    centres: Array
    iterations: NDArray[np.int64]
    converged: NDArray[np.bool_]

    def in_order(self) -> Modes:
        """The same modes by ascending centre frequency."""
        order = np.argsort(self.centres, axis=-1, kind="stable")
        return Modes(
            np.take_along_axis(self.values, order[..., None], axis=-2),
            np.take_along_axis(self.centres, order, axis=-1),
            self.iterations,
            self.converged,
        )


def vmd(
    x: ArrayLike,
    n_modes: int,
    *,
    alpha: float = 2000.0,
    tau: float = 0.0,
    dc: bool = False,
    init: Start | Literal[0, 1, 2] | ArrayLike = "uniform",
    tol: float = 1e-7,
    max_iterations: int = 500,
    relative: bool = False,
    rng: np.random.Generator | None = None,
    threads: int | None = None,
) -> Modes:
    """Take signals apart into `n_modes` modes, each narrow about a centre frequency.

    Parameters
    ----------
    x : array_like [..., samples]
        At least 4 samples each. Every signal converges on its own.
    n_modes : int
        K.
    alpha : float
        Narrowness of the modes, (samples/cycle)^2: a mode is halved 1/sqrt(alpha) cycles/sample off its centre per
        pass. Bearing signals: 2000 to 2500.
    tau : float
        Step of the dual ascent; 0 leaves noise out of the modes, above 0 drives their sum towards the signal (in
        noise the centre frequencies then keep wandering, and the tolerance is rarely met).
    dc : bool
        Hold the first mode at frequency 0.
    init : {"zero", "uniform", "random"} or {0, 1, 2} or array_like [K] or [..., K]
        Where the centre frequencies start: all at 0, evenly spaced from 0 to 1/2, drawn log-uniformly between 1/samples
        and 1/2, or as given (cycles/sample).
    tol : float
        Absolute tolerance, in squared units of `x` (see the module).
    max_iterations : int
        Iterates at most, the zero one included, as in vmdpy: its 500 are 499 steps.
    relative : bool
        Divide each signal by its rms first and multiply the modes by it afterwards, which makes the tolerance, and so
        the result, independent of the unit. Equals the absolute one for a signal of rms 1.
    rng : numpy.random.Generator, optional
        Needed by init "random" alone.
    threads : int, optional
        Threads at most; default `numba.get_num_threads()`. Results are the same bytes for any number.

    Returns
    -------
    Modes
        Zeros for a signal of zeros; a mode without energy keeps its starting frequency.

    Raises
    ------
    TwingapError
        For NaN, infinities, fewer than 4 samples, and arguments out of range.
    """
    where = "vmd"
    signals = as_signals(x, where=where, at_least=4)
    modes = whole(n_modes, "n_modes", where=where)
    positive(alpha, "alpha", where=where)
    if not (math.isfinite(tau) and tau >= 0):
        raise TwingapError(f"tau = {tau!r}, a number of at least 0 expected", where=where)
    if not (math.isfinite(tol) and tol >= 0):
        raise TwingapError(f"tol = {tol!r}, a number of at least 0 expected", where=where)
    most = whole(max_iterations, "max_iterations", where=where, at_least=2) - 1
    shape, samples = signals.shape[:-1], signals.shape[-1]
    rows = signals.reshape(-1, samples)
    centres = _starting_centres(init, modes, shape, samples, dc, rng, where)
    values = np.empty((rows.shape[0], modes, samples))
    iterations = np.empty(rows.shape[0], dtype=np.int64)
    converged = np.empty(rows.shape[0], dtype=np.bool_)

    frequency = np.arange(samples) / (2 * samples)

    from twingap.signal.vmd_kernel import decompose

    def work(task: slice) -> None:
        part = rows[task]
        scale = _rms(part) if relative else np.ones(len(part))
        spectra = fft.dct(part / scale[:, None] if relative else part, type=2, axis=-1)
        space = np.empty((2 * modes + 2, samples))
        one, other, residual, dual = space[:modes], space[modes : 2 * modes], space[-2], space[-1]
        for i, row in enumerate(range(task.start, task.stop)):
            done, still, in_one = decompose(
                spectra[i], frequency, centres[row], float(alpha), float(tau), bool(dc), float(tol), most,
                one, other, residual, dual,
            )  # fmt: skip
            iterations[row], converged[row] = done, still
            _from_spectra(one if in_one else other, values[row])
            if relative:
                values[row] *= scale[i]

    _in_threads(work, rows.shape[0], max(1, _TASK_SAMPLES // samples), threads, where)
    return Modes(
        values.reshape(*shape, modes, samples),
        centres.reshape(*shape, modes),
        iterations.reshape(shape),
        converged.reshape(shape),
    )


def vmd_hz(
    x: ArrayLike,
    fs_hz: float,
    n_modes: int,
    *,
    bandwidth_hz: float | None = None,
    init_hz: ArrayLike | None = None,
    relative: bool = True,
    **options: object,
) -> Modes:
    """`vmd` for a signal whose sampling rate is known: frequencies in Hz, tolerance free of the signal's unit.

    Parameters
    ----------
    x : array_like [..., samples]
    fs_hz : float
        Sampling rate, Hz.
    n_modes : int
    bandwidth_hz : float, optional
        Half width at half height of a mode's filter, Hz; sets alpha = (fs / bandwidth)^2 unless alpha is given.
    init_hz : array_like [K] or [..., K], optional
        Where the centre frequencies start, Hz.
    relative : bool
        As in `vmd`, but True by default.
    **options
        Others of `vmd`.

    Returns
    -------
    Modes
        Centre frequencies in Hz.

    Raises
    ------
    TwingapError
        As `vmd`; also when both a bandwidth and alpha are given, or both init and init_hz.
    """
    rate = positive(fs_hz, "fs_hz", where="vmd_hz")
    for twice, given in (("alpha", bandwidth_hz), ("init", init_hz)):
        if given is not None and twice in options:
            raise TwingapError(f"{twice} is given twice: as such and in Hz", where="vmd_hz", mend="leave one out")
    if bandwidth_hz is not None:
        options["alpha"] = (rate / positive(bandwidth_hz, "bandwidth_hz", where="vmd_hz")) ** 2
    if init_hz is not None:
        options["init"] = np.asarray(init_hz, dtype=np.float64) / rate
    found = vmd(x, n_modes, relative=relative, **options)  # type: ignore[arg-type]
    return Modes(found.values, found.centres * rate, found.iterations, found.converged)


def _from_spectra(spectra: Array, out: Array) -> None:
    """Samples `[K, samples]` of modes from their real spectra `[K, bins]`, bins = samples."""
    samples = spectra.shape[-1]
    out[...] = fft.idct(spectra, type=2, axis=-1)
    if samples % 2 == 0:
        # vmdpy gives the Nyquist bin the (complex) value of the bin below it, k = N - 1, whose phase is
        # pi k (1 - 2a) / 2N with a = N/2 mirrored samples ahead of the first.
        phase = -math.pi * (samples - 1) ** 2 / (2 * samples)
        sign = 1.0 if samples % 4 == 0 else -1.0
        nyquist = spectra[:, -1] * (sign * math.cos(phase) / (2 * samples))
        out[:, 0::2] += nyquist[:, None]
        out[:, 1::2] -= nyquist[:, None]


def _starting_centres(
    init: Start | Literal[0, 1, 2] | ArrayLike,
    n_modes: int,
    shape: tuple[int, ...],
    samples: int,
    dc: bool,
    rng: np.random.Generator | None,
    where: str,
) -> Array:
    """Starting frequencies `[signals, K]`, cycles/sample."""
    count = math.prod(shape)
    if isinstance(init, (int, np.integer)) and not isinstance(init, bool) and 0 <= init <= 2:
        init = _STARTS[int(init)]
    if isinstance(init, str):
        if init == "zero":
            start = np.zeros((count, n_modes))
        elif init == "uniform":
            start = np.tile(0.5 / n_modes * np.arange(n_modes), (count, 1))
        elif init == "random":
            if rng is None:
                raise TwingapError("init = 'random' needs a generator", where=where, mend="pass rng=")
            start = np.sort(np.exp(rng.uniform(-math.log(samples), math.log(0.5), (count, n_modes))), axis=-1)
        else:
            raise TwingapError(f"init = {init!r}", where=where, mend=f"use one of {', '.join(_STARTS)}")
    else:
        given = np.asarray(init)
        if given.dtype.kind not in "iuf" or given.shape not in ((n_modes,), (*shape, n_modes)):
            raise TwingapError(
                f"init of type {given.dtype} and shape {given.shape}, starting frequencies [{n_modes}] expected",
                where=where,
            )
        if not ((given >= 0) & (given <= 0.5)).all():
            raise TwingapError("starting frequencies outside 0 to half the sampling rate", where=where)
        start = np.ascontiguousarray(np.broadcast_to(given, (*shape, n_modes)), dtype=np.float64).reshape(count, -1)
        start = start.copy()
    if dc:
        start[:, 0] = 0.0
    return start


def _rms(rows: Array) -> Array:
    """Rms of each row without overflow; 1 for a row of zeros."""
    peak = np.abs(rows).max(axis=-1)
    peak[peak == 0] = 1.0
    rms: Array = peak * np.sqrt(np.mean((rows / peak[:, None]) ** 2, axis=-1))
    rms[rms == 0] = 1.0
    return rms


def _in_threads(work: object, count: int, group: int, threads: int | None, where: str) -> None:
    """Call `work(slice)` for groups of signals, in threads; the kernel and the transforms let go of the lock."""
    import numba

    if threads is not None:
        whole(threads, "threads", where=where)
    most = numba.get_num_threads() if threads is None else threads
    tasks: Sequence[slice] = [slice(low, min(low + group, count)) for low in range(0, count, group)]
    assert callable(work)
    if min(most, len(tasks)) == 1:
        for task in tasks:
            work(task)
        return
    with ThreadPoolExecutor(min(most, len(tasks))) as pool:
        for _ in pool.map(work, tasks):
            pass
