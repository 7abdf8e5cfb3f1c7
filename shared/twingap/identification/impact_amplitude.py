"""Impact amplitude of a fault: energy that it adds in the mode's band, relative to that of unit impacts.

faulty minus healthy spectra, in the band --/ unit impacts through the mode--> amplitude squared
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twingap.identification.healthy_model import HealthyModel, is_of
from twingap.identification.impacts import band, band_energy, impact_gain, unit_spectra
from twingap.identification.intervals import Spread, clusters, jackknife
from twingap.identification.resonance import HealthyFit
from twingap.identification.spectra import Spectra

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Amplitude:
    """Spectra of a fault's records and of unit impacts in the mode's band, for each sampling rate."""

    problem: HealthyModel
    fault: str
    sides: tuple[tuple[Spectra, Mask, Array, Array], ...]  # spectra, band, unit PSDs, gain at the first fit

    @classmethod
    def of(cls, problem: HealthyModel, fault: str, fit: HealthyFit, root: int) -> Amplitude:
        """Compute the spectra."""
        sides = []
        for s in problem.of(is_of(problem.records, fault)):
            speeds = [problem.records.conditions[int(place)].speed_rpm for place in s.places]
            inside = band(s, fit, problem.twin.bearing.fault_order(fault) * max(speeds) / 60)
            unit = unit_spectra(problem.twin, fit, s, problem.records, root)
            sides.append((s, inside, unit, impact_gain(s, fit)))
        return cls(problem, fault, tuple(sides))

    def power(self, fit: HealthyFit, healthy: Mask, keep: Mask) -> float:
        """Squared amplitude in record units, possibly negative, from some healthy and faulty records."""
        above, unit = 0.0, 0.0
        for s, inside, template, gain in self.sides:
            own = keep[s.places]
            if not own.any():
                continue
            floor = float(band_energy(s, self.floor(s, fit, healthy), inside))
            weights = s.averages[own]
            above += float(weights @ (band_energy(s, s.psd[own], inside) - floor))
            moved = template[own] * (impact_gain(s, fit) / gain)
            unit += float(weights @ band_energy(s, moved, inside))
        return above / unit

    def floor(self, spectra: Spectra, fit: HealthyFit, healthy: Mask) -> Array:
        """PSD without the fault: measured if there are healthy records at this rate, else fitted."""
        same = [s for s in self.problem.of(healthy) if s.fs_hz == spectra.fs_hz] if healthy.any() else []
        return same[0].mean(lines=True)[0] if same else fit.psd(spectra)

    def spread(self, fit: HealthyFit, healthy: Mask, scale: float) -> Spread:
        """Spread of the squared amplitude in multiples of scale, by the scatter of the faulty records."""
        places = np.concatenate([s.places for s, *_ in self.sides])

        def without(keep: Mask) -> Array:
            mask = np.zeros(len(self.problem.records), bool)
            mask[places[keep]] = True
            return np.array([self.power(fit, healthy, mask) / scale**2])

        return jackknife(without, clusters([str(self.problem.records.conditions[p].group) for p in places]))
