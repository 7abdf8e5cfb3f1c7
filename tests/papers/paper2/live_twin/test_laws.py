"""Clearance and damping against temperature: the laws' own fixed points and hand computations."""

from __future__ import annotations

import pytest

from papers.paper2_digital_twin.live_twin.laws import Laws
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError


def test_walther_goes_through_both_points_of_the_data_sheet_and_falls_between() -> None:
    law = Laws(nu40=68.0, nu100=8.7)
    assert law.viscosity(40.0) == pytest.approx(68.0) and law.viscosity(100.0) == pytest.approx(8.7)
    values = [law.viscosity(t) for t in (-60, -30, 0, 20, 40, 70, 100, 150, 200, 500)]
    assert values[0] == values[1] and values[-1] == values[-2]
    assert values[1:-1] == sorted(values[1:-1], reverse=True)


def test_walther_by_another_oil_tables_value() -> None:
    """An ISO VG 68 mineral oil of index 95 to 100 has some 20 mm^2/s at 70 deg C in makers' charts."""
    assert Laws(nu40=68.0, nu100=8.7).viscosity(70.0) == pytest.approx(20.0, rel=0.05)


def test_damping_follows_the_film_alone() -> None:
    law = Laws(film=0.25)
    assert law.damping_factor(40.0) == pytest.approx(1.0)
    assert law.damping_factor(100.0) == pytest.approx(0.75 + 0.25 * 5.4 / 32.0)
    assert Laws(film=0.0, reference_c=20.0).damping_factor(90.0) == 1.0


def test_clearance_shrinks_by_the_catalogues_rule() -> None:
    """10 K between the rings: 0.012 um per K and mm of mean diameter, both sides of the shaft together."""
    bearing = BEARINGS["6205"]
    change = Laws(excess=0.25).clearance_change_um(bearing, 80.0)
    assert change == pytest.approx(-0.012 * 10 * bearing.pitch_diameter_mm / 2)


@pytest.mark.parametrize("wrong", [{"nu40": 5.0}, {"film": 1.5}, {"nu100": -1.0}])
def test_impossible_oils_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(TwingapError, match="damping law"):
        Laws(**wrong)
