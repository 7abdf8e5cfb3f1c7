"""Baseline of a twin with effects, matched to records by simulation of the twin itself.

spec with effects --simulated with each noise alone--> spectra [BANDS] --least squares--> two noise powers, per mode
                  --simulated with and without impacts--> energy in the band --fixed point--> impact amplitudes
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from twingap.bearing import FAULTS
from twingap.effects import Mode, Stage, catalogue
from twingap.effects.modes import moving_average
from twingap.identification.impact_band import mode_band
from twingap.records import Condition, Record, RecordSet
from twingap.signal.record_transforms import Frame, medians
from twingap.streams import root_entropy
from twingap.twins.simulator import TwinSimulator
from twingap.twins.twin_file import TwinSpec, all_parameters, flat, nested

Array = NDArray[np.float64]
Key = tuple[object, ...]

MOST_SIMULATED: Final = 4
"""Most records of each state that are simulated to match a baseline: more are slower and reduce the error of levels."""
BANDS: Final = 128
"""Bands of the spectra in which baselines are matched; more resolve sharper modes with more noise."""
_MOST_STEPS: Final = 4
"""Most steps, each of at most a factor of ten, to an impact amplitude: fewer may not reach a distant one."""
_LEAST_BEGUN: Final = 1.0
"""Least initial impact amplitude: the energy of weaker impacts is within the noise."""
_SURE_STEP: Final = math.log(9.9)
"""Logarithm of a step below which no further step follows: energy is quadratic in amplitude, so one step suffices."""
_FINAL_STEP: Final = 0.1
"""The same with effects of acquisition, where energy is not quadratic in amplitude; smaller takes more steps."""
_GRID: Final = (0.08, 0.16, 0.27, 0.4)
"""Fractions of the sampling rate tried as frequencies of broad modes, which have no spectral peak."""
_SEGMENT: Final = 128
"""Length of a segment in samples: about one impulse and its ring-down."""
_FEWEST_SEGMENTS: Final = 16
"""Fewest segments of a record for a search for impulses; fewer give a poor estimate of the usual power."""
_IMPULSE: Final = 20.0
"""Median deviations above the usual power from which a segment counts as an impulse; lower also removes noise of a
sharp mode, whose power is nearly exponential."""
_MOST_IMPULSES: Final = 0.08
"""Largest fraction of a record's segments that is left out; with more loud ones, their mean is reliable."""
FINE_STEPS: Final = (0.15, 0.05, 0.02, 0.007)
"""Steps of `match_level` where the result is not refined any further."""
_SAME_LEVEL: Final = math.log(1.1)
"""Log ratio of levels below which a simulator of the user's own is matched without asking whether its unit is right."""
_AGREES, _AGREEING = 0.15, 0.2
"""Largest log ratio of power densities that agree, and part of the bands that has to. A smaller part keeps the level of
simulators that agree by chance."""
_LEAST_BETWEEN: Final = 0.3
"""Part of a simulator's power between tones from which its level is matched there."""
_BESIDE: Final = 0.06
"""Log ratio of frequencies below which they share one initial value of a search; larger is faster and less thorough."""


@dataclass(frozen=True)
class StateSpectrum:
    """Mean power density in bands of the records of one state at one rate, without tones."""

    fault: str
    fs_hz: float
    conditions: tuple[Condition, ...]
    psd: Array
    energy: float  # mean square in the frame's band

    @property
    def peak_hz(self) -> float:
        """Frequency of the highest band, Hz, the ends left out."""
        smooth = np.convolve(self.psd[2:], np.ones(3) / 3, mode="same")
        return (int(np.argmax(smooth[: int(0.9 * smooth.size)])) + 2.5) / BANDS * self.fs_hz / 2


