"""The contact twin against mechanics, independent solvers and its own promises."""

from __future__ import annotations

import gc
import tracemalloc
from dataclasses import fields, replace
from typing import Any

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.signal import butter, freqz, hilbert, sosfiltfilt

from twingap.bearing import BEARINGS
from twingap.effects import Draft, Mode, make_effect
from twingap.effects.modes import modal_response
from twingap.errors import TwingapError
from twingap.records import Condition
from twingap.streams import Streams
from twingap.twins.contact import (
    PRESETS,
    ContactParameters,
    ContactTwin,
    hertz_stiffness,
    make_each,
    make_together,
    sink_depth_um,
    through,
)
from twingap.twins.contact_dynamics import LADDER, Job, low_pass, settle, statics
from twingap.twins.contact_integration import integrate
from twingap.twins.contact_kernel import LOOK_AHEAD, LOOK_BACK, ROWS

Array = NDArray[np.float64]

B6205 = BEARINGS["6205"]
QUIET = replace(PRESETS["physical"], structure_noise_rms=0.0, white_noise_rms=0.0)
FAULTS = ("inner", "outer", "ball")


def condition(fault: str = "outer", n: int = 600, speed: float = 1797.0, fs: float = 12000.0, **more: Any) -> Condition:
    return Condition(str(more.pop("name", "a")), speed, fs, n, fault, **more)


def samples(twin: ContactTwin, *conditions: Condition, seed: int = 1) -> list[Array]:
    return [record.samples for record in twin.simulate(conditions, np.random.default_rng(seed))]


def trajectory(
    own: ContactParameters, start: Array, intervals: int, factor: int, fault: str = "outer", speed: float = 1797.0,
    starts: tuple[float, float, float] = (0.1, 0.2, 0.3),
) -> Array:  # fmt: skip
    """States [intervals + 1, 4] of one trajectory in all lanes, from calls of one interval each."""
    job = Job(B6205, own, condition(fault, intervals, speed), np.arange(intervals) * speed / 60 / 12000, starts=starts)
    state = np.tile(start[None, :, None], (1, 1, 16)).astype(float)
    turns, cage = (np.tile(a[None, :, None], (1, 1, 16)) for a in job.angles(0, intervals + 1))
    rows = np.tile(np.array(job.rows(factor))[None, :, None], (1, 1, 16))
    states = [state[0, :, 5].copy()]
    for i in range(intervals):
        span = slice(i, i + 2)
        integrate(
            9, state, np.ascontiguousarray(turns[:, span]), np.ascontiguousarray(cage[:, span]), rows,
            *low_pass(factor), np.empty((1, 0, 16)), point_contact=own.contact == "point",
        )  # fmt: skip
        assert (state == state[:, :, :1]).all(), "lanes with the same input differ"
        states.append(state[0, :, 5].copy())
    return np.array(states)


def equations(own: ContactParameters, job: Job) -> Any:
    """The model's equations written down plainly, in the fixed frame, roller by roller."""
    z, mass = B6205.n_rollers, own.mass_kg
    hz = job.condition.speed_rpm / 60
    shaft0, cage0, spin0 = job.starts
    half = 0.5 * own.defect_width_mm
    radius = {"outer": (39.04 + 7.94) / 2, "inner": (39.04 - 7.94) / 2, "ball": 7.94 / 2}[job.condition.fault or ""]

    def depth(off_turns: float) -> float:
        """Depth at an angle off the defect's middle."""
        r = abs((off_turns + 0.5) % 1 - 0.5) * 2 * np.pi * radius / half
        s = 1 - r if own.edge == 1 else float(r < 1)
        return (
            1e-6 * own.defect_depth_um[job.condition.fault or ""] * (s**3 * (10 - 15 * s + 6 * s * s) if s > 0 else 0)
        )

    def slope(t: float, state: Array) -> Array:
        x, y, vx, vy = state
        shaft, cage = shaft0 + hz * t, cage0 + B6205.ftf * hz * t
        spin = spin0 + B6205.bsf * hz * t
        ax, ay = own.load_x_n, own.load_n
        unbalance = mass * 1e-6 * own.eccentricity_um * (2 * np.pi * hz) ** 2
        ax += unbalance * np.cos(2 * np.pi * shaft)
        ay += unbalance * np.sin(2 * np.pi * shaft)
        for j in range(z):
            phi = 2 * np.pi * (cage + j / z)
            if job.condition.fault == "outer":
                sunk = depth(cage + j / z - own.outer_angle_deg / 360)
            elif job.condition.fault == "inner":
                sunk = depth(cage + j / z - shaft)
            else:
                sunk = max(depth(spin), depth(spin + 0.5)) if j == 0 else 0.0
            squeeze = x * np.cos(phi) + y * np.sin(phi) - 1e-6 * own.clearance_um - sunk
            force = own.stiffness * max(squeeze, 0.0) ** own.exponent
            ax -= force * np.cos(phi)
            ay -= force * np.sin(phi)
        return np.array([vx, vy, (ax - own.damping * vx) / mass, (ay - own.damping * vy) / mass])

    return slope


