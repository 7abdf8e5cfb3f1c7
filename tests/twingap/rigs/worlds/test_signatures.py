"""Each effect shows in the records as the catalogue says, against the same world without it.

Measured as an analyst would who knows where to look and at which true speed. Written here apart from `twingap.signal`
and from the worlds themselves: plain Fourier sums, envelopes, counts.
"""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from twingap.records import RecordSet
from twingap.rigs.worlds import CATALOGUE, Case, World, machine, make_world

Array = NDArray[np.float64]
Measure = Callable[[RecordSet, World], float]


def samples(records: RecordSet, world: World, fault: str | None = None) -> Iterator[tuple[Array, float]]:
    """Samples and true shaft speed in Hz of the records of one fault."""
    for i, record in enumerate(records):
        if fault is None or world.layout.fault[i] == fault:
            yield record.samples, world.layout.speed_rpm[i] / 60


def envelope(x: Array, world: World, bandwidth: float = 0.06) -> Array:
    """Squared envelope around the first mode, mean taken out."""
    fs, f0 = world.layout.fs_hz, world.base.modes[0].frequency_hz
    half = max(bandwidth * fs, 2 * world.base.modes[0].damping_ratio * f0)
    low, high = max(f0 - half, 0.01 * fs), min(f0 + half, 0.495 * fs)
    band = signal.sosfiltfilt(signal.butter(3, [low, high], "band", fs=fs, output="sos"), x)
    square = np.abs(signal.hilbert(band)) ** 2
    return np.asarray(square - square.mean())


def lines(x: Array, fs_hz: float, hz: Array) -> Array:
    """Amplitude of a Hann-weighted Fourier sum at these frequencies."""
    window = np.hanning(x.size)
    step = np.exp(-2j * np.pi * np.outer(np.atleast_1d(hz) / fs_hz, np.arange(x.size)))
    return np.asarray(2 * np.abs(step @ (window * x)) / window.sum())


def over_floor(x: Array, fs_hz: float, hz: float, clear_hz: float = 3.0, wide_hz: float = 9.0) -> float:
    """Power of a line over the median power beside it, dB."""
    off = np.concatenate([np.arange(clear_hz, wide_hz, 1.0), -np.arange(clear_hz, wide_hz, 1.0)])
    power = lines(x, fs_hz, np.concatenate([[hz], hz + off[hz + off > 0]])) ** 2
    return float(10 * np.log10(power[0] / np.median(power[1:])))


def raw_line(
    records: RecordSet, world: World, order: float = 0.0, hz: float = 0.0, fault: str | None = "healthy"
) -> float:
    """Mean height of a raw line at `order` times shaft speed plus `hz` over its floor, dB."""
    fs = world.layout.fs_hz
    return float(np.mean([over_floor(x, fs, order * f + hz) for x, f in samples(records, world, fault)]))


def envelope_line(records: RecordSet, world: World, order: float, fault: str) -> float:
    """Mean height of an envelope line over its floor, dB."""
    fs = world.layout.fs_hz
    return float(np.mean([over_floor(envelope(x, world), fs, order * f) for x, f in samples(records, world, fault)]))


def envelope_ratio(records: RecordSet, world: World, order: float, to: float, fault: str) -> float:
    """Mean power of one envelope line over that of another, dB."""
    found = []
    for x, f in samples(records, world, fault):
        one, two = lines(envelope(x, world), world.layout.fs_hz, np.array([order, to]) * f)
        found.append(20 * np.log10(one / two))
    return float(np.mean(found))


def smear(records: RecordSet, world: World, order: float, fault: str) -> float:
    """Part of the power near an envelope line that lies off it."""
    found = []
    for x, f in samples(records, world, fault):
        off = np.arange(-12.0, 12.1, 0.5)
        power = lines(envelope(x, world), world.layout.fs_hz, order * f + off) ** 2
        found.append(power[np.abs(off) > 2.5].sum() / power.sum())
    return float(np.mean(found))


def faulty(world: World, *wanted: str) -> str:
    """The strongest fault that occurs, out of those wanted."""
    return max((f for f in wanted or world.layout.faults if f in world.layout.faults), key=world.base.ratio.__getitem__)


def own_order(world: World, fault: str) -> float:
    return world.layout.bearing.fault_order(fault)


