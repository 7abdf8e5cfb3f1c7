"""Features of the records, and their comparison with the twin with any set of effects added.

records --calibrate--> fit part, held-out part, frame, twin
twin + effects --recalibrate on the fit part, simulate both parts--> Compared: features of each part
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.effects import Draft, Effect, catalogue
from twingap.effects.base import HEALTHY_RMS
from twingap.effects.by_state import ByState
from twingap.gap.distance.feature_vectors import FeatureVectors, measure_vectors
from twingap.gap.distance.grid import Grid
from twingap.gap.distance.paired import Paired
from twingap.gap.external_simulator import ExternalSimulator
from twingap.gap.features import comparison
from twingap.gap.features.measured import Pair
from twingap.gap.features.pooled import features as pooled
from twingap.gap.features.pooled.features import PooledRecords
from twingap.gap.features.pooled.trends import Levels
from twingap.gap.features.spectrum.record_summary import RecordSummary, summarise
from twingap.gap.search.parameter_scale import Setting
from twingap.identification.baseline import MOST_SIMULATED, Key, StateSpectrum, levels_of, match_level, state_spectra
from twingap.identification.calibrate import Calibrated, recalibrate, thinned
from twingap.records import Array, Condition, Record, RecordSet
from twingap.signal.record_transforms import RecordTransforms
from twingap.twins.simulator import Simulator, TwinSimulator
from twingap.twins.twin_file import TwinSpec, all_parameters, flat, nested

MOST_TRIED: Final = 6
"""Records of each state that trial simulations use. A larger number makes fitted values more precise and trials
fewer."""
LONGEST_TRIED: Final = 1 << 15
"""Largest number of samples of each of these records. Longer records make trials fewer."""
SAMPLES_TRIED: Final = 5e7
"""Samples that one search for values may simulate. A larger number makes fitted values more precise and takes
longer."""
TRIALS: Final = (24, 320)
"""Smallest and largest number of trials of one search for values, whatever the cost of a simulation."""
THOROUGH: Final = (0.012, 0.04, 0.12)
"""Initial damping ratios of the search for a mode in a diagnosis. Fewer are faster and may miss sharp or broad
modes. Training uses the middle one alone."""
FEWEST_GROUPS: Final = 6
"""Smallest number of groups of records for an exchange test. Fewer allow at most 16 distinct exchanges, too few for
a small p-value."""
_KEPT_VECTORS: Final = 64
"""Simulations whose feature vectors are kept. A larger number repeats fewer of them and takes more memory."""
CONTACT_COSTS: Final = 13
"""Cost of a sample of the contact twin relative to the phenomenological twin. A larger value reduces the number of
trials."""


class Compared:
    """Comparison of the records with one simulation of them; each part is simulated on first use.

    `effects` are those added to the twin, `simulator` is the twin calibrated with them.
    """

    def __init__(self, evidence: Evidence, effects: tuple[Effect, ...], simulator: Simulator) -> None:
        self._evidence, self.effects, self.simulator = evidence, effects, simulator
        self._levels: Levels | None = None

    @cached_property
    def fit(self) -> Array:
        """[features] Comparison on the fit part; trends over both parts."""
        return self._features(0)

    @cached_property
    def held_out(self) -> Array:
        """[features] Comparison on the held-out part; pooled features over both parts."""
        return self._features(1)

    def _features(self, part: int) -> Array:
        """[features] Comparison of one part, 0 (fit) or 1 (held out)."""
        of, real = self._evidence, self._evidence.parts[part]
        simulated = comparison.measure_records(self._simulated(part), of.frame, of.grid(real.conditions))
        if part == 0:
            # Initial values are for the fit part: lines and combs of the held-out part must not enter them.
            if self._levels is None:
                self._levels = pooled.levels(of.pooled, self._pooled(part, simulated.summaries))
            of_pooled = pooled.compare(real.pooled, simulated.pooled, self._levels)
        else:
            both = self._pooled(part, simulated.summaries)
            self._levels = pooled.levels(of.pooled, both)
            of_pooled = pooled.compare(of.pooled, both, self._levels)
        pair = Pair(real, simulated, self.simulator.makes_waveforms)
        return comparison.compare(pair, of.calibrated.speeds, of_pooled, has_effects=bool(of.modelled))

    def _pooled(self, part: int, summaries: Sequence[RecordSummary]) -> PooledRecords:
        """Simulated records of both parts; of the part that is not compared, only summaries are computed."""
        of = self._evidence
        others = [summarise(RecordTransforms(r.samples, r.condition, of.frame)) for r in self._simulated(1 - part)]
        return of.pool(*((others, summaries) if part else (summaries, others)))

    def _simulated(self, part: int) -> Iterator[Record]:
        """Simulated records of one part."""
        of = self._evidence
        return of.simulated(self.simulator, self.effects, of.parts[part].conditions, part)


def simulator_of(calibrated: Calibrated, sim: RecordSet | None = None) -> Simulator:
    """The calibrated twin, or an external simulator of the user's simulated records."""
    fit = calibrated.fit
    if sim is not None:
        others = calibrated.held_out.conditions
        return ExternalSimulator(sim, fit, calibrated.frame.bearing, calibrated.frame.scale, others=others)
    assert calibrated.spec is not None  # set by `calibrate` unless simulated records are given
    conditions = (*fit.conditions, *calibrated.held_out.conditions)
    return TwinSimulator(calibrated.spec, calibrated.frame.bearing, fit.unit, conditions)


