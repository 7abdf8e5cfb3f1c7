"""Noise without a healthy record: found again under impacts whose spacing is not even."""

import numpy as np
import pytest

from twingap.bearing import Bearing
from twingap.effects import make_effect
from twingap.identification import identify
from twingap.identification.noise_share import _Mixture, noise_share
from twingap.identification.phenomenological import quick_identify
from twingap.identification.resonance import HealthyFit
from twingap.records import Condition
from twingap.streams import Streams
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec, flat

BEARING = Bearing("6205", 9, 7.94, 39.04, 0.0)
CONDITIONS = [
    Condition(f"{fault}{i}", 1500.0 + 100 * i, 12_000.0, 12_000, fault)
    for fault in ("inner", "outer", "ball")
    for i in range(3)
]
TRUTH = PhenomenologicalParameters(3000.0, 0.05, {"inner": 6.0, "outer": 8.0, "ball": 5.0}, 0.9, 0.436, 2.0)


def found(effects=()):
    records = PhenomenologicalTwin(BEARING, TRUTH, effects).simulate(CONDITIONS, np.random.default_rng(0))
    spec, notes = quick_identify(TwinSpec("phenomenological", bearing=BEARING), records, np.random.default_rng(1))
    return flat(spec.parameters), notes


@pytest.mark.parametrize("sigma", [0.0, 0.002, 0.03])
def test_noise_and_impacts_are_told_apart_by_time(sigma):
    """Impacts that walk leave no lines high up: between the lines they would all be noise."""
    jitter = (make_effect("slip_jitter", {"sigma": sigma, "accumulating": True}),) if sigma else ()
    values, notes = found(jitter)
    assert values["resonance_hz"] == pytest.approx(3000.0, rel=0.02)
    # Jitter that the twin does not have is in the spectra between lines: at 3 %, 8 % of the damping.
    assert values["damping_ratio"] == pytest.approx(0.05, rel=0.15 if sigma == 0.03 else 0.06)
    assert values["scale"] == pytest.approx(2.0, rel=0.05)
    for fault, amplitude in (("inner", 6.0), ("outer", 8.0), ("ball", 5.0)):
        assert values[f"impact_amplitude.{fault}"] == pytest.approx(amplitude, rel=0.15)
    assert any("no healthy record" in note for note in notes)


def test_a_hum_is_no_mode():
    """Its lines are the strongest, and lie elsewhere than what the impacts ring in."""
    hum = make_effect("mains_interference", {"level": 3.0, "decay": 0.5, "n_harmonics": 3})
    values, _ = found((hum,))
    assert values["resonance_hz"] == pytest.approx(3000.0, rel=0.03)
    assert values["scale"] == pytest.approx(2.0, rel=0.15)


def test_noise_told_from_impacts_by_time_has_no_interval():
    """How far that may be off nobody has measured: no interval rather than one that leaves it out."""
    walk = make_effect("slip_jitter", {"sigma": 0.03, "accumulating": True})
    records = PhenomenologicalTwin(BEARING, TRUTH, (walk,)).simulate(CONDITIONS, np.random.default_rng(0))
    outcome = identify(records, TwinSpec("phenomenological", bearing=BEARING), seed=1)
    known = {name for name, estimate in outcome.estimates.items() if estimate.interval is not None}
    assert known == {"resonance_hz", "damping_ratio"}
    assert any("identified as impacts by its variation over time" in note for note in outcome.notes)


@pytest.mark.parametrize("amplitude", [0.0, 2.0, 4.0])
def test_impacts_that_ring_into_each_other_are_told_by_what_pulses(amplitude, monkeypatch):
    """A mode of a quarter per cent rings on from impact to impact; what a fit took to be noise is put right."""
    own = PhenomenologicalParameters(
        3000.0, 0.0025, dict.fromkeys(("inner", "outer", "ball"), amplitude), 0.6, 0.3, 1.0
    )
    records = list(PhenomenologicalTwin(BEARING, own, ()).simulate(CONDITIONS, np.random.default_rng(0)))
    struck = np.mean([r.samples.var() for r in records]) - 0.3**2
    fit = HealthyFit(3000.0, 0.0025, float(np.sqrt(struck)), 0.3)
    twin = PhenomenologicalTwin(BEARING, own)
    mixtures = [_Mixture.of(twin, fit, r, Streams(3, k)) for k, r in enumerate(records)]
    pulses = [found for mixture in mixtures if (found := mixture.by_modulation()) is not None]
    assert len(pulses) >= 5
    assert np.median(pulses) == pytest.approx(0.36 / struck, rel=0.25)
    monkeypatch.setattr(_Mixture, "by_evenness", lambda self: None)
    assert noise_share(twin, fit, records, 3) == pytest.approx(min(0.36 / struck, 1.0), rel=0.25)
