"""Decompositions against vmdpy, against a plain transcription for odd lengths, and by their properties."""

import tracemalloc

import numpy as np
import pytest
import vmdpy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from twingap.errors import TwingapError
from twingap.signal import vmd, vmd_hz


def vibration(samples, seed, count=1):
    """Two tones of random frequency and phase in noise, about rms 1."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples)
    x = 0.3 * rng.standard_normal((count, samples))
    for row in x:
        for frequency in rng.uniform(0.02, 0.45, 2):
            row += np.cos(2 * np.pi * (frequency * t + rng.random()))
    return x


def assert_agree(found, expected, tolerance=1e-6):
    """Each mode within `tolerance` of its norm, and in truth much closer."""
    assert found.shape == expected.shape
    norms = np.linalg.norm(expected, axis=-1)
    assert (np.linalg.norm(found - expected, axis=-1) <= tolerance * norms).all()


@pytest.mark.parametrize("samples", [256, 258, 510])
@pytest.mark.parametrize(
    ("alpha", "tau", "modes", "dc", "init", "tol"),
    [
        (2000, 0.0, 4, 0, 1, 1e-7),
        (2000, 0.0, 3, 0, 0, 1e-7),
        (500, 0.0, 5, 1, 1, 1e-6),
        (2500, 0.1, 2, 0, 1, 1e-5),
        (100, 0.5, 3, 1, 0, 1e-6),
        (2000, 0.0, 1, 0, 1, 1e-9),
        (1e6, 0.0, 6, 0, 1, 1e-7),
    ],
)
def test_agrees_with_vmdpy(samples, alpha, tau, modes, dc, init, tol):
    x = vibration(samples, seed=samples + modes)[0]
    expected, _, centres = vmdpy.VMD(x, alpha, tau, modes, dc, init, tol)
    found = vmd(x, modes, alpha=alpha, tau=tau, dc=bool(dc), init=init, tol=tol)
    assert found.iterations == len(centres)
    assert_agree(found.values, expected, 1e-9)
    np.testing.assert_allclose(found.centres, centres[-1], rtol=1e-9, atol=1e-12)
    assert found.converged == (len(centres) < 499)


def test_agrees_with_vmdpy_on_a_batch_of_the_promised_size():
    x = vibration(2048, seed=1, count=3)
    found = vmd(x, 4)
    for row, modes in zip(x, found.values, strict=True):
        assert_agree(modes, vmdpy.VMD(row, 2000, 0, 4, 0, 1, 1e-7)[0])


def test_agrees_with_vmdpy_from_random_starts():
    x, modes, samples = vibration(400, seed=3)[0], 3, 400
    state = np.random.get_state()  # noqa: NPY002 - vmdpy draws from the global generator
    try:
        np.random.seed(5)  # noqa: NPY002
        start = np.sort(np.exp(np.log(1 / samples) + (np.log(0.5) - np.log(1 / samples)) * np.random.rand(modes)))  # noqa: NPY002
        np.random.seed(5)  # noqa: NPY002
        expected, _, centres = vmdpy.VMD(x, 2000, 0, modes, 0, 2, 1e-7)
    finally:
        np.random.set_state(state)  # noqa: NPY002
    found = vmd(x, modes, init=start)
    assert_agree(found.values, expected, 1e-9)
    assert found.iterations == len(centres)


def test_agrees_with_vmdpy_on_white_noise_whose_nyquist_bin_matters():
    x = np.random.default_rng(8).standard_normal(128)
    expected = vmdpy.VMD(x, 50, 0, 3, 0, 1, 1e-7)[0]
    assert_agree(vmd(x, 3, alpha=50).values, expected, 1e-9)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    half=st.integers(2, 60),
    modes=st.integers(1, 4),
    scale=st.floats(1e-2, 1e3),
    offset=st.floats(-5, 5),
    seed=st.integers(0, 1000),
)
def test_agrees_with_vmdpy_whatever_the_length_scale_and_offset(half, modes, scale, offset, seed):
    x = scale * (vibration(2 * half, seed)[0] + offset)
    expected, _, centres = vmdpy.VMD(x, 2000, 0, modes, 0, 1, 1e-7)
    found = vmd(x, modes)
    assert found.iterations == len(centres)
    np.testing.assert_allclose(found.values, expected, rtol=0, atol=1e-8 * np.abs(x).max())


def plain_vmd(x, alpha, modes, tol):
    """The method transcribed with a complex spectrum of both halves, without vmdpy's even-length habits."""
    n = len(x)
    ahead = n // 2
    mirrored = np.concatenate((x[:ahead][::-1], x, x[ahead:][::-1]))
    spectrum, frequency = np.fft.rfft(mirrored), np.arange(n + 1) / (2 * n)
    u, centres = np.zeros((modes, n + 1), complex), 0.5 / modes * np.arange(modes)
    for _ in range(499):
        before, old = u.copy(), centres.copy()
        for k in range(modes):
            others = u.sum(axis=0) - u[k]
            u[k] = (spectrum - others) / (1 + alpha * (frequency - old[k]) ** 2)
            power = np.abs(u[k]) ** 2
            centres[k] = (frequency * power).sum() / power.sum()
        if (np.abs(u - before) ** 2).sum() / (2 * n) <= tol:
            break
    return np.fft.irfft(before, 2 * n)[:, ahead : ahead + n], old


