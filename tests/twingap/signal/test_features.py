"""Features against SciPy and by their invariances."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from twingap.errors import TwingapError
from twingap.signal import (
    PAPER2_FEATURES,
    SPECTRAL_KURTOSIS_FEATURES,
    TIME_FEATURES,
    paper2_features,
    spectral_kurtosis,
    spectral_kurtosis_features,
    time_features,
)

POWER_OF_SCALE = dict.fromkeys(TIME_FEATURES, 0) | dict.fromkeys(
    ("mean", "std", "rms", "mean_abs", "peak", "peak_to_peak"), 1
) | {"energy": 2}  # fmt: skip


def skewed(shape=(4, 3, 500), seed=0):
    return np.random.default_rng(seed).gamma(2.0, size=shape) - 1.5


def test_values_equal_scipys_and_the_definitions():
    x = skewed()
    table = time_features(x)
    assert table.values.shape == (4, 3, len(TIME_FEATURES))
    size = np.abs(x)
    rms = np.sqrt((x**2).sum(-1) / 500)
    expected = {
        "mean": x.mean(-1), "std": stats.tstd(x, axis=-1, ddof=0), "rms": rms, "mean_abs": size.mean(-1),
        "peak": size.max(-1), "peak_to_peak": x.max(-1) - x.min(-1), "skewness": stats.skew(x, axis=-1),
        "kurtosis": stats.kurtosis(x, axis=-1, fisher=False), "crest_factor": size.max(-1) / rms,
        "shape_factor": rms / size.mean(-1), "impulse_factor": size.max(-1) / size.mean(-1),
        "clearance_factor": size.max(-1) / np.mean(size**0.5, -1) ** 2, "energy": np.einsum("...t,...t", x, x),
    }  # fmt: skip
    assert set(expected) == set(TIME_FEATURES)
    for name, values in expected.items():
        np.testing.assert_allclose(table[name], values, rtol=1e-10, err_msg=name)


def test_a_sine_has_the_textbook_factors():
    table = time_features(3 * np.sin(2 * np.pi * (np.arange(40000) + 0.5) / 4000))
    for name, value in {
        "rms": 3 / np.sqrt(2), "crest_factor": np.sqrt(2), "shape_factor": np.pi / np.sqrt(8),
        "impulse_factor": np.pi / 2, "kurtosis": 1.5, "peak_to_peak": 6,
    }.items():  # fmt: skip
        assert table[name] == pytest.approx(value, rel=1e-4), name


@given(st.floats(1e-6, 1e6), st.sampled_from([-1, 1]), st.integers(1, 60), st.integers(0, 50))
def test_scale_and_sign(scale, sign, samples, seed):
    x = skewed((2, samples), seed)
    plain, changed = time_features(x), time_features(sign * scale * x)
    for name, power in POWER_OF_SCALE.items():
        turned = sign if name in ("mean", "skewness") else 1
        np.testing.assert_allclose(
            changed[name], turned * scale**power * plain[name], rtol=1e-7, atol=1e-9 * scale**power, err_msg=name
        )


@given(st.integers(0, 499), st.integers(0, 20))
def test_order_of_samples_does_not_matter(shift, seed):
    x = skewed((500,), seed)
    np.testing.assert_allclose(time_features(np.roll(x, shift)).values, time_features(x).values, rtol=1e-9)


def test_features_of_the_spectral_kurtosis_are_its_moments():
    x = np.random.default_rng(1).standard_normal((2, 4000)) ** 3
    sk = spectral_kurtosis(x, 10.0, window_samples=128).values
    table = spectral_kurtosis_features(x, 10.0)
    assert table.names == SPECTRAL_KURTOSIS_FEATURES
    expected = sk.mean(-1), sk.std(-1), stats.skew(sk, axis=-1), stats.kurtosis(sk, axis=-1, fisher=False)
    np.testing.assert_allclose(table.values, np.stack(expected, -1), rtol=1e-9)
    np.testing.assert_allclose(spectral_kurtosis_features(-7 * x, 10.0).values, table.values, rtol=1e-6)


def test_paper_2_has_eleven_and_four():
    x = skewed((5, 1000))
    table = paper2_features(x, 100.0)
    assert table.names == PAPER2_FEATURES
    assert table.values.shape == (5, 15)
    assert len(set(PAPER2_FEATURES) & set(TIME_FEATURES)) == 11
    assert (table["rms"] == time_features(x)["rms"]).all()
    assert (table["sk_std"] == spectral_kurtosis_features(x, 100.0)["sk_std"]).all()


def test_features_without_a_meaning_are_zero():
    silent = time_features(np.zeros((2, 10)))
    assert (silent.values == 0).all()
    constant = time_features(np.full(10, -0.1))
    assert constant["std"] == constant["skewness"] == constant["kurtosis"] == 0
    assert constant["crest_factor"] == pytest.approx(1)
    assert constant["clearance_factor"] == pytest.approx(1)


def test_refuses_unknown_names():
    with pytest.raises(TwingapError, match="no feature 'rmz'"):
        time_features(np.ones(3))["rmz"]
    with pytest.raises(TwingapError, match="known: mean"):
        time_features(np.ones(3)).select(("mean", "margin"))