class Evidence:
    """Features of the records, and comparisons with every twin evaluated so far.

    `simulator` is the calibrated twin, or the user's own. `spec` is the twin as given: its fixed parameters stay fixed,
    its effects are not candidates. `root` is the entropy of all simulations: every combination of effects is simulated
    with the same random impacts and noise, so that differences between combinations are not random. `dampings` are
    initial damping ratios of the search for the mode of a twin with effects, see `baseline.match_baseline`.
    """

    def __init__(
        self,
        calibrated: Calibrated,
        simulator: Simulator,
        spec: TwinSpec,
        root: int,
        dampings: Sequence[float] = (0.04,),
    ) -> None:
        self.spec, self.dampings = spec, tuple(dampings)
        self.calibrated, self.root, self.frame = calibrated, root, calibrated.frame
        self.fit, self.held_out = (
            comparison.measure_records(part, self.frame, self.grid(part.conditions))
            for part in (calibrated.fit, calibrated.held_out)
        )
        self.parts = self.fit, self.held_out
        self.pooled = self.pool(self.fit.summaries, self.held_out.summaries)
        conditions = (*calibrated.fit.conditions, *calibrated.held_out.conditions)
        self.setting = Setting.of(conditions)
        self._simulator = simulator
        self._known: dict[tuple[Effect, ...], Compared] = {}
        self.kept: dict[object, Any] = {}  # what others compute once from the records, by whatever names it
        self._bare_spectra: dict[Key, Array] = {}
        self._kept_vectors: dict[Key, FeatureVectors] = {}
        self._read_off: dict[str, Mapping[str, float]] = {}

    def grid(self, conditions: Sequence[Condition]) -> Grid:
        """Bins for records under these conditions."""
        return Grid.of(conditions, self.frame.bearing)

    def pool(self, fit: Sequence[RecordSummary], held_out: Sequence[RecordSummary]) -> PooledRecords:
        """Pooled records of both parts; records that are in both count once."""
        shared = self.calibrated.shared
        return PooledRecords((*fit, *(summary for summary in held_out if summary.condition.name not in shared)))

    def against(self, effects: Sequence[Effect] = ()) -> Compared:
        """Comparison of both parts with the twin with these effects, recalibrated on the fit part."""
        chain = tuple(sorted(effects, key=lambda effect: effect.name))
        if chain not in self._known:
            self._known[chain] = Compared(self, chain, self._recalibrated(chain))
        return self._known[chain]

    @property
    def modelled(self) -> tuple[str, ...]:
        """Names of the effects of the given twin."""
        return tuple(dict.fromkeys((*self.spec.effects, *self._simulator.has)))

    @cached_property
    def groups(self) -> NDArray[np.str_]:
        """[records of both parts] Group of each record; a record without a group is a group of its own."""
        return np.array([c.group or c.name for part in self.parts for c in part.conditions])

    @property
    def exchangeable(self) -> bool:
        """Whether there are enough groups of records for an exchange test."""
        return int(np.unique(self.groups).size) >= FEWEST_GROUPS

    def can_add(self, name: str) -> str | None:
        """Reason why the simulator cannot add this effect, or None."""
        return self._simulator.can_add(name)

    def read_off(self, name: str) -> Mapping[str, float]:
        """Values of an effect that the fit part shows exactly, in the unit of the records; see `Effect.read_off`."""
        if name not in self._read_off:
            fit = self.calibrated.fit
            bare = self.simulated(self._simulator, (), fit.conditions, 0)
            self._read_off[name] = catalogue()[name].read_off(fit, bare)
        return self._read_off[name]

    def at_read_values(self, effect: Effect, simulator: Simulator) -> Effect:
        """The effect at the values that records show exactly, relative to the healthy vibration of this simulator."""
        found = {} if isinstance(effect, ByState) else self.read_off(effect.name)
        if not found:
            return effect
        units = {field.name: field.metadata["unit"] for field in effect.parameters()}
        return effect.moved(
            **{n: v / simulator.reference_rms if units[n] == HEALTHY_RMS else v for n, v in found.items()}
        )

    def fits(self, effect: Effect) -> bool:
        """Whether every record can be simulated with the effect at these values."""
        t = np.zeros(2)
        conditions = (*self.fit.conditions, *self.held_out.conditions)
        return all(effect.cannot_act_on(Draft(c, self.frame.bearing, 1.0, t, t)) is None for c in conditions)

    @cached_property
    def trial_records(self) -> RecordSet:
        """A few shortened records of each state of the fit part, for trial simulations."""
        return self.shortened(thinned(self.calibrated.fit, MOST_TRIED))

    @staticmethod
    def shortened(records: RecordSet) -> RecordSet:
        """The records with at most `LONGEST_TRIED` samples each."""
        conditions = [replace(c, n_samples=min(c.n_samples, LONGEST_TRIED)) for c in records.conditions]
        return RecordSet(
            records.name, records.unit, records.bearing, conditions, lambda i: records[i].samples[:LONGEST_TRIED]
        )

    @property
    def trials(self) -> int:
        """Number of simulations of one search for values; it decreases with the cost of a simulation."""
        conditions = self.trial_records.conditions
        samples = replicates_of(self._simulator, conditions, 2) * sum(c.n_samples for c in conditions)
        dear = CONTACT_COSTS if self.spec.model == "contact" else 1
        return int(np.clip(SAMPLES_TRIED / (samples * dear), *TRIALS))

    @cached_property
    def _trial_grid(self) -> Grid:
        """Grid of the trial records."""
        return self.grid(self.trial_records.conditions)

    @cached_property
    def _trial_vectors(self) -> FeatureVectors:
        """Feature vectors of the trial records."""
        return self.vectors(self.trial_records, self._trial_grid)

    @cached_property
    def _scale(self) -> Array:
        """Scale [bins] of distances on the fit part, the same for all twins."""
        conditions = self.fit.conditions
        made = self._replicates(self._simulator, (), conditions, self.grid(conditions))
        return Paired(self.fit.vectors, made).scale

    @cached_property
    def _trial_scale(self) -> Array:
        """Scale [bins] of distances on the trial records, the same for all twins."""
        made = self._replicates(self._simulator, (), self.trial_records.conditions, self._trial_grid)
        return Paired(self._trial_vectors, made).scale

    def _replicates(
        self, simulator: Simulator, effects: Sequence[Effect], conditions: Sequence[Condition], grid: Grid
    ) -> list[FeatureVectors]:
        """Feature vectors of two simulations, or of the only one there is."""
        numbers = (3, 4)[: replicates_of(simulator, conditions, 2)]
        return [self.simulated_vectors(simulator, effects, conditions, grid, k) for k in numbers]

    def held_out_replicates(self, simulator: Simulator, effects: Sequence[Effect], most: int) -> list[FeatureVectors]:
        """Feature vectors of at most `most` simulations of the held-out part, on the bins of its records."""
        conditions = self.held_out.conditions
        grid, count = self.grid(conditions), replicates_of(simulator, conditions, most)
        return [self.vectors(self.simulated(simulator, effects, conditions, 2 + k), grid) for k in range(count)]

    def gap(self, simulator: Simulator, effects: Sequence[Effect], replicate: int = 3) -> float:
        """Overall distance of the fit part from one simulation of it; for the search only, never reported."""
        conditions = self.fit.conditions
        made = self.simulated_vectors(simulator, effects, conditions, self.grid(conditions), replicate)
        pair = Paired(self.fit.vectors, [made], self._scale)
        return float(pair.over_domains(pair.squares())[0][0])

    def misfit(self, simulator: Simulator, effects: Sequence[Effect]) -> float:
        """Distance of the trial records, the noise of their means included: the objective function of fitted values."""
        return self.tried(simulator, effects).misfit()

    def tried(self, simulator: Simulator, effects: Sequence[Effect]) -> Paired:
        """The trial records paired with two simulations of them, with fixed random streams.

        With one simulation alone, values whose simulations have less scatter would have a smaller distance.
        """
        made = self._replicates(simulator, effects, self.trial_records.conditions, self._trial_grid)
        return Paired(self._trial_vectors, made, self._trial_scale)

    def simulated_vectors(
        self,
        simulator: Simulator,
        effects: Sequence[Effect],
        conditions: Sequence[Condition],
        grid: Grid,
        replicate: int,
    ) -> FeatureVectors:
        """Feature vectors of one simulation. The last ones are kept, because searches come back to the same values."""
        if not isinstance(simulator, TwinSimulator):
            return self.vectors(self.simulated(simulator, effects, conditions, replicate), grid)
        spec, of = simulator.spec, tuple((c.name, c.n_samples) for c in conditions)
        # Numbers as text: a table of parameters has no hash.
        key = spec.effects, repr(spec.parameters), tuple(effects), of, grid, replicate
        found = self._kept_vectors.pop(key, None)
        if found is None:
            found = self.vectors(self.simulated(simulator, effects, conditions, replicate), grid)
        self._kept_vectors[key] = found
        if len(self._kept_vectors) > _KEPT_VECTORS:
            del self._kept_vectors[next(iter(self._kept_vectors))]
        return found

    def with_values(
        self, simulator: Simulator, effects: Sequence[Effect], baseline: Mapping[str, float] | None = None
    ) -> Simulator:
        """The simulator with its effects at other values and, where given, new values of baseline parameters."""
        if isinstance(simulator, ExternalSimulator):
            return simulator.with_gain(baseline["gain"]) if baseline else simulator
        if not isinstance(simulator, TwinSimulator):
            return simulator
        values = flat(simulator.spec.parameters) | dict(baseline or {})
        own = {e.name: e.parameter_values() for e in effects if e.name in simulator.spec.effects}
        spec = replace(simulator.spec, parameters={**nested(values), **own})
        return TwinSimulator(spec, self.frame.bearing, simulator.unit, simulator.conditions)

    def without_added(self, simulator: Simulator) -> Simulator:
        """The simulator at its baseline, without effects that were added to the given twin."""
        if not isinstance(simulator, TwinSimulator):
            return simulator
        spec, given = simulator.spec, self.spec.effects
        added = {name for name in spec.effects if name not in given}
        kept = {name: value for name, value in spec.parameters.items() if name not in added}
        own = replace(spec, effects=tuple(name for name in spec.effects if name in given), parameters=kept)
        return TwinSimulator(own, self.frame.bearing, simulator.unit, simulator.conditions)

    def matched(self, effects: tuple[Effect, ...]) -> Simulator:
        """The simulator with these effects, its mode as calibrated and its levels matched anew; for fast trials."""
        return self._recalibrated(effects, steps=0)

    def _recalibrated(self, effects: tuple[Effect, ...], steps: int = 4) -> Simulator:
        """The simulator with these effects, its baseline matched anew: what effects explain is no noise of the twin."""
        spec = self.calibrated.spec
        if not effects:
            return self._simulator
        if spec is None or spec.model != "phenomenological":
            return self._levelled(effects)
        values = {**spec.parameters, **{effect.name: effect.parameter_values() for effect in effects}}
        more = replace(spec, effects=(*spec.effects, *(effect.name for effect in effects)), parameters=values)
        rng = np.random.default_rng(self.root)
        own = recalibrate(
            self.calibrated, more, rng, free=self.spec, steps=steps, dampings=self.dampings, known=self._bare_spectra
        )
        return simulator_of(own)

    def _levelled(self, effects: tuple[Effect, ...]) -> Simulator:
        """The simulator with these effects where a level is the only baseline parameter; a free level is matched anew.

        The level of the contact twin is fitted together with the values at the end, because matching it for every
        combination of effects would take too long.
        """
        level = level_of(self._simulator, self.spec)
        if level is None or (self._simulator.name == "contact" and isinstance(self._simulator, TwinSimulator)):
            return self._simulator
        name, now = level

        def at(value: float) -> Simulator:
            return self.with_values(self._simulator, (), {name: value})

        found = match_level(
            lambda value, conditions: list(self.simulated(at(value), effects, conditions, 0)),
            self._levels_of, self.frame, now,
        )  # fmt: skip
        return at(found)

    def bare_psd(self, side: StateSpectrum) -> Array:
        """[baseline.BANDS] Power spectral density, 1/Hz, of the given simulator under some conditions of a state."""
        made = self.simulated(self._simulator, (), side.conditions[:MOST_SIMULATED], 0)
        (simulated,) = state_spectra(list(made), self.frame)
        return simulated.psd

    @cached_property
    def _levels_of(self) -> list[StateSpectrum]:
        """Spectra for the matching of levels: of healthy records of the fit part, or of all where none is healthy."""
        return levels_of(thinned(self.calibrated.fit, 6), self.frame)

    def simulated(
        self, simulator: Simulator, effects: Sequence[Effect], conditions: Sequence[Condition], replicate: int
    ) -> Iterator[Record]:
        """Simulated records, one at a time; equal numbers of the replicate have equal random streams."""
        yield from simulator.simulate(tuple(effects), conditions, self.root, replicate)

    def vectors(self, records: RecordSet | Iterable[Record], grid: Grid) -> FeatureVectors:
        """Feature vectors of records; samples are not kept."""
        return measure_vectors((RecordTransforms(r.samples, r.condition, self.frame) for r in records), grid)


def replicates_of(simulator: Simulator, conditions: Sequence[Condition], most: int) -> int:
    """Number of independent simulations of these conditions: `most`, or fewer where the user's records are fewer."""
    return min(simulator.replicates(conditions), most) if isinstance(simulator, ExternalSimulator) else most


def level_of(simulator: Simulator, given: TwinSpec) -> tuple[str, float] | None:
    """Name and value of the factor on all samples of a simulator; None without one, or where the twin file fixes it."""
    if isinstance(simulator, ExternalSimulator):
        return ("gain", simulator.gain) if simulator.level_free else None
    if isinstance(simulator, TwinSimulator) and not given.given("scale"):
        scale = flat(all_parameters(simulator.spec)).get("scale")
        return None if scale is None else ("scale", float(scale))
    return None