def spectrum_db(records: RecordSet, world: World, hz: float, width: float = 0.02) -> float:
    """Mean power density in a band, over all records, dB."""
    fs, found = world.layout.fs_hz, []
    for x, _ in samples(records, world):
        at, psd = signal.welch(x, fs, nperseg=1024)
        found.append(10 * np.log10(psd[np.abs(at - hz) <= max(width * hz, 1.5 * fs / 1024)].mean()))
    return float(np.mean(found))


def impact_level(records: RecordSet, world: World) -> Array:
    """Log power of each faulty record over the mean of healthy ones."""
    quiet = np.mean([np.var(x) for x, _ in samples(records, world, "healthy")])
    out = np.full(len(records), np.nan)
    for i, record in enumerate(records):
        if world.layout.fault[i] != "healthy":
            out[i] = 0.5 * np.log(max(np.var(record.samples) - quiet, 1e-3 * quiet))
    return out


def slope(records: RecordSet, world: World, along: Array) -> float:
    """Slope of log impact level along something, each fault about its own mean."""
    level, top, bottom = impact_level(records, world), 0.0, 0.0
    for fault in world.layout.faults:
        of = np.array([f == fault for f in world.layout.fault])
        a, b = along[of] - along[of].mean(), level[of] - level[of].mean()
        top, bottom = top + float(a @ b), bottom + float(a @ a)
    return top / bottom


def peak_order(records: RecordSet, world: World, fault: str) -> float:
    """Order, within 7 % of the kinematic one, at which the envelope has its line."""
    order = own_order(world, fault)
    grid = order * np.linspace(0.93, 1.07, 561)
    total = np.zeros(grid.size)
    for x, f in samples(records, world, fault):
        power = lines(envelope(x, world), world.layout.fs_hz, grid * f) ** 2
        total += power / power.sum()
    return float(grid[total.argmax()])


def _mean_slip(r: RecordSet, w: World) -> float:
    fault = faulty(w, "inner", "outer")
    return abs(peak_order(r, w, fault) / own_order(w, fault) - 1)


def _fault_smear(r: RecordSet, w: World) -> float:
    fault = faulty(w)
    return smear(r, w, 3 * own_order(w, fault), fault)


def _jitter(r: RecordSet, w: World) -> float:
    """Decay of the fourth envelope harmonic against the first, or its smear where slip accumulates."""
    fault = faulty(w)
    order = own_order(w, fault)
    return -envelope_ratio(r, w, 4 * order, order, fault)


def _scatter(r: RecordSet, w: World) -> float:
    """Envelope floor between lines against the fault's line, dB."""
    fault = faulty(w)
    order, found = own_order(w, fault), []
    for x, f in samples(r, w, fault):
        e = envelope(x, w)
        between = lines(e, w.layout.fs_hz, f * order * np.linspace(0.25, 0.8, 41) + 0.37)
        found.append(20 * np.log10(np.median(between) / lines(e, w.layout.fs_hz, np.array([f * order]))[0]))
    return float(np.mean(found))


def _load_zone(r: RecordSet, w: World) -> float:
    fault = faulty(w, "inner", "ball")
    order, side = own_order(w, fault), 1.0 if fault == "inner" else w.layout.bearing.ftf
    return envelope_ratio(r, w, order - side, order, fault)


def _cage(r: RecordSet, w: World) -> float:
    fault = faulty(w)
    return envelope_ratio(r, w, own_order(w, fault) - w.layout.bearing.ftf, own_order(w, fault), fault)


def _entry(r: RecordSet, w: World) -> float:
    """Autocorrelation of the squared envelope at the delay, over that at the spacing of impacts."""
    fault, p = faulty(w), w.parameters["entry_exit"]
    found = []
    for x, f in samples(r, w, fault):
        e = envelope(x, w, 0.12)
        spacing = w.layout.fs_hz / (own_order(w, fault) * f)
        lag = round(p["delay_fraction"] * spacing)
        spectrum = np.abs(np.fft.rfft(e, 2 * e.size)) ** 2
        correlation = np.fft.irfft(spectrum)
        found.append(correlation[lag] / correlation[round(spacing)])
    return float(np.mean(found))


def _drive(r: RecordSet, w: World) -> float:
    p = w.parameters["drive_interference"]
    return float(np.mean([raw_line(r, w, s * p["pole_pairs"], p["carrier_hz"]) for s in (-1, 1)]))


