"""Simulated gaps: machines whose missing effects are known, to learn the diagnosis from.

machine + effects at random --simulate--> records (nominal metadata)   what a diagnosis would be given
                      |---- effects' names and values                  what it should say
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from twingap.effects import Effect, catalogue, make_effect
from twingap.gap.knowledge.effect_variants import as_built
from twingap.gap.knowledge.machines import Machine, draw_machine
from twingap.gap.knowledge.outside_catalogue import estrange
from twingap.gap.search.evidence import values_of
from twingap.gap.search.parameter_scale import Setting, a_little_off
from twingap.records import Record, RecordSet
from twingap.twins.twin_file import TwinSpec

Array = NDArray[np.float64]
Drawer = Callable[[np.random.Generator, Machine], Mapping[str, float] | None]

HOW_MANY = (0.27, 0.24, 0.2, 0.12, 0.1, 0.07)
"""Chances of 0, 1, ... effects missing: of machines that lack none, p-values get their grain."""
HOW_MANY_OF_FEW = (0.48, 0.34, 0.18)
"""The same when only some effects are learnt, from few machines: a p-value needs its share without a gap."""
MODELLING = 0.35
"""Part of the machines some of whose effects the twin models: p-values of those get their grain from these alone."""
STRANGE = 0.18
"""Part of the gaps with something that no catalogued effect describes."""


@dataclass(frozen=True)
class SimulatedGap:
    """A gap whose cause is known.

    Parameters
    ----------
    records : RecordSet
        Of the machine, with nominal metadata.
    spec : TwinSpec
        The twin that a diagnosis gets.
    sim : RecordSet or None
        Records of the user's own simulator, in place of the twin's.
    missing : tuple of Effect
        What the machine has and the twin lacks.
    modelled : tuple of Effect
        What both have, at the machine's values.
    strange : bool
        Whether the machine has something outside the catalogue too.
    machine : Machine
    """

    records: RecordSet
    spec: TwinSpec
    sim: RecordSet | None
    missing: tuple[Effect, ...]
    modelled: tuple[Effect, ...]
    strange: bool
    machine: Machine


def draw_gap(
    rng: np.random.Generator, own_simulator: bool | None = None, most_records: int = 40, among: Sequence[str] = ()
) -> SimulatedGap:
    """A gap at random.

    Parameters
    ----------
    rng : numpy.random.Generator
    own_simulator : bool or None
        Whether the twin is a set of simulated records; None: one time in three.
    most_records : int
    among : sequence of str
        Effects to draw from; empty is the whole catalogue.
    """
    own = bool(rng.random() < 1 / 3) if own_simulator is None else own_simulator
    machine = draw_machine(rng, own, most_records)
    chances = HOW_MANY_OF_FEW if among else HOW_MANY
    count = int(rng.choice(len(chances), p=chances))
    modelled: tuple[Effect, ...] = ()
    effects = draw_effects(rng, machine, count + (int(rng.integers(1, 3)) if rng.random() < MODELLING else 0), among)
    if len(effects) > count:
        kept = rng.permutation(len(effects))
        modelled, effects = tuple(effects[i] for i in kept[count:]), tuple(effects[i] for i in kept[:count])
    # What a twin models is there as the twin has it or nearly so, but a slip the other way is another slip. A simulator
    # of the machine's own has what it models as the machine has it.
    alike = tuple(e for e in modelled if own or e.name == "mean_slip")
    built = [e if e in alike else as_built(e, machine, rng) for e in (*modelled, *effects)]
    records = simulated(machine, tuple(built), rng)
    strange = bool(rng.random() < STRANGE)
    if strange:
        records = estrange(records, rng)
    nominal = RecordSet.from_records(
        "machine", "", machine.bearing,
        (Record(c, r.samples) for c, r in zip(machine.nominal, records, strict=True)),
    )  # fmt: skip
    sim = None
    if own:
        gain = float(np.exp(rng.normal(0, 0.7))) if rng.random() < 0.7 else 1.0
        sim = simulated(replace(machine, conditions=machine.nominal), modelled, rng, gain)
    values = {effect.name: values_of(effect) for effect in _as_known(modelled, machine, rng)}
    spec = TwinSpec("phenomenological", tuple(values), None, values)
    return SimulatedGap(nominal, spec, sim, effects, modelled, strange, machine)


def _as_known(modelled: Sequence[Effect], machine: Machine, rng: np.random.Generator) -> tuple[Effect, ...]:
    """Effects as a twin file has them: at true values, or at values that were read off records."""
    if rng.random() < 0.5:
        return tuple(modelled)
    setting, error = Setting.of(machine.nominal), 0.12 * rng.random()
    return tuple(a_little_off(effect, error, setting, rng) for effect in modelled)


def simulated(machine: Machine, effects: Sequence[Effect], rng: np.random.Generator, gain: float = 1.0) -> RecordSet:
    """Records of the machine under its conditions."""
    return machine.twin(effects, gain).simulate(machine.conditions, rng)


def draw_effects(
    rng: np.random.Generator, machine: Machine, count: int, among: Sequence[str] = ()
) -> tuple[Effect, ...]:
    """So many different effects, as far as this machine's records could show them."""
    names = [name for name in catalogue() if not among or name in among]
    chances = np.array([_SHYNESS.get(name, 1.0) for name in names])
    out: list[Effect] = []
    for place in rng.choice(len(names), len(names), replace=False, p=chances / chances.sum()):
        if len(out) == count:
            break
        name = names[place]
        drawer = DRAWERS.get(name, _plausible(name))
        values = drawer(rng, machine)
        if values is None:
            continue
        effect = make_effect(name, values)
        if _fits(effect, machine):
            out.append(effect)
    return tuple(out)