# --- mechanics ---------------------------------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(
    cage=st.floats(0, 1), load=st.floats(20, 2e4), across=st.floats(-300, 300), clearance=st.floats(-10, 30),
    preset=st.sampled_from(sorted(PRESETS)), contact=st.sampled_from(["point", "line"]),
)  # fmt: skip
def test_equilibrium_is_that_of_an_independent_solver(
    cage: float, load: float, across: float, clearance: float, preset: str, contact: Any
) -> None:
    own = replace(PRESETS[preset], load_n=load, load_x_n=across, clearance_um=clearance, contact=contact)
    ((xy,), _, _) = settle(9, statics(own, None), np.array([cage]))
    angle = 2 * np.pi * (cage + np.arange(9) / 9)

    def unbalanced(at: Array) -> Array:
        squeeze = at[0] * np.cos(angle) + at[1] * np.sin(angle) - clearance
        force = own.stiffness * (1e-6 * np.maximum(squeeze, 0)) ** own.exponent
        return np.array([across - (force * np.cos(angle)).sum(), load - (force * np.sin(angle)).sum()]) / load

    assert np.abs(unbalanced(1e6 * xy)).max() < 1e-9
    found = root(unbalanced, 1e6 * xy * 1.02)
    assert np.abs(found.fun).max() < 1e-6
    assert 1e6 * xy == pytest.approx(found.x, rel=1e-5, abs=1e-5)


def test_ring_comes_to_rest_where_statics_says() -> None:
    own = replace(QUIET, damping=4000.0)
    rest = trajectory(own, np.array([2e-6, 1e-5, 0.0, 0.0]), 900, 12, "healthy", speed=1e-9)[-1]
    ((x, y),) = settle(9, statics(own, None), np.array([0.2]))[0]
    assert rest[:2] == pytest.approx([x, y], rel=1e-9)
    assert np.abs(rest[2:]).max() < 1e-12


def test_contact_force_is_continuous() -> None:
    """Across the onset of contact and the edge of a dip the force moves no more than the steepest contact allows."""
    step = 1e-9
    y = np.append(5e-6 + np.array([-1e-9, -5e-10, 0.0]), np.linspace(4.0e-6, 1.4e-5, 13))
    forces = []
    for shift in (0.0, step):
        state = np.zeros((1, 4, 16))
        state[0, 1] = y + shift
        job = Job(B6205, replace(QUIET, damping=0.0), condition(n=1, fs=1e9), np.zeros(1), starts=(0.0, 0.25, 0.0))
        turns, cage = (np.tile(a[None, :, None], (1, 1, 16)) for a in job.angles(0, 2))
        rows = np.tile(np.array(job.rows(2))[None, :, None], (1, 1, 16))
        integrate(9, state, turns, cage, rows, *low_pass(2), np.empty((1, 0, 16)))
        forces.append(500 - 0.6 * state[0, 3] / 1e-9)
    change = forces[1] - forces[0]
    steepest = 1.5 * 9.3e9 * np.sqrt(1.4e-5) * 3
    assert (forces[0] >= -1e-6).all() and forces[0].max() > 100
    assert (change >= -1e-6).all() and (change <= steepest * step + 1e-6).all()


def energy(own: ContactParameters, states: Array, cage: float) -> Array:
    angle = 2 * np.pi * (cage + np.arange(9) / 9)
    squeeze = np.maximum(states[:, :1] * np.cos(angle) + states[:, 1:2] * np.sin(angle) - 1e-6 * own.clearance_um, 0)
    spring = own.stiffness / 2.5 * (squeeze**2.5).sum(axis=1)
    kinetic = 0.5 * own.mass_kg * (states[:, 2:] ** 2).sum(axis=1)
    return np.asarray(spring + kinetic - own.load_n * states[:, 1])


