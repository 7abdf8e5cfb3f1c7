"""The inner loop of variational mode decomposition, compiled.

All arrays are real: see `twingap.signal.vmd` for why. One pass over the spectrum per iteration does everything: since
an iteration filters with the centre frequencies of the one before, its filters at one frequency need nothing from other
frequencies. The spectrum is walked in blocks that stay in cache while all modes pass over them.

Slices are handed to the block functions rather than bounds: only then does the compiler see a loop it can vectorise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twingap._compiled import njit

Array = NDArray[np.float64]

BLOCK = 2048
"""Bins per block: frequencies, residual and two iterates of one mode are 64 KiB."""
EPSILON = float(np.spacing(1.0))
"""vmdpy starts its sum of changes here, so that a tolerance below it is never met."""

# Reassociation lets the compiler keep several partial sums side by side; NaN and infinity keep their meaning.
_FAST = {"reassoc", "contract", "nsz", "arcp"}


@njit(error_model="numpy", fastmath=_FAST)
def filter_block(
    new: Array, old: Array, residual: Array, dual: Array, frequency: Array, alpha: float, centre: float
) -> tuple[float, float, float]:
    """Update one mode on one block. Returns the sums of f u^2, of u^2, and of the squared change."""
    moment = energy = change = 0.0
    for i in range(new.size):
        off = frequency[i] - centre
        before = old[i]
        after = (residual[i] + before - 0.5 * dual[i]) / (1.0 + alpha * off * off)
        difference = after - before
        residual[i] -= difference
        new[i] = after
        power = after * after
        moment += frequency[i] * power
        energy += power
        change += difference * difference
    return moment, energy, change


@njit(error_model="numpy", fastmath=_FAST)
def filter_block_slack(
    new: Array, old: Array, residual: Array, frequency: Array, alpha: float, centre: float
) -> tuple[float, float, float]:
    """`filter_block` where the dual variable stays zero (tau = 0): the common case, with one array less to read."""
    moment = energy = change = 0.0
    for i in range(new.size):
        off = frequency[i] - centre
        before = old[i]
        after = (residual[i] + before) / (1.0 + alpha * off * off)
        difference = after - before
        residual[i] -= difference
        new[i] = after
        power = after * after
        moment += frequency[i] * power
        energy += power
        change += difference * difference
    return moment, energy, change


@njit(error_model="numpy")
def decompose(
    spectrum: Array,
    frequency: Array,
    centres: Array,
    alpha: float,
    tau: float,
    hold_first: bool,
    tolerance: float,
    most: int,
    one: Array,
    other: Array,
    residual: Array,
    dual: Array,
) -> tuple[int, bool, bool]:
    """Iterate on one signal until its modes stand still.

    Parameters
    ----------
    spectrum : Array [bins]
        Real spectrum of the mirrored signal.
    frequency : Array [bins]
        Of each bin, cycles/sample: i / (2 bins).
    centres : Array [K]
        Centre frequencies, cycles/sample: at the start on entry, of the iterate before the last on return.
    alpha, tau : float
    hold_first : bool
        Keep the first mode's centre where it is.
    tolerance : float
        On the sum over modes and mirrored samples of the squared change.
    most : int
        Iterations at most, at least 1.
    one, other : Array [K, bins]
        Work space for two iterates.
    residual, dual : Array [bins]
        Work space.

    Returns
    -------
    int, bool, bool
        Iterations done; whether the tolerance was met; whether the iterate before the last lies in `one` (else in
        `other`).
    """
    n_modes, bins = one.shape
    moment, energy, before = np.empty(n_modes), np.empty(n_modes), np.empty(n_modes)
    one[:] = 0.0
    dual[:] = 0.0
    residual[:] = spectrum
    old, new = one, other
    done = 0
    old_is_one = True
    while True:
        moment[:] = 0.0
        energy[:] = 0.0
        total = 0.0
        for low in range(0, bins, BLOCK):
            high = min(low + BLOCK, bins)
            r, f, d = residual[low:high], frequency[low:high], dual[low:high]
            for k in range(n_modes):
                if tau == 0.0:
                    m, e, c = filter_block_slack(new[k, low:high], old[k, low:high], r, f, alpha, centres[k])
                else:
                    m, e, c = filter_block(new[k, low:high], old[k, low:high], r, d, f, alpha, centres[k])
                moment[k] += m
                energy[k] += e
                total += c
            if tau != 0.0:
                # What is left of the signal is minus the violation of "the modes add up to it".
                d -= tau * r
        for k in range(n_modes):
            before[k] = centres[k]
            # A mode without energy (a signal of zeros) has no centre of its own and stays where it is.
            if not (hold_first and k == 0) and energy[k] > 0.0:
                centres[k] = moment[k] / energy[k]
        done += 1
        still = total / (2 * bins) + EPSILON <= tolerance
        if still or done >= most:
            centres[:] = before
            return done, still, old_is_one
        old, new = new, old
        old_is_one = not old_is_one
