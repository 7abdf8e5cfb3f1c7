"""Paper 2's dynamics study: settles where the static solution is, faults strike on time, resumable, honest tables."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from papers.framework import Work
from papers.paper2_digital_twin.dynamics import reference
from papers.paper2_digital_twin.dynamics.jobs import Case, settle, settled_at, strike
from papers.paper2_digital_twin.dynamics.study import STUDY
from twingap.bearing import BEARINGS
from twingap.errors import TwingapError
from twingap.twins.contact_dynamics import settle as at_rest
from twingap.twins.contact_dynamics import statics
from twingap.twins.contact_parameters import ContactParameters

TINY = """
[profiles.tiny]
speeds_rpm = [1797.0]
loads_n = [500.0]
clearances_um = [5.0]
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "dynamics.toml"
    text = re.sub(r"(?m)^settings = .*$", 'settings = ["physical"]', STUDY.config.read_text(encoding="utf-8"))
    text = re.sub(r"(?m)^reference_s = .*$", "reference_s = 0.005", text)
    path.write_text(text + TINY, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out")


@pytest.fixture(scope="module")
def study(config: Path, folder: Path) -> Work:
    return STUDY.run("tiny", out=folder, backend="sequential", config=config)


def test_a_normal_bearing_settles_where_the_root_finder_says(study: Work) -> None:
    (row,) = study.tables["dynamics-balance"].to_dict("records")
    assert row["y mean um"] == pytest.approx(row["y static um"], rel=2e-3)
    assert abs(row["x mean um"] - row["x static um"]) < 0.01 * row["y static um"]
    assert row["settled s"] < 0.03 and row["furthest from static %"] < 1
    assert row["energy residual %"] < 1 and row["displacement apart %"] < 0.2 and row["velocity apart %"] < 0.2


@pytest.mark.parametrize(
    ("off", "settled"),
    [
        ([0, 0, 0, 0, 0, 0], 0.0),
        ([9, 0, 0, 0, 0, 0], 1.0),
        ([9, 0, 9, 0, 0, 0], 3.0),
        ([9, 0, 0, 9, 0, 0], None),
        ([9, 0, 0, 0, 9, 0], None),  # only the very last point lies inside
        ([0, 0, 0, 0, 0, 9], None),
    ],
)
def test_settled_is_inside_for_the_whole_judged_part(off: list[float], settled: float | None) -> None:
    assert settled_at(np.arange(6.0), np.array(off, dtype=float), 2.0, 3.0) == settled


def test_a_ring_that_is_off_in_the_judged_half_has_not_settled() -> None:
    """At 6000 rpm rollers pass too fast for a ring with 15 um of clearance; its last point happens to lie inside."""
    options = dataclasses.replace(STUDY.read(), reference_s=0.002, settled_part=0.5, within=0.02)
    found = settle(Case("physical", "healthy", 6000.0, 500.0, 15.0, 0.12), options)
    assert found["most_off_percent"] > 4 and found["settled_s"] is None


def test_every_fault_strikes_on_time(study: Work) -> None:
    found = study.tables["dynamics-faults"]
    assert list(found["fault"]) == ["inner", "outer", "ball"] and found["on time"].all()
    assert (found["rms over healthy"] > 10).all()
    assert found.set_index("fault").loc["outer", "strongest order"] == pytest.approx(BEARINGS["6205"].bpfo, rel=0.01)


def test_a_line_elsewhere_is_not_called_on_time() -> None:
    """Half the speed and the same records: nothing is where it is expected."""
    value = strike(Case("physical", "outer", 1797.0, 500.0, 5.0, 0.8), STUDY.read())
    off = np.abs(value["order"] - 0.7 * value["expected"])
    assert value["lines"][off < 0.1].max() < 0.1 * value["lines"].max()


@pytest.mark.parametrize("cage", [0.0, 0.013, 0.05])
def test_two_static_solutions_agree(cage: float) -> None:
    """Newton on the energy (the twin's own) and Powell's method on the forces."""
    own = ContactParameters(load_x_n=50.0)
    xy, _, _ = at_rest(9, statics(own, 500.0), np.array([cage]))
    np.testing.assert_allclose(reference.rest(BEARINGS["6205"], own, 500.0, cage), xy[0], rtol=1e-7, atol=1e-13)


def test_taken_up_again_with_the_same_tables(study: Work, folder: Path, config: Path) -> None:
    before = {p.name: p.read_bytes() for p in (folder / "tables").iterdir()}
    assert len(before) == 4
    assert {p.stem for p in (folder / "figures").iterdir()} == {
        f"dynamics-{name}-physical" for name in ("normal", "reference", "faults")
    }
    again = STUDY.run("tiny", out=folder, backend="sequential", config=config, draw=False)
    assert again.finished == 4 and not again.computed
    assert {p.name: p.read_bytes() for p in (folder / "tables").iterdir()} == before


def test_a_fault_without_a_model_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "dynamics.toml"
    path.write_text(STUDY.config.read_text(encoding="utf-8").replace('"ball"]', '"cage"]'), encoding="utf-8")
    with pytest.raises(TwingapError, match="faults: 'cage' found, one of"):
        STUDY.read(path)
