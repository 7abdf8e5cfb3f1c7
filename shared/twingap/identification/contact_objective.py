"""Distance of the contact twin's amplitude spectra from measured ones, for many stiffnesses and dampings at once.

records -----------PSD per state, coarse----------------------> measured --+
stiffness, damping --trajectories, no noise--> PSD per state --+           |
contact mode ------structure noise of unit RMS-> PSD ----------+--levels--> RMSE of amplitude spectra
white noise -------------------------------------> flat -------+

For given stiffness and damping the spectrum is linear in three powers (scale, structure noise, white noise), which
non-negative least squares give. The objective thus has two parameters (section 2.2 of paper 3 uses the root-mean-square
error of spectra). A population is simulated in one call, sixteen trajectories at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from twingap.errors import TwingapError
from twingap.identification.intervals import clusters
from twingap.identification.mode import autocorrelation
from twingap.identification.spectra import Spectra, power_density, spectra
from twingap.records import Condition, RecordSet
from twingap.twins.contact import ContactTwin
from twingap.twins.contact_dynamics import Job, accelerations
from twingap.twins.contact_parameters import DEFECTS, ContactParameters

Array = NDArray[np.float64]

SEGMENT_S = 0.02
"""Length of a segment, s. In short segments lines of a fault merge, so that a slightly wrong speed is no misfit."""
LENGTH_S = 0.25
"""Length of a simulated trajectory, s; longer gives less scatter and is slower."""
PICKED = 12
"""Most records of a state whose conditions are simulated; more cover more speeds and are slower."""
BLOCKS = 10
"""Segments into which the records of a state are cut to estimate their scatter."""
FEWEST_GROUPS = 4
"""Groups of a state from which on groups are left out instead of segments."""


@dataclass(frozen=True)
class State:
    """Records of one state at one rate.

    Parameters
    ----------
    fault : str
    measured : Spectra
    psd : Array [bins]
        Mean PSD.
    conditions : tuple[Condition, ...]
        Conditions to simulate, some of the records' with the length of a trajectory.
    without : Array [blocks, bins]
        Mean PSD with one block left out in turn: a group of records, or a segment.
    """

    fault: str
    measured: Spectra
    psd: Array
    conditions: tuple[Condition, ...]
    without: Array


class SpectrumObjective:
    """Error of the twin's amplitude spectra against the measured ones, at points (log stiffness, log damping).

    Parameters
    ----------
    twin : ContactTwin
        Twin with the other parameters.
    states : sequence of State
    starts : Array [trajectories, 3]
        Initial angles of trajectories, the same for all points (common random numbers).
    levels : Mapping
        Fixed values among scale, structure_noise_rms, white_noise_rms.
    """

    def __init__(self, twin: ContactTwin, states: Sequence[State], starts: Array, levels: dict[str, float]) -> None:
        self.twin, self.states, self.starts, self.levels = twin, states, starts, levels

    def __call__(self, points: Array) -> Array:
        """Root-mean-square errors relative to the measured amplitude spectra [points]."""
        made = self.components([self.parameters(p) for p in points])
        return np.array([np.inf if parts is None else self.match(parts)[0] for parts in made])

    def parameters(self, point: Array) -> ContactParameters:
        """The twin's parameters at a point."""
        stiffness, damping = (float(v) for v in np.exp(point))
        return replace(self.twin.parameters, stiffness=stiffness, damping=damping)

    def components(self, candidates: Sequence[ContactParameters]) -> list[list[Array] | None]:
        """PSDs [3, bins] of contact, unit structure noise and unit white noise, for each candidate and state."""
        jobs, owners = [], []
        for number, own in enumerate(candidates):
            mine = self._jobs(own)
            jobs += mine
            owners += [number] * len(mine)
        paths = accelerations(jobs)
        out: list[list[Array] | None] = []
        for number, own in enumerate(candidates):
            traces = [x[lead:] for (x, lead), owner in zip(paths, owners, strict=True) if owner == number]
            out.append(self._psds(own, traces) if traces else None)
        return out

    def match(self, parts: Sequence[Array], psds: Sequence[Array] | None = None) -> tuple[float, Array]:
        """Error, and the three powers (scale^2, of structure and of white noise in record units squared).

        Parameters
        ----------
        parts : sequence of Array [3, bins]
            Components of each state, from `components`.
        psds : sequence of Array [bins], optional
            Spectra instead of those of the states.
        """
        psds = [s.psd for s in self.states] if psds is None else psds
        measured = np.concatenate([psd[s.measured.usable] for psd, s in zip(psds, self.states, strict=True)])
        # States have equal weight, independent of their number of bins and level.
        bins = [int(s.measured.usable.sum()) for s in self.states]
        share = np.repeat([1 / (n * _power(s) * len(bins)) for n, s in zip(bins, self.states, strict=True)], bins)
        basis = np.concatenate([p[:, s.measured.usable] for p, s in zip(parts, self.states, strict=True)], axis=1)
        fitted = measured
        for _ in range(6):
            # (sqrt f - sqrt m)^2 = (f - m)^2 / (sqrt f + sqrt m)^2: least squares with weights from the last fit.
            weight = np.sqrt(share) / (np.sqrt(fitted) + np.sqrt(measured))
            powers = self._powers(basis * weight, measured * weight)
            fitted = powers @ basis
        error = np.sqrt(fitted) - np.sqrt(measured)
        return float(np.sqrt(np.sum(share * error**2))), powers

    def _powers(self, basis: Array, wanted: Array) -> Array:
        """Non-negative least squares of the free powers; a fixed noise level is relative to scale."""
        tied = {1: self.levels.get("structure_noise_rms"), 2: self.levels.get("white_noise_rms")}
        columns, places = [basis[0]], [1, 2]
        for place, value in tied.items():
            if value is not None:
                columns[0] = columns[0] + value**2 * basis[place]
                places.remove(place)
        free = [basis[p] for p in places]
        scale = self.levels.get("scale")
        if scale is None:
            found = nnls(np.array([columns[0], *free]).T, wanted)[0]
        else:
            rest = nnls(np.array(free).T, wanted - scale**2 * columns[0])[0] if free else np.empty(0)
            found = np.array([scale**2, *rest])
        powers = np.zeros(3)
        powers[0], powers[places] = found[0], found[1:]
        for place, value in tied.items():
            if value is not None:
                powers[place] = powers[0] * value**2
        return powers

    def _jobs(self, own: ContactParameters) -> list[Job]:
        """Trajectories of one candidate; none where it cannot be simulated."""
        twin = ContactTwin(self.twin.bearing, own)
        jobs, number = [], 0
        for state in self.states:
            for condition in state.conditions:
                if twin.contact_mode(condition.load_n).frequency_hz >= 0.48 * condition.fs_hz:
                    return []
                turns = np.arange(condition.n_samples) * (condition.speed_rpm / 60 / condition.fs_hz)
                job = Job(twin.bearing, own, condition, turns, starts=tuple(self.starts[number]))  # type: ignore[arg-type]
                number += 1
                try:
                    job.oversampling()
                except TwingapError:
                    return []
                jobs.append(job)
        return jobs

    def _psds(self, own: ContactParameters, traces: Sequence[Array]) -> list[Array]:
        out, number = [], 0
        twin = ContactTwin(self.twin.bearing, own)
        for state in self.states:
            s, count = state.measured, len(state.conditions)
            contact = np.mean([power_density(x, s.fs_hz, s.segment) for x in traces[number : number + count]], axis=0)
            number += count
            mode = twin.contact_mode(state.conditions[0].load_n)
            acf = autocorrelation(mode.frequency_hz, mode.damping_ratio, s.fs_hz, s.segment)
            out.append(np.array([contact, s.expected(acf), np.full(contact.size, 2 / s.fs_hz)]))
        return out