def match_baseline(
    spec: TwinSpec,
    fit_records: RecordSet,
    frame: Frame,
    rng: np.random.Generator,
    steps: int = 4,
    *,
    free: TwinSpec | None = None,
    dampings: Sequence[float] = (0.04,),
    known: dict[Key, Array] | None = None,
) -> TwinSpec:
    """Match the baseline of a twin with effects to records.

    The healthy spectrum is linear in two powers (structure noise and white noise; disturbances scale with their sum).
    Their spectra are simulated with one of them alone, so the powers follow from weighted non-negative least squares,
    for each of a few resonances and dampings around the present ones. Impact amplitudes follow from the energy that
    impacts add in the band, by fixed-point iteration. Common random numbers are used throughout.

    Parameters
    ----------
    spec : TwinSpec
        Phenomenological, with all parameters and the effects.
    fit_records : RecordSet
        A few records of each state suffice.
    frame : Frame
    rng : numpy.random.Generator
    steps : int
        Iterations of the search; 0 keeps the mode and matches levels once.
    free : TwinSpec, optional
        The twin whose fixed parameters stay.
    dampings : sequence of float
        Initial damping ratios of the search for the mode, at the present frequency and at the highest peaks: a search
        from a single one may end in a broad mode that compensates for an effect.
    known : dict, optional
        Spectra of the twin without effects, kept for further calls with the same records and random numbers.

    Returns
    -------
    TwinSpec
    """
    root = root_entropy(rng)
    fixed = set(flat(free.parameters)) if free is not None else set()
    values = {k: float(v) for k, v in flat(all_parameters(spec)).items()}
    sides = state_spectra(list(fit_records), frame)
    quiet = [s for s in sides if s.fault == "healthy"]
    loud = [s for s in sides if s.fault != "healthy"]
    noise_free = not {"structure_noise_rms", "white_noise_rms", "scale"} & fixed
    matcher = _Matcher(spec, frame, fit_records.unit, root, {} if known is None else known)
    if quiet:
        at, best_powers = _mode_search(matcher, quiet, loud, values, fixed, steps, dampings)
        values["resonance_hz"], values["damping_ratio"] = at
        if noise_free:
            before = values["scale"]
            structure, white = np.sqrt(best_powers)
            scale = math.hypot(structure, white)
            if scale > 0:
                values.update(scale=scale, structure_noise_rms=structure / scale, white_noise_rms=white / scale)
                for fault in FAULTS[1:]:
                    name = f"impact_amplitude.{fault}"
                    if name in values and name not in fixed:
                        values[name] *= before / scale
    if {"resonance_hz", "damping_ratio"} - fixed and loud:
        # Impact energy is measured in the band of the matched mode, which may differ from the frame's.
        conditions = [c for s in sides for c in s.conditions]
        band = mode_band(values["resonance_hz"], values["damping_ratio"], conditions, frame.bearing)
        matcher = replace(matcher, frame=replace(frame, band_hz=band))
        loud = [s for s in state_spectra(list(fit_records), matcher.frame) if s.fault != "healthy"]
    without: dict[str, Array] = {}
    for _ in range(2 if steps else 1):
        for fault in sorted({s.fault for s in loud}):
            name = f"impact_amplitude.{fault}"
            if name in fixed:
                continue
            values[name] = matcher.amplitude(fault, [s for s in loud if s.fault == fault], values, without)
    return matcher.spec_with(values)


def match_level(
    made: Callable[[float, Sequence[Condition]], Sequence[Record]],
    sides: Sequence[StateSpectrum],
    frame: Frame,
    now: float,
    steps: Sequence[float] = (0.15, 0.05, 0.02),
) -> float:
    """Factor on a simulator's waveforms that matches its spectra to those of records, effects included.

    The level is the only baseline parameter of the user's own simulator. Effects may change the best level: without
    a sensor's roll-off, for example, the level was too low.

    Parameters
    ----------
    made : callable
        (level, conditions) -> simulated records, with common random numbers at all levels.
    sides : sequence of StateSpectrum
        Spectra of the records.
    frame : Frame
    now : float
        Initial level.
    steps : sequence of float
        Steps of its logarithm, tried one after the other.

    Returns
    -------
    float
        Minimiser of the mean square log ratio over bands, each clipped at one, so that strong tones and disturbances
        in a few bands have little influence.
    """

    def tried(level: float) -> tuple[float, float, Array]:
        rest = log_ratios(made, sides, frame, level)
        return float(np.mean(np.minimum(np.square(rest), 1.0))), level, np.concatenate(rest)

    best = tried(now)
    best = min(best, tried(now * math.exp(-0.5 * float(np.median(best[2])))), key=lambda t: t[0])
    for step in steps:
        best = min([best, *(tried(best[1] * math.exp(sign * step)) for sign in (-1, 1))], key=lambda t: t[0])
    return best[1]