def _fits(effect: Effect, machine: Machine) -> bool:
    """Whether every record of the machine can be simulated with it."""
    from twingap.effects import Draft

    t = np.zeros(2)
    fastest = max(machine.conditions, key=lambda c: c.speed_rpm)
    return effect.cannot_act_on(Draft(fastest, machine.bearing, 1.0, t, t)) is None


_SHYNESS = {
    "entry_exit": 1.8, "mean_slip": 2.0, "slip_jitter": 1.6, "speed_fluctuation": 1.6, "impact_scatter": 1.6,
    "second_resonance": 1.8, "load_zone": 1.6, "cage_modulation": 1.4, "damage_growth": 2.0, "speed_gain": 2.0,
    "sensor_rolloff": 1.7, "coloured_noise": 1.7, "distributed_roughness": 1.3, "foreign_bearing": 1.2,
}  # fmt: skip
"""Effects that are hard to see, or that few machines' records could show, are drawn more often."""
_SHORTEST = 0.036
"""Arc of the shortest defects over that of the longest: 1.5 to 42 % of a pass."""
_APART = math.log(1.12)
"""Of the fastest over the slowest record of a kind, from which a gain over speed shows."""
_FELT = 0.2
"""Part of the strikes' gain from which healthy records show it too."""
_SHOWN_GAIN = 0.15
"""Slope of log amplitudes times the spread of log speeds that just shows: three times what levels are off by."""
_JUST_SEEN = 93.0
"""Power of a tone over that of the noise, times the samples, from which it shows: the more there are, the weaker."""


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _faintest(machine: Machine) -> float:
    """RMS of a tone, in multiples of the healthy RMS, that all records of the machine together just show."""
    samples = sum(c.n_samples for c in machine.conditions)
    return float(np.clip(math.sqrt(_JUST_SEEN / samples), 0.012, 0.09))


def _tone(rng: np.random.Generator, machine: Machine, most: float) -> float:
    """Level of a tone: one half about what the records just show, where a detector must know the limit."""
    faintest = _faintest(machine)
    return _log(rng, 0.8 * faintest, 5 * faintest) if rng.random() < 0.5 else _log(rng, faintest, most)