def test_undamped_energy_drifts_by_the_fifth_power_of_the_step() -> None:
    # Preloaded, so that all rollers stay in contact and the law is smooth.
    own = replace(QUIET, damping=0.0, clearance_um=-20.0)
    start = np.array([1e-6, 5e-6, 0.0, 0.0])
    drifts = []
    for factor in (8, 16, 32):
        held = energy(own, trajectory(own, start, 120, factor, "healthy", speed=1e-9), 0.2)
        drifts.append(abs(held[-1] - held[0]) / np.ptp(own.load_n * np.array([0.0, 5e-6])))
    assert drifts[0] < 1e-2
    assert np.log2(drifts[0] / drifts[1]) > 4.5 and np.log2(drifts[1] / drifts[2]) > 4.5


def test_damping_only_takes_energy() -> None:
    own = replace(QUIET, damping=300.0)
    held = energy(own, trajectory(own, np.array([1e-6, 2e-5, 0.0, 0.0]), 200, 20, "healthy", speed=1e-9), 0.2)
    assert (np.diff(held) <= 1e-12 * abs(held[0])).all() and held[-1] < held[0]


@pytest.mark.parametrize("fault", FAULTS)
def test_agrees_with_dop853(fault: str) -> None:
    own = replace(QUIET, eccentricity_um=3.0, load_x_n=40.0, defect_width_mm=1.5, defect_depth_um={fault: 3.0})
    starts = {"outer": (0.1, 0.24, 0.3), "inner": (0.24, 0.239, 0.3), "ball": (0.1, 0.23, 0.99)}[fault]
    job = Job(B6205, own, condition(fault), np.zeros(1), starts=starts)
    start = np.array([job.equilibrium.x, job.equilibrium.y, 0.0, 0.0])
    ours = trajectory(own, start, 60, 128, fault, starts=starts)
    t = np.arange(61) / 12000
    theirs = solve_ivp(
        equations(own, job), (0, t[-1]), start, "DOP853", t, rtol=1e-12, atol=1e-16, max_step=2e-5
    ).y.T  # fmt: skip
    scale = np.abs(theirs).max(axis=0)
    assert (np.abs(ours - theirs) / scale).max() < 2e-8
    healthy = trajectory(replace(own, defect_depth_um={fault: 0.0}), start, 60, 128, fault, starts=starts)
    assert (np.abs(healthy - theirs) / scale).max() > 1e-2, "the defect was not met: the comparison shows nothing"


def test_cylinders_follow_their_own_law() -> None:
    own = replace(QUIET, contact="line", stiffness=1e8, load_n=300.0, defect_width_mm=1.5)
    job = Job(B6205, own, condition("outer"), np.zeros(1), starts=(0.0, 0.24, 0.0))
    start = np.array([job.equilibrium.x, job.equilibrium.y, 0.0, 0.0])
    ours = trajectory(own, start, 20, 32, "outer", starts=job.starts)[-1]
    slope = equations(own, job)
    theirs = solve_ivp(slope, (0, 20 / 12000), start, "DOP853", rtol=1e-11, atol=1e-15, max_step=2e-5).y[:, -1]
    assert ours == pytest.approx(theirs, rel=1e-6, abs=1e-10)


def test_order_of_convergence() -> None:
    """Fourth with the smooth edge, about first with the papers' jump."""

    def order(own: ContactParameters) -> float:
        start, errors = np.array([0.0, 5e-6, 0.0, 0.0]), []
        best = trajectory(own, start, 90, 2048, starts=(0.0, 0.24, 0.0))[-1]
        factors = np.array([8, 16, 32, 64])
        errors = [np.abs(trajectory(own, start, 90, f, starts=(0.0, 0.24, 0.0))[-1] - best)[2:].max() for f in factors]
        return -float(np.polyfit(np.log(factors), np.log(errors), 1)[0])

    smooth = replace(QUIET, clearance_um=-15.0, defect_width_mm=0.6)
    assert order(smooth) > 3.8
    assert 0.4 < order(replace(smooth, edge=0.0)) < 2.0