def level_of_own(
    made: Callable[[float, Sequence[Condition]], Sequence[Record]], records: Sequence[Record], frame: Frame
) -> float:
    """Level of a simulator of the user's own, from healthy records, or from all where none is healthy.

    As `match_level`, so that hum of the machine is no reason for a louder simulator. It is 1 where the spectra agree in
    many bands as they are: the samples are then in the unit of the records, which have more in the other bands. Where
    the simulator makes tones and little else, it is the ratio of RMS.

    Parameters
    ----------
    made : callable
        As for `match_level`.
    records : sequence of Record
    frame : Frame
    """
    records = [r for r in records if r.condition.fault == "healthy"] or list(records)
    plain = made(1.0, [r.condition for r in records])
    noise, power = (
        np.array([_bands(r, frame)[0].mean() * r.condition.fs_hz / 2 for r in plain]),
        np.array([r.samples.var() for r in plain], float),
    )
    if noise.sum() < _LEAST_BETWEEN * power.sum():
        return math.sqrt(float(np.median([r.samples.var() for r in records] / np.maximum(power, 1e-300))))
    sides = state_spectra(records, frame)
    found = match_level(made, sides, frame, 1.0, FINE_STEPS)
    if abs(math.log(found)) < _SAME_LEVEL:
        return found
    here = np.abs(log_ratios(made, sides, frame, 1.0)) < _AGREES
    return 1.0 if here.mean() >= _AGREEING else found


def log_ratios(
    made: Callable[[float, Sequence[Condition]], Sequence[Record]],
    sides: Sequence[StateSpectrum],
    frame: Frame,
    level: float,
) -> list[Array]:
    """[states] Log ratios of power densities, simulator over records, in bands. Parameters as `match_level`."""
    inside, rest = slice(2, int(0.92 * BANDS)), []
    for side in sides:
        records = made(level, side.conditions[:MOST_SIMULATED])
        psd = np.mean([_bands(r, frame)[0] for r in records], axis=0)
        rest.append(np.log(np.maximum(psd, 1e-300) / np.maximum(side.psd, 1e-300))[inside])
    return rest


def levels_of(records: RecordSet, frame: Frame) -> list[StateSpectrum]:
    """Spectra for `match_level`: of the healthy records, or of all where none is healthy."""
    sides = state_spectra(list(records), frame)
    return [side for side in sides if side.fault == "healthy"] or sides


def _mode_search(
    matcher: _Matcher,
    quiet: Sequence[StateSpectrum],
    loud: Sequence[StateSpectrum],
    values: dict[str, float],
    fixed: set[str],
    steps: int,
    dampings: Sequence[float],
) -> tuple[tuple[float, float], Array]:
    """Best resonance and damping ratio, and the corresponding powers of structure and white noise.

    Coordinate search from the best of a few initial values, since effects may have biased the first fit; a successful
    step is kept, an unsuccessful one is halved. Initial values include peaks of the spectrum added by a defect, which
    excites the mode and is not masked by disturbances of healthy records.
    """
    top = 0.49 * min(s.fs_hz for s in quiet)
    names = ("resonance_hz", "damping_ratio")
    free = [axis for axis in (0, 1) if names[axis] not in fixed]
    start = (values["resonance_hz"], values["damping_ratio"])

    def tried(point: tuple[float, float]) -> tuple[float, Array, tuple[float, float]]:
        inside = (float(np.clip(point[0], 0.01 * top, top)), float(np.clip(point[1], 1e-3, 0.45)))
        return (*matcher.noise(quiet, *inside, values), inside)

    best = tried(start)
    if steps and len(free) == 2:
        loudest = max(quiet, key=lambda s: len(s.conditions))
        centres = _apart((start[0], loudest.peak_hz, *_impact_peaks_hz(loudest, loud)))
        broad = [(part * loudest.fs_hz, max(dampings)) for part in _GRID]
        starts = [*((f, d) for d in dampings for f in centres), *broad]
        best = min([best, *(tried(point) for point in starts)], key=lambda t: t[0])
    step = [0.03, 0.25]
    for _ in range(steps):
        for axis in free:
            points = [(0.0, best), *((sign, tried(_moved(best[2], axis, sign * step[axis]))) for sign in (-1.0, 1.0))]
            losses = np.array([p[1][0] for p in sorted(points, key=lambda p: p[0])])
            bend = losses[0] - 2 * losses[1] + losses[2]
            vertex = float(0.5 * (losses[0] - losses[2]) / bend) if bend > 0 else 0.0
            if 0.05 < abs(vertex) < 1:
                points.append((vertex, tried(_moved(best[2], axis, vertex * step[axis]))))
            how_far, found = min(points, key=lambda p: p[1][0])
            best = found
            step[axis] *= 1.5 if abs(how_far) == 1 else 0.5
    return best[2], best[1]