def states_of(records: RecordSet, notes: list[str], most: int = 40) -> list[State]:
    """Spectra and conditions of each state of the contact model, at most `most` records of each."""
    known = ("healthy", *DEFECTS)
    if left := [c for c in records.conditions if c.fault not in known]:
        notes.append(f"{len(left)} records of unknown or cage fault were left out")
    out = []
    for fault in known:
        places = [i for i, c in enumerate(records.conditions) if c.fault == fault]
        if not places:
            continue
        chosen = [places[i] for i in np.unique(np.linspace(0, len(places) - 1, most).round().astype(int))]
        same = records.take(chosen)
        for s in spectra(same, SEGMENT_S):
            own = [same.conditions[p] for p in s.places]
            picked = [own[i] for i in np.unique(np.linspace(0, len(own) - 1, PICKED).round().astype(int))]
            length = max(s.segment, round(LENGTH_S * s.fs_hz))
            conditions = tuple(replace(c, n_samples=length) for c in picked)
            out.append(State(fault, s, s.mean(lines=True)[0], conditions, _without(same, s)))
    if not out:
        raise TwingapError(
            "no record of a state that the contact model can simulate",
            where=f"record set {records.name!r}",
            mend="label records healthy, inner, outer or ball",
        )
    return out


def _power(state: State) -> float:
    """Mean of the measured PSD, to which errors are relative."""
    return float(state.psd[state.measured.usable].mean())


def _without(records: RecordSet, own: Spectra) -> Array:
    """Mean PSD with one block left out in turn [blocks, bins]; none where records are too short for two blocks.

    Blocks are groups if there are at least `FEWEST_GROUPS`. With fewer, records are cut into segments, and differences
    between groups are not included.
    """
    groups = [str(records.conditions[p].group) for p in own.places]
    if len(set(groups)) >= FEWEST_GROUPS:
        of, psd, weight = clusters(groups), own.psd, own.averages
    else:
        rows: list[Array] = []
        lengths: list[float] = []
        numbers: list[int] = []
        # If records are long enough, a block has a segment of each, so that all speeds keep their weight without it.
        most = [records.conditions[int(place)].n_samples // (4 * own.segment) for place in own.places]
        wanted = BLOCKS if min(most) >= BLOCKS else -(-BLOCKS // len(own.places))
        for place, fits in zip(own.places, most, strict=True):
            for stretch in np.array_split(records[int(place)].samples, max(1, min(wanted, fits))):
                rows.append(power_density(stretch, own.fs_hz, own.segment))
                lengths.append(float(stretch.size))
                numbers.append(len(numbers) % BLOCKS)
        of, psd, weight = np.array(numbers), np.array(rows), np.array(lengths)
    if of.max() == 0:
        return np.empty((0, psd.shape[1]))
    keep = (of != np.unique(of)[:, None]) * weight
    return np.asarray(keep @ psd / keep.sum(axis=1, keepdims=True))
