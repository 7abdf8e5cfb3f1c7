"""The phenomenological twin against its specification, eq. 1 of paper 1, and kinematics."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from dataclasses import replace

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import hilbert, welch

from twingap import BEARINGS, Condition, TwingapError
from twingap.effects import catalogue, make_effect
from twingap.effects.modes import Mode, modal_response, response_rms
from twingap.streams import Streams, root_entropy
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin, paper1_chain

Array = NDArray[np.float64]
BEARING = BEARINGS["6205"]
STILL = PhenomenologicalParameters(structure_noise_rms=0.0, white_noise_rms=1e-9)


def one(twin: PhenomenologicalTwin, condition: Condition, seed: int = 3) -> Array:
    return twin.simulate([condition], np.random.default_rng(seed))[0].samples


def literal_eq1(condition: Condition, parameters: PhenomenologicalParameters, seed: int) -> Array:
    """x_k(t) = S(k) D(k) sum_i h(t - iT - tau_i) q(iT) A_i + n(t), as printed: impact by impact, sample by sample."""
    streams = Streams(root_entropy(np.random.default_rng(seed)), 0)
    rate = condition.speed_rpm / 60
    period = 1 / (BEARING.bpfi * rate)
    t = np.arange(condition.n_samples) / condition.fs_hz
    w, zeta = 2 * np.pi * parameters.resonance_hz, parameters.damping_ratio
    before, inside = int(np.ceil(0.3 / period)) + 2, int(np.ceil(t[-1] / period))
    count = before + inside + 4 + int(np.ceil(2 * np.sqrt(before + inside)))
    i = np.arange(count) - before + streams("impact_phase").random()
    tau = 0.02 * period * streams("slip_jitter").standard_normal(count)
    normal = streams("impact_scatter").standard_normal(count)
    strength = np.exp(np.sqrt(np.log(1.01)) * normal) / np.sqrt(1.01)  # mean 1, standard deviation 0.1
    angle = 2 * np.pi * streams("load_zone").random()
    q = 1 + 0.3 * np.cos(2 * np.pi * rate * i * period + angle)
    x = np.zeros_like(t)
    for place, late, weight, a in zip(i * period, tau, q, strength, strict=True):
        since = t - place - late
        h = np.exp(-zeta * w * since) * np.sin(np.sqrt(1 - zeta**2) * w * since)
        x += np.where(since >= 0, h, 0.0) * weight * a
    speed_gain = condition.speed_rpm / 1000
    damage = np.exp(1e-3 * (float(condition.time_s or 0) - 200.0))
    noise = parameters.white_noise_rms * streams("white_noise").standard_normal(t.size)
    return np.asarray(speed_gain * damage * parameters.impact_amplitude["inner"] * x + noise)


@pytest.mark.filterwarnings("ignore:overflow")
def test_eq1_of_paper_1_is_one_chain_of_effects() -> None:
    condition = Condition("a", 1430.0, 12000.0, 3000, "inner", time_s=1400.0)
    parameters = replace(STILL, white_noise_rms=0.5)
    twin = PhenomenologicalTwin(BEARING, parameters, paper1_chain(rate_per_s=1e-3, onset_s=200.0))
    with np.errstate(over="ignore", invalid="ignore"):
        expected = literal_eq1(condition, parameters, seed=3)
    assert expected.std() > 5
    np.testing.assert_allclose(one(twin, condition), expected, atol=1e-8)


def test_baseline_is_equal_impacts_strictly_periodic_through_one_mode() -> None:
    condition = Condition("a", 1800.0, 48000.0, 48000, "outer")
    x = one(PhenomenologicalTwin(BEARING, STILL), condition)
    phase = Streams(root_entropy(np.random.default_rng(3)), 0)("impact_phase").random()
    period = 1 / (BEARING.bpfo * 30)
    w, zeta = 2 * np.pi * 3400, 0.05
    for k in (0, 7, 100):
        t = np.arange(np.ceil((k + phase) * period * 48000), np.ceil((k + phase) * period * 48000) + 200) / 48000
        since = t - (k + phase) * period
        expected = 8 * np.exp(-zeta * w * since) * np.sin(np.sqrt(1 - zeta**2) * w * since)
        np.testing.assert_allclose(x[np.rint(t * 48000).astype(int)], expected, atol=1e-3)


@pytest.mark.parametrize("fault", ["inner", "outer", "ball", "cage"])
def test_impacts_do_not_depend_on_the_sampling_rate(fault: str) -> None:
    twin = PhenomenologicalTwin(BEARING, STILL)
    coarse = one(twin, Condition("a", 1797.0, 12000.0, 6000, fault))
    fine = one(twin, Condition("a", 1797.0, 60000.0, 30000, fault))
    np.testing.assert_allclose(coarse, fine[::5], atol=1e-6)


def test_healthy_is_the_two_noises_at_their_levels() -> None:
    parameters = PhenomenologicalParameters(2500.0, 0.03, {}, structure_noise_rms=0.6, white_noise_rms=0.8, scale=2.5)
    assert parameters.reference_rms == pytest.approx(2.5)
    x = one(PhenomenologicalTwin(BEARING, parameters), Condition("a", 1800.0, 20000.0, 2**19, "healthy"))
    assert x.std() == pytest.approx(2.5, rel=0.01)
    f, power = welch(x, 20000.0, nperseg=4096)
    response = np.exp(-2j * np.pi * np.outer(f, np.arange(2000)) / 20000) @ modal_response(
        [Mode(2500.0, 0.03)], 20000, 2000, *_hit()
    )
    expected = 1.5**2 * np.abs(response) ** 2 / response_rms([Mode(2500.0, 0.03)], 20000.0) ** 2 + 2.0**2
    np.testing.assert_allclose(power[5:-5], expected[5:-5] * 2 / 20000, rtol=0.5)
    assert np.mean(power[5:-5] * 20000 / 2 / expected[5:-5]) == pytest.approx(1, abs=0.01)


def _hit() -> tuple[Array, Array]:
    return np.zeros(1), np.ones(1)


def test_records_do_not_start_at_rest() -> None:
    slow = PhenomenologicalParameters(400.0, 0.01, {"outer": 5.0}, structure_noise_rms=1.0, white_noise_rms=0.0)
    twin = PhenomenologicalTwin(BEARING, slow)
    for fault in ("healthy", "outer"):
        conditions = [Condition(f"{i}", 1800.0, 6000.0, 1200, fault) for i in range(400)]
        x = np.stack([record.samples for record in twin.stream(conditions, np.random.default_rng(0))])
        level = x.std(axis=0)
        assert level[:60].mean() == pytest.approx(level[600:].mean(), rel=0.08)
        assert level.mean() > 0.9


def test_response_rms_is_that_of_the_response() -> None:
    modes = [Mode(1500.0, 0.02), Mode(2100.0, 0.05, 0.7)]
    noise = np.random.default_rng(0).standard_normal(400_000)
    assert modal_response(modes, 12000.0, noise.size, force=noise).std() == pytest.approx(
        response_rms(modes, 12000.0), rel=0.02
    )


def test_ringing_is_the_sum_of_its_parts() -> None:
    rng = np.random.default_rng(1)
    modes, times, strengths = (
        [Mode(1500.0, 0.02), Mode(2100.0, 0.05, 0.7)],
        rng.uniform(-0.1, 0.6, 50),
        rng.normal(size=50),
    )
    force = rng.normal(size=5000)
    whole = modal_response(modes, 10000.0, 5000, times, strengths, force)
    parts = modal_response(modes, 10000.0, 5000, times, strengths) + modal_response(modes, 10000.0, 5000, force=force)
    np.testing.assert_allclose(whole, parts, atol=1e-10)
    order = rng.permutation(50)
    np.testing.assert_allclose(
        modal_response(modes, 10000.0, 5000, times[order], strengths[order], force), whole, atol=1e-10
    )


@pytest.mark.parametrize("name", sorted(BEARINGS))
@pytest.mark.parametrize("fault", ["inner", "outer", "ball", "cage"])
def test_envelope_peaks_within_one_bin_of_the_kinematic_order(name: str, fault: str) -> None:
    fs, n, rpm = 12000.0, 24000, 1733.0
    bearing = BEARINGS[name]
    clear = PhenomenologicalParameters(impact_amplitude={"inner": 8.0, "outer": 8.0, "ball": 8.0, "cage": 25.0})
    x = one(PhenomenologicalTwin(bearing, clear), Condition("a", rpm, fs, n, fault))
    spectrum, f = np.fft.rfft(x), np.fft.rfftfreq(n, 1 / fs)
    band = np.fft.irfft(spectrum * ((f > 2400) & (f < 4400)), n)
    envelope = np.abs(hilbert(band)) ** 2
    power = np.abs(np.fft.rfft(envelope - envelope.mean()))
    order = bearing.fault_order(fault)
    bins_per_order = rpm / 60 * n / fs
    for harmonic in (1, 2):
        place = harmonic * order * bins_per_order
        low, high = (place + np.array([-0.45, 0.45]) * order * bins_per_order).astype(int)
        assert abs(low + int(np.argmax(power[low:high])) - place) <= 1


def conditions(count: int = 10, n: int = 2000) -> list[Condition]:
    faults = ["healthy", "inner", "outer", "ball", "cage"]
    return [Condition(f"r{i}", 1500.0 + i, 12000.0, n, faults[i % 5], time_s=10.0 * i) for i in range(count)]


def as_bytes(records: Iterator[object]) -> list[bytes]:
    return [record.samples.tobytes() for record in records]  # type: ignore[attr-defined]


ALL = [make_effect(name) for name in catalogue()]


def test_same_seed_same_bytes_on_any_number_of_threads() -> None:
    twin = PhenomenologicalTwin(BEARING, effects=ALL)
    before = numba.get_num_threads()
    expected = as_bytes(twin.stream(conditions(), np.random.default_rng(8), threads=1))
    try:
        for threads in (1, 2):
            numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))
            for own in (1, 2, 3):
                assert as_bytes(twin.stream(conditions(), np.random.default_rng(8), threads=own)) == expected
    finally:
        numba.set_num_threads(before)
    assert as_bytes(twin.stream(conditions(), np.random.default_rng(9))) != expected


def test_a_record_depends_on_its_place_alone() -> None:
    twin = PhenomenologicalTwin(BEARING, effects=ALL)
    whole = as_bytes(twin.stream(conditions(6), np.random.default_rng(8)))
    assert as_bytes(twin.stream(conditions(4), np.random.default_rng(8))) == whole[:4]
    assert len(set(whole)) == 6


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_adding_an_effect_leaves_the_other_draws_untouched(name: str) -> None:
    """With the draws of every other stream counted and compared: common random numbers."""
    seen: list[dict[str, float]] = []

    class Watched(PhenomenologicalTwin):
        def make(self, conditions, streams):  # type: ignore[no-untyped-def]
            drawn: dict[str, np.random.Generator] = {}

            class WatchedStreams(Streams):
                def __call__(self, purpose: str) -> np.random.Generator:
                    return drawn.setdefault(f"{self.index} {purpose}", super().__call__(purpose))

            made = super().make(conditions, [WatchedStreams(own.root, own.index) for own in streams])
            seen.append({purpose: float(rng.random()) for purpose, rng in drawn.items()})
            return made

    others = [effect for effect in ALL if effect.name != name]
    for chain in (others, [*others, make_effect(name)]):
        list(Watched(BEARING, effects=chain).stream(conditions(1, 500), np.random.default_rng(8)))
    without, with_it = seen
    assert set(with_it) - set(without) == {f"0 {name}"}
    assert all(with_it[purpose] == value for purpose, value in without.items())


@pytest.mark.parametrize("threads", [1, 2])
def test_streams_in_bounded_memory(threads: int) -> None:
    twin = PhenomenologicalTwin(BEARING, effects=paper1_chain())
    many = (Condition(f"r{i}", 1800.0, 12000.0, 12000, "inner", time_s=0.0) for i in range(400))
    list(twin.stream(conditions(2), np.random.default_rng(0)))
    tracemalloc.start()
    try:
        count = sum(1 for _ in twin.stream(many, np.random.default_rng(0), threads))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert count == 400
    assert peak < 10e6, "400 records are 38 MB"


def test_a_reader_that_stops_early_stops_the_work() -> None:
    asked: list[int] = []

    def endless() -> Iterator[Condition]:
        for i in range(10_000):
            asked.append(i)
            yield Condition(f"r{i}", 1800.0, 12000.0, 100, "healthy")

    for threads in (1, 3):
        asked.clear()
        stream = PhenomenologicalTwin(BEARING).stream(endless(), np.random.default_rng(0), threads)
        next(stream)
        stream.close()  # type: ignore[attr-defined]
        assert len(asked) < 20


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"resonance_hz": 0.0}, "resonance_hz = 0.0, a positive number expected"),
        ({"resonance_hz": float("nan")}, "resonance_hz = nan"),
        ({"damping_ratio": 1.0}, "damping_ratio = 1.0, below 1 expected"),
        ({"scale": -1.0}, "scale = -1.0, a positive number expected"),
        ({"white_noise_rms": -0.1}, "white_noise_rms = -0.1, a number of at least 0 expected"),
        ({"impact_amplitude": {"inner": float("inf")}}, "impact_amplitude.inner = inf"),
        ({"impact_amplitude": {"iner": 1.0}}, "unknown fault 'iner'"),
        ({"structure_noise_rms": 0.0, "white_noise_rms": 0.0}, "both noises are 0"),
    ],
)
def test_impossible_parameters_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(TwingapError, match=message):
        replace(PhenomenologicalParameters(), **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        (Condition("a", 1800.0, 12000.0, 100), "record 'a': the fault is unknown"),
        (Condition("a", 1800.0, 6000.0, 100, "inner"), "record 'a': the resonance at 3400 Hz lies above half"),
        (Condition("a", 1800.0, 12000.0, 100, "cage"), "record 'a': no impact amplitude for fault 'cage'; add impact"),
    ],
)
def test_what_cannot_be_simulated_says_why(condition: Condition, message: str) -> None:
    twin = PhenomenologicalTwin(BEARING, PhenomenologicalParameters(impact_amplitude={"inner": 1.0}))
    for threads in (1, 2):
        with pytest.raises(TwingapError, match=message):
            list(twin.stream([condition], np.random.default_rng(0), threads))


def test_an_effect_named_twice_is_refused() -> None:
    with pytest.raises(TwingapError, match="effect 'clipping' is named twice"):
        PhenomenologicalTwin(BEARING, effects=[make_effect("clipping"), make_effect("clipping", {"rail": 2.0})])
