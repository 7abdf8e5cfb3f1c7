"""From records to an identified twin: values, intervals, and what is said when something is missing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.identification import identify
from twingap.identification.figures import figure_of_fit, write_figure
from twingap.identification.intervals import Spread, clusters, jackknife
from twingap.records import Condition, Record, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec, build_twin, flat, nested

FREE = TwinSpec("phenomenological")
OWN = PhenomenologicalParameters()


def records(
    own: PhenomenologicalParameters = OWN,
    seed: int = 0,
    *,
    healthy: int = 4,
    faulty: int = 3,
    faults: tuple[str, ...] = ("inner",),
    fs_hz: float = 12000.0,
    samples: int = 12000,
    speed_error: float = 0.0,
    effects: tuple[str, ...] = (),
) -> RecordSet:
    """Simulated records; `speed_error` is how far the speed stated is from the one they were made at."""
    states = [("healthy", healthy), *((fault, faulty) for fault in faults)]
    conditions = [Condition(f"{f}{i}", 1797.0, fs_hz, samples, f) for f, count in states for i in range(count)]
    twin = build_twin(TwinSpec("phenomenological", effects), BEARINGS["6205"], "g")
    twin = PhenomenologicalTwin(BEARINGS["6205"], own, twin.effects, "g")
    made = twin.simulate(conditions, np.random.default_rng(seed))
    stated = [Record(replace(r.condition, speed_rpm=1797.0 / (1 + speed_error)), r.samples) for r in made]
    return RecordSet.from_records("made", "g", BEARINGS["6205"], stated)


def identified(of: RecordSet, spec: TwinSpec = FREE, **options: object):  # type: ignore[no-untyped-def]
    return identify(of, spec, seed=1, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("harmonic", [2.5, 4.5, 7.5])
def test_a_sharp_mode_between_two_lines_of_the_impacts(harmonic: float) -> None:
    """Hardly any of their energy is in the mode's own band then, and what is there is chance."""
    impact_hz = BEARINGS["6205"].bpfi * 1797.0 / 60
    own = PhenomenologicalParameters(harmonic * impact_hz, 0.012, {"inner": 2.0, "outer": 2.0}, 0.6, 0.8, 1.0)
    found = flat(identified(records(own, 5)).spec.parameters)
    assert found["impact_amplitude.inner"] == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize(
    ("own", "fs_hz", "samples"),
    [
        (PhenomenologicalParameters(scale=0.02), 12000.0, 12000),
        (PhenomenologicalParameters(6000.0, 0.03, {"inner": 4.0, "outer": 10.0}, 0.6, 0.8, 3.0), 25600.0, 25600),
        (PhenomenologicalParameters(3000.0, 0.01, {"inner": 2.0, "outer": 4.0}, 0.6, 0.8, 1.0), 48000.0, 24000),
    ],
)
def test_parameters_are_recovered(own: PhenomenologicalParameters, fs_hz: float, samples: int) -> None:
    found = identified(records(own, 3, faults=("inner", "outer"), fs_hz=fs_hz, samples=samples))
    got = flat(found.spec.parameters)
    assert got["resonance_hz"] == pytest.approx(own.resonance_hz, rel=0.01)
    assert got["damping_ratio"] == pytest.approx(own.damping_ratio, rel=0.25)
    assert got["scale"] == pytest.approx(own.scale, rel=0.06)
    assert got["structure_noise_rms"] == pytest.approx(own.structure_noise_rms, rel=0.08)
    assert got["white_noise_rms"] == pytest.approx(own.white_noise_rms, rel=0.08)
    for fault in ("inner", "outer"):
        assert got[f"impact_amplitude.{fault}"] == pytest.approx(own.impact_amplitude[fault], rel=0.2)
    # The convention that frees the parameters of one redundancy.
    assert got["structure_noise_rms"] ** 2 + got["white_noise_rms"] ** 2 == pytest.approx(1)
    assert found.spec.identified is not None and found.spec.identified.unit == "g"


@pytest.mark.parametrize("speed_error", [-0.03, 0.03])
def test_speeds_need_only_be_nominal(speed_error: float) -> None:
    own = PhenomenologicalParameters(3000.0, 0.01, {"inner": 6.0}, 0.6, 0.8)
    right = identified(records(own, 5)).estimates["impact_amplitude.inner"].value
    off = identified(records(own, 5, speed_error=speed_error)).estimates["impact_amplitude.inner"].value
    assert off == pytest.approx(right, rel=0.05)