def _gear(r: RecordSet, w: World) -> float:
    p = w.parameters["gear_mesh"]
    return raw_line(r, w, (int(np.argmax(p["amplitudes"])) + 1) * p["teeth"])


def _shaft(r: RecordSet, w: World) -> float:
    return raw_line(r, w, float(np.argmax(w.parameters["shaft_harmonics"]["amplitudes"])) + 1)


def _half(r: RecordSet, w: World) -> float:
    amplitudes = w.parameters["looseness"]["amplitudes"]
    return raw_line(r, w, 0.5 + float(np.argmax(amplitudes[::2])))


def _mains(r: RecordSet, w: World) -> float:
    p = w.parameters["mains_interference"]
    return raw_line(r, w, hz=p["mains_hz"] * p["harmonics"][int(np.argmax(p["amplitudes"]))])


def _wave(r: RecordSet, w: World) -> float:
    p = w.parameters["waviness"]
    return raw_line(r, w, (float(np.argmax(p["amplitudes"])) + 1) * own_order(w, p["race"]))


def _second(r: RecordSet, w: World) -> float:
    return spectrum_db(r, w, w.parameters["second_resonance"]["frequency_hz"], 0.01)


def _colour(r: RecordSet, w: World) -> float:
    p = w.parameters["coloured_noise"]
    return spectrum_db(r, w, p["centre_hz"] if p["shape"] == "band" else 0.5 * p["corner_hz"], 0.08)


def _rolloff(r: RecordSet, w: World) -> float:
    fs = w.layout.fs_hz
    return spectrum_db(r, w, 0.03 * fs, 0.3) - spectrum_db(r, w, 0.35 * fs, 0.05)


def _impulses(r: RecordSet, w: World) -> float:
    return float(max(np.abs(x).max() / np.std(x) for x, _ in samples(r, w, "healthy")))


def _atoms(r: RecordSet, w: World) -> float:
    """Samples at the extremes of the whole set."""
    top, bottom = max(x.max() for x, _ in samples(r, w)), min(x.min() for x, _ in samples(r, w))
    return float(sum(np.sum((x == top) | (x == bottom)) for x, _ in samples(r, w)))


def _repeats(r: RecordSet, w: World) -> float:
    """Part of the samples of the first record whose value comes more than once."""
    x = next(samples(r, w))[0]
    _, counts = np.unique(x, return_counts=True)
    return float(counts[counts > 1].sum() / x.size)


def _runs(r: RecordSet, w: World) -> float:
    """Longest run of equal samples."""
    longest = 1
    for x, _ in samples(r, w):
        edges = np.flatnonzero(np.diff(x) != 0)
        longest = max(longest, int(np.diff(np.concatenate([[-1], edges, [x.size - 1]])).max()))
    return float(longest)


MEASURES: dict[str, Measure] = {
    "speed_fluctuation": _fault_smear,
    "mean_slip": _mean_slip,
    "slip_jitter": _jitter,
    "impact_scatter": _scatter,
    "load_zone": _load_zone,
    "cage_modulation": _cage,
    "entry_exit": _entry,
    "distributed_roughness": lambda r, w: envelope_line(r, w, 1.0, "healthy"),
    "speed_gain": lambda r, w: slope(r, w, np.log(w.layout.speed_rpm)),
    "damage_growth": lambda r, w: slope(r, w, np.asarray(w.layout.time_s) / w.layout.time_s[-1]),  # type: ignore[index]
    "second_resonance": _second,
    "sensor_rolloff": _rolloff,
    "shaft_harmonics": _shaft,
    "looseness": _half,
    "mains_interference": _mains,
    "drive_interference": _drive,
    "gear_mesh": _gear,
    "foreign_bearing": lambda r, w: envelope_line(r, w, w.parameters["foreign_bearing"]["order"], "healthy"),
    "coloured_noise": _colour,
    "impulsive_noise": _impulses,
    "waviness": _wave,
    "clipping": _atoms,
    "quantisation": _repeats,
    "dropout": _runs,
}