def test_hertz_and_geometry_figures() -> None:
    assert hertz_stiffness(B6205) == pytest.approx(PRESETS["physical"].stiffness, rel=0.01)
    for inch, depth in ((0.007, 1.0), (0.014, 4.0), (0.021, 8.9)):
        assert sink_depth_um(25.4 * inch, 7.94) == pytest.approx(depth, abs=0.08)
    physical, paper = PRESETS["physical"], PRESETS["paper"]
    assert physical.defect_depth_um["outer"] <= 1.01 * sink_depth_um(physical.defect_width_mm, 7.94)
    assert (paper.stiffness, paper.damping, paper.load_n, paper.defect_depth_um["outer"]) == (1.27e9, 139, 12000, 50)
    assert sink_depth_um(paper.defect_width_mm, 7.94) == pytest.approx(50, rel=0.01)


# --- signals -----------------------------------------------------------------------------------------------------


def envelope_line(twin: ContactTwin, x: Array, fs: float, expected_hz: float, reach: float) -> tuple[int, float]:
    """Bin of the strongest squared-envelope line within `reach` bins of the expected one, and its height."""
    centre = twin.contact_mode().frequency_hz
    band = butter(4, [0.6 * centre, min(1.8 * centre, 0.48 * fs)], "band", fs=fs, output="sos")
    squared = np.abs(hilbert(sosfiltfilt(band, x))) ** 2
    spectrum = np.abs(np.fft.rfft(squared - squared.mean()))
    per_hz = x.size / fs
    lo, hi = int((expected_hz - reach / per_hz) * per_hz), int(np.ceil((expected_hz + reach / per_hz) * per_hz))
    best = lo + int(np.argmax(spectrum[lo : hi + 1]))
    return best, float(spectrum[best] / np.median(spectrum[lo : hi + 1]))


@pytest.mark.parametrize("name", ["6205", "ZA-2115"])  # with and without a contact angle; each count compiles a kernel
def test_envelope_peaks_at_the_kinematic_orders(name: str) -> None:
    bearing, hz = BEARINGS[name], 30.0
    twin = ContactTwin(bearing)
    records = samples(twin, *(condition(f, 20000, 1800.0, 20000.0, name=f) for f in FAULTS), seed=5)
    for fault, x in zip(FAULTS, records, strict=True):
        expected = bearing.fault_order(fault) * hz
        # Sidebands at shaft rate (inner) and cage rate (ball) lie outside the reach.
        found, height = envelope_line(twin, x, 20000.0, expected, 0.3 * hz)
        assert abs(found - expected) <= 1, fault
        assert height > 4, fault
    assert bearing.bpfo + bearing.bpfi == pytest.approx(bearing.n_rollers, rel=1e-14)


def test_load_zone_is_inherent() -> None:
    """An inner-race defect is modulated at shaft rate, a ball's at cage rate, an outer one under load at neither."""
    twin = ContactTwin(B6205, QUIET)
    records = samples(twin, *(condition(f, 24000, 1800.0, name=f) for f in FAULTS))
    for fault, x, rate in zip(FAULTS, records, (30.0, 30.0, 30.0 * B6205.ftf), strict=True):
        squared = np.abs(hilbert(x)) ** 2
        spectrum = np.abs(np.fft.rfft(squared - squared.mean()))
        side = spectrum[round(2 * rate) - 1 : round(2 * rate) + 2].max() / spectrum.max()
        assert (side < 0.1) if fault == "outer" else (side > 0.3), fault
    named = ContactTwin(B6205, QUIET, [make_effect("load_zone"), make_effect("entry_exit")])
    assert all((a == b).all() for a, b in zip(samples(named, condition()), samples(twin, condition()), strict=True))


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_a_fault_is_louder_and_more_impulsive_than_health(fault: str, preset: str) -> None:
    twin = ContactTwin(B6205, PRESETS[preset])
    healthy, faulty = samples(twin, condition("healthy", 4000, name="h"), condition(fault, 4000, name="f"))
    assert faulty.std() > 4 * healthy.std()
    deeper = replace(PRESETS[preset], defect_depth_um={fault: 2 * PRESETS[preset].defect_depth_um[fault]})
    assert samples(ContactTwin(B6205, deeper), condition(fault, 4000))[0].std() > 1.2 * faulty.std()