def test_effects_that_the_twin_has_are_counted() -> None:
    """Two events a pass carry more energy than one: a twin that knows finds the amplitude, one that does not is off."""
    made, spec = records(seed=2, effects=("entry_exit",)), TwinSpec("phenomenological", ("entry_exit",))
    true = OWN.impact_amplitude["inner"]
    assert identified(made, spec).estimates["impact_amplitude.inner"].value == pytest.approx(true, rel=0.12)
    assert identified(made).estimates["impact_amplitude.inner"].value != pytest.approx(true, rel=0.12)


def test_what_is_fixed_is_kept_and_helps() -> None:
    spec = TwinSpec(
        "phenomenological", parameters={"resonance_hz": 3400.0, "scale": 2.0, "impact_amplitude": {"inner": 1.0}}
    )
    found = identified(records(), spec)
    assert set(found.estimates) == {"damping_ratio", "structure_noise_rms", "white_noise_rms"}
    got = flat(found.spec.parameters)
    assert got["resonance_hz"] == 3400.0 and got["impact_amplitude.inner"] == 1.0
    assert 2.0 * got["structure_noise_rms"] == pytest.approx(0.8, rel=0.05)
    everything = TwinSpec("phenomenological", parameters=found.spec.parameters)
    assert identified(records(), everything).estimates == {}


def test_two_records_give_wide_intervals() -> None:
    narrow = identified(records(healthy=8, faulty=8)).estimates
    wide = identified(records(healthy=2, faulty=2)).estimates
    for name, estimate in wide.items():
        assert estimate.interval is not None and narrow[name].interval is not None
    spans = [(w.interval[1] - w.interval[0]) / (narrow[n].interval[1] - narrow[n].interval[0]) for n, w in wide.items()]
    assert np.median(spans) > 1.5, "a quarter of the records: about twice as wide"


def test_one_record_of_each_is_cut_in_blocks_and_says_so() -> None:
    found = identified(records(healthy=1, faulty=1))
    assert found.estimates["resonance_hz"].interval is not None
    assert sum("one record of state" in note for note in found.notes) == 2


def test_healthy_records_alone() -> None:
    found = identified(records(faults=()))
    assert set(found.estimates) == {"resonance_hz", "damping_ratio", "structure_noise_rms", "white_noise_rms", "scale"}
    assert sum("keeps the default" in note for note in found.notes) == 4


def test_faulty_records_alone_are_read_between_their_lines() -> None:
    found = identified(records(healthy=0, faulty=5))
    assert any("no healthy record" in note for note in found.notes)
    assert found.estimates["resonance_hz"].value == pytest.approx(3400, rel=0.01)
    assert found.estimates["scale"].value == pytest.approx(1.0, rel=0.06)
    assert found.estimates["impact_amplitude.inner"].value == pytest.approx(8.0, rel=0.15)


def test_a_mode_that_only_faults_show() -> None:
    own = PhenomenologicalParameters(structure_noise_rms=0.01, white_noise_rms=1.0)
    found = identified(records(own, faults=("inner", "outer")))
    assert any("were estimated from the" in note and "faulty" in note for note in found.notes)
    assert found.estimates["resonance_hz"].value == pytest.approx(3400, rel=0.03)
    assert found.estimates["resonance_hz"].interval is None
    assert found.estimates["white_noise_rms"].interval is not None


def test_a_mode_below_noise_in_a_band_is_where_defects_ring() -> None:
    """Healthy spectra are highest in the band; what defects add is nowhere but in the mode."""
    own, made = PhenomenologicalParameters(resonance_hz=3400.0, structure_noise_rms=0.4, white_noise_rms=0.9), []
    for record in records(own, faults=("inner", "outer"), seed=3):
        rng = np.random.default_rng(len(made))
        sides = butter(4, (1300.0, 2100.0), "bandpass", fs=record.condition.fs_hz, output="sos")
        noise = sosfilt(sides, rng.standard_normal(record.samples.size))
        made.append(Record(record.condition, record.samples + 1.5 * own.scale * noise / noise.std()))
    found = identified(RecordSet.from_records("made", "g", BEARINGS["6205"], made))
    assert found.estimates["resonance_hz"].value == pytest.approx(3400, rel=0.03)
    assert found.estimates["damping_ratio"].value == pytest.approx(own.damping_ratio, rel=0.3)
    assert any("difference of faulty and healthy spectra" in note for note in found.notes)


