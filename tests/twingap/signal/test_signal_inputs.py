"""What every signal function does with input that is no signal: one line that says so."""

import numpy as np
import pytest

import twingap.signal as signal
from twingap.errors import TwingapError

FUNCTIONS = {
    "amplitude_spectrum": lambda x: signal.amplitude_spectrum(x, 1.0),
    "averaged_spectrum": lambda x: signal.averaged_spectrum(x, 1.0, segment_samples=8),
    "power_spectral_density": lambda x: signal.power_spectral_density(x, 1.0, segment_samples=8),
    "analytic_signal": signal.analytic_signal,
    "envelope": signal.envelope,
    "demodulate": lambda x: signal.demodulate(x, 1.0, (0.1, 0.4)),
    "squared_envelope_spectrum": lambda x: signal.squared_envelope_spectrum(x, 1.0),
    "most_impulsive_band": lambda x: signal.most_impulsive_band(x, 1.0),
    "impulsive_envelope_spectrum": lambda x: signal.impulsive_envelope_spectrum(x, 1.0),
    "turns_from_speed": lambda x: signal.turns_from_speed(x, 1.0),
    "turns_from_tacho": lambda x: signal.turns_from_tacho(x, 10, 1.0),
    "to_angle": lambda x: signal.to_angle(x, np.arange(300) / 10, 4),
    "order_spectrum": lambda x: signal.order_spectrum(x, np.arange(300) / 10, 4),
    "synchronous_average": lambda x: signal.synchronous_average(x, 4),
    "without_average": lambda x: signal.without_average(x, 4),
    "spectral_kurtosis": lambda x: signal.spectral_kurtosis(x, 1.0, window_samples=16),
    "fast_kurtogram": lambda x: signal.fast_kurtogram(x, 1.0),
    "time_features": signal.time_features,
    "spectral_kurtosis_features": lambda x: signal.spectral_kurtosis_features(x, 1.0),
    "paper2_features": lambda x: signal.paper2_features(x, 1.0),
    "vmd": lambda x: signal.vmd(x, 2),
    "vmd_hz": lambda x: signal.vmd_hz(x, 1.0, 2),
}


def spoilt(value):
    x = np.linspace(1.0, 2.0, 300)
    x[7] = value
    return x


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize(
    "x",
    [spoilt(np.nan), spoilt(np.inf), spoilt(-np.inf), spoilt(1e80), [], np.zeros((0, 300)), 3.0, None, ["x"] * 300,
     [[1.0, 2.0], [3.0]], np.ones(300, complex), np.array([object()] * 300)],
    ids=["nan", "inf", "-inf", "huge", "empty", "no signals", "scalar", "none", "text", "ragged", "complex", "objects"],
)  # fmt: skip
def test_refuses_in_one_line(name, x):
    with pytest.raises(TwingapError) as error:
        FUNCTIONS[name](x)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", sorted(set(FUNCTIONS) - {"turns_from_tacho"}))
@pytest.mark.parametrize("dtype", [np.int16, np.float32, ">f8"])
def test_accepts_any_real_type_and_any_memory_order(name, dtype):
    x = (100 + 50 * np.random.default_rng(0).random((2, 600))).astype(dtype)
    plain = FUNCTIONS[name](np.ascontiguousarray(x[:, ::2]).astype(float))
    assert repr(plain) == repr(FUNCTIONS[name](x[:, ::2]))


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf, "fast", None])
def test_refuses_rates_that_are_none(rate):
    for call in (signal.amplitude_spectrum, signal.fast_kurtogram, signal.paper2_features, signal.turns_from_speed):
        with pytest.raises(TwingapError, match="fs_hz"):
            call(np.ones(300), rate)


@pytest.mark.parametrize("count", [0, -1, 2.5, np.nan, np.inf, True, "two", None])
def test_refuses_counts_that_are_none(count):
    for call in (
        lambda: signal.vmd(np.ones(300), count),
        lambda: signal.averaged_spectrum(np.ones(300), 1.0, segment_samples=count),
        lambda: signal.synchronous_average(np.ones(300), count),
        lambda: signal.gaussian_sk_sd(count),
    ):
        with pytest.raises(TwingapError, match="whole number"):
            call()


def test_everything_public_is_documented_and_listed():
    for name in signal.__all__:
        assert getattr(signal, name) is not None
        documented = getattr(signal, name).__doc__ if callable(getattr(signal, name)) else "constant"
        assert documented
