"""What is asked of both parts of the records, and what must not be."""

import numpy as np
import pytest

from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.gap.features.comparison import feature_names
from twingap.gap.features.pooled import features as pooled
from twingap.gap.features.pooled.features import PooledRecords
from twingap.gap.features.spectrum.record_summary import summarise
from twingap.gap.search.evidence import Evidence, simulator_of
from twingap.identification.calibrate import calibrate
from twingap.records import Condition, Record, RecordSet
from twingap.signal.record_transforms import Frame, RecordTransforms
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec

BEARING = BEARINGS["6205"]
CONDITIONS = tuple(
    Condition(f"{fault}-{i}", 1200.0 + 130 * i, 12000.0, 12000, fault, group=f"{fault}-{i}")
    for fault in ("healthy", "outer") for i in range(6)
)  # fmt: skip
OF_WHOLE = slice(
    feature_names().index(pooled.feature_names()[0]), -len([n for n in feature_names() if n[:8] == "context|"])
)
SECOND = make_effect("entry_exit", {"arc_deg": 4.0, "exit_ratio": 0.7})


def records(*effects, seed=0):
    parameters = PhenomenologicalParameters(2500.0, 0.05, impact_amplitude={"outer": 10.0})
    return list(PhenomenologicalTwin(BEARING, parameters, effects).simulate(CONDITIONS, np.random.default_rng(seed)))


@pytest.fixture(scope="module")
def calibrated():
    machine = RecordSet.from_records("m", "g", BEARING, (Record(r.condition, r.samples) for r in records(SECOND)))
    return calibrate(machine, TwinSpec("phenomenological"), np.random.default_rng(1))


def evidence_of(calibrated):
    return Evidence(calibrated, simulator_of(calibrated), TwinSpec("phenomenological"), 7)


def named(values):
    return dict(zip(feature_names(), values, strict=True))


def test_features_do_not_depend_on_which_part_was_asked_first(calibrated):
    one, other = evidence_of(calibrated).against(), evidence_of(calibrated).against()
    held_out, fit = one.held_out, one.fit
    np.testing.assert_array_equal(fit, other.fit)
    np.testing.assert_array_equal(held_out, other.held_out)


def test_a_comb_is_asked_of_both_parts_but_its_values_of_the_fit_part(calibrated):
    evidence = evidence_of(calibrated)
    compared = evidence.against()
    both, fit = named(compared.held_out), named(compared.fit)
    simulated = [
        PooledRecords(
            tuple(
                summarise(RecordTransforms(r.samples, r.condition, evidence.frame)) for r in compared._simulated(part)
            )
        )
        for part in (0, 1)
    ]
    together = evidence.pool(*(part.summaries for part in simulated))
    expected = dict(
        zip(
            pooled.feature_names(),
            pooled.compare(evidence.pooled, together, pooled.levels(evidence.pooled, together)),
            strict=True,
        )
    )
    of_fit_part = evidence.fit.pooled
    of_fit = dict(
        zip(
            pooled.feature_names(),
            pooled.compare(of_fit_part, simulated[0], pooled.levels(of_fit_part, simulated[0])),
            strict=True,
        )
    )
    for name in expected:
        assert both[name] == pytest.approx(expected[name], nan_ok=True)
        if not name.startswith("trend|"):
            assert fit[name] == pytest.approx(of_fit[name], nan_ok=True)
    assert both["comb|clear_known"] >= fit["comb|clear_known"]
    assert np.exp(both["comb|clear_arc_log"]) == pytest.approx(4.0, rel=0.03)


def test_slopes_are_of_both_parts_whoever_asks(calibrated):
    compared = evidence_of(calibrated).against()
    fit, held_out = named(compared.fit), named(compared.held_out)
    trends = [name for name in pooled.feature_names() if name.startswith("trend|")]
    assert trends
    for name in trends:
        assert fit[name] == pytest.approx(held_out[name], nan_ok=True)


def test_what_is_held_out_does_not_say_which_values_to_start_from(calibrated):
    """Other records in the held-out part, loud with a hum: the fit part's lines and combs stay as they were."""
    from dataclasses import replace

    hum = {r.condition.name: r.samples for r in records(SECOND, make_effect("mains_interference", {"level": 2.0}))}
    part = calibrated.held_out
    louder = RecordSet.from_records(
        "h",
        part.unit,
        BEARING,
        (
            Record(c, hum[c.name] * r.samples.std() / hum[c.name].std())
            for c, r in zip(part.conditions, part, strict=True)
        ),
    )
    before, after = (named(evidence_of(of).against().fit) for of in (calibrated, replace(calibrated, held_out=louder)))
    for name in pooled.feature_names():
        if not name.startswith("trend|"):
            assert after[name] == pytest.approx(before[name], nan_ok=True), name


def test_levels_are_paired_by_name():
    frame = Frame(BEARING, (1800.0, 3200.0), 1.0)
    ours, theirs = (
        PooledRecords(tuple(summarise(RecordTransforms(r.samples, r.condition, frame)) for r in records(seed=seed)))
        for seed in (1, 2)
    )
    shuffled = PooledRecords(
        tuple(theirs.summaries[i] for i in np.random.default_rng(0).permutation(len(theirs.summaries))[:9])
    )
    paired = pooled.levels(ours, shuffled)
    assert len(paired.conditions) == 9
    straight = pooled.levels(ours, theirs)
    by_name = {
        c.name: (m, s) for c, m, s in zip(straight.conditions, straight.measured, straight.simulated, strict=True)
    }
    for c, m, s in zip(paired.conditions, paired.measured, paired.simulated, strict=True):
        assert (m, s) == by_name[c.name]