def test_slip_moves_bpfo_and_bpfi_apart() -> None:
    twin = ContactTwin(B6205, effects=[make_effect("mean_slip", {"slip": 0.03})])
    orders = B6205.slipped(0.97)
    for fault in ("outer", "inner"):
        (x,) = samples(twin, condition(fault, 40000, 1800.0, 20000.0))
        expected = orders[fault] * 30 * 2
        assert abs(expected - 2 * 30 * B6205.fault_order(fault)) > 4
        found, _ = envelope_line(twin, x, 20000.0, expected / 2, 18)
        assert abs(found - expected) <= 1


def test_speed_fluctuation_is_followed() -> None:
    """A speed that changes within the record drags the impacts along."""
    twin = ContactTwin(B6205, QUIET)
    streams = [Streams(3, 0)]
    (draft,) = twin.prepare([condition("outer", 24000, 1800.0)], streams)
    draft.turns = 30 * draft.t * (0.9 + 0.1 * draft.t)  # from 27 to 39 turns per second over two seconds
    twin.respond([draft])
    squared = np.abs(hilbert(draft.x)) ** 2
    half = squared.size // 2
    even = np.linspace(draft.turns[0], draft.turns[-1], squared.size)
    for x, per in ((np.interp(even, draft.turns, squared), draft.turns[-1]),):
        spectrum = np.abs(np.fft.rfft(x - x.mean()))
        assert abs(int(np.argmax(spectrum)) - B6205.bpfo * per) <= 1
    for x, mean_hz in ((squared[:half], 30.0), (squared[half:], 36.0)):
        spectrum = np.abs(np.fft.rfft(x - x.mean()))
        assert abs(int(np.argmax(spectrum[:250])) - B6205.bpfo * mean_hz) < 14


def test_cage_lag_delays_the_passes() -> None:
    twin = ContactTwin(B6205, QUIET)
    drafts = [twin.prepare([condition("outer", 3000)], [Streams(3, 0)])[0] for _ in range(2)]
    spacing_s = 60 / (1797 * B6205.bpfo)
    drafts[1].delay(np.full(3000, 0.25 / B6205.bpfo))
    for draft in drafts:
        twin.respond([draft])
    lag = np.argmax(np.correlate(drafts[1].x, drafts[0].x, "full")) - 2999
    period = spacing_s * 12000
    assert (lag - 0.25 * period + 1) % period <= 2


def test_gain_force_modes_and_filters_act_as_documented() -> None:
    twin = ContactTwin(B6205, replace(QUIET, structure_noise_rms=0.4))

    def made(change: Any, fault: str = "outer") -> Draft:
        (draft,) = twin.prepare([condition(fault, 6000)], [Streams(3, 0)])
        change(draft)
        twin.respond([draft])
        return draft

    plain = made(lambda d: None)
    bare = made(lambda d: setattr(d, "force", None))
    assert np.std(plain.x - bare.x) == pytest.approx(0.4, rel=0.1)
    assert made(lambda d: (setattr(d, "force", None), d.modulate(3.0))).x == pytest.approx(3 * bare.x)
    halved = made(lambda d: d.filters.append(lambda x: 0.5 * x))
    assert halved.x == pytest.approx(0.5 * plain.x)
    # A second mode rings at its own frequency.
    second = made(lambda d: (setattr(d, "force", None), d.modes.append(Mode(4200.0, 0.02, 0.5))))
    added = np.abs(np.fft.rfft((second.x - bare.x) * np.hanning(6000)))
    assert abs(np.argmax(added) * 2 - 4200) < 250


def test_a_further_mode_answers_the_hits_that_the_contact_answered() -> None:
    old, new = Mode(2000.0, 0.03, 1.0), Mode(3100.0, 0.05, 0.4)
    times, sizes = np.array([100, 377, 820]) / 12000, np.array([1.0, 0.3, 2.0])
    through_old = modal_response([old], 12000.0, 1200, times, sizes)
    through_new = modal_response([new], 12000.0, 1200, times, sizes)
    assert through(new, old, through_old, 12000.0) == pytest.approx(through_new, abs=1e-9)