def _impact_peaks_hz(quiet: StateSpectrum, loud: Sequence[StateSpectrum]) -> Iterator[float]:
    """Frequencies at which defects add most to healthy spectra: in power, and in proportion."""
    sides = [side for side in loud if side.fs_hz == quiet.fs_hz]
    if not sides:
        return
    psd = np.average([side.psd for side in sides], axis=0, weights=[len(side.conditions) for side in sides])
    smooth = np.ones(5) / 5
    with_defect, without = (np.convolve(p, smooth, mode="same") for p in (psd, quiet.psd))
    for more in (with_defect - without, with_defect / np.maximum(without, 1e-300)):
        yield replace(quiet, psd=np.maximum(more, 0.0)).peak_hz


def _apart(places: Sequence[float]) -> list[float]:
    """Frequencies without those within `_BESIDE` of an earlier one."""
    kept: list[float] = []
    for place in places:
        if all(abs(math.log(place / other)) > _BESIDE for other in kept):
            kept.append(place)
    return kept


def _moved(point: tuple[float, float], axis: int, by: float) -> tuple[float, float]:
    """The point with one coordinate multiplied by exp(by)."""
    factor = math.exp(by)
    return (point[0] * factor, point[1]) if axis == 0 else (point[0], point[1] * factor)


def state_spectra(records: Sequence[Record], frame: Frame) -> list[StateSpectrum]:
    """Spectra of records grouped by state and sampling rate."""
    by: dict[tuple[str, float], list[Record]] = {}
    for record in records:
        by.setdefault((str(record.condition.fault), record.condition.fs_hz), []).append(record)
    out = []
    for (fault, fs_hz), own in by.items():
        measured = [_bands(r, frame) for r in own]
        out.append(
            StateSpectrum(
                fault, fs_hz, tuple(r.condition for r in own), np.mean([m[0] for m in measured], axis=0),
                float(np.mean([m[1] for m in measured])),
            )
        )  # fmt: skip
    return out


def _bands(record: Record, frame: Frame) -> tuple[Array, float]:
    """Power density in `BANDS` bands without tones, and mean square in the frame's band, tones included.

    Segments with impulses are left out of healthy records: with few records, a few strong impulses bias
    the mean, to which mode and noises are fitted. With a defect, loud segments may be its impacts.
    """
    x, fs_hz = record.samples, record.condition.fs_hz
    x = x - x.mean()
    kept = _between_impulses(x) if record.condition.fault == "healthy" else None
    transform = scipy.fft.rfft(x if kept is None else x * kept)
    weight = x.size if kept is None else float(kept @ kept)
    power = (transform.real**2 + transform.imag**2) * (2 / (fs_hz * weight))
    df = fs_hz / x.size
    low, high = (round(f / df) for f in frame.band_hz)
    energy = float(power[max(low, 1) : max(high, low + 1)].sum() * df)
    per = (power.size - 1) // BANDS
    if per < 1:
        return np.interp(np.arange(BANDS), np.linspace(0, BANDS - 1, power.size - 1), power[1:]), energy
    blocks = power[1 : 1 + per * BANDS].reshape(BANDS, per)
    if per < 8:
        return np.asarray(blocks.mean(axis=1)), energy
    # Each bin is clipped at the expected maximum of so many bins of noise, which removes tones.
    level = medians(blocks)[:, None] / math.log(2)
    return np.asarray(np.minimum(blocks, level * (math.log(per) + 3)).mean(axis=1)), energy


