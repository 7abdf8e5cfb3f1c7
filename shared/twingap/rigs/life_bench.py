"""Virtual bench of a bearing life test: acceleration at the sensor for a given speed, load and spall.

rough surfaces (spectrum in space, swept by speed) --+
waviness and changing stiffness (ball-pass orders) --+--> structure's modes --> + tones, background --> sensor [g]
balls hitting a spall (`twingap.rigs.spall`) --------+

The force of an impact follows from its speed by Hertz's law. The modes are linear and do not act back on the contact,
whose equation of motion is not integrated. How amplitude depends on speed is not prescribed: at higher speed the rough
surfaces excite higher frequencies, impacts are stronger and shorter, and ball-pass orders meet the structure's modes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal

from twingap.bearing import Bearing
from twingap.rigs.rolling import Impacts, Motion, force, load_share, move, slow_noise
from twingap.rigs.spall import impact
from twingap.rigs.structure import Structure

Array = NDArray[np.float64]
GRAVITY = 9.80665
OVERSAMPLING = 2
"""Steps of the simulation per sample; more place impacts more finely and are slower."""
SETTLING_S = 0.1
"""Time simulated before each snapshot and discarded, s."""
MOTION_HZ = 2000.0
"""Rate at which the angles of shaft and cage are computed, Hz; they vary slowly and are interpolated."""
BANDS_HZ = ((400, 500), (1000, 1500), (2300, 3100), (4100, 5200), (6400, 7900), (9800, 11800))
FULL_SCALE_G = 50.0
STEP_G = FULL_SCALE_G / 2**15
"""Step of the 16-bit converter, g."""
DENT_MM = 0.12
"""Length of a spall with the same impacts as the indentation made before the test, mm; its rounded edges make it
short."""


@dataclass(frozen=True)
class LifeBench:
    """Bench with one mounted bearing.

    Parameters
    ----------
    bearing : Bearing
    structure : Structure
        Structure with this mounting of the bearing.
    slip : float
        Mean slip of the cage, a fraction.
    roughness : float
        Amplitude of the rolling noise at 1500 rpm, N per root Hz at 1 kHz.
    waviness_n : float
        Force of the strongest ball-pass order, N.
    wavy_order : int
        Multiple of the ball-pass order that is strongest.
    size_spread : Array [rollers]
        Strength of each ball's impacts relative to the mean.
    gain : float
        Acceleration at the sensor relative to that of the structure.
    background_g : float
        RMS of the coloured background noise, g.
    """

    bearing: Bearing
    structure: Structure
    slip: float
    roughness: float
    waviness_n: float
    wavy_order: int
    size_spread: Array
    gain: float = 1.0
    background_g: float = 0.03

    @classmethod
    def draw(cls, rng: np.random.Generator, bearing: Bearing) -> LifeBench:
        """Random bench, scaled to 15 g for a spall of 3 mm and to 2.4 g for healthy rolling, at 1500 rpm and 9 kN.

        Both values are peak to peak. They set the gain at the sensor, the roughness and the waviness, which causes half
        of the rolling noise or more where its order meets the first mode. The speed at which it does, and the
        dependence on speed in general, follow from the random structure.
        """
        bench = cls(
            bearing, Structure.draw(rng, BANDS_HZ), slip=0.002, roughness=0.0, waviness_n=0.0,
            wavy_order=int(rng.integers(5, 7)), size_spread=np.ones(bearing.n_rollers), background_g=0.0,
        )  # fmt: skip
        n, fs_hz = 25_000, 50_000.0
        entropy = int(rng.integers(0, 2**63))

        def peak_to_peak(bench: LifeBench, spall_mm: float, speed_rpm: float = 1500.0) -> float:
            x = bench.acceleration(speed_rpm, 9000.0, spall_mm, n, fs_hz, np.random.default_rng(entropy), wear=1.0)
            return float(np.ptp(x))

        bench = replace(bench, gain=15.0 / peak_to_peak(bench, 3.0))
        rough = peak_to_peak(replace(bench, roughness=1.0), 0.0)
        resonant_rpm = 60 * float(bench.structure.frequency_hz[0]) / (bench.wavy_order * bearing.bpfo)
        wavy = peak_to_peak(replace(bench, waviness_n=100.0), 0.0, float(np.clip(resonant_rpm, 1000, 2000)))
        waviness_n = 100.0 * float(rng.uniform(0.5, 0.8)) * 2.4 / wavy
        return replace(bench, roughness=2.4 / rough, waviness_n=waviness_n, background_g=0.03)

    def mounted(self, rng: np.random.Generator) -> LifeBench:
        """The same bench with another bearing mounted."""
        return replace(
            self,
            structure=self.structure.remounted(rng),
            slip=float(rng.uniform(0.0, 0.006)),
            roughness=float(self.roughness * np.exp(rng.normal(0.0, 0.1))),
            waviness_n=float(self.waviness_n * np.exp(rng.normal(0.0, 0.2))),
            size_spread=np.exp(rng.normal(0.0, 0.04, self.bearing.n_rollers)),
        )

    def length_for_ratio(self, ratio: float, rng: np.random.Generator) -> float:
        """Length of a spall, mm, that raises peak to peak at 1500 rpm and 9 kN by `ratio` over the healthy bearing."""
        entropy = rng.integers(0, 2**63, 3)

        def peak_to_peak(spall_mm: float) -> float:
            return float(np.mean([
                np.ptp(self.acceleration(1500.0, 9000.0, spall_mm, 25_000, 50e3, np.random.default_rng(e), wear=1.0))
                for e in entropy
            ]))  # fmt: skip

        wanted = ratio * peak_to_peak(0.0)
        low, high = 0.1, 3.0
        for _ in range(6):
            middle = float(np.sqrt(low * high))
            low, high = (middle, high) if peak_to_peak(middle) < wanted else (low, middle)
        return float(np.sqrt(low * high))

    def record(
        self, speed_rpm: float, load_n: float, spall_mm: float, n: int, fs_hz: float, rng: np.random.Generator,
        *, wear: float,
    ) -> Array:  # fmt: skip
        """Samples of a snapshot: `acceleration` in steps of the converter, limited to its range [n], g."""
        x = self.acceleration(speed_rpm, load_n, spall_mm, n, fs_hz, rng, wear=wear)
        codes = np.clip(np.round(x / STEP_G), -(2**15), 2**15 - 1)
        return np.asarray(codes * STEP_G + 0.0)  # no negative zeros

    def acceleration(
        self, speed_rpm: float, load_n: float, spall_mm: float, n: int, fs_hz: float, rng: np.random.Generator,
        *, wear: float,
    ) -> Array:  # fmt: skip
        """Acceleration before the converter.

        Parameters
        ----------
        speed_rpm, load_n : float
            Shaft speed, rpm, and radial load, N.
        spall_mm : float
            Length of the spall, mm; the indentation is present also at 0.
        n : int
            Number of samples.
        fs_hz : float
            Sampling rate, Hz.
        rng : numpy.random.Generator
        wear : float
            Level of the rolling noise relative to that of new surfaces at working temperature.

        Returns
        -------
        Array [samples]
            g.
        """
        fine_hz = OVERSAMPLING * fs_hz
        settle = int(SETTLING_S * fs_hz)
        count = OVERSAMPLING * (n + settle)
        coarse = int(np.ceil(count / fine_hz * MOTION_HZ)) + 2
        motion = move(self.bearing, speed_rpm, coarse, MOTION_HZ, self.slip, rng)
        t = np.arange(count) / fine_hz
        zone = float(np.clip(0.3 + load_n / 40_000, 0.3, 0.6))
        acting = force(self._impacts(motion, load_n, zone, spall_mm + DENT_MM, rng), count, fine_hz)
        passing = np.exp(2j * np.pi * self.bearing.n_rollers * np.interp(t, motion.t, motion.cage))
        if self.roughness > 0:
            rolling = wear * self._rolling_noise(speed_rpm, count, fine_hz, rng)
            acting += rolling * (1 + 0.08 * passing.real)
        if self.waviness_n > 0:
            acting[1] += self._waviness(passing, rng)
        x = self.structure.acceleration(acting, fine_hz) * (self.gain / GRAVITY)
        if self.background_g > 0:
            x += self._disturbances(t, motion, fine_hz, rng)
        return np.asarray(signal.resample_poly(x, 1, OVERSAMPLING)[settle:])

    def _rolling_noise(self, speed_rpm: float, n: int, fs_hz: float, rng: np.random.Generator) -> Array:
        """Force of rough surfaces [2, samples], N.

        Heights whose spectrum falls as k^-2.5 over wavenumber give v^1.5 f^-2.5 over frequency at speed v. A contact of
        finite length averages shorter waves, which gives a corner frequency proportional to v.
        """
        rolling_m_s = speed_rpm / 60 * np.pi * self.bearing.pitch_diameter_mm * 1e-3 * 0.5
        f = np.maximum(np.fft.rfftfreq(n, 1 / fs_hz), 30.0)
        corner_hz = rolling_m_s / 0.45e-3
        level = self.roughness * (speed_rpm / 1500) ** 0.75 * (f / 1000) ** -1.25 / (1 + (f / corner_hz) ** 2)
        draws = rng.standard_normal((2, 2, f.size))
        spectrum = level * (draws[0] + 1j * draws[1]) * np.sqrt(n * fs_hz) / 2
        return np.asarray(fft.irfft(spectrum, n, axis=1))

    def _waviness(self, passing: NDArray[np.complex128], rng: np.random.Generator) -> Array:
        """Force along the load of waviness (one strong order) and of varying stiffness as balls pass [samples], N."""
        turn = np.exp(2j * np.pi * rng.uniform(size=8))
        total = np.zeros(passing.size)
        power = np.ones_like(passing)
        for k in range(1, 9):
            power = power * passing
            level = 1.0 if k == self.wavy_order else 0.25 / k
            total += self.waviness_n * level * (turn[k - 1] * power).real
        return total

    def _disturbances(self, t: Array, motion: Motion, fs_hz: float, rng: np.random.Generator) -> Array:
        """Disturbances: unbalance, switching of the drive, coloured background noise [samples], g."""
        x = self.background_g * slow_noise(rng, t.size, fs_hz, 2e-4)
        shaft = 2 * np.pi * np.interp(t, motion.t, motion.shaft)
        for harmonic, level in ((1, 0.02), (2, 0.012)):
            x += level * np.cos(harmonic * shaft + rng.uniform(0, 2 * np.pi))
        for side in (-1, 1):
            x += 0.015 * np.cos(2 * np.pi * 8000.0 * t + 4 * side * shaft + rng.uniform(0, 2 * np.pi))
        return x

    def _impacts(
        self, motion: Motion, load_n: float, zone: float, length_mm: float, rng: np.random.Generator
    ) -> Impacts:
        """Impacts of all balls on a spall of the inner race."""
        bearing = self.bearing
        z = bearing.n_rollers
        relative = motion.shaft - motion.cage
        at: list[Array] = []
        relative_strength: list[Array] = []
        for roller in range(z):
            turns = np.arange(np.ceil(relative[0] - roller / z), np.floor(relative[-1] - roller / z) + 1)
            # The position of a ball in its pocket is correlated from pass to pass.
            wander = signal.lfilter([1.0], [1.0, -0.7], rng.standard_normal(turns.size + 10))[10:]
            place = roller / z + 0.008 / z * wander
            at.append(np.interp(turns + place, relative, motion.t))
            relative_strength.append(np.full(turns.size, self.size_spread[roller]))
        time_s, strength = np.concatenate(at), np.concatenate(relative_strength)
        direction = 2 * np.pi * np.interp(time_s, motion.t, motion.shaft)
        radius_m = 0.5e-3 * (bearing.pitch_diameter_mm - bearing.roller_diameter_mm)
        rolling_m_s = 2 * np.pi * radius_m * np.interp(time_s, motion.t, np.gradient(relative, motion.t))
        peak_n, duration_s = impact(bearing, length_mm, rolling_m_s)
        # Unloaded balls are hardly pressed into the spall.
        pressed = 0.06 + load_share(direction, zone) * (load_n / 9000) ** 0.6
        peak_n = peak_n * strength * pressed * np.exp(rng.normal(0.0, 0.12, time_s.size))
        crossing_s = 1e-3 * length_mm / rolling_m_s
        return Impacts(
            time_s=np.concatenate([time_s, time_s + crossing_s]),
            strength_n=np.concatenate([-0.25 * peak_n, peak_n]),
            direction_rad=np.concatenate([direction, direction]),
            duration_s=np.concatenate([2.5 * duration_s, duration_s]),
        )


__all__ = ["BANDS_HZ", "FULL_SCALE_G", "STEP_G", "LifeBench"]