def test_no_mode_at_all_keeps_the_defaults() -> None:
    own = PhenomenologicalParameters(impact_amplitude={"inner": 0.0}, structure_noise_rms=0.01, white_noise_rms=1.0)
    found = identified(records(own))
    assert "resonance_hz" not in found.estimates
    assert any("keep their defaults" in note for note in found.notes)
    assert any("do not stand out" in note for note in found.notes)


def test_a_fault_too_weak_to_see_has_zero_in_its_interval() -> None:
    own = PhenomenologicalParameters(impact_amplitude={"inner": 0.0})
    found = identified(records(own)).estimates["impact_amplitude.inner"]
    assert found.interval is not None and found.interval[0] == 0.0 < found.interval[1]


def test_a_sharp_mode_in_short_records_is_no_line_with_an_interval() -> None:
    own = PhenomenologicalParameters(resonance_hz=1500.0, damping_ratio=0.004)
    for seed in range(3):
        found = identified(records(own, seed, healthy=20, faulty=0, fs_hz=25600.0, samples=1100))
        damping = found.estimates["damping_ratio"]
        held = damping.interval is None or damping.interval[0] <= 0.004 <= damping.interval[1]
        assert held, damping
        assert damping.interval is not None or any(
            "do not separate a sharp mode from a line" in note for note in found.notes
        )


def test_unlabelled_records_are_better_than_none() -> None:
    found = identified(records(faults=()).without_labels())
    assert found.estimates["resonance_hz"].value == pytest.approx(3400, rel=0.01)
    assert any("no healthy record" in note for note in found.notes)


def test_equation_8_gives_values_without_intervals() -> None:
    found = identified(records(healthy=8), method="eq8")
    assert all(estimate.interval is None for estimate in found.estimates.values())
    assert found.estimates["resonance_hz"].value == pytest.approx(3400, rel=0.03)
    assert found.estimates["damping_ratio"].value == pytest.approx(0.05, rel=0.4)


def test_the_same_records_give_the_same_twin() -> None:
    assert identified(records()).spec == identified(records()).spec


@pytest.mark.parametrize(
    ("options", "says"),
    [({"method": "guess"}, "method 'guess'"), ({"level": 0.2}, "level = 0.2"), ({"level": 1.0}, "level = 1")],
)
def test_options_that_mean_nothing(options: dict[str, object], says: str) -> None:
    with pytest.raises(TwingapError, match=says):
        identified(records(faults=()), **options)


def test_too_short_a_single_record() -> None:
    with pytest.raises(TwingapError, match="200 samples are too few"):
        identified(records(healthy=1, faults=(), samples=200))


def test_figure_shows_every_state(tmp_path: Path) -> None:
    found = identified(records(faults=("inner", "outer")))
    figure = figure_of_fit(found.fits)
    assert [axis.get_title() for axis in figure.axes] == [fit.title for fit in found.fits]
    assert len(found.fits) == 3
    write_figure(tmp_path / "a.png", found.fits)
    write_figure(tmp_path / "b.png", found.fits)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_jackknife_of_a_mean_is_the_t_interval() -> None:
    x = np.random.default_rng(0).standard_normal(9)
    spread = jackknife(lambda keep: np.array([x[keep].mean()]), np.arange(9))
    assert spread.variance[0] == pytest.approx(x.var(ddof=1) / 9)
    lo, hi = spread.interval(np.array([x.mean()]), 0.9)[0]
    assert hi - lo == pytest.approx(2 * 1.8595480375 * x.std(ddof=1) / 3)


def test_spreads_add_as_satterthwaite_says() -> None:
    one, two = Spread(np.array([1.0]), np.array([4.0])), Spread(np.array([3.0]), np.array([6.0]))
    both = one + two
    assert both.variance[0] == 4 and both.freedom[0] == pytest.approx(16 / (1 / 4 + 9 / 6))


def test_groups_are_left_out_whole() -> None:
    assert list(clusters(["a", "a", "b", "a"])) == [0, 0, 1, 0]
    assert list(clusters(["a", "a", "a"])) == [0, 1, 2]
    many = clusters([f"g{i // 2}" for i in range(60)])
    assert len(set(many)) == 12 and (many[::2] == many[1::2]).all()