def _between_impulses(x: Array) -> Array | None:
    """[samples] Weights: 0 in segments far louder than the rest of the record, 1 elsewhere; None without impulses."""
    count = x.size // _SEGMENT
    if count < _FEWEST_SEGMENTS:
        return None
    pieces = x[: count * _SEGMENT].reshape(count, _SEGMENT)
    power = np.einsum("ij,ij->i", pieces, pieces)
    usual = float(medians(power))
    loud = power > usual + _IMPULSE * max(float(medians(np.abs(power - usual))), 0.1 * usual)
    if not 0 < loud.sum() <= _MOST_IMPULSES * count:
        return None
    # Neighbouring segments contain the beginning and the ring-down of an impulse.
    quiet = np.convolve(loud, np.ones(3), mode="same") == 0
    kept = np.repeat(quiet, _SEGMENT).astype(float)
    kept = np.pad(kept, (0, x.size - kept.size), mode="edge")
    edge = np.hanning(_SEGMENT // 2 + 2)[1:-1]
    return np.asarray(np.convolve(np.pad(kept, edge.size // 2, mode="edge"), edge / edge.sum(), mode="same"))[
        edge.size // 2 : edge.size // 2 + x.size
    ]


@dataclass(frozen=True)
class _Matcher:
    """Simulator of a twin under changed baselines with common random numbers."""

    spec: TwinSpec
    frame: Frame
    unit: str
    root: int
    bare: dict[Key, Array]
    known: dict[float, Array] = field(default_factory=dict)
    idle: dict[tuple[object, ...], bool] = field(default_factory=dict)

    @cached_property
    def plain(self) -> TwinSpec:
        """The twin without its effects."""
        own = {k: v for k, v in self.spec.parameters.items() if k not in self.spec.effects}
        return replace(self.spec, effects=(), parameters=own)

    def spec_with(self, values: dict[str, float]) -> TwinSpec:
        """The twin with these baseline values."""
        return replace(self.spec, parameters=nested(flat(self.spec.parameters) | values))

    def simulated(self, conditions: Sequence[Condition], values: dict[str, float]) -> list[Record]:
        """Simulated records."""
        own = TwinSimulator(self.spec_with(values), self.frame.bearing, self.unit)
        return own.simulate((), conditions, self.root, 0)

    def noise(
        self, quiet: Sequence[StateSpectrum], f: float, zeta: float, values: dict[str, float]
    ) -> tuple[float, Array]:
        """Misfit of the healthy spectra and the minimising powers of structure and white noise."""
        loss, powers, weights = 0.0, np.zeros(2), 0.0
        for side in quiet:
            conditions = side.conditions[:MOST_SIMULATED]
            basis = []
            for structure, white in ((1.0, 1e-4), (1e-4, 1.0)):
                own = values | {
                    "resonance_hz": f, "damping_ratio": zeta, "scale": 1.0,
                    "structure_noise_rms": structure, "white_noise_rms": white,
                }  # fmt: skip
                exact = structure**2 * mode_density(f, zeta, side.fs_hz) + white**2 * 2 / side.fs_hz
                basis.append(exact * self._changed(conditions, own))
            inside = slice(2, int(0.92 * BANDS))
            got, one = _nonnegative(np.array(basis).T[inside], side.psd[inside])
            loss += one * len(side.conditions)
            powers += got * len(side.conditions)
            weights += len(side.conditions)
        return loss / weights, powers / weights

    def _changed(self, conditions: Sequence[Condition], values: dict[str, float]) -> Array | float:
        """Factor by which effects change the healthy spectrum [BANDS], from records with common random numbers."""
        acts = self.acts(conditions)
        if acts == "nothing":
            return 1.0
        # Without structure noise the mode is irrelevant, unless an effect excites it.
        lasting = acts == "after the mode" and values["structure_noise_rms"] < values["white_noise_rms"]
        if lasting and conditions[0].fs_hz in self.known:
            return self.known[conditions[0].fs_hz]
        key = self.root, tuple(c.name for c in conditions), tuple(sorted(values.items()))
        if key not in self.bare:
            self.bare[key] = self.density(conditions, values, self.plain)
        factor = self.density(conditions, values, self.spec) / self.bare[key]
        if lasting:
            self.known[conditions[0].fs_hz] = factor
        return factor

    def acts(self, conditions: Sequence[Condition]) -> Literal["nothing", "after the mode", "more"]:
        """Stage at which the effects act on healthy records of these conditions."""
        stages = {catalogue()[name].stage for name in self.spec.effects}
        if stages <= {Stage.SHAFT, Stage.EXCITATION}:
            key = tuple((c.speed_rpm, c.time_s, c.load_n) for c in conditions)
            if key not in self.idle:
                short = [replace(c, fault="healthy", n_samples=min(c.n_samples, 512)) for c in conditions]
                values = {"resonance_hz": conditions[0].fs_hz / 8, "damping_ratio": 0.05}
                pair = (replace(self, spec=s).simulated(short, values) for s in (self.spec, self.plain))
                # Most change only the impacts of a defect, which healthy records do not have.
                self.idle[key] = all(np.array_equal(a.samples, b.samples) for a, b in zip(*pair, strict=True))
            if self.idle[key]:
                return "nothing"
        return "more" if Stage.EXCITATION in stages else "after the mode"

    @cached_property
    def linear(self) -> bool:
        """Whether no effect of acquisition acts: clipping and quantisation are nonlinear in the impacts."""
        return Stage.ACQUISITION not in {catalogue()[name].stage for name in self.spec.effects}

    def density(self, conditions: Sequence[Condition], values: dict[str, float], spec: TwinSpec) -> Array:
        """Mean power density [BANDS] of a twin's records."""
        made = replace(self, spec=spec).simulated(conditions, values)
        return np.asarray(np.mean([_bands(r, self.frame)[0] for r in made], axis=0))

    def amplitude(
        self, fault: str, sides: Sequence[StateSpectrum], values: dict[str, float], without: dict[str, Array]
    ) -> float:
        """Impact amplitude that matches the energy in the band to that of the records.

        `without` keeps the energies without impacts, by fault.
        """
        name = f"impact_amplitude.{fault}"
        number = np.array([len(side.conditions) for side in sides], float)

        def energy(amplitude: float) -> Array:
            made = (self.simulated(side.conditions[:MOST_SIMULATED], values | {name: amplitude}) for side in sides)
            return np.array([np.mean([_bands(r, self.frame)[1] for r in records]) for records in made])

        if fault not in without:
            without[fault] = energy(0.0)
        wanted = float(number @ (np.array([side.energy for side in sides]) - without[fault]))
        if wanted <= 0:  # by chance, simulated impulses stronger than the records' hide the impacts
            return values[name]
        now = max(values[name], _LEAST_BEGUN)
        for _ in range(_MOST_STEPS):
            added = float(number @ (energy(now) - without[fault]))
            if added <= 0:
                return now
            step = math.sqrt(float(np.clip(wanted / added, 0.01, 100.0)))
            now *= step
            # Energy is quadratic in amplitude unless the record clips; too long a step may miss.
            if abs(math.log(step)) < (_SURE_STEP if self.linear else _FINAL_STEP):
                break
        return now


def mode_density(resonance_hz: float, damping_ratio: float, fs_hz: float) -> Array:
    """[BANDS] Power density of sampled structure noise of unit variance, 1/Hz, from 0 to half the rate."""
    f = (np.arange(8 * BANDS) + 0.5) / (16 * BANDS)
    s, turn = np.array(Mode(resonance_hz, damping_ratio).pole / fs_hz), np.exp(-2j * math.pi * f)
    (now, before), pole = moving_average(s), np.exp(s)
    power = np.abs((now + before * turn) / ((1 - pole * turn) * (1 - np.conj(pole) * turn))) ** 2
    return np.asarray((power / power.mean() * 2 / fs_hz).reshape(BANDS, 8).mean(axis=1))


def _nonnegative(basis: Array, wanted: Array) -> tuple[Array, float]:
    """Powers [2] of the two spectra [bins, 2] by non-negative least squares of relative errors, and the log misfit."""
    from scipy.optimize import nnls

    weight = 1 / np.maximum(wanted, 1e-300)
    got = np.zeros(2)
    for _ in range(4):
        got = nnls(basis * weight[:, None], wanted * weight)[0]
        model = np.maximum(basis @ got, 1e-3 * wanted)
        weight = 1 / np.sqrt(model * wanted)
    rest = np.log(np.maximum(basis @ got, 1e-300) / np.maximum(wanted, 1e-300))
    return got, float(np.mean(np.minimum(rest**2, 1.0)))
