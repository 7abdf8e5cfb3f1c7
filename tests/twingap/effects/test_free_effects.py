"""Effects that are measured from spectra: a free path, lines, background; and the three that go with them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kurtosis

from twingap import BEARINGS, Condition, TwingapError
from twingap.config import read_toml, to_toml
from twingap.effects import Effect, make_effect
from twingap.effects.by_state import ByState, State, by_state, of_state
from twingap.effects.line_spectrum import LineSpectrum
from twingap.effects.transfer_path import minimum_phase, scattered_delays
from twingap.signal import power_spectral_density
from twingap.streams import Streams
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

BEARING = BEARINGS["6205"]
FS = 12000.0
QUIET = PhenomenologicalParameters(structure_noise_rms=1e-6, white_noise_rms=1.0)


def record(effects: tuple[Effect, ...], fault: str = "healthy", n: int = 60000, own=None) -> np.ndarray:
    twin = PhenomenologicalTwin(BEARING, own or PhenomenologicalParameters(), effects)
    return twin.make([Condition("a", 1500.0, FS, n, fault)], [Streams(3, 0)])[0].samples


def levels_db(x: np.ndarray, places: list[float]) -> np.ndarray:
    found = power_spectral_density(x, FS, segment_samples=1024)
    return 10 * np.log10(np.interp(places, found.frequency, found.values))


def test_path_has_the_gains_that_are_stated() -> None:
    """Impacts alone, with next to no noise: the gain in dB between the places is a straight line."""
    own = PhenomenologicalParameters(structure_noise_rms=1e-9, white_noise_rms=1e-6)
    path = make_effect("transfer_path", {"frequencies_hz": (1000.0, 3000.0, 5000.0), "gains_db": (6.0, -6.0, 6.0)})
    places = [1000.0, 2000.0, 3000.0, 4000.0, 5000.0]
    gained = levels_db(record((path,), "outer", own=own), places) - levels_db(record((), "outer", own=own), places)
    np.testing.assert_allclose(gained, [6.0, 0.0, -6.0, 0.0, 6.0], atol=0.7)


def test_path_is_causal_and_of_least_delay() -> None:
    """Its response begins at once, and its energy comes no later than that of any filter with the same gain."""
    places, gains = (500.0, 2000.0, 4000.0), (0.0, 15.0, -10.0)
    response = minimum_phase(4096, FS, places, gains)
    h = np.fft.irfft(response)
    np.testing.assert_allclose(20 * np.log10(np.abs(response)), np.interp(np.fft.rfftfreq(4096, 1 / FS), places, gains),
                               atol=0.05)  # fmt: skip
    assert np.sum(h[2048:] ** 2) < 1e-4 * np.sum(h**2)
    early = np.cumsum(h**2)
    other = np.fft.irfft(np.abs(response) * np.exp(-2j * np.pi * np.fft.rfftfreq(4096) * 5))
    assert (early[:64] >= np.cumsum(other**2)[:64] - 1e-9).all()


def test_spread_delays_keep_the_gain_and_spread_an_impact() -> None:
    """Of gain 1 at all frequencies, causal, over within the spread; the longer, the lower the peak."""
    n, peaks = 4096, []
    for spread_s in (0.0005, 0.002, 0.004):
        response = scattered_delays(n, FS, spread_s)
        np.testing.assert_allclose(np.abs(response), 1.0, atol=1e-12)
        h = np.fft.irfft(response)
        last = round(1.3 * spread_s * FS) + 16
        assert np.sum(h[:last] ** 2) + np.sum(h[-16:] ** 2) > 0.93
        peaks.append(np.abs(h).max())
    assert peaks[0] > 0.85 and peaks[1] < 0.7 and peaks[2] < 0.6


def test_a_path_with_spread_delays_has_less_kurtosis_and_the_same_spectrum() -> None:
    own = PhenomenologicalParameters(structure_noise_rms=1e-9, white_noise_rms=1e-6)
    values = {"frequencies_hz": (1000.0, 3000.0, 5000.0), "gains_db": (6.0, -6.0, 6.0)}
    plain, spread = (
        record((make_effect("transfer_path", values | {"delay_spread_s": s}),), "outer", own=own) for s in (0.0, 0.004)
    )
    places = [1000.0, 2000.0, 3000.0, 4000.0, 5000.0]
    np.testing.assert_allclose(levels_db(spread, places), levels_db(plain, places), atol=0.5)
    assert kurtosis(spread) < 0.6 * kurtosis(plain)


def test_path_may_turn_the_sign() -> None:
    plain, turned = (make_effect("transfer_path", {"inverted": sign}) for sign in (False, True))
    own = PhenomenologicalParameters(structure_noise_rms=1e-9, white_noise_rms=1e-9)
    np.testing.assert_allclose(record((plain,), "inner", own=own), -record((turned,), "inner", own=own), atol=1e-6)


def test_lines_stand_where_they_are_stated_at_any_speed() -> None:
    lines = make_effect(
        "line_spectrum",
        {"frequencies_hz": (730.0,), "amplitudes": (2.0,), "orders": (6.5,), "order_amplitudes": (1.0,)},
    )
    wobble = make_effect("speed_fluctuation", {"level": 0.004})
    for effects in ((lines,), (lines, wobble)):
        x = record(effects, own=QUIET)
        spectrum = 2 * np.abs(np.fft.rfft(x * np.hanning(x.size))) / (0.5 * x.size)
        hz = np.fft.rfftfreq(x.size, 1 / FS)
        at = [spectrum[np.abs(hz - place) < 1.0].max() for place in (730.0, 162.5)]
        assert at[0] == pytest.approx(2.0, rel=0.15)
        assert at[1] == pytest.approx(1.0, rel=0.2) or (len(effects) == 2 and at[1] < 0.9), "smeared with the speed"


def test_lines_of_a_drive_turn_with_the_shaft_about_its_carrier() -> None:
    about = LineSpectrum(
        frequencies_hz=(), amplitudes=(), orders=(), order_amplitudes=(), carriers_hz=(3000.0, 3000.0),
        carrier_orders=(-2.0, 3.0), carrier_amplitudes=(1.0, 2.0),
    )  # fmt: skip
    x = record((about,), own=QUIET)
    spectrum = 2 * np.abs(np.fft.rfft(x * np.hanning(x.size))) / (0.5 * x.size)
    hz = np.fft.rfftfreq(x.size, 1 / FS)
    at = [spectrum[np.abs(hz - place) < 1.0].max() for place in (2950.0, 3075.0, 3000.0)]
    assert at[:2] == pytest.approx([1.0, 2.0], rel=0.15) and at[2] < 0.1


def test_lines_above_half_the_rate_are_left_out() -> None:
    lines = LineSpectrum(frequencies_hz=(7000.0,), amplitudes=(5.0,), orders=(400.0,), order_amplitudes=(5.0,))
    np.testing.assert_allclose(record((lines,)), record(()), atol=1e-9)


def test_level_of_lines_scatters_over_records() -> None:
    lines = LineSpectrum(scatter_db=6.0, frequencies_hz=(1000.0,), amplitudes=(1.0,), orders=(), order_amplitudes=())
    twin = PhenomenologicalTwin(BEARING, PhenomenologicalParameters(white_noise_rms=1e-6), (lines,))
    conditions = [Condition(f"r{i}", 1500.0, FS, 1200, "healthy") for i in range(200)]
    made = [r.samples for r in twin.simulate(conditions, np.random.default_rng(0))]
    heights = [20 * np.log10(np.abs(np.fft.rfft(x))[100]) for x in made]
    assert np.std(heights) == pytest.approx(6.0, rel=0.35)


def test_background_has_its_density_and_replaces_the_twins_own() -> None:
    places = [500.0, 2000.0, 4000.0]
    densities = (-30.0, -40.0, -60.0)
    noise = make_effect(
        "background_spectrum", {"replaced": 1.0, "frequencies_hz": tuple(places), "densities_db": densities}
    )
    reference = PhenomenologicalTwin(BEARING).reference_rms
    found = levels_db(record((noise,), n=240000), places) - 20 * np.log10(reference)
    np.testing.assert_allclose(found, densities, atol=1.5)
    added = make_effect("background_spectrum", {"frequencies_hz": tuple(places), "densities_db": densities})
    both = np.mean(np.square(record((added,), n=240000)))
    assert both == pytest.approx(
        np.mean(np.square(record(()))) + np.mean(np.square(record((noise,), n=240000))), rel=0.1
    )


def test_burst_keeps_the_energy_and_spoils_the_repetition() -> None:
    own = PhenomenologicalParameters(structure_noise_rms=1e-9, white_noise_rms=1e-6)
    plain, burst = (record(e, "outer", own=own) for e in ((), (make_effect("impulsive_share", {"share": 0.9}),)))
    assert np.mean(burst**2) == pytest.approx(np.mean(plain**2), rel=0.15)
    period = round(FS / (BEARING.bpfo * 25.0))
    alike = [np.corrcoef(x[:-period], x[period:])[0, 1] for x in (plain, burst)]
    assert alike[1] < alike[0] - 0.1


def test_ball_meets_one_race_less_hard() -> None:
    own = PhenomenologicalParameters(structure_noise_rms=1e-9, white_noise_rms=1e-6)
    x = record((make_effect("ball_contact", {"depth": 1.0}),), "ball", own=own)
    power = np.abs(np.fft.rfft(x**2 - np.mean(x**2))) ** 2
    hz = np.fft.rfftfreq(x.size, 1 / FS)
    spin = BEARING.fault_order("ball") / 2 * 25.0
    assert power[np.abs(hz - spin) < 0.5].max() > 0.3 * power[np.abs(hz - 2 * spin) < 0.5].max()
    np.testing.assert_array_equal(record((make_effect("ball_contact"),), "inner"), record((), "inner"))


def test_converter_repeats_samples() -> None:
    x = record((make_effect("sample_hold", {"repeats": 3}),))
    same = x[1:] == x[:-1]
    assert np.mean(same) == pytest.approx(2 / 3, abs=0.001)
    assert set(np.unique(x)) <= set(record(()))


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("transfer_path", {"frequencies_hz": (1.0, 2.0), "gains_db": (0.0,)}, "2 frequencies and 1 gains_db"),
        ("transfer_path", {"frequencies_hz": (2.0, 1.0), "gains_db": (0.0, 0.0)}, "do not increase"),
        ("transfer_path", {"frequencies_hz": tuple(map(float, range(600))), "gains_db": (0.0,) * 600}, "at most 512"),
        ("transfer_path", {"gains_db": (0.0, 1e9, 0.0, 0.0, 0.0)}, "between -150 and 150"),
        ("line_spectrum", {"frequencies_hz": (50.0,)}, "1 lines and 2 amplitudes"),
        ("line_spectrum", {"amplitudes": "loud"}, "loud"),
        ("line_spectrum", {"carrier_orders": (2.0,), "carrier_amplitudes": (1.0,)}, "1 lines and 0 carriers"),
        ("background_spectrum", {"densities_db": (float("nan"),) * 4}, "densities_db"),
    ],
)
def test_lists_are_checked(name: str, values: dict, said: str) -> None:
    with pytest.raises(TwingapError, match=said):
        make_effect(name, values)


def test_values_of_a_fault_act_on_its_records_alone() -> None:
    both = make_effect("impact_scatter", {"sigma": 0.0, "outer": {"sigma": 0.8}})
    assert isinstance(both, ByState) and both.name == "impact_scatter"
    np.testing.assert_array_equal(
        record((both,), "inner"), record((make_effect("impact_scatter", {"sigma": 0.0}),), "inner")
    )
    np.testing.assert_array_equal(
        record((both,), "outer"), record((make_effect("impact_scatter", {"sigma": 0.8}),), "outer")
    )
    assert of_state(both, State("outer")) == make_effect("impact_scatter", {"sigma": 0.8})
    assert by_state(both.base, {State("inner"): both.base}) == both.base, "nothing differs"


def test_values_of_a_fault_survive_a_file(tmp_path) -> None:
    both = make_effect("load_zone", {"depth": 0.1, "inner": {"depth": 0.7}})
    (tmp_path / "a.toml").write_text(to_toml({"parameters": {"load_zone": both.parameter_values()}}), encoding="utf-8")
    assert make_effect("load_zone", read_toml(tmp_path / "a.toml")["parameters"]["load_zone"]) == both
    with pytest.raises(TwingapError, match=r"load_zone\.inner.*unknown key 'depht'"):
        make_effect("load_zone", {"inner": {"depht": 0.1}})


def test_values_of_a_unit_act_on_its_records_alone() -> None:
    both = make_effect("impact_scatter", {"sigma": 0.0, "outer": {"sigma": 0.3, "units": {"OR 21": {"sigma": 0.8}}}})

    def of_unit(effect: Effect, **extra: str) -> np.ndarray:
        condition = Condition("r", 1800.0, 12000.0, 6000, "outer", extra=extra)
        twin = PhenomenologicalTwin(BEARINGS["6205"], effects=(effect,))
        return twin.simulate([condition], np.random.default_rng(3))[0].samples

    for extra, sigma in (
        ({"bearing_id": "OR 21"}, 0.8),
        ({"unit": "OR 21"}, 0.8),
        ({"bearing_id": "OR 7"}, 0.3),
        ({}, 0.3),
    ):
        plain = make_effect("impact_scatter", {"sigma": sigma})
        np.testing.assert_array_equal(of_unit(both, **extra), of_unit(plain, **extra), err_msg=str(extra))


def test_values_of_a_unit_survive_a_file(tmp_path) -> None:
    path = {"frequencies_hz": [100.0, 900.0], "gains_db": [0.0, 3.0]}
    units = {"outer": {"gains_db": [1.0, 4.0], "units": {"OR 21": {"gains_db": [2.0, 5.0]}, "ä.b": {"depth": 0.5}}}}
    both = make_effect("transfer_path", {**path, **units, "ball": {"units": {"B7": {"inverted": True}}}})
    text = to_toml({"parameters": {"transfer_path": both.parameter_values()}})
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    assert make_effect("transfer_path", read_toml(tmp_path / "a.toml")["parameters"]["transfer_path"]) == both
    assert of_state(both, State("outer", "ä.b")).gains_db == (1.0, 4.0)
    assert of_state(both, State("ball", "B8")) == both.base
    for units, said in (
        ({"x": {"depht": 1}}, r"outer\.units\.x.*unknown key 'depht'"),
        ({"x": 3}, "table"),
        (3, "table"),
    ):
        with pytest.raises(TwingapError, match=said):
            make_effect("transfer_path", {"outer": {"units": units}})