def test_without_healthy_records_the_harmonics_of_the_defects_are_no_noise() -> None:
    """A second's spectrum is one average: what stood a few times above its floor was taken for noise, 13 % of it."""
    made = records(healthy=0, faulty=5, faults=("inner", "outer", "ball"), seed=3)
    found = identified(made).estimates
    white = found["white_noise_rms"].value * found["scale"].value
    assert white == pytest.approx(OWN.white_noise_rms * OWN.scale, rel=0.03)
    assert found["scale"].value == pytest.approx(OWN.scale, rel=0.03)


def test_of_a_twin_whose_effects_colour_the_spectrum_no_interval_is_given() -> None:
    spec = TwinSpec("phenomenological", ("sensor_rolloff",))
    found = identified(records(effects=("sensor_rolloff",)), spec)
    assert any("has it twice" in note for note in found.notes)
    assert found.estimates and all(e.interval is None for e in found.estimates.values())


def test_an_identified_twin_keeps_where_its_values_come_from_and_follows_the_unit() -> None:
    made = records()
    spec = identified(made).spec
    in_m_s2 = RecordSet.from_records(
        "other", "m/s^2", made.bearing, [replace(r, samples=9.80665 * r.samples) for r in made]
    )
    again = identified(in_m_s2, spec)
    assert not again.estimates and any("the twin is unchanged" in note for note in again.notes)
    assert again.spec.parameters["scale"] == pytest.approx(9.80665 * spec.parameters["scale"])
    assert spec.identified is not None and again.spec.identified == replace(spec.identified, unit="m/s^2")
    assert again.spec.intervals.keys() == spec.intervals.keys()


def test_intervals_hold_their_values_in_any_unit() -> None:
    made = records()
    tiny = RecordSet.from_records("tiny", "g", made.bearing, [replace(r, samples=1e-14 * r.samples) for r in made])
    for name, estimate in identified(tiny).estimates.items():
        assert estimate.interval is not None, name
        assert estimate.interval[0] <= estimate.value <= estimate.interval[1], name


def test_a_speed_that_may_be_of_another_column_is_said() -> None:
    made = records()
    slow = [replace(r, condition=replace(r.condition, speed_rpm=29.95)) for r in made]
    notes = identified(RecordSet.from_records("slow", "g", made.bearing, slow)).notes
    assert any("speed_rpm is as low as 29.95" in note for note in notes)


def test_scale_does_not_follow_from_a_noise_that_is_not_there() -> None:
    rng = np.random.default_rng(0)
    faults = ("healthy", "healthy", "inner", "inner")
    white = [
        Record(Condition(f"r{i}", 1750.0, 12000.0, 6000, fault), rng.standard_normal(6000))
        for i, fault in enumerate(faults)
    ]
    of = RecordSet.from_records("white", "g", BEARINGS["6205"], white)
    with pytest.raises(TwingapError, match="no structure noise, from which scale would follow"):
        identified(of, TwinSpec("phenomenological", parameters={"structure_noise_rms": 0.8}))
    assert identified(of, TwinSpec("phenomenological", parameters={"white_noise_rms": 0.8})).estimates


def test_a_record_in_another_unit_is_said() -> None:
    given = list(records())
    given[0] = Record(given[0].condition, 1e6 * given[0].samples)
    found = identified(RecordSet.from_records("made", "g", BEARINGS["6205"], given))
    assert any("record 'healthy0'" in note and "check their units" in note for note in found.notes)
    low, high = found.estimates["resonance_hz"].interval or (0.0, 6000.0)
    assert 0 <= low <= high <= 6000
    assert not any("check their units" in note for note in identified(records()).notes)


def test_what_was_identified_before_keeps_its_interval() -> None:
    first = identified(records(faults=("inner", "outer"))).spec
    left = {k: v for k, v in flat(first.parameters).items() if k != "impact_amplitude.inner"}
    again = identified(records(seed=1), replace(first, parameters=nested(left)))
    assert set(again.spec.intervals) == set(first.intervals)
    assert again.spec.intervals["scale"] == first.intervals["scale"]
    assert again.spec.intervals["impact_amplitude.inner"] != first.intervals["impact_amplitude.inner"]
    assert first.identified is not None
    assert any("as identified before" in n and first.identified.records_sha256[:12] in n for n in again.notes)
