"""A virtual machine with one test bearing, and its recordings.

rolling (impacts, roughness) + shaft -> structure -> + tones, background -> sensor -> filter, decimate -> converter [g]
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from twingap.bearing import Bearing
from twingap.records import RecordSet
from twingap.rigs.rolling import LOAD_DIRECTION, force, impacts, load_share, move, slow_noise
from twingap.rigs.structure import Structure

Array = NDArray[np.float64]
GRAVITY = 9.80665
OVERSAMPLING = 4
"""Steps of the simulation per sample; more place impacts more finely and are slower."""
SETTLING_S = 0.1
"""Time simulated before each recording and discarded, s, so that filters and modes are in their stationary state."""


@dataclass(frozen=True)
class Machine:
    """A motor with one test bearing.

    Parameters
    ----------
    bearing : Bearing
    structure : Structure
        Structure with this mounting of the bearing.
    slip : float
        Mean slip of the cage, a fraction.
    roughness : float
        Amplitude of the rolling noise, N per root N of load.
    unbalance_g, electrical_g, background_g : float
        RMS of the first shaft tone, of the supply's tones and of the coloured background at the sensor, g.
    full_scale_g : float
        Range of the 16-bit converter, g.
    """

    bearing: Bearing
    structure: Structure
    slip: float
    roughness: float = 0.012
    unbalance_g: float = 0.01
    electrical_g: float = 0.008
    background_g: float = 0.012
    full_scale_g: float = 20.0

    def record(
        self, speed_rpm: float, load_n: float, fault: str, size_mm: float, severity: float, n: int, fs_hz: float,
        rng: np.random.Generator,
    ) -> Array:  # fmt: skip
        """Samples of one recording.

        Parameters
        ----------
        speed_rpm, load_n : float
            Shaft speed, rpm, and radial load, N.
        fault : {"healthy", "inner", "outer", "ball"}
        size_mm : float
            Diameter of the defect, mm; ignored when healthy.
        severity : float
            Strength of the impacts relative to the mean of defects of this size, since edges differ.
        n : int
            Number of samples.
        fs_hz : float
            Sampling rate, Hz.
        rng : numpy.random.Generator

        Returns
        -------
        Array [samples]
            Acceleration, g, in steps of the converter.
        """
        fine_hz = OVERSAMPLING * fs_hz
        settle = int(SETTLING_S * fs_hz)
        count = OVERSAMPLING * (n + settle)
        motion = move(self.bearing, speed_rpm, count, fine_hz, self.slip, rng)
        # The load zone widens with load.
        zone = float(np.clip(0.3 + load_n / 4000, 0.3, 0.6))
        acting = self._rolling_noise(motion.cage, load_n, zone, speed_rpm, count, rng)
        if fault != "healthy":
            pulses = impacts(self.bearing, fault, size_mm, load_n, zone, motion, rng)
            acting = acting + severity * force(pulses, count, fine_hz)
        x = self.structure.acceleration(acting, fine_hz) / GRAVITY
        x += self._tones(motion.t, motion.shaft, rng)
        x += self.background_g * slow_noise(rng, count, fine_hz, 3e-4) + 0.003 * rng.standard_normal(count)
        # Accelerometer on a magnet (first resonance near 14 kHz), then the recorder's filter and converter.
        w = 2 * np.pi * 14e3
        b, a = signal.bilinear([w**2], [1.0, 2 * 0.08 * w, w**2], fine_hz)
        x = signal.lfilter(b, a, x)
        taps = signal.firwin(20 * OVERSAMPLING + 1, 0.94 / OVERSAMPLING)
        x = signal.fftconvolve(x, taps, mode="same")[::OVERSAMPLING][settle:]
        step = self.full_scale_g / 2**15
        return np.asarray(np.clip(np.round(x / step), -(2**15), 2**15 - 1) * step)

    def _rolling_noise(
        self, cage: Array, load_n: float, zone: float, speed_rpm: float, n: int, rng: np.random.Generator
    ) -> Array:
        """Force of rough surfaces under load and of the stiffness that varies as rollers pass [2, samples], N."""
        strength = self.roughness * np.sqrt(load_n) * speed_rpm / 1800
        noise = signal.lfilter([0.45], [1.0, -0.55], rng.standard_normal((2, n)), axis=1)
        # One roller is slightly larger; it is at the bottom once per cage turn.
        lowest = load_share(LOAD_DIRECTION + 2 * np.pi * cage, zone)
        passing = np.cos(2 * np.pi * self.bearing.n_rollers * cage)
        noise *= 1 + 0.05 * passing + 0.05 * lowest
        noise[1] += 0.05 * passing
        return np.asarray(strength * noise)

    def _tones(self, t: Array, shaft: Array, rng: np.random.Generator) -> Array:
        """Tones of unbalance and misalignment, of the supply and of the rotor slots [samples], g."""
        x = np.zeros(t.size)
        for harmonic, level in ((1, 1.0), (2, 0.6), (3, 0.3), (5, 0.15)):
            x += np.sqrt(2) * self.unbalance_g * level * np.cos(2 * np.pi * (harmonic * shaft + rng.uniform()))
        for hz, level in ((120.0, 1.0), (240.0, 0.3)):
            x += np.sqrt(2) * self.electrical_g * level * np.cos(2 * np.pi * (hz * t + rng.uniform()))
        for side in (-1, 0, 1):  # rotor slots, with supply sidebands
            phase = 34 * shaft + side * 120.0 * t + rng.uniform()
            x += np.sqrt(2) * self.electrical_g * (0.5 if side else 1.0) * np.cos(2 * np.pi * phase)
        return x


def digest(records: RecordSet) -> str:
    """Hex sha256 over names, conditions and samples of a set, in its order.

    Samples are rounded to 1e-6 of the unit, so that rounding errors of a processor do not change the digest.
    """
    result = hashlib.sha256()
    for record in records:
        c = record.condition
        result.update(repr((c.name, c.group, c.fault, c.speed_rpm, c.load_n, c.fs_hz, c.n_samples)).encode())
        result.update(np.round(record.samples * 1e6).astype("<i8").tobytes())
    return result.hexdigest()