def _shaft(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
    strongest = _tone(rng, machine, 1.5)
    levels = strongest * 10 ** (-rng.uniform(0, 12, 3) / 20)
    levels[rng.integers(3)] = strongest
    return {f"level_{k}x": float(level) for k, level in enumerate(levels, start=1)}


def _faults(machine: Machine) -> set[str]:
    return {str(c.fault) for c in machine.conditions} - {"healthy"}


def _any_fault(drawer: Drawer) -> Drawer:
    return lambda rng, machine: drawer(rng, machine) if _faults(machine) else None


def _slip(rng: np.random.Generator, machine: Machine) -> Mapping[str, float] | None:
    # One fault alone shows it where the shaft itself is seen, by tones or side lines.
    if not _faults(machine):
        return None
    other = rng.choice([-1.0, 0.0, rng.uniform(-1.5, 0.5)])
    return {
        "slip": float(rng.choice([-1, 1])) * _log(rng, 0.003, 0.06),
        "of_rollers": 1.0 if rng.random() < 0.6 else float(other),
    }


def _zone(rng: np.random.Generator, machine: Machine) -> Mapping[str, float] | None:
    if not _faults(machine) & {"inner", "ball"}:
        return None
    return {"depth": _log(rng, 0.12, 1.0), "extent": 1.0 if rng.random() < 0.4 else rng.uniform(0.25, 1.0)}


def _growth(rng: np.random.Generator, machine: Machine) -> Mapping[str, float] | None:
    times = [c.time_s for c in machine.conditions if c.time_s is not None and c.fault != "healthy"]
    if len(times) < 4 or max(times) <= min(times):
        return None
    begin, span = min(times), max(times) - min(times)
    onset = begin + span * rng.uniform(0, 0.6) if rng.random() < 0.6 else begin
    return {"rate_per_s": _log(rng, 0.15, 3.0) / (max(times) - onset), "onset_s": onset}


def _gain(rng: np.random.Generator, machine: Machine) -> Mapping[str, float] | None:
    # A speed that strikes feel, the noise of the structure may feel as much, less or not at all.
    on_noise = float(rng.choice([0.0, rng.random(), 1.0], p=[0.4, 0.3, 0.3]))
    # A level of each fault is free, so only one fault at several speeds shows a gain; noise does where it feels it.
    courses = [
        np.log([c.speed_rpm for c in machine.conditions if c.fault == kind])
        for kind in (*_faults(machine), *(["healthy"] if on_noise > _FELT else []))
    ]
    courses = [x for x in courses if x.size and np.ptp(x) > _APART]
    if not courses:
        return None
    sign = 1 if rng.random() < 0.6 else -1  # faster strikes harder, and may leave a resonance behind
    speeds = [c.speed_rpm for c in machine.conditions]
    reference = 1800.0 if rng.random() < 0.3 else float(np.median(speeds))
    least = float(np.clip(_SHOWN_GAIN / math.sqrt(sum(float(((x - x.mean()) ** 2).sum()) for x in courses)), 0.15, 0.8))
    return {"exponent": sign * _log(rng, least, 4.5), "reference_speed_rpm": reference, "on_noise": on_noise}


def _density(machine: Machine, f_hz: float, more: tuple[float, float, float] | None = None) -> float:
    """Power density of healthy vibration at a frequency, 1/Hz in units of scale, with one more mode or without; all
    modes of the machine's structure in it."""
    own, fs_hz = machine.parameters, machine.conditions[0].fs_hz

    def response(at_hz: Array, mode_hz: float, damping: float, gain: float) -> NDArray[np.complex128]:
        w = 2 * np.pi * mode_hz
        return np.asarray(gain * w / (w**2 - (2 * np.pi * at_hz) ** 2 + 4j * np.pi * damping * w * at_hz))

    grid = np.linspace(0, fs_hz / 2, 600)
    first = response(grid, own.resonance_hz, own.damping_ratio, 1.0)
    force = own.structure_noise_rms**2 / float(np.mean(np.abs(first) ** 2) * fs_hz / 2)
    at = np.array([f_hz])
    whole = response(at, own.resonance_hz, own.damping_ratio, 1.0)
    for mode in machine.modes:
        whole = whole + response(at, mode.frequency_hz, mode.damping_ratio, mode.gain)
    if more is not None:
        whole = whole + response(at, *more)
    return float(np.abs(whole[0]) ** 2 * force + own.white_noise_rms**2 / (fs_hz / 2))


def _resonance(rng: np.random.Generator, machine: Machine) -> Mapping[str, float] | None:
    first, fs_hz = machine.parameters.resonance_hz, machine.conditions[0].fs_hz
    second, damping = _log(rng, 0.02, 0.46) * fs_hz, _log(rng, 0.01, 0.15)
    if abs(np.log(second / first)) < 0.2:
        return None
    wanted, opposed = 10 ** (rng.uniform(1.0, 14.0) / 10), bool(rng.random() < 0.5)
    for gain in np.geomspace(0.02, 8.0, 72):  # the least that raises the healthy spectrum there by as much
        more = (second, damping, -float(gain) if opposed else float(gain))
        if _density(machine, second, more) > wanted * _density(machine, second):
            return {"frequency_hz": second, "damping_ratio": damping, "gain": float(gain), "opposed": opposed}
    return None


def _rolloff(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
    order, loss_db = int(rng.integers(1, 7)), _log(rng, 1.0, 18.0)
    # Lost at the resonance, or high up: there only background is left to lose.
    at_hz = machine.parameters.resonance_hz
    if rng.random() < 0.5:
        at_hz = max(at_hz, rng.uniform(0.2, 0.45) * machine.conditions[0].fs_hz)
    # Most of what a sensor shows between modes is the machine's, or most is its own.
    background = 0.0 if rng.random() < 0.3 else 1 - 10 ** rng.uniform(-2.5, -0.1)
    corner_hz = at_hz / (10 ** (loss_db / 10) - 1) ** (0.5 / order)
    return {"corner_hz": corner_hz, "order": order, "background": background}


def _mains(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
    return {
        "level": _tone(rng, machine, 2.0), "decay": rng.uniform(0.2, 0.9),
        "mains_hz": float(rng.choice([50.0, 60.0])), "n_harmonics": int(rng.integers(1, 9)),
    }  # fmt: skip


def _drive(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
    fs_hz = machine.conditions[0].fs_hz
    order = float(rng.integers(1, 9)) if rng.random() < 0.7 else rng.uniform(1, 8)
    return {
        "level": _tone(rng, machine, 2.0), "depth": rng.uniform(0.2, 2.0),
        "carrier_hz": fs_hz * _log(rng, 0.04, 0.46), "sideband_order": order,
    }  # fmt: skip


def _gear(rng: np.random.Generator, machine: Machine) -> Mapping[str, float] | None:
    fastest = max(c.speed_rpm for c in machine.conditions) / 60
    most = int(0.45 * machine.conditions[0].fs_hz / fastest)
    if most < 9:
        return None
    return {
        "level": _tone(rng, machine, 3.0), "decay": rng.uniform(0.1, 0.9),
        "depth": rng.uniform(0.1, 1.5), "teeth": int(rng.integers(8, min(90, most) + 1)),
        "n_harmonics": int(rng.integers(1, 7)),
    }  # fmt: skip


def _foreign(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
    ring = _ring(rng, machine, (0.04, 0.44), (0.01, 0.15))
    return {"level": _log(rng, 0.8, 20.0), "order": rng.uniform(1.3, 13.0), **ring}


def _ring(
    rng: np.random.Generator, machine: Machine, place: tuple[float, float], damping: tuple[float, float]
) -> Mapping[str, float]:
    """What strikes from elsewhere ring in: a mode on their own way, or the machine's own."""
    own = machine.parameters
    if rng.random() < 0.4:
        return {"resonance_hz": own.resonance_hz, "damping_ratio": own.damping_ratio}
    return {"resonance_hz": machine.conditions[0].fs_hz * _log(rng, *place), "damping_ratio": _log(rng, *damping)}


def _two_strikes(rng: np.random.Generator, machine: Machine) -> Mapping[str, float] | None:
    """From what is one strike of another shape to nearly half a pass, on the race where there is one."""
    race, bearing = 360 / machine.bearing.n_rollers, machine.bearing
    longest = 0.42 * (race if _faults(machine) - {"ball"} else 180.0)
    # Arcs whose strikes fall within two samples at every speed show nowhere.
    seen = [
        2 * (180.0 if c.fault == "ball" else race) * bearing.fault_order(str(c.fault)) * c.speed_rpm / 60 / c.fs_hz
        for c in machine.conditions if c.fault != "healthy"
    ]  # fmt: skip
    shortest = max(min(seen), longest * _SHORTEST)
    arc_deg, turned = min(_log(rng, shortest, longest), 80.0), bool(rng.random() < 0.4)
    return {"arc_deg": arc_deg, "exit_ratio": _log(rng, 0.14, 7.0), "turned": turned}


def _coloured(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
    fs_hz = machine.conditions[0].fs_hz
    if rng.random() < 0.55:  # a slope from pumps and flow
        slope = rng.uniform(0.6, 2.5) if rng.random() < 0.85 else rng.uniform(-1.0, -0.6)
        band = {"slope": slope, "low_hz": _log(rng, 0.001, 0.01) * fs_hz, "high_hz": _log(rng, 0.2, 1.2) * fs_hz}
        return {"level": _log(rng, 0.2, 4.0), **band}
    low, width = fs_hz * rng.uniform(0.005, 0.4), fs_hz * rng.uniform(0.01, 0.15)  # a band from a neighbour
    power = (10 ** (rng.uniform(1.2, 15.0) / 10) - 1) * _density(machine, low + width / 2) * width
    level = math.sqrt(power) / math.hypot(machine.parameters.structure_noise_rms, machine.parameters.white_noise_rms)
    return {"level": level, "slope": rng.uniform(-0.3, 0.5), "low_hz": low, "high_hz": low + width}


def _knocks(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
    ring = _ring(rng, machine, (0.03, 0.44), (0.01, 0.25))
    spread = 1.0 if rng.random() < 0.4 else rng.uniform(0.15, 1.0)
    return {"level": _log(rng, 4.0, 60.0), "rate_hz": _log(rng, 0.7, 40.0), "spread": spread, **ring}


def _waviness(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
    return {
        "level": _tone(rng, machine, 2.0), "decay": rng.uniform(0.2, 0.95),
        "n_harmonics": int(rng.integers(1, 8)), "inner": bool(rng.random() < 0.35),
    }  # fmt: skip


def _clipping(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
    # Where the strongest records reach is known only roughly here; a rail that nothing meets is no effect.
    reach = 3.2 if not _faults(machine) else max(machine.parameters.impact_amplitude.values()) + 2.5
    return {"rail": max(reach * rng.uniform(0.25, 0.9), 1.6)}


DRAWERS: dict[str, Drawer] = {
    "speed_fluctuation": _any_fault(lambda r, m: {"level": _log(r, 0.0015, 0.05), "bandwidth_hz": _log(r, 0.5, 10.0)}),
    "mean_slip": _slip,
    "slip_jitter": _any_fault(lambda r, m: {"sigma": _log(r, 0.005, 0.1), "accumulating": bool(r.random() < 0.3)}),
    "impact_scatter": _any_fault(lambda r, m: {"sigma": _log(r, 0.1, 1.0)}),
    "load_zone": _zone,
    "cage_modulation": _any_fault(lambda r, m: {"depth": _log(r, 0.09, 1.0)}),
    "entry_exit": _any_fault(_two_strikes),
    "distributed_roughness": lambda r, m: {"level": _log(r, 0.3, 4.0), "depth": r.uniform(0.25, 1.0)},
    "speed_gain": _gain,
    "damage_growth": _growth,
    "second_resonance": _resonance,
    "sensor_rolloff": _rolloff,
    "shaft_harmonics": _shaft,
    "looseness": lambda r, m: {
        "level": _tone(r, m, 1.2), "decay": r.uniform(0.6, 0.97), "half_ratio": r.uniform(0.25, 1.0),
        "n_orders": int(r.integers(5, 18)), "in_phase": bool(r.random() < 0.5),
    },
    "mains_interference": _mains,
    "drive_interference": _drive,
    "gear_mesh": _gear,
    "foreign_bearing": _foreign,
    "coloured_noise": _coloured,
    "impulsive_noise": _knocks,
    "waviness": _waviness,
    "clipping": _clipping,
    "quantisation": lambda r, m: {"step": _log(r, 0.05, 2.0)},
    "dropout": lambda r, m: {"rate_hz": _log(r, 0.4, 20.0), "length_s": _log(r, 0.001, 0.03)},
}  # fmt: skip
"""Effect -> values at random for a machine, visible in its records; None where they could not show it.

Wider than one machine has them and narrower than their plausible ranges, whose lower ends nobody could see.
"""


def _plausible(name: str) -> Drawer:
    """Values for an effect of a user's own: its plausible ranges."""
    import dataclasses

    def draw(rng: np.random.Generator, machine: Machine) -> Mapping[str, float]:
        out = {}
        for field in dataclasses.fields(catalogue()[name]):  # type: ignore[arg-type]
            low, high = field.metadata["plausible"]
            if field.metadata["fitted"]:
                out[field.name] = _log(rng, low, high) if field.metadata["log"] else rng.uniform(low, high)
        return out

    return draw
