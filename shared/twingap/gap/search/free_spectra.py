"""Transfer path, background and lines of the records, measured from spectra of records and twin.

faulty states less healthy ones, records and twin --log ratio--> gains of the path --+
healthy states, records less twin ---------------difference---> densities of noise -+--> simulated, corrected
lines of the records that the twin lacks, in Hz and in shaft orders ---------------> list of lines

Only impacts show the path, so that healthy spectra are subtracted. Where no record is healthy, what lies between the
lines of faulty ones takes their place, which holds what jitter smears of the impacts. A path that all samples of a
finished waveform pass is one filter for all records, which all spectra show.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from twingap.effects import BackgroundSpectrum, Effect, TransferPath
from twingap.effects.by_state import ByState, State, by_state, of_state, unit_of
from twingap.effects.transfer_path import delay_spread_s, passed_by_all_samples
from twingap.gap.search.missing_lines import missing_lines
from twingap.records import Array, Condition, Record, RecordSet
from twingap.signal.record_transforms import SMOOTH_SEGMENTS, RecordTransforms, band_medians
from twingap.twins.simulator import Simulator, TwinSimulator
from twingap.twins.twin_file import all_parameters, flat

if TYPE_CHECKING:
    from twingap.gap.search.evidence import Evidence

Chain = tuple[Effect, ...]
By = Literal["all", "fault", "unit"]
"""Whose records have a path, background or lines of their own: all, those of each fault, or of each unit."""

PATH: Final = "transfer_path"
BACKGROUND: Final = "background_spectrum"
LINES: Final = "line_spectrum"
_EVEN_BANDS: Final = 120
"""Bands of equal width of the spectra. More resolve sharper modes, each with more noise."""
_LOW_BANDS: Final = (0.25, 0.5)
"""Where the lowest of them is parted, in parts of its width: noise of machines falls by far within it."""
_BANDS: Final = _EVEN_BANDS + len(_LOW_BANDS)
ROUNDS: Final = 4
"""Simulations by which path and background are corrected. More reduce what structure noise and clipping leave."""
_LEAST_EXCESS: Final = 0.05
"""Smallest part of a faulty spectrum that counts as that of impacts. A smaller value lets noise decide on the path."""
_LEAST_NOISE: Final = 1e-3
"""Smallest part of the healthy spectrum that is background, where other effects explain all of it."""
_WIDTHS: Final = (0.6, 2.0, 6.0)
"""Standard deviations, in bands, of the means by which gains are smoothed, the first that has enough impacts. Larger
ones lose sharp modes and have less noise."""
_SPACINGS: Final = 0.4
"""Standard deviation, in distances of a record's lines of impacts, by which its power is smoothed: where these lines
are sharp, a path cannot be told between them. A larger value loses sharp modes; a smaller one finds gains between the
lines that are those of chance, and that lines at another speed meet."""
_ENOUGH: Final = 0.3
"""Weight of impacts in such a mean from which it is used. A larger value smooths more bands."""
_LARGEST_STEP: Final = 2.5
"""Largest correction of a log power in one round."""
_NEPERS_PER_DB: Final = math.log(10) / 10
"""Logarithms of power in a dB."""
_ENOUGH_RECORDS: Final = 2
"""Records of each fault from which path, background and lines are measured by fault: different faults are mostly
different bearings, mounted anew. A smaller value does so from noisier spectra."""
_UNIT_RECORDS: Final = 3
"""Records of each unit by which its path and background are measured. More reduce noise and take longer."""
_HEALTHY: Final = State("healthy")


def measured(
    evidence: Evidence,
    simulator: Simulator,
    effects: Sequence[Effect],
    names: Collection[str],
    rounds: int = ROUNDS,
    *,
    by: By = "all",
    all_samples: bool = False,
) -> tuple[Simulator, Chain] | None:
    """The twin with transfer path, background or lines (`names`) as measured on the fit part; None where none can be.

    Those among `effects` are measured anew, path and background from where they are, in `rounds` simulations that
    correct them. `by` is whose records have their own, as different bearings in different mountings have; lines are not
    measured by unit: those of few recordings are not in others. With `all_samples`, all samples of finished waveforms
    pass the path, one for all records (`TransferPath.all_samples`); so it is where the path of `effects` is such a one.
    """
    spectra = spectra_of(evidence, by)
    names = {name for name in names if evidence.can_add(name) is None and not (by == "unit" and name == LINES)}
    states = [State("")] if by == "all" else spectra.states
    if not names:
        return None
    kept = tuple(effect for effect in effects if effect.name not in names)
    known = {effect.name: effect for effect in effects}
    all_samples = all_samples or passed_by_all_samples(known.get(PATH))
    filter_ = TransferPath(delay_spread_s=delay_spread_s(known.get(PATH)), all_samples=all_samples)
    paths = {state: _path_of(known.get(PATH), state, spectra) for state in states} if PATH in names else {}
    densities: dict[State, Array | None] = dict.fromkeys(states if BACKGROUND in names else ())
    if BACKGROUND in names and (own := known.get(BACKGROUND)) is not None:
        densities = {state: _density_of(own, state, spectra, simulator.reference_rms) for state in states}
    # Impact amplitudes of the twin differ between faults, not between units.
    has_levels = isinstance(simulator, TwinSimulator) and by != "unit"
    # Without lines, their power would be taken for that of impacts.
    lines = _all_lines(evidence, simulator, kept, states) if LINES in names and paths else ()
    over = known if by == "unit" else {}
    for _ in range(rounds if paths or densities else 0):
        chain = _with((*kept, *lines), spectra, paths, densities, simulator.reference_rms, over, filter_)
        made = spectra.of(evidence.simulated(simulator, chain, spectra.records.conditions, 3))
        if all_samples and paths:
            step = _filter_step(spectra, made)
            paths = {state: path + step for state, path in paths.items()}
        elif paths:
            steps, levels = _path_steps(spectra, made, states, has_levels=has_levels)
            paths = {state: path + steps[state] for state, path in paths.items()}
            simulator = _louder(evidence, simulator, kept, levels)
        for state, density in densities.items():
            side = state if state.fault else _HEALTHY
            wanted, now = np.exp(spectra.real[side].between), np.exp(made[side].between)
            # What impacts, other effects and a finished waveform have between lines stays.
            rest = 0.0 if density is None else np.maximum(now - density, 0.0)
            densities[state] = np.maximum(wanted - rest, _LEAST_NOISE * wanted)
    chain = _with(kept, spectra, paths, densities, simulator.reference_rms, over, filter_)
    if LINES in names:
        chain = (*chain, *_all_lines(evidence, simulator, chain, states))
    return None if chain == kept else (simulator, chain)


def by_of(effects: Iterable[Effect]) -> By:
    """Whose records have values of their own in these effects."""
    own = [effect for effect in effects if isinstance(effect, ByState)]
    return "unit" if any(effect.has_units for effect in own) else "fault" if own else "all"


def by_fault_or_all(evidence: Evidence) -> By:
    """Whether each fault has its own path and background: where it has records enough to measure them."""
    counts = Counter(c.fault for c in evidence.trial_records.conditions if c.fault != "healthy")
    return "fault" if counts and min(counts.values()) >= _ENOUGH_RECORDS else "all"


class StateLevels(NamedTuple):
    """Mean log power densities of the records of a state."""

    all: Array  # of everything: impacts at a regular spacing are lines
    between: Array  # between the lines


class Spectra:
    """Mean log spectra of the states of some records of the fit part, and how to compute those of simulated ones.

    With `by_unit`, each unit is a state of its own; its records are used then, else the trial records.
    """

    def __init__(self, evidence: Evidence, *, by_unit: bool) -> None:
        self.evidence, self.by_unit = evidence, by_unit
        self.records = evidence.shortened(_of_units(evidence)) if by_unit else evidence.trial_records
        self.top_hz = min(c.fs_hz for c in self.records.conditions) / 2
        places = np.array([0.0, *_LOW_BANDS, *range(1, _EVEN_BANDS + 1)])
        self.edges_hz = places * (self.top_hz / _EVEN_BANDS)
        self.middles_hz = 0.5 * (self.edges_hz[:-1] + self.edges_hz[1:])
        self.real = self.of(self.records)

    @cached_property
    def states(self) -> list[State]:
        """States whose fault is known."""
        return list(dict.fromkeys(s for c in self.records.conditions if (s := self.state_of(c)).fault != "None"))

    def state_of(self, condition: Condition) -> State:
        """State of a record."""
        return State(str(condition.fault), unit_of(condition) if self.by_unit else "")

    def of(self, records: Iterable[Record]) -> dict[State, StateLevels]:
        """State -> levels of its records; also those of all healthy records, or of the noise where none is healthy."""
        rows: dict[State, list[tuple[Array, Array]]] = {}
        for record in records:
            one = RecordTransforms(record.samples, record.condition, self.evidence.frame)
            power = np.square(np.abs(one.transform[1:])) * (2 / (one.fs_hz * one.x.size))
            # Windowed: without, strong impacts leak into what lies between their lines.
            density = one.tones[1:] * (2 * one.x.size / (3 * one.fs_hz))
            between = band_medians(density, SMOOTH_SEGMENTS) / math.log(2)
            spacing_hz = one.shaft_hz * (one.fault_order or 0.0)
            both = self._banded(power, one.fs_hz, _SPACINGS * spacing_hz), self._banded(between, one.fs_hz)
            state = self.state_of(record.condition)
            for key in dict.fromkeys((state, _HEALTHY) if state.fault == "healthy" else (state,)):
                rows.setdefault(key, []).append(both)
        found = {state: StateLevels(*np.mean(own, axis=0)) for state, own in rows.items()}
        if _HEALTHY not in found and found:
            # Noise is no louder than what lies between the lines of any state.
            least = np.min([levels.between for levels in found.values()], axis=0)
            found[_HEALTHY] = StateLevels(least, least)
        return found

    def _banded(self, power: Array, fs_hz: float, smoothed_hz: float = 0.0) -> Array:
        """[bands] Log mean in each band of a spectrum that covers 0 to half the sampling rate evenly."""
        edges = np.round(self.edges_hz * (power.size / (fs_hz / 2))).astype(int)
        starts = np.minimum(edges[:-1], power.size - 1)
        stop = max(min(int(edges[-1]), power.size), int(starts[-1]) + 1)
        sums = np.add.reduceat(power[:stop], starts)
        means = sums / np.maximum(np.diff((*starts, stop)), 1)
        if smoothed_hz:
            means = gaussian_filter1d(means, smoothed_hz * _EVEN_BANDS / self.top_hz, mode="nearest")
        return np.asarray(np.log(means + 1e-300))


def spectra_of(evidence: Evidence, by: By) -> Spectra:
    """Mean spectra of records of the fit part, computed on first use."""
    key = Spectra, by == "unit"
    if key not in evidence.kept:
        evidence.kept[key] = Spectra(evidence, by_unit=by == "unit")
    found: Spectra = evidence.kept[key]
    return found


def _path_of(effect: Effect | None, state: State, spectra: Spectra) -> Array:
    """[bands] Log power gain of the path for records of a state; 0 without a path."""
    if effect is None or not isinstance(own := of_state(effect, state), TransferPath):
        return np.zeros(_BANDS)
    return np.asarray(own.depth * _NEPERS_PER_DB * np.interp(spectra.middles_hz, own.frequencies_hz, own.gains_db))


def _density_of(effect: Effect, state: State, spectra: Spectra, reference: float) -> Array:
    """[bands] Power density of the background for records of a state."""
    own = of_state(effect, state)
    assert isinstance(own, BackgroundSpectrum)
    levels = np.interp(spectra.middles_hz, own.frequencies_hz, own.densities_db) * _NEPERS_PER_DB
    return np.asarray(np.exp(levels) * (own.level * reference) ** 2)


def _path_steps(
    spectra: Spectra, made: Mapping[State, StateLevels], states: Sequence[State], *, has_levels: bool
) -> tuple[dict[State, Array], dict[str, float]]:
    """Corrections of each state's path, log power [bands], and of each fault's impacts, as logarithms of amplitude."""
    total, weights = np.zeros(_BANDS), np.zeros(_BANDS)
    levels: dict[str, float] = {}
    own_steps: dict[State, Array] = {}
    for state in spectra.states:
        if state.fault == "healthy":
            continue
        real, own = _excess(spectra.real, state), _excess(made, state)
        # Bands without impacts say nothing of the path.
        weight = np.minimum(_shown(spectra.real, state, real), _shown(made, state, own)) + 1e-4
        off = np.clip(real - own, -_LARGEST_STEP, _LARGEST_STEP)
        if has_levels:
            # A gain common to all bands belongs to the impacts, which may differ between faults.
            common = float(np.average(off, weights=weight))
            levels[state.fault], off = 0.5 * common, off - common
        own_steps[state] = _between_bands(weight * off, weight)
        total, weights = total + weight * off, weights + weight
    shared = _between_bands(total, weights)
    return {state: own_steps.get(state, shared) for state in states}, levels


def _filter_step(spectra: Spectra, made: Mapping[State, StateLevels]) -> Array:
    """[bands] Correction, log power, of a filter that all records pass as a whole."""
    off = np.mean([spectra.real[state].all - made[state].all for state in spectra.states], axis=0)
    return _between_bands(np.clip(off, -_LARGEST_STEP, _LARGEST_STEP), np.ones(_BANDS))


def _between_bands(total: Array, weights: Array) -> Array:
    """[bands] Weighted means over neighbouring bands: where a band has no impacts, those of the nearest that have."""
    out = np.zeros(_BANDS)
    left = np.ones(_BANDS, bool)
    for width in _WIDTHS:
        over = gaussian_filter1d(weights, width, mode="nearest")
        mean = gaussian_filter1d(total, width, mode="nearest") / np.maximum(over, 1e-12)
        known = left & (over > _ENOUGH)
        out[known], left = mean[known], left & ~known
    out[left] = mean[left]
    return out


def _excess(of: Mapping[State, StateLevels], state: State) -> Array:
    """[bands] Log power of a faulty state over its background, which is no louder than what lies between its lines."""
    faulty, healthy = np.exp(of[state].all), of.get(State("healthy", state.unit), of.get(_HEALTHY))
    background = 0.0 if healthy is None else np.exp(np.minimum(healthy.between, of[state].between))
    return np.asarray(np.log(np.maximum(faulty - background, _LEAST_EXCESS * faulty)))


def _shown(of: Mapping[State, StateLevels], state: State, excess: Array) -> Array:
    """[bands] Weight of impacts: log of their part of the power over the smallest that counts, 0 below."""
    return np.asarray(np.maximum(excess - of[state].all - math.log(_LEAST_EXCESS), 0.0))


def _with(
    kept: Chain,
    spectra: Spectra,
    paths: Mapping[State, Array],
    densities: Mapping[State, Array | None],
    reference: float,
    over: Mapping[str, Effect],
    filter_: TransferPath,
) -> Chain:
    """The effects with these paths (log power) and backgrounds (power density) of the states added.

    Records of other states have those of `over`; the paths are otherwise those of `filter_`.
    """
    places = tuple(float(f) for f in spectra.middles_hz)
    chain = list(kept)
    if paths:
        gains = {state: np.clip(path / _NEPERS_PER_DB, -80.0, 80.0).round(3) for state, path in paths.items()}
        own = {s: replace(filter_, frequencies_hz=places, gains_db=tuple(g)) for s, g in gains.items()}
        chain.append(_stated(own, over.get(PATH)))
    known = {state: density for state, density in densities.items() if density is not None}
    if known:
        levels = {s: (10 * np.log10(np.maximum(d / reference**2, 1e-25))).round(3) for s, d in known.items()}
        noise = {
            s: BackgroundSpectrum(replaced=1.0, frequencies_hz=places, densities_db=tuple(d)) for s, d in levels.items()
        }
        chain.append(_stated(noise, over.get(BACKGROUND)))
    return tuple(chain)


def _stated(of: Mapping[State, Effect], over: Effect | None = None) -> Effect:
    """One effect from those of the states: that of `over`, healthy or first records, and those that differ."""
    base = over or of.get(State(""), of.get(_HEALTHY, next(iter(of.values()))))
    known = dict(base.states) if isinstance(base, ByState) else {}
    plain = base.base if isinstance(base, ByState) else base
    return by_state(plain, {**known, **{s: effect for s, effect in of.items() if s not in (State(""), _HEALTHY)}})


def _of_units(evidence: Evidence) -> RecordSet:
    """A few records of each unit of the fit part, spread over its speeds."""
    fit = evidence.calibrated.fit
    places: dict[State, list[int]] = {}
    for place, condition in enumerate(fit.conditions):
        places.setdefault(State(str(condition.fault), unit_of(condition)), []).append(place)
    return fit.take(sorted(i for own in places.values() for i in _spread(own, fit.conditions)))


def _spread(places: Sequence[int], conditions: Sequence[Condition]) -> list[int]:
    """At most `_UNIT_RECORDS` of these places, spread over their speeds."""
    ordered = sorted(places, key=lambda i: (conditions[i].speed_rpm, i))
    chosen = np.linspace(0, len(ordered) - 1, min(_UNIT_RECORDS, len(ordered))).round().astype(int)
    return [ordered[i] for i in chosen]


def _louder(evidence: Evidence, simulator: Simulator, effects: Chain, levels: Mapping[str, float]) -> Simulator:
    """The twin with impact amplitudes changed by these logarithms, where they are free."""
    if not levels or not isinstance(simulator, TwinSimulator):
        return simulator
    own, fixed = flat(all_parameters(simulator.spec)), flat(evidence.spec.parameters)
    values = {
        name: float(own[name]) * math.exp(level)
        for fault, level in levels.items()
        if (name := f"impact_amplitude.{fault}") in own and name not in fixed
    }
    return evidence.with_values(simulator, effects, values) if values else simulator


def _all_lines(evidence: Evidence, simulator: Simulator, chain: Chain, states: Sequence[State]) -> Chain:
    """Lines of all states as one effect, or nothing: those that all records have, and more that a fault has."""
    common = missing_lines(evidence, simulator, chain)
    found = {s: missing_lines(evidence, simulator, chain, s.fault, common) if s.fault else common for s in states}
    if not any(one.places[0].size for one in found.values()):
        return ()
    return (_stated(found),)
