"""Spectrum and levels of a machine without the effect to be added, relative to which the strength of effects is set.

a few records of the machine --> spectra and levels, in internal units (before the gain)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.rigs.worlds.base import Base, unit_response
from twingap.rigs.worlds.excitation import Effects
from twingap.rigs.worlds.layout import Layout
from twingap.rigs.worlds.recorder import simulate
from twingap.streams import Streams

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MachineLevels:
    """Spectrum and levels of a machine, in internal units.

    Parameters
    ----------
    hz, psd : Array [bins]
        Frequency, Hz, and one-sided power spectral density: geometric mean over the simulated records.
    quiet_rms, mean_rms : float
        RMS of the quietest record, and root mean square over all simulated records.
    values : Array [samples]
        Samples of all simulated records.
    impact_energy, impact_peak : float
        Sum of squares and peak of the response to one impact of unit impulse.
    duration_s : float
        Length of one record, s.
    faintest : float
        RMS of the impacts over that of the noise, smallest over the faults that occur.
    """

    hz: Array
    psd: Array
    quiet_rms: float
    mean_rms: float
    values: Array
    impact_energy: float
    impact_peak: float
    duration_s: float
    faintest: float

    def at(self, hz: float) -> float:
        """Power spectral density at a frequency, by interpolation of its logarithm."""
        return float(np.exp(np.interp(hz, self.hz[1:], np.log(self.psd[1:]))))

    def tone(self, hz: float, snr_db: float) -> float:
        """Peak amplitude of a tone whose line in the spectrum of one record is `snr_db` above the noise in its bin."""
        return float(np.sqrt(2 * 10 ** (snr_db / 10) * self.at(hz) / self.duration_s))


def measure(base: Base, layout: Layout, effects: Effects, root: int, count: int) -> MachineLevels:
    """Levels from `count` simulated records of each fault, spread over the conditions.

    Parameters
    ----------
    base : Base
    layout : Layout
    effects : Mapping[str, Mapping[str, Any]]
        Effects that the machine has, with parameters.
    root : int
        Entropy of the records.
    count : int
        Records of each fault (healthy counts as one).
    """
    internal = replace(base, gain=1.0)
    rms, spectra, values = [], [], []
    n_bins = int(min(2048, layout.n_samples))
    for fault in dict.fromkeys(layout.fault):
        places = [i for i, f in enumerate(layout.fault) if f == fault]
        chosen = [places[k] for k in np.unique(np.linspace(0, len(places) - 1, count + 2)[1:-1].astype(int))]
        for i in chosen:
            x = simulate(internal, layout, i, layout.speed_rpm[i], effects, Streams(root, i))
            hz, psd = signal.welch(x, layout.fs_hz, nperseg=n_bins)
            rms.append(float(np.std(x)))
            spectra.append(np.log(psd + 1e-30))
            values.append(x)
    response = unit_response(base)
    return MachineLevels(
        hz=hz,
        psd=np.exp(np.mean(spectra, axis=0)),
        quiet_rms=min(rms),
        mean_rms=float(np.sqrt(np.mean(np.square(rms)))),
        values=np.concatenate(values),
        impact_energy=float(np.sum(response**2)),
        impact_peak=float(np.abs(response).max()),
        duration_s=layout.n_samples / layout.fs_hz,
        faintest=min((base.ratio[f] for f in layout.faults), default=1.0),
    )
