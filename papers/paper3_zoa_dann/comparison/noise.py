"""White noise at a stated signal-to-noise ratio, added to windows.

windows --power of each recording--> + white noise at snr_db below (or above) it
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twingap.adapt.windows import Windows


def with_noise(windows: Windows, snr_db: float, rng: np.random.Generator) -> Windows:
    """The windows of noisier recordings.

    Parameters
    ----------
    windows : Windows
        The noise a recording already has counts as signal, as in the field's noise tests. Windows that overlap get
        noises of their own, so that they would not do for adaptation and judging at once (they never do).
    snr_db : float
        10 log10 of the variance of a recording (all its windows here, each without its mean) over that of the noise:
        one level a recording, so that its quiet stretches drown first. Infinity adds none.
    """
    centred = windows.samples - windows.samples.mean(axis=1, keepdims=True)
    sd = np.empty(len(windows))
    for group in np.unique(windows.group):
        chosen = windows.group == group
        sd[chosen] = np.sqrt(np.mean(centred[chosen] ** 2))
    noise = rng.standard_normal(windows.samples.shape)
    noise *= (sd * 10 ** (-snr_db / 20))[:, None]
    return replace(windows, samples=windows.samples + noise)