@pytest.mark.parametrize("samples", [255, 257, 511])
def test_odd_lengths_keep_their_last_sample(samples):
    x = vibration(samples, seed=2)[0]
    expected, centres = plain_vmd(x, 2000, 3, 1e-5)
    found = vmd(x, 3, tol=1e-5)
    assert_agree(found.values, expected, 1e-9)
    np.testing.assert_allclose(found.centres, centres, rtol=1e-9)


def test_tones_come_apart_at_their_frequencies():
    fs_hz, t = 12000.0, np.arange(4096) / 12000.0
    tones = np.array([500.0, 1800.0, 4200.0])
    x = np.cos(2 * np.pi * tones[:, None] * t)
    found = vmd_hz(x.sum(axis=0), fs_hz, 3).in_order()
    np.testing.assert_allclose(found.centres, tones, atol=fs_hz / 4096)
    middle = slice(400, -400)
    np.testing.assert_allclose(found.values[:, middle], x[:, middle], atol=0.05)


def test_bandwidth_is_the_filters_half_width():
    x = vibration(300, seed=4)
    wide = vmd_hz(x, 1000.0, 2, bandwidth_hz=50.0, relative=False, init_hz=[100.0, 300.0])
    same = vmd(x, 2, alpha=400.0, init=[0.1, 0.3])
    assert (wide.values == same.values).all()
    np.testing.assert_allclose(wide.centres, 1000 * same.centres)


def test_dual_ascent_makes_modes_add_up():
    # Without noise: with it, dual ascent keeps the centre frequencies wandering (with vmdpy too).
    t = np.arange(301)
    x = np.cos(2 * np.pi * 0.07 * t) + np.cos(2 * np.pi * 0.31 * t)
    loose, tight = vmd(x, 2, alpha=500), vmd(x, 2, alpha=500, tau=0.1, tol=1e-12)
    gap = [np.linalg.norm(m.values.sum(axis=0) - x) / np.linalg.norm(x) for m in (loose, tight)]
    assert gap[1] < 0.1 * gap[0]


def test_same_bytes_on_any_number_of_threads_and_in_any_batch():
    x = vibration(700, seed=7, count=60)
    one, two = vmd(x, 3, threads=1), vmd(x, 3, threads=2)
    assert one.values.tobytes() == two.values.tobytes()
    assert one.centres.tobytes() == two.centres.tobytes()
    again = vmd(x[40], 3)
    assert again.values.tobytes() == one.values[40].tobytes()


def test_leading_axes_are_kept_and_the_input_is_not_touched():
    x = vibration(128, seed=9, count=6).reshape(2, 3, 128)
    copy = x.copy()
    found = vmd(x, 2)
    assert found.values.shape == (2, 3, 2, 128)
    assert found.centres.shape == (2, 3, 2)
    assert found.iterations.shape == found.converged.shape == (2, 3)
    assert (x == copy).all()
    assert (vmd(x[1, 2], 2).values == found.values[1, 2]).all()
    assert (vmd(x.astype(np.float32), 2).values == vmd(x.astype(np.float32).astype(float), 2).values).all()