LEAST = {
    "speed_fluctuation": 0.15, "mean_slip": 0.009, "slip_jitter": 2.0, "impact_scatter": 2.0, "load_zone": 6.0,
    "cage_modulation": 4.0, "entry_exit": 0.1, "distributed_roughness": 6.0, "speed_gain": 0.5, "damage_growth": 0.5,
    "second_resonance": 2.5, "sensor_rolloff": 3.5, "shaft_harmonics": 10.0, "looseness": 10.0,
    "mains_interference": 10.0, "drive_interference": 10.0, "gear_mesh": 10.0, "foreign_bearing": 10.0,
    "coloured_noise": 3.0, "impulsive_noise": 4.0, "waviness": 10.0, "clipping": 100.0, "quantisation": 0.9,
    "dropout": 15.0,
}  # fmt: skip
"""How much the measure of each effect must rise by a plain effect."""


def both(name: str, strength: str = "medium", arm: str = "twin") -> tuple[World, RecordSet]:
    """A world with one effect, and its records without."""
    effects = ((name, strength),)
    case = Case("single", arm, effects, (), n_records=8, fs_hz=12_800.0, faults=("healthy", "inner", "outer"))
    world = make_world(case, seed=2)
    return world, machine(case, 2, ())


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_effect_leaves_its_signature(name: str) -> None:
    world, without = both(name)
    before, after = MEASURES[name](without, world), MEASURES[name](world.records, world)
    sign = -1.0 if world.parameters[name].get("exponent", 1.0) < 0 else 1.0
    assert sign * (after - before) > LEAST[name], (before, after, world.parameters[name])


@pytest.mark.parametrize("name", ["load_zone", "second_resonance", "gear_mesh", "clipping"])
def test_so_it_does_on_a_contact_machine(name: str) -> None:
    world, without = both(name, "strong", "contact")
    assert MEASURES[name](world.records, world) - MEASURES[name](without, world) > LEAST[name]


def test_slip_moves_the_races_apart_and_keeps_their_sum() -> None:
    world, _ = both("mean_slip", "strong")
    inner, outer = (peak_order(world.records, world, fault) for fault in ("inner", "outer"))
    change = world.parameters["mean_slip"]["cage_speed_change"]
    assert outer == pytest.approx(world.layout.bearing.bpfo * (1 + change), rel=1e-3)
    assert inner + outer == pytest.approx(world.layout.bearing.n_rollers, rel=1e-3)


def test_smear_grows_with_order() -> None:
    world, _ = both("speed_fluctuation")
    order = own_order(world, "outer")
    found = [smear(world.records, world, k * order, "outer") for k in (1, 3)]
    assert found[1] > found[0] + 0.1, found


def test_roughness_leaves_no_first_order_line() -> None:
    world, without = both("distributed_roughness", "strong")
    assert raw_line(world.records, world, 1.0) < raw_line(without, world, 1.0) + 4.0
    assert envelope_line(world.records, world, 1.0, "healthy") > 10.0


def test_waviness_is_in_the_raw_spectrum_not_in_the_envelope() -> None:
    world, without = both("waviness")
    order = own_order(world, world.parameters["waviness"]["race"])
    assert envelope_line(world.records, world, order, "healthy") < envelope_line(without, world, order, "healthy") + 3.0


def test_load_zone_leaves_the_outer_race_alone() -> None:
    world, without = both("load_zone", "strong")
    for one, other, fault in zip(world.records, without, world.layout.fault, strict=True):
        assert np.array_equal(one.samples, other.samples) == (fault != "inner")


def test_quantised_samples_lie_on_the_grid() -> None:
    world, _ = both("quantisation")
    steps = world.records[0].samples / world.parameters["quantisation"]["step"]
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


@pytest.mark.parametrize("fault", ["inner", "outer"])
def test_impacts_come_at_the_kinematic_order_of_the_true_speed(fault: str) -> None:
    world, without = both("shaft_harmonics")
    assert peak_order(without, world, fault) == pytest.approx(own_order(world, fault), rel=1e-3)
    assert envelope_line(without, world, own_order(world, fault), fault) > 8.0


def test_a_third_of_the_drives_has_no_line_at_its_carrier() -> None:
    drives = [
        make_world(Case("single", effects=(("drive_interference", "strong"),), name=f"d{k}", n_records=10), 5)
        for k in range(24)
    ]
    without = [w for w in drives if w.parameters["drive_interference"].get("suppressed")]
    assert 4 <= len(without) <= 13
    for w in without[:2]:
        p = w.parameters["drive_interference"]
        assert raw_line(w.records, w, p["pole_pairs"], p["carrier_hz"]) > 10.0
        assert raw_line(w.records, w, 0.0, p["carrier_hz"]) < 5.0
