"""The source: labelled records of the contact twin, made like the unlabelled recordings that are adapted to.

adaptation recordings (no labels) --averaged spectrum--> stiffness, damping, noises --> a population of virtual
bearings about them (defect, clearance, load, speed drawn) --contact twin--> labelled windows

The paper identifies k and c from the spectrum of measured faults, whose classes it must know. Here the classes are
unknown, so the spectrum averaged over all adaptation recordings is compared with that averaged over simulated records
of all classes alike. The share of white noise, which the paper's model does not have, is found with them. How far a
fault stands above the noise cannot be estimated without labels: it is drawn, widely. (`twingap.identify` fits the
contact twin to records whose states are known, which these are not.)
"""

import contextlib
import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.stats import qmc

from papers.arrays import Array
from papers.paper3_zoa_dann.inputs.options import IdentificationOptions, SourceOptions
from twingap import Bearing, Condition, RecordSet, TwingapError
from twingap.adapt import Windows, cut, joined
from twingap.effects import Effect, SecondResonance, catalogue, make_effect
from twingap.signal.spectrum import averaged_spectrum
from twingap.streams import Streams, root_entropy
from twingap.twins.contact import ContactTwin, make_each
from twingap.twins.contact_parameters import DEFECTS, PRESETS, ContactParameters, sink_depth_um

FREE = ("stiffness", "damping", "white_share")
"""What is identified, all on a log scale: K, c, and the white part of the noise's power (the rest rings along)."""


def mean_log_spectrum(windows: Windows, segment_samples: int) -> Array:
    """Spectrum in dB averaged over recordings, each scaled to unit variance first [bins]."""
    rows = []
    for group in dict.fromkeys(windows.group):
        x = windows.samples[windows.group == group]
        x = (x - x.mean(axis=1, keepdims=True)) / x.std()
        amplitude = averaged_spectrum(x, float(windows.fs_hz[0]), segment_samples=segment_samples).values
        rows.append(np.sqrt(np.mean(amplitude**2, axis=0)))
    return np.asarray(20 * np.log10(np.mean(rows, axis=0)[1:-1]))