@given(power=st.integers(-60, 60), seed=st.integers(0, 20))
@settings(max_examples=20, deadline=None)
def test_relative_tolerance_does_not_depend_on_the_unit(power, seed):
    x = vibration(96, seed)[0]
    plain, scaled = vmd(x, 2, relative=True), vmd(x * 2.0**power, 2, relative=True)
    assert (scaled.values == plain.values * 2.0**power).all()
    assert (scaled.centres == plain.centres).all()


def test_relative_equals_absolute_at_rms_one():
    x = vibration(256, seed=11)[0]
    x /= np.sqrt(np.mean(x**2))
    a, b = vmd(x, 3), vmd(x, 3, relative=True)
    np.testing.assert_allclose(a.values, b.values, atol=1e-9)


def test_random_starts_come_from_the_generator():
    x = vibration(200, seed=12, count=3)
    first, again = (vmd(x, 3, init="random", rng=np.random.default_rng(1)) for _ in range(2))
    assert first.values.tobytes() == again.values.tobytes()
    with pytest.raises(TwingapError, match="rng="):
        vmd(x, 3, init="random")


@pytest.mark.parametrize("relative", [False, True])
def test_silence_and_constants_have_defined_results(relative):
    silent = vmd(np.zeros(64), 3, relative=relative)
    assert (silent.values == 0).all()
    assert silent.centres.tolist() == [0, 0.5 / 3, 1 / 3]
    assert silent.converged
    constant = vmd(np.full(64, 2.5), 2, tau=0.1, tol=1e-12, relative=relative)
    assert np.isfinite(constant.values).all()
    np.testing.assert_allclose(constant.values.sum(axis=0), 2.5, rtol=1e-3)


@pytest.mark.parametrize(
    ("x", "options", "message"),
    [
        ([1.0, np.nan, 2.0, 3.0], {}, "NaN"),
        ([1.0, np.inf, 2.0, 3.0], {}, "infinite"),
        ([1.0, 2.0, 3.0], {}, "at least 4"),
        ([], {}, "at least 4"),
        (np.zeros((0, 8)), {}, "no signals"),
        (np.float64(3), {}, "single number"),
        (["a", "b", "c", "d"], {}, "real numbers"),
        (np.ones(8) * 1j, {}, "real numbers"),
        (np.full(8, 1e80), {}, "1e\\+70"),
        (np.ones(8), {"n_modes": 0}, "n_modes"),
        (np.ones(8), {"alpha": 0.0}, "alpha"),
        (np.ones(8), {"alpha": np.nan}, "alpha"),
        (np.ones(8), {"tau": -1.0}, "tau"),
        (np.ones(8), {"tol": np.nan}, "tol"),
        (np.ones(8), {"init": "uniformly"}, "zero, uniform, random"),
        (np.ones(8), {"init": 3}, "init"),
        (np.ones(8), {"init": [0.1, 0.2, 0.3]}, "\\[2\\]"),
        (np.ones(8), {"init": [0.1, 0.7]}, "half the sampling rate"),
        (np.ones(8), {"max_iterations": 1}, "max_iterations"),
        (np.ones(8), {"threads": 0}, "threads"),
    ],
)
def test_refuses_in_one_line(x, options, message):
    with pytest.raises(TwingapError, match=message) as error:
        vmd(x, **{"n_modes": 2, **options})
    assert "\n" not in str(error.value)


def test_hz_wrapper_refuses_what_is_given_twice():
    with pytest.raises(TwingapError, match="alpha is given twice"):
        vmd_hz(np.ones(8), 100.0, 1, bandwidth_hz=3.0, alpha=5.0)
    with pytest.raises(TwingapError, match="init is given twice"):
        vmd_hz(np.ones(8), 100.0, 1, init_hz=[3.0], init=0)
    with pytest.raises(TwingapError, match="fs_hz"):
        vmd_hz(np.ones(8), 0.0, 1)


def test_memory_stays_under_twenty_times_the_input():
    x = vibration(2048, seed=13, count=64)
    vmd(x[:1], 4, max_iterations=3)
    tracemalloc.start()
    try:
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        vmd(x, 4, max_iterations=3, threads=2)
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    assert peak < 8 * x.nbytes
