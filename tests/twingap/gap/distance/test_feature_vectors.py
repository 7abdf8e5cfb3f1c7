"""Feature vectors: finite on any record, and each kind of difference shows in the bin that is named after it."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.feature_vectors import FeatureVectors, measure_vectors
from twingap.gap.distance.grid import Grid
from twingap.records import Condition
from twingap.signal.record_transforms import Frame, RecordTransforms

Array = NDArray[np.float64]
BEARING = BEARINGS["6205"]
FRAME = Frame(BEARING, (2000.0, 4000.0), 1.0)


def condition(fs_hz: float = 12000.0, n: int = 12000, rpm: float = 1800.0) -> Condition:
    return Condition("r", rpm, fs_hz, n, "outer")


def vectors_of(*records: Array, at: Condition | None = None) -> FeatureVectors:
    at = at or condition(n=records[0].size)
    conditions = [replace(at, name=f"r{i}", group=None) for i in range(len(records))]
    grid = Grid.of(conditions, BEARING)
    return measure_vectors((RecordTransforms(x, c, FRAME) for x, c in zip(records, conditions, strict=True)), grid)


def changed(vectors: FeatureVectors, domain: DomainName, kind: str) -> tuple[Array, Array, Array]:
    """Second record less first, with the bins' bounds."""
    axis = vectors.axes[domain]
    own = np.array(axis.kind) == kind
    return (vectors.values[domain][1] - vectors.values[domain][0])[own], axis.lo[own], axis.hi[own]


@pytest.fixture(scope="module")
def noise() -> Array:
    return np.random.default_rng(1).standard_normal(12000)


@pytest.mark.parametrize("n", [64, 600, 12000, 120000])
@pytest.mark.parametrize("fs_hz", [2000.0, 51200.0])
def test_any_record_gives_finite_vectors_that_fit_their_bins(fs_hz: float, n: int) -> None:
    rng = np.random.default_rng(0)
    t = np.arange(n) / fs_hz
    noise = rng.standard_normal(n)
    half = np.where(np.arange(n) < n // 2, noise, 0.0)
    some = (
        noise, np.zeros(n), np.full(n, 3.0), np.sin(2 * np.pi * 100 * t), np.round(noise), half, 1e-9 * noise,
        1e6 * np.eye(1, n, 5)[0],
    )  # fmt: skip
    made = vectors_of(*some, at=condition(fs_hz, n))
    assert made.domains == get_args(DomainName)
    assert np.isfinite(made.matrix).all()
    for domain, values in made.values.items():
        axis = made.axes[domain]
        assert values.shape[1] == axis.lo.size == axis.hi.size == len(axis.kind)
        assert np.all(axis.hi >= axis.lo)
        assert axis.weight.sum() == pytest.approx(1)
        assert np.array_equal(made.matrix[:, made.columns(domain)], values)
    assert made.weight.sum() == pytest.approx(1)


def test_gain_moves_levels_by_its_logarithm_and_leaves_shapes_alone(noise: Array) -> None:
    made = vectors_of(noise, np.e * noise)
    difference = made.values["frequency"][1] - made.values["frequency"][0]
    levels = np.array(made.axes["frequency"].kind) == "level"
    assert difference[levels] == pytest.approx(2.0, abs=1e-6)
    assert difference[~levels] == pytest.approx(0.0, abs=1e-6)
    for domain in ("envelope_order", "order", "time"):
        assert made.values[domain][1] == pytest.approx(made.values[domain][0], abs=1e-6)
    assert changed(made, "amplitude", "level")[0] == pytest.approx(1.0)
    assert changed(made, "amplitude", "shape")[0] == pytest.approx(0.0, abs=1e-9)
    assert made.values["condition"][1, 0] - made.values["condition"][0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize("tone_hz", [50.0, 333.0, 2710.0])
def test_a_tone_is_in_its_bin_of_hz_and_of_orders(noise: Array, tone_hz: float) -> None:
    t = np.arange(noise.size) / 12000
    made = vectors_of(noise, noise + 0.3 * np.sin(2 * np.pi * tone_hz * t))
    for domain, place in (("frequency", tone_hz), ("order", tone_hz / 30)):
        by, lo, hi = changed(made, domain, "lines")  # type: ignore[arg-type]
        best = int(by.argmax())
        if place < hi[-1]:
            assert lo[best] <= place <= hi[best]
            assert by[best] > 2
            assert np.abs(np.delete(by, [best - 1, best, min(best + 1, by.size - 1)])).max() < 0.5
    assert np.abs(changed(made, "frequency", "level")[0]).max() < 0.15


def test_modulation_is_in_its_bin_of_envelope_orders(noise: Array) -> None:
    t = np.arange(noise.size) / 12000
    made = vectors_of(noise, noise * (1 + 0.8 * np.cos(2 * np.pi * BEARING.bpfo * 30 * t)))
    by, lo, hi = changed(made, "envelope_order", "lines")
    assert lo[by.argmax()] <= BEARING.bpfo <= hi[by.argmax()]
    assert by.max() > 2


def test_clipping_dropout_and_asymmetry_show_in_the_amplitudes(noise: Array) -> None:
    clipped = vectors_of(noise, np.clip(noise, -1.5, 1.5))
    assert changed(clipped, "amplitude", "extreme")[0][0] > 3
    by, *_ = changed(clipped, "amplitude", "shape")
    assert by[-1] < -0.5 < by[0]
    held = noise.copy()
    held[3000:3600] = held[3000]
    dropped = vectors_of(noise, held)
    assert changed(dropped, "amplitude", "repeated")[0][0] > 2
    assert changed(dropped, "time", "level")[0].min() < -0.3
    skewed = vectors_of(noise, np.where(noise > 0, 2 * noise, noise))
    assert changed(skewed, "amplitude", "asymmetry")[0][1:].min() > 0.3


def test_rates_and_lengths_may_differ_within_a_set() -> None:
    rng = np.random.default_rng(2)
    conditions = [Condition("a", 1500, 12000, 12000), Condition("b", 1800, 20000, 10000)]
    grid = Grid.of(conditions, BEARING)
    made = measure_vectors((RecordTransforms(rng.standard_normal(c.n_samples), c, FRAME) for c in conditions), grid)
    levels = made.values["frequency"][:, np.array(made.axes["frequency"].kind) == "level"]
    # White noise of unit power has density 2 / fs: log of its ratio between the rates.
    assert (levels[0] - levels[1]).mean() == pytest.approx(np.log(20 / 12), abs=0.05)
    assert grid.top_hz == 6000


def test_what_cannot_be_measured_is_refused() -> None:
    with pytest.raises(TwingapError, match="at least 64"):
        Grid.of([condition(n=20)], BEARING)
    with pytest.raises(TwingapError, match="no records"):
        Grid.of([], BEARING)
    with pytest.raises(TwingapError, match="no records"):
        measure_vectors([], Grid.of([condition()], BEARING))