def test_low_pass_is_flat_then_closed() -> None:
    for factor in LADDER[:12]:
        first, second = low_pass(factor)
        assert first.shape == (6, factor // 2)
        hz = np.linspace(0, factor / 2, 3001)
        up = np.zeros(32 * factor)
        up[:: factor // 2] = second
        whole = np.abs(
            freqz(first[::-1].ravel(), worN=hz, fs=factor)[1] * freqz(up, worN=hz, fs=factor)[1]
        )  # fmt: skip
        assert np.abs(whole[hz <= 0.4] - 1).max() < 0.006
        assert whole[hz >= 0.5].max() < 0.004


def test_output_is_the_acceleration_at_the_samples_instant() -> None:
    """No delay through oversampling and filters: halving the rate leaves every second sample (below 0.4 fs)."""
    own = replace(QUIET, defect_width_mm=3.0, defect_depth_um={"outer": 2.0})
    (slow,) = samples(ContactTwin(B6205, own), condition("outer", 1500, fs=20000.0))
    (fast,) = samples(ContactTwin(B6205, own), condition("outer", 3000, fs=40000.0))
    assert np.abs(slow - fast[::2]).max() < 0.02 * np.abs(fast).max()


# --- sameness ----------------------------------------------------------------------------------------------------


def test_same_bytes_on_one_and_two_threads_and_in_any_company() -> None:
    twin = ContactTwin(B6205, effects=[make_effect("slip_jitter"), make_effect("mean_slip")])
    conditions = [
        condition(("healthy", *FAULTS)[i % 4], 300 + 37 * (i % 3), 1700.0 + 10 * i, name=str(i)) for i in range(37)
    ]
    streams = [Streams(11, i) for i in range(37)]
    most = numba.get_num_threads()
    together = [r.samples for r in twin.make(conditions, streams)]
    try:
        numba.set_num_threads(1)
        alone_on_one = [r.samples for r in twin.make(conditions, streams)]
    finally:
        numba.set_num_threads(most)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(together, alone_on_one, strict=True))
    for i in (0, 5, 18, 36):
        (single,) = twin.make([conditions[i]], [streams[i]])
        assert single.samples.tobytes() == together[i].tobytes()
    backwards = twin.make(conditions[::-1], streams[::-1])
    assert all(r.samples.tobytes() == x.tobytes() for r, x in zip(backwards, together[::-1], strict=True))
    assert len({x[:100].tobytes() for x in together}) == 37


def test_candidates_share_an_integration_to_the_bit() -> None:
    twins = [ContactTwin(B6205, replace(PRESETS["physical"], stiffness=k)) for k in (5e9, 9e9, 1.3e10)]
    conditions, streams = [condition("inner"), condition("ball", name="b")], [Streams(2, 0), Streams(2, 1)]
    for twin, records in zip(twins, make_together(twins, conditions, streams), strict=True):
        for ours, own in zip(records, twin.make(conditions, streams), strict=True):
            assert ours.samples.tobytes() == own.samples.tobytes()


def test_a_population_shares_an_integration_to_the_bit() -> None:
    """Other parameters, effects, lengths and numbers of records: each machine's are what it makes by itself."""

    def machines() -> list[ContactTwin]:
        return [
            ContactTwin(B6205, replace(PRESETS["physical"], stiffness=5e9, load_n=300.0, white_noise_rms=0.2)),
            ContactTwin(B6205, replace(PRESETS["physical"], damping=900.0), (make_effect("shaft_harmonics"),)),
            ContactTwin(B6205, replace(PRESETS["physical"], mass_kg=0.9), (make_effect("second_resonance"),)),
        ]

    conditions = [
        [condition("inner", n=500), condition("healthy", n=300, name="h")],
        [condition("ball", name="b")],
        [condition("outer", 700, 1500.0, name=str(i)) for i in range(3)],
    ]
    streams = [[Streams(7 + k, i) for i in range(len(own))] for k, own in enumerate(conditions)]
    together = machines()
    made = make_each(together, conditions, streams)
    for twin, alone, records, *own in zip(together, machines(), made, conditions, streams, strict=True):
        assert twin.reference_rms == alone.reference_rms
        for ours, theirs in zip(records, alone.make(*own), strict=True):
            assert ours.samples.tobytes() == theirs.samples.tobytes()


def test_records_stream_in_bounded_memory() -> None:
    twin = ContactTwin(B6205, replace(QUIET, defect_width_mm=1.0))

    def peak(count: int) -> int:
        tracemalloc.start()
        made = twin.stream((condition(n=400, name=str(i)) for i in range(count)), np.random.default_rng(0))
        for number, record in enumerate(made):
            del record
            if number % 32 == 0:  # what other tests leave decides when the collector runs by itself
                gc.collect()
        (_, most) = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(64)
    assert peak(512) < 1.3 * peak(128)


# --- loads and refusals ------------------------------------------------------------------------------------------


def test_a_records_own_load_is_used() -> None:
    light, heavy, default = samples(
        ContactTwin(B6205, QUIET), condition(load_n=50.0), condition(load_n=2000.0, name="b"), condition(name="c")
    )
    again = samples(ContactTwin(B6205, replace(QUIET, load_n=2000.0)), condition(name="z"), condition(name="b"))[1]
    assert heavy == pytest.approx(again, rel=1e-9)
    assert light.std() != pytest.approx(default.std(), rel=0.05)
    (unloaded,) = samples(ContactTwin(B6205, QUIET), condition(load_n=0.0))
    assert np.isfinite(unloaded).all()


NUMBERS = [f.name for f in fields(ContactParameters) if "allowed" in f.metadata]


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(NUMBERS),
    value=st.one_of(st.sampled_from([float("nan"), float("inf"), -float("inf"), -1e15, 1e15]), st.floats(), st.text()),
)
def test_parameters_are_plausible_or_refused(name: str, value: Any) -> None:
    try:
        made = replace(PRESETS["physical"], **{name: value})
    except TwingapError as error:
        assert name in str(error) and "\n" not in str(error)
    else:
        held = getattr(made, name)
        assert isinstance(held, (int, float)) and np.isfinite(held)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"stiffness": -1.0}, "stiffness"),
        ({"mass_kg": 0.0}, "mass_kg"),
        ({"damping": float("nan")}, "damping"),
        ({"damping": -1.0}, "damping"),
        ({"edge": 1.5}, "edge"),
        ({"contact": "gear"}, "contact"),
        ({"defect_depth_um": {"cage": 1.0}}, "cage"),
        ({"defect_depth_um": {"inner": -1.0}}, "inner"),
        ({"oversampling": 0}, "oversampling"),
        ({"oversampling": 7}, "oversampling"),
        ({"stiffness": True}, "stiffness"),
    ],
)
def test_bad_parameters_are_refused(change: dict[str, Any], says: str) -> None:
    with pytest.raises(TwingapError, match=says):
        replace(PRESETS["physical"], **change)


