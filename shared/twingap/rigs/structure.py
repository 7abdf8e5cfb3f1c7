"""Structure of a machine: from forces at the bearing seat to acceleration at the sensor.

force along x and y [2, samples] -> modes in state-space form -> acceleration [samples]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Structure:
    """Sum of lightly damped modes, each driven along x and y with its own weights.

    Parameters
    ----------
    frequency_hz, damping_ratio : Array [modes]
    participation : Array [2, modes]
        Response of each mode to a force along x and along y, 1/kg.
    seen : Array [modes]
        Weight of each mode's acceleration at the sensor, with sign.
    """

    frequency_hz: Array
    damping_ratio: Array
    participation: Array
    seen: Array

    @classmethod
    def draw(cls, rng: np.random.Generator, bands_hz: tuple[tuple[float, float], ...]) -> Structure:
        """Random structure: one mode in each band, with random damping and residues of either sign."""
        low, high = np.array(bands_hz).T
        modes = len(bands_hz)
        participation, seen = rng.normal(0.0, 1.0, (2, modes)), rng.normal(0.0, 1.0, modes)
        # The sum of squared residues is fixed: machines differ more in their modes than in their mass.
        seen *= 3.0 / np.sqrt(np.sum((participation * seen) ** 2))
        damping_ratio = np.exp(rng.uniform(np.log(0.012), np.log(0.06), modes))
        return cls(rng.uniform(low, high), damping_ratio, participation, seen)

    def remounted(self, rng: np.random.Generator) -> Structure:
        """The same machine after the bearing was replaced, with slightly different seats and bolts."""
        modes = self.frequency_hz.size
        return Structure(
            frequency_hz=self.frequency_hz * np.exp(rng.normal(0.0, 0.015, modes)),
            damping_ratio=self.damping_ratio * np.exp(rng.normal(0.0, 0.15, modes)),
            participation=self.participation + rng.normal(0.0, 0.2, (2, modes)),
            seen=self.seen + rng.normal(0.0, 0.15, modes),
        )

    def acceleration(self, force: Array, fs_hz: float) -> Array:
        """Acceleration at the sensor.

        Parameters
        ----------
        force : Array [2, samples]
            Force along x and y, N.
        fs_hz : float

        Returns
        -------
        Array [samples]
            m/s^2.
        """
        total = np.zeros(force.shape[1])
        for mode in range(self.frequency_hz.size):
            w, zeta = 2 * np.pi * self.frequency_hz[mode], self.damping_ratio[mode]
            drive = self.participation[:, mode] @ force
            # q'' = drive - 2 zeta w q' - w^2 q, held constant between samples; the output is q'' itself.
            continuous = (
                np.array([[0.0, 1.0], [-(w**2), -2 * zeta * w]]),
                np.array([[0.0], [1.0]]),
                np.array([[-(w**2), -2 * zeta * w]]),
                np.array([[1.0]]),
            )
            a, b, c, d, _ = signal.cont2discrete(continuous, 1 / fs_hz, method="zoh")
            numerator, denominator = signal.ss2tf(a, b, c, d)
            total += self.seen[mode] * signal.lfilter(numerator[0], denominator, drive)
        return total
