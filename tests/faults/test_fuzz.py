"""Mutated files and words over all readers and commands: samples, results or one line; nothing half-written."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.faults.conftest import FULL, Diagnosed
from tests.twingap.records.test_record_files import WRITERS
from twingap.bearing import BEARINGS
from twingap.records import Condition
from twingap.records.folder import write_records
from twingap.records.samples import SUFFIXES
from twingap.twins.phenomenological import PhenomenologicalTwin

PROCESSES, EACH = (5, 2000) if FULL else (1, 200)
TWIN = """
[twin]
model = "phenomenological"
effects = ["slip_jitter", "coloured_noise", "clipping"]

[parameters]
resonance_hz = 2000.0
scale = 0.5

[parameters.slip_jitter]
sigma = 0.02

[parameters.slip_jitter.outer]
sigma = 0.01
"""


@pytest.fixture(scope="session")
def corpus(inputs: Path, diagnosed: Diagnosed, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Whole files of every kind, and the folder `base` in which each input is tried."""
    top = tmp_path_factory.mktemp("corpus")
    for kind in ("base", "samples", "twin", "table", "features", "lives", "report"):
        (top / kind).mkdir()
    _samples(top / "samples")
    for name in ("twin.toml", "table.csv"):
        shutil.copy(inputs / name, top / "base" / name)
        shutil.copy(inputs / name, top / name.partition(".")[0] / name)
    bearing = (inputs / "twin.toml").read_text(encoding="utf-8")
    bearing = bearing[bearing.index("[bearing]") :]
    (top / "twin" / "effects.toml").write_text(f"{TWIN}\n{bearing}", encoding="utf-8")
    (top / "twin" / "contact.toml").write_text(f'[twin]\nmodel = "contact"\n\n{bearing}', encoding="utf-8")
    conditions = [Condition(f"r{i}", 1800.0, 8192.0, 800, "inner", time_s=60.0 * i) for i in range(3)]
    made = PhenomenologicalTwin(BEARINGS["6205"]).stream(conditions, np.random.default_rng(0))
    write_records(top / "set", "made", "g", BEARINGS["6205"], None, made)
    shutil.copytree(top / "set", top / "base" / "set")
    t = np.arange(60.0)
    rows = [f"{60 * k:g},{1 + (k / 50) ** 4:.6f},{3 + np.sin(k):.6f}" for k in t]
    (top / "features" / "features.csv").write_text("\n".join(["time_s,rms,kurtosis", *rows]) + "\n", encoding="utf-8")
    runs = "record,life_revolutions,after_anomaly_revolutions,end_ratio\na,2e6,3e5,9.5\nb,3e6,5e5,12\n"
    (top / "lives" / "lives.csv").write_text(runs, encoding="utf-8")
    shutil.copy(diagnosed.out / "gap.json", top / "report" / "gap.json")
    return top


def _samples(folder: Path) -> None:
    x = np.sin(np.arange(200.0))
    for suffix, write in WRITERS.items():
        write(folder / f"x{suffix}", x)
    from scipy.io import savemat

    np.savez(folder / "many.npz", x=x, fs=12000, data=np.stack([x, x]).T)
    savemat(folder / "packed.mat", {"x": x, "s": {"a": x, "b": [1, 2]}}, do_compression=True)
    lines = [f"{k / 1000:.4f}".replace(".", ",") + f";{v:.5f}".replace(".", ",") for k, v in enumerate(x)]
    (folder / "logger.csv").write_text(
        "Logger 7\nSerial;12\n\nTime [s];Acc [g]\n" + "\n".join(lines), encoding="latin-1"
    )
    import h5py

    with h5py.File(folder / "x.h5", "w") as file:
        file["a/x"] = x
        file.create_dataset("b", data=np.stack([x, -x]).T, chunks=(50, 2), compression="gzip")
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(folder / "x.tdms")) as writer:
        writer.write_segment([ChannelObject("run", "acc", x, properties={"wf_increment": 1 / 12000})])
    import pyuff

    about: dict[str, object] = dict.fromkeys(("id2", "id3", "id4", "id5", "rsp_ent_name", "ref_ent_name"), "NONE")
    about |= dict.fromkeys(("func_type", "rsp_node", "rsp_dir", "ref_node", "ref_dir", "ver_num", "binary"), 1)
    about |= {"id1": "acc", "num_pts": 200, "ord_data_type": 4, "abscissa_spacing": 1, "abscissa_inc": 1 / 12800}
    about |= {"abscissa_spec_data_type": 17, "ordinate_spec_data_type": 12, "ordinate_axis_units_lab": "g"}
    one = pyuff.prepare_58(
        data=x, x=np.arange(200) / 12800, abscissa_min=0.0, orddenom_spec_data_type=0, load_case_id=0, z_axis_value=0.0,
        **about,
    )  # fmt: skip
    pyuff.UFF(str(folder / "x.uff")).write_sets(one, "add")
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.append([Signal(x, np.arange(x.size) / 12000, name="acc", unit="g")])
        file.save(folder / "x.mf4")
    if "TWINGAP_DATA" in os.environ:
        found = [path for path in Path(os.environ["TWINGAP_DATA"]).rglob("*") if path.suffix.lower() in SUFFIXES]
        for suffix in {path.suffix for path in found}:
            smallest = min((path for path in found if path.suffix == suffix), key=lambda path: path.stat().st_size)
            shutil.copy(smallest, folder / f"real{suffix}")


@pytest.mark.parametrize("seed", range(PROCESSES))
def test_mutated_inputs_give_results_or_one_line(corpus: Path, seed: int) -> None:
    paths = os.pathsep.join(path for path in sys.path if path)
    environment = {
        **os.environ, "PYTHONPATH": paths, "TWINGAP_HOME": str(corpus / "home"),
    }  # fmt: skip
    program = [sys.executable, Path(__file__).with_name("fuzzing.py"), corpus, str(seed), str(EACH)]
    ended = subprocess.run(program, capture_output=True, text=True, env=environment)
    assert ended.returncode == 0, f"ended by {(corpus / f'now-{seed}').read_text()}: {ended.stderr[-2000:]}"
    lines = [json.loads(line) for line in ended.stdout.splitlines()]
    problems, about = lines[:-1], lines[-1]
    assert not problems, "\n".join(f"{p['kind']} {p['number']}: {p['problem']}" for p in problems)
    assert not ended.stderr, "libraries print nothing of their own"
    assert about["tried"] == EACH and about["peak_mb"] < 2500