@pytest.mark.parametrize(
    ("change", "asked", "says"),
    [
        ({"oversampling": 2, "stiffness": 2e10}, condition(fs=8000.0), "unstable"),
        ({"mass_kg": 1e-3}, condition(), "sampling rate"),
        ({"defect_width_mm": 20.0}, condition(), "wider"),
        ({"defect_width_mm": 1e-4}, condition(fs=8000.0), "internal steps"),
        ({}, condition("cage"), "cage"),
        ({}, Condition("a", 1797.0, 12000.0, 100, None), "unknown"),
    ],
)
def test_what_cannot_be_simulated_is_refused(change: dict[str, Any], asked: Condition, says: str) -> None:
    with pytest.raises(TwingapError, match=says) as caught:
        samples(ContactTwin(B6205, replace(PRESETS["physical"], **change)), asked)
    assert "\n" not in str(caught.value)


@settings(max_examples=12, deadline=None)
@given(
    stiffness=st.floats(1e9, 2e10), damping=st.floats(50, 3000), load=st.floats(0, 5000), clearance=st.floats(-5, 20),
    speed=st.floats(300, 6000), fault=st.sampled_from(("healthy", *FAULTS)), edge=st.sampled_from([0.0, 0.3, 1.0]),
)  # fmt: skip
def test_plausible_parameters_never_give_nan(
    stiffness: float, damping: float, load: float, clearance: float, speed: float, fault: str, edge: float
) -> None:
    own = replace(PRESETS["physical"], stiffness=stiffness, damping=damping, clearance_um=clearance, edge=edge)
    (x,) = samples(ContactTwin(B6205, own), condition(fault, 200, speed, 25600.0, load_n=load))
    assert x.shape == (200,) and np.isfinite(x).all()
    assert np.abs(x).max() < 1e5


def test_rows_are_in_the_kernels_order() -> None:
    own = replace(QUIET, eccentricity_um=2.0, load_x_n=7.0)
    rows = dict(zip(ROWS, Job(B6205, own, condition(), np.zeros(1)).rows(10), strict=True))
    assert rows["half_step"] == 0.5 / 120000 and rows["force_x"] == 7.0 / 0.6 and rows["depth"] == 1e-6
    assert rows["phase_cage"] == -9 and rows["steepness"] == 1.0 and LOOK_BACK > LOOK_AHEAD
