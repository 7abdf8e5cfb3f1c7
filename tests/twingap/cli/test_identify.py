"""`twingap identify` as it is typed."""

from __future__ import annotations

import json
import os
import shutil
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.twingap.cli.typed import Run, refused
from twingap.bearing import BEARINGS
from twingap.cli import main
from twingap.identification import contact_bottom
from twingap.records import Condition
from twingap.records.folder import write_records
from twingap.twins.contact import ContactTwin
from twingap.twins.phenomenological import PhenomenologicalTwin
from twingap.twins.twin_file import TwinSpec, flat, read_twin, write_twin


@pytest.fixture
def twingap(typed: Run) -> Run:
    """Runs `twingap identify ...`."""
    return partial(typed, "identify")


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two healthy and two inner-race records, in a folder with a name that is not ASCII."""
    folder = tmp_path_factory.mktemp("sets") / "Prüfstand 7"
    conditions = [Condition(f"{f}{i}", 1797.0, 12000.0, 6000, f) for f in ("healthy", "inner") for i in range(2)]
    made = PhenomenologicalTwin(BEARINGS["6205"]).stream(conditions, np.random.default_rng(0))
    return write_records(folder, "made", "g", BEARINGS["6205"], None, made)


@pytest.fixture
def twin(tmp_path: Path) -> Path:
    path = tmp_path / "mein Zwilling.toml"
    path.write_text('[twin]\nmodel = "phenomenological"\n', encoding="utf-8")
    return path


def test_it_writes_the_twin_and_its_figure(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    out = tmp_path / "gefunden" / "zwölf.toml"
    said = twingap(twin, records, "--out", out)
    assert said.status == 0 and said.err == ""
    assert said.out.splitlines()[-2:] == [str(out), str(out.with_name("zwölf_fit.png"))]
    assert "resonance_hz" in said.out and "keeps the default" in said.out
    assert sorted(p.name for p in out.parent.iterdir()) == ["zwölf.toml", "zwölf_fit.png"]
    assert out.with_name("zwölf_fit.png").read_bytes().startswith(b"\x89PNG")
    spec = read_twin(out)
    assert flat(spec.parameters)["resonance_hz"] == pytest.approx(3400, rel=0.02)
    assert spec.intervals["impact_amplitude.inner"][0] < 8.0 * 1.3
    assert spec.identified is not None and spec.identified.unit == "g" and len(spec.identified.records_sha256) == 64


def test_a_twin_of_another_bearing_is_noted(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    other = '\n[bearing]\nname = "other"\nn_rollers = 12\nroller_diameter_mm = 7.5\npitch_diameter_mm = 38.5\n'
    twin.write_text(twin.read_text(encoding="utf-8") + other, encoding="utf-8")
    said = twingap(twin, records, "--out", tmp_path / "found.toml")
    assert said.status == 0, said.err
    assert "bearing (12 rollers of 7.5 on 38.5 mm) is not that of the records (9 of 7.94 on 39.04 mm)" in " ".join(
        said.out.split()
    )


def test_same_input_same_bytes_and_json(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    first = twingap(twin, records, "--out", tmp_path / "a.toml", "--figures", tmp_path / "f", "--json")
    again = twingap(twin, records, "--out", tmp_path / "b.toml", "--figures", tmp_path / "f", "--json")
    assert first.status == again.status == 0
    assert (tmp_path / "a.toml").read_bytes() == (tmp_path / "b.toml").read_bytes()
    assert (tmp_path / "f" / "a_fit.png").read_bytes() == (tmp_path / "f" / "b_fit.png").read_bytes()
    about = json.loads(first.out)
    lo, hi = about["parameters"]["damping_ratio"]["ci"]
    assert lo < about["parameters"]["damping_ratio"]["value"] < hi
    assert about["twin"] == str(tmp_path / "a.toml") and about["notes"]


def test_an_identified_twin_simulates(
    twingap: Run, twin: Path, records: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert twingap(twin, records, "--out", tmp_path / "b.toml").status == 0
    words = ["twingap", "simulate", str(tmp_path / "b.toml"), "--records", str(records), "--out", str(tmp_path / "s")]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as left:
        main()
    assert not left.value.code
    assert (tmp_path / "s" / "records.csv").exists()


def test_an_identified_twin_simulates_a_table_of_conditions(
    twingap: Run, typed: Run, twin: Path, records: Path, tmp_path: Path
) -> None:
    """Which brings no geometry: it is that of the records."""
    assert twingap(twin, records, "--out", tmp_path / "b.toml").status == 0
    assert read_twin(tmp_path / "b.toml").bearing == BEARINGS["6205"]
    table = tmp_path / "conditions.csv"
    table.write_text("record,speed_rpm,fault,fs_hz,n_samples\na,1500,inner,12000,1000\n")
    assert typed("simulate", tmp_path / "b.toml", "--records", table, "--out", tmp_path / "s").status == 0


def test_mistakes_are_one_line_and_leave_nothing(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.toml"
    broken = tmp_path / "broken.toml"
    broken.write_text('[twin]\nmodel = "phenomenological"\n[parameters]\nresonance_hz = "high"\n')
    before = sorted(tmp_path.iterdir())
    refused(twingap(tmp_path / "nowhere.toml", records, "--out", out), "nowhere.toml")
    refused(twingap(twin, tmp_path / "nowhere", "--out", out), "nowhere")
    refused(twingap(twin, twin, "--out", out), twin.name)
    refused(twingap(broken, records, "--out", out), "broken.toml", "resonance_hz", "'high'", "a finite number")
    for read in (twin, records / "records.csv", records / "recordset.toml"):
        text = read.read_bytes()
        refused(twingap(twin, records, "--out", read), read.name, "name another file")
        assert read.read_bytes() == text
    refused(twingap(twin, records, "--out", tmp_path), "folder")
    refused(twingap(twin, records, "--out", "/proc/nothing/out.toml"), "/proc/nothing")
    refused(twingap(twin, records, "--out", out, "--figures", twin), twin.name)
    refused(twingap(twin, records, "--out", out, "--method", "guess"), "'guess'")
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("samples", "says"),
    [
        (np.zeros(4000), "all samples are equal"),
        (np.r_[np.ones(300), np.nan], "nan"),
        (np.r_[np.ones(300), np.inf], "inf"),
        (np.ones(1), "1 samples"),
        (np.empty(0), "empty"),
    ],
    ids=["constant", "nan", "infinite", "one sample", "none"],
)
def test_records_that_identify_nothing(
    twingap: Run, twin: Path, tmp_path: Path, samples: np.ndarray, says: str
) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "recordset.toml").write_text('[recordset]\nname = "x"\nfs_hz = 12000\nunit = "g"\n')
    (folder / "records.csv").write_text("record,file,speed_rpm,fault\na,a.npy,1797,healthy\nb,a.npy,1797,healthy\n")
    np.save(folder / "a.npy", samples)
    refused(twingap(twin, folder, "--out", tmp_path / "out.toml"), says)
    assert not (tmp_path / "out.toml").exists()


def test_a_faulty_set_without_geometry_asks_for_it(twingap: Run, twin: Path, tmp_path: Path) -> None:
    conditions = [Condition(f"i{i}", 1797.0, 12000.0, 3000, "inner") for i in range(2)]
    made = PhenomenologicalTwin(BEARINGS["6205"]).stream(conditions, np.random.default_rng(0))
    folder = write_records(tmp_path / "set", "made", "g", None, None, made)
    refused(twingap(twin, folder, "--out", tmp_path / "out.toml"), "[bearing]")
    write_twin(twin, TwinSpec("phenomenological", bearing=BEARINGS["6205"]))
    assert twingap(twin, folder, "--out", tmp_path / "out.toml").status == 0


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root writes anywhere")
def test_a_folder_without_permission(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    shut = tmp_path / "shut"
    shut.mkdir(mode=0o500)
    refused(twingap(twin, records, "--out", shut / "out.toml"), "cannot be written")


def test_the_contact_twin_by_an_optimiser_of_choice(
    twingap: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(contact_bottom, "TRAJECTORIES", contact_bottom.SETS)
    twin, out = tmp_path / "contact.toml", tmp_path / "found.toml"
    made = ContactTwin(BEARINGS["6205"], unit="g").stream(
        [Condition("inner0", 1797.0, 12000.0, 2400, "inner")], np.random.default_rng(0)
    )
    records = write_records(tmp_path / "made", "made", "g", BEARINGS["6205"], None, made)
    twin.write_text('[twin]\nmodel = "contact"\n[parameters]\nload_n = 400.0\n', encoding="utf-8")
    said = twingap(twin, records, "--out", out, "--optimiser", "zoa")
    assert said.status == 0
    assert {"stiffness", "damping"} <= set(flat(read_twin(out).parameters))
    refused(twingap(twin, records, "--out", out, "--optimiser", "annealing"), "annealing", "differential-evolution")


def test_no_optimiser_for_a_twin_that_needs_none(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    refused(twingap(twin, records, "--out", tmp_path / "x.toml", "--optimiser", "zoa"), "zoa", "contact twin")


def test_no_sample_file_is_written_over(twingap: Run, twin: Path, records: Path, tmp_path: Path) -> None:
    own = shutil.copytree(records, tmp_path / "own")
    (sample, *_) = sorted(own.rglob("*.npy"))
    before = sample.read_bytes()
    said = twingap(twin, own, "--out", sample)
    assert said.status == 2 and "is read by this command" in said.err and sample.read_bytes() == before
    drawn = sample.with_name("x_fit.png")
    sample.rename(drawn)
    table = own / "records.csv"
    table.write_text(table.read_text().replace(sample.relative_to(own).as_posix(), drawn.relative_to(own).as_posix()))
    said = twingap(twin, own, "--out", tmp_path / "x.toml", "--figures", drawn.parent)
    assert said.status == 2 and "is read by this command" in said.err and drawn.read_bytes() == before
