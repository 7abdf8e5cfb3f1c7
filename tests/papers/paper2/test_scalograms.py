"""Wavelet images: noise reads one, a modulation stands where it belongs, size and sensor say nothing."""

from __future__ import annotations

import numpy as np
import pytest

from papers.paper2_digital_twin.methods.condition_features import (
    FAULTS,
    PIECE_FEATURES,
    WINDOW_FEATURES,
    line_features,
    window_features,
)
from papers.paper2_digital_twin.methods.scalograms import CHANNELS, ImageOptions, images, modulation, pieces_of
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError

FS, RPM = 12_000.0, 1800.0
IMAGE = ImageOptions(turns=8, carriers=8)
LENGTH = IMAGE.piece_samples(FS, RPM)
T = np.arange(LENGTH) / FS


def struck(fault: str, pieces: int, rng: np.random.Generator) -> np.ndarray:
    """Noise that swells at a fault's order, with a quarter of plain noise."""
    order = BEARINGS["6205"].fault_order(fault)
    phase = rng.random((pieces, 1))
    swell = np.maximum(np.cos(2 * np.pi * (order * RPM / 60 * T + phase)), 0) ** 4
    return swell * rng.standard_normal((pieces, LENGTH)) + 0.25 * rng.standard_normal((pieces, LENGTH))


def test_white_noise_reads_one_at_all_orders_and_carriers() -> None:
    """The closed form of the noise's envelope spectrum, against noise itself."""
    found = modulation(np.random.default_rng(0).standard_normal((120, LENGTH)), FS, RPM, IMAGE)
    # Below order 1/2 the mean that is taken out shows; 120 exponentials: an eighth of an order apart, neighbours alike.
    rows = found.lines[..., 4:].mean(axis=(0, 2))
    assert rows[:-1] == pytest.approx(np.ones(7), abs=0.06)
    assert 1 < rows[-1] < 1.25  # its band reaches beyond half the rate
    assert found.lines[..., 48:].mean() == pytest.approx(1, abs=0.06)


def test_a_modulated_tone_stands_at_its_order_and_grows_with_the_square_of_its_depth() -> None:
    carrier = np.cos(2 * np.pi * IMAGE.carriers_hz(FS)[4] * T)
    swing = np.cos(2 * np.pi * 3 * RPM / 60 * T)
    found = [modulation(((1 + m * swing) * carrier)[None], FS, RPM, IMAGE) for m in (0.01, 0.02)]
    assert IMAGE.orders[found[1].lines[0, 4].argmax()] == 3.0
    place = int(np.flatnonzero(IMAGE.orders == 3.0)[0])
    assert found[1].lines[0, 4, place] / found[0].lines[0, 4, place] == pytest.approx(4, rel=0.02)
    assert found[0].power[0, 4] == pytest.approx(0.5, rel=0.02)  # a tone of amplitude 1


@pytest.mark.parametrize("fault", ["inner", "outer", "ball"])
def test_a_fault_has_its_line_on_every_carrier_and_in_the_features(fault: str) -> None:
    bearing = BEARINGS["6205"]
    found = modulation(struck(fault, 6, np.random.default_rng(1)), FS, RPM, IMAGE).pooled()
    strongest = IMAGE.orders[8 + found.lines[0, :, 8:].argmax(axis=1)]
    assert np.median(np.abs(strongest - bearing.fault_order(fault))) <= 1 / 8
    row = line_features(found, bearing, IMAGE)[0]
    assert FAULTS[int(row[:3].argmax())] == fault
    assert len(row) == len(PIECE_FEATURES) - len(WINDOW_FEATURES)


def test_size_of_the_signal_moves_the_level_channel_alone() -> None:
    x = struck("outer", 2, np.random.default_rng(2))
    a, b = modulation(x, FS, RPM, IMAGE), modulation(10 * x, FS, RPM, IMAGE)
    baseline = a.power.mean(axis=0)
    first, second = images(a, baseline, IMAGE), images(b, baseline, IMAGE)
    assert first.shape == (2, CHANNELS, 8, IMAGE.orders.size)
    assert first.dtype == np.float32
    np.testing.assert_allclose(first[:, :2], second[:, :2], atol=1e-4)
    np.testing.assert_allclose(second[:, 2] - first[:, 2], 2, atol=1e-4)  # log10 of a power


def test_a_short_piece_shows_the_same_orders_and_silence_is_no_error() -> None:
    x = struck("outer", 40, np.random.default_rng(3))[:, : LENGTH // 2]
    found = modulation(x, FS, RPM, IMAGE).pooled()
    strongest = IMAGE.orders[8 + found.lines[0, :, 8:].argmax(axis=1)]
    assert np.median(np.abs(strongest - BEARINGS["6205"].bpfo)) <= 1 / 8
    silent = modulation(np.zeros((1, LENGTH)), FS, RPM, IMAGE)
    assert np.isfinite(images(silent, np.ones(8), IMAGE)).all()


def test_pieces_cover_a_record_once() -> None:
    x = np.arange(10.0)
    assert pieces_of(x, 3).tolist() == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]
    with pytest.raises(TwingapError, match="a piece needs 11"):
        pieces_of(x, 11)
    with pytest.raises(TwingapError, match="at most"):
        modulation(np.zeros((1, LENGTH + 1)), FS, RPM, IMAGE)
    with pytest.raises(TwingapError, match="makes no image"):
        ImageOptions(turns=1)


def test_window_features_are_logarithms() -> None:
    """Ten times the signal adds log 10 to every level and nothing to a shape."""
    x = np.random.default_rng(4).standard_normal((3, 1024)) + 5.0
    step = window_features(10 * x) - window_features(x)
    wanted = np.array([np.log(10) if n == "log_std" or n.startswith("log_band") else 0.0 for n in WINDOW_FEATURES])
    np.testing.assert_allclose(step, np.tile(wanted, (3, 1)), atol=1e-9)


def test_a_tone_moves_no_median_level_and_impacts_move_all() -> None:
    """Such a tone, stronger without load, is what would make a healthy recording of CWRU alarm."""
    rng = np.random.default_rng(5)
    x = rng.standard_normal((20, 1024))
    tone = 0.7 * np.sin(2 * np.pi * 4145 / 12_000 * np.arange(1024))
    broad = 1.5 * rng.standard_normal(x.shape)
    band = WINDOW_FEATURES.index("log_band_5")
    by_mean, by_median = (
        [(window_features(x + more, level) - window_features(x, level))[:, band].mean() for more in (tone, broad)]
        for level in (np.mean, np.median)
    )
    assert by_mean[0] > 0.5 and abs(by_median[0]) < 0.1
    assert by_median[1] == pytest.approx(by_mean[1], abs=0.1)
