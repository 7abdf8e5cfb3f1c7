"""Population twins: drawn machines have the mean and the spread of the units."""

from __future__ import annotations

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.effects.by_state import State, of_state
from twingap.errors import TwingapError
from twingap.records import Condition
from twingap.twins.population import has_population, machines
from twingap.twins.simulate import simulate
from twingap.twins.twin_file import TwinSpec

PLACES = (500.0, 2000.0, 4500.0)
GAINS = {"a": (0.0, 4.0, -6.0), "b": (3.0, 1.0, 0.0), "c": (-3.0, 4.0, 0.0), "d": (1.0, 2.0, 8.0)}
SIGMAS = {"a": 0.1, "b": 0.2, "c": 0.3, "d": 0.4}
SPEC = TwinSpec(
    "phenomenological", ("impact_scatter", "transfer_path"), bearing=BEARINGS["6205"],
    parameters={
        "transfer_path": {
            "frequencies_hz": PLACES, "gains_db": (0.0, 0.0, 0.0),
            "outer": {"units": {unit: {"gains_db": gains} for unit, gains in GAINS.items()}},
        },
        "impact_scatter": {"outer": {"units": {unit: {"sigma": sigma} for unit, sigma in SIGMAS.items()}}},
    },
)  # fmt: skip


def drawn(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gains [machines, frequencies] and scatter [machines] of drawn machines."""
    gains, sigmas = [], []
    for _, own in machines(SPEC, count, np.random.default_rng(0)):
        path, scatter = (make_effect(name, own.parameters[name]) for name in ("transfer_path", "impact_scatter"))
        gains.append(of_state(path, State("outer")).gains_db)
        sigmas.append(of_state(scatter, State("outer")).sigma)
    return np.array(gains), np.array(sigmas)


def test_drawn_values_have_mean_and_covariance_of_the_units() -> None:
    gains, sigmas = drawn(4000)
    wanted = np.array(list(GAINS.values()))
    np.testing.assert_allclose(gains.mean(axis=0), wanted.mean(axis=0), atol=0.3)
    np.testing.assert_allclose(np.cov(gains.T), np.cov(wanted.T), atol=2.5)
    units = np.log(list(SIGMAS.values()))
    assert np.log(sigmas).mean() == pytest.approx(units.mean(), abs=0.05)
    assert np.log(sigmas).std() == pytest.approx(units.std(ddof=1), rel=0.1)


def test_values_of_one_unit_stay_together() -> None:
    """Scatter and the gain at the highest frequency are related over the units as over the machines."""
    gains, sigmas = drawn(4000)
    units = np.corrcoef(np.array(list(GAINS.values()))[:, 2], np.log(list(SIGMAS.values())))[0, 1]
    assert np.corrcoef(gains[:, 2], np.log(sigmas))[0, 1] == pytest.approx(units, abs=0.05)


def test_lines_are_those_of_one_unit() -> None:
    lines = {"a": ((100.0, 200.0), (0.1, 0.2)), "b": ((300.0,), (0.3,))}
    table = {unit: {"frequencies_hz": hz, "amplitudes": level} for unit, (hz, level) in lines.items()}
    spec = TwinSpec("phenomenological", ("line_spectrum",), parameters={"line_spectrum": {"ball": {"units": table}}})
    seen = set()
    for _, own in machines(spec, 20, np.random.default_rng(1)):
        one = of_state(make_effect("line_spectrum", own.parameters["line_spectrum"]), State("ball"))
        seen.add((one.frequencies_hz, one.amplitudes))
    assert seen == set(lines.values())


def test_each_machine_has_a_record_per_condition() -> None:
    conditions = [
        Condition(f"{fault}{i}", 1500.0 + i, 12000.0, 1200, fault, extra={"bearing_id": "a", "shift": "night"})
        for fault in ("healthy", "outer") for i in range(2)
    ]  # fmt: skip
    made = simulate(conditions, SPEC, seed=2, population=3)
    assert len(made) == 12 and len(set(made.groups)) == 12
    assert [c.extra["unit"] for c in made.conditions] == [f"machine{i}" for i in (1, 2, 3) for _ in range(4)]
    assert all("bearing_id" not in c.extra and c.extra["shift"] == "night" for c in made.conditions)
    again = simulate(conditions, SPEC, seed=2, population=3)
    assert all(np.array_equal(a.samples, b.samples) for a, b in zip(made, again, strict=True))
    assert not np.array_equal(made[2].samples, made[6].samples), "machines differ"


def test_a_twin_without_units_has_no_population() -> None:
    conditions = [Condition("a", 1500.0, 12000.0, 1200, "outer")]
    one = {"outer": {"units": {"a": {"sigma": 0.2}}}}
    for spec in (
        TwinSpec("phenomenological", bearing=BEARINGS["6205"]),
        TwinSpec("phenomenological", ("impact_scatter",), parameters={"impact_scatter": one}, bearing=BEARINGS["6205"]),
    ):
        assert has_population(SPEC) and not has_population(spec)
        with pytest.raises(TwingapError, match="no values of several units"):
            simulate(conditions, spec, population=2)
    with pytest.raises(TwingapError, match="0 machines asked for"):
        simulate(conditions, SPEC, population=0)