def identify(
    measured: Windows, bearing: Bearing, classes: Sequence[str], source: SourceOptions,
    options: IdentificationOptions, evaluations: int,
) -> dict[str, float]:  # fmt: skip
    """The contact twin's free parameters (`FREE`, to four digits) from windows whose labels are not read, all classes
    simulated alike, and distances of spectra before and after, dB. Half of the evaluations are a Sobol sample of the
    box, the rest ever smaller steps about the best; 0 gives the preset's values."""
    preset = PRESETS[source.preset]
    wanted = mean_log_spectrum(measured, options.segment_samples)
    length = source.windows_per_record * measured.samples.shape[1]
    fs_hz, speed_rpm = float(measured.fs_hz[0]), float(np.median(measured.speed_rpm))
    middle_snr_db = float(np.mean(source.snr_db))

    def distance(values: Mapping[str, float]) -> float:
        own = dataclasses.replace(preset, stiffness=values["stiffness"], damping=values["damping"])
        virtual = [VirtualBearing(own, (), fault, middle_snr_db, preset.load_n) for fault in classes]
        numbers = range(options.records_per_class)
        conditions = [
            [Condition(f"{fault}-{i}", speed_rpm, fs_hz, length, fault, preset.load_n) for i in numbers]
            for fault in classes
        ]
        roots = [root_entropy(np.random.default_rng(0))] * len(classes)
        try:
            made = list(_records(virtual, conditions, roots, bearing, source, values["white_share"]))
        except TwingapError:  # a contact mode above half the sampling rate, for one
            return np.inf
        windows = joined(cut(m, measured.samples.shape[1], source.windows_per_record) for m in made)
        simulated = mean_log_spectrum(windows, options.segment_samples)
        return float(np.sqrt(np.mean((simulated - wanted) ** 2)))

    start = {"stiffness": preset.stiffness, "damping": preset.damping, "white_share": 0.5}
    before = distance(start)
    best, lowest = start, before
    low, high = np.log([options.stiffness, options.damping, options.white_share]).T
    rng = np.random.default_rng(0)
    spread = qmc.Sobol(len(FREE), rng=rng).random_base2(max(1, int(np.ceil(np.log2(max(evaluations // 2, 2))))))
    for count in range(evaluations):
        if count < evaluations // 2:
            place = low + spread[count] * (high - low)
        else:
            width = 0.25 * 0.1 ** ((count - evaluations // 2) / (evaluations - evaluations // 2))
            step = width * (high - low) * rng.standard_normal(len(FREE))
            place = np.clip(np.log([best[name] for name in FREE]) + step, low, high)
        tried = {name: float(f"{value:.4g}") for name, value in zip(FREE, np.exp(place), strict=True)}
        found = distance(tried)
        if found < lowest:
            best, lowest = tried, found
    return {**best, "rmse_db_before": round(before, 6), "rmse_db": round(lowest, 6)}


@dataclass(frozen=True)
class Recipe:
    """All that the simulated windows of a task depend on, so that any worker anywhere makes the same ones."""

    stiffness: float  # stiffness, damping, white_share: as identified
    damping: float
    white_share: float
    speeds_rpm: tuple[float, ...]  # of the adaptation recordings; simulated speeds lie around them
    fs_hz: float
    bearing: Bearing
    classes: tuple[str, ...]
    options: SourceOptions
    bearings_per_class: int
    records_per_bearing: int
    window_samples: int
    seed: int
    # effects beyond `options.effects` that the gap diagnosis names: each virtual bearing has each of them or not, by
    # lot, with parameters drawn from all that is plausible
    closed: tuple[str, ...] = ()

    def twin_toml(self) -> str:
        """The identified twin as a twin file; the white share is in a comment, since noise levels are drawn."""
        effects = ", ".join(f'"{name}"' for name in self.options.effects)
        return (
            f"# white part of the noise's power: {self.white_share!r}\n"
            f'[twin]\nmodel = "contact"\npreset = "{self.options.preset}"\neffects = [{effects}]\n\n'
            f"[parameters]\nstiffness = {self.stiffness!r}\ndamping = {self.damping!r}\n"
        )


@dataclass(frozen=True)
class VirtualBearing:
    parameters: ContactParameters  # without noise
    path: tuple[Effect, ...]  # of its structure
    fault: str
    snr_db: float  # of its fault's vibration over its noise (of an inner-race fault's, when healthy)
    load_n: float
    drawn: tuple[Effect, ...] = ()  # by lot, on top of fault and noise: no part of what they are measured by


@lru_cache(maxsize=2)
def simulate(recipe: Recipe) -> Windows:
    """Labelled windows of a population of virtual bearings; group = virtual bearing."""
    rng, source = np.random.default_rng(recipe.seed), recipe.options
    length = source.windows_per_record * recipe.window_samples
    virtual: list[VirtualBearing] = []
    conditions: list[list[Condition]] = []
    roots: list[int] = []
    for fault in recipe.classes:
        for number in range(recipe.bearings_per_class):
            one = _virtual_bearing(recipe, fault, rng)
            # Draws of their own: all else is as without them.
            own = np.random.default_rng([recipe.seed, 61, recipe.classes.index(fault), number])
            drawn = tuple(drawn_effect(name, recipe.fs_hz, own) for name in recipe.closed if own.random() < 0.5)
            virtual.append(dataclasses.replace(one, drawn=drawn))
            group, made = f"{fault}-{number}", []
            for i in range(recipe.records_per_bearing):
                speed = float(rng.choice(recipe.speeds_rpm) * (1 + source.speed_spread * rng.uniform(-1, 1)))
                made.append(Condition(f"{group}-{i}", speed, recipe.fs_hz, length, fault, one.load_n, group=group))
            conditions.append(made)
            roots.append(root_entropy(rng))
    return joined(
        cut(made, recipe.window_samples, source.windows_per_record, recipe.classes)
        for made in _records(virtual, conditions, roots, recipe.bearing, source, recipe.white_share)
    )


def _virtual_bearing(recipe: Recipe, fault: str, rng: np.random.Generator) -> VirtualBearing:
    """One bearing of the population. The draws are the same whatever the fault."""
    source, preset = recipe.options, PRESETS[recipe.options.preset]
    width_mm = _log_uniform(source.width_mm, rng)
    sink_um = sink_depth_um(width_mm, recipe.bearing.roller_diameter_mm)
    depth_um = sink_um * _uniform(source.depth_share, rng)
    spread = np.exp(source.parameter_spread * rng.standard_normal(3))
    load_n, snr_db = _uniform(source.load_n, rng), _uniform(source.snr_db, rng)
    drawn = (source.resonance_hz, source.resonance_damping, source.resonance_gain)
    hz, damping, gain = (_log_uniform(bounds, rng) for bounds in drawn)
    own = dataclasses.replace(
        preset, stiffness=recipe.stiffness * float(spread[0]), damping=recipe.damping * float(spread[1]),
        mass_kg=preset.mass_kg * float(spread[2]), load_n=load_n, clearance_um=_uniform(source.clearance_um, rng),
        defect_width_mm=width_mm, defect_depth_um=dict.fromkeys(DEFECTS, depth_um),
    )  # fmt: skip
    return VirtualBearing(own, (SecondResonance(hz, damping, gain),), fault, snr_db, load_n)


def drawn_effect(name: str, fs_hz: float, rng: np.random.Generator) -> Effect:
    """An effect with parameters from all that is plausible, frequencies no higher than 0.45 of the sampling rate."""
    for _ in range(_TRIES - 1):
        # A band whose lower edge lies above its upper one is drawn again.
        with contextlib.suppress(TwingapError):
            return make_effect(name, _drawn_values(name, fs_hz, rng), "closed")
    return make_effect(name, _drawn_values(name, fs_hz, rng), "closed")


def _drawn_values(name: str, fs_hz: float, rng: np.random.Generator) -> dict[str, float | bool]:
    values: dict[str, float | bool] = {}
    for field in dataclasses.fields(catalogue()[name]):  # type: ignore[arg-type]
        about = field.metadata
        if "plausible" not in about or not about.get("fitted", True):
            continue
        if field.type in (bool, "bool"):
            values[field.name] = bool(rng.random() < 0.5)
            continue
        low, high = (float(end) for end in about["plausible"])
        if about["unit"] == "Hz":
            low, high = min(low, 0.4 * fs_hz), min(high, 0.45 * fs_hz)
        value = _log_uniform((low, high), rng) if about.get("log") else _uniform((low, high), rng)
        values[field.name] = round(value) if field.type in (int, "int") else value
    return values


_TRIES: Final = 100
AT_ONCE: Final = 64  # bearings integrated together: lanes of the integrator are full, and memory stays bounded


def _records(
    virtual: Sequence[VirtualBearing], conditions: Sequence[Sequence[Condition]], roots: Sequence[int],
    bearing: Bearing, source: SourceOptions, white_share: float,
) -> Iterator[RecordSet]:  # fmt: skip
    """Records of each bearing under its conditions, with its noise; roots are those of its random streams."""
    for begin in range(0, len(virtual), AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        twins = _with_noise(virtual[some], bearing, source, white_share, conditions[some])
        streams = [
            [Streams(root, i) for i in range(len(own))] for root, own in zip(roots[some], conditions[some], strict=True)
        ]
        for twin, made in zip(twins, make_each(twins, conditions[some], streams), strict=True):
            yield RecordSet.from_records("contact twin", twin.unit, bearing, made)


def _with_noise(
    virtual: Sequence[VirtualBearing], bearing: Bearing, source: SourceOptions, white_share: float,
    conditions: Sequence[Sequence[Condition]],
) -> list[ContactTwin]:  # fmt: skip
    """Twins whose noise lies as far below the vibration of their faults as was drawn for each."""
    chain = tuple(make_effect(name) for name in source.effects)
    quiet, pilots = [], []
    for one, own in zip(virtual, conditions, strict=True):
        silent = dataclasses.replace(one.parameters, structure_noise_rms=0.0, white_noise_rms=0.0)
        quiet.append(ContactTwin(bearing, silent, (*chain, *one.path)))
        struck = "inner" if one.fault == "healthy" else one.fault
        pilots.append([Condition("pilot", 1780.0, own[0].fs_hz, 4096, struck, one.parameters.load_n)])
    streams = [[Streams(root_entropy(np.random.default_rng(0)), 0)]] * len(quiet)
    twins = []
    for one, (record,) in zip(virtual, make_each(quiet, pilots, streams), strict=True):
        noise = float(np.std(record.samples)) * 10 ** (-one.snr_db / 20)
        structure, white = (noise * float(np.sqrt(share)) for share in (1 - white_share, white_share))
        noisy = dataclasses.replace(one.parameters, structure_noise_rms=structure, white_noise_rms=white)
        twins.append(ContactTwin(bearing, noisy, (*chain, *one.path, *one.drawn)))
    return twins


def _log_uniform(bounds: Sequence[float], rng: np.random.Generator) -> float:
    return float(np.exp(_uniform(np.log(bounds), rng)))


def _uniform(bounds: Sequence[float] | Array, rng: np.random.Generator) -> float:
    return float(rng.uniform(bounds[0], bounds[1]))
