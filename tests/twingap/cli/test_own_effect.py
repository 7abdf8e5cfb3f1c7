"""An effect of a user's own, in one file, at the command line: catalogue, simulation, diagnosis, report."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from papers import reproduce
from papers.paper3_zoa_dann.inputs.study import STUDY
from tests.twingap.cli.typed import Run, refused
from twingap.bearing import BEARINGS
from twingap.effects import registry
from twingap.effects.handover import handed_effects
from twingap.records import Condition
from twingap.records.folder import read_record_set, write_records
from twingap.twins import twin_file
from twingap.twins.phenomenological import PhenomenologicalTwin

FILE = (Path(__file__).parents[3] / "docs" / "how-to" / "my_effects.py").read_text(encoding="utf-8")
"""The example of the documentation."""


@pytest.mark.slow
@pytest.mark.usefixtures("few_trials")
def test_one_new_file_is_all_that_an_effect_takes(typed: Run, tmp_path: Path) -> None:
    own, machine, twin = (tmp_path / name for name in ("my_effects.py", "machine.toml", "twin.toml"))
    own.write_text(FILE, encoding="utf-8")
    machine.write_text(
        '[twin]\nmodel = "phenomenological"\neffects = ["soft_knee"]\n[parameters]\nresonance_hz = 2600.0\n'
        "damping_ratio = 0.04\n[parameters.soft_knee]\nknee = 1.2\n",
        encoding="utf-8",
    )
    twin.write_text('[twin]\nmodel = "phenomenological"\n', encoding="utf-8")
    faults = ("healthy", "outer", "inner", "ball")
    conditions = [Condition(f"r{i}", (1500.0, 1800.0)[i // 4 % 2], 12000.0, 6000, faults[i % 4]) for i in range(16)]
    asked = write_records(
        tmp_path / "asked", "asked", "g", BEARINGS["6205"], None,
        PhenomenologicalTwin(BEARINGS["6205"]).stream(conditions, np.random.default_rng(0)),
    )  # fmt: skip

    listed = typed("effects", "soft_knee", "--effects", own)
    assert listed.status == 0, listed.err
    assert "A sensor that compresses large samples" in listed.out

    refused(typed("simulate", machine, "--records", asked, "--out", tmp_path / "without"), "soft_knee")
    made = typed("simulate", machine, "--records", asked, "--out", tmp_path / "records", "--effects", own)
    assert made.status == 0, made.err

    said = typed(
        "gap", tmp_path / "records", "--twin", twin, "--out", tmp_path / "out", "--effects", own,
        "--no-track", "--json",
    )  # fmt: skip
    assert said.status == 0, said.err
    table = json.loads((tmp_path / "out" / "gap.json").read_text(encoding="utf-8"))
    assert "soft_knee" in table["verdict"]["effects"]
    assert table["provenance"]["own_effects"] == {"soft_knee": hashlib.sha256(FILE.encode()).hexdigest()}
    assert "soft_knee" in (tmp_path / "out" / "closest.toml").read_text(encoding="utf-8")
    assert "soft knee" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")

    again = typed(
        "simulate", tmp_path / "out" / "closest.toml", "--records", asked, "--out", tmp_path / "again", "--effects", own
    )
    assert again.status == 0, again.err


SIMULATOR = """
import numpy as np
from twingap.twins import register_callable


def tones(conditions, rng):
    return [np.sin({pitch} * np.arange(c.n_samples)) + 0.1 * rng.standard_normal(c.n_samples) for c in conditions]


register_callable("tones", tones)
"""


def test_a_file_registers_a_simulator(typed: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "OWN_MODELS", {})
    monkeypatch.setattr(twin_file, "OWN_MODELS", registry.OWN_MODELS)
    own, twin, asked = (tmp_path / name for name in ("mine.py", "closest.toml", "asked.csv"))
    twin.write_text(
        '[twin]\nmodel = "tones"\neffects = ["clipping"]\n[parameters]\nscale = 2.0\n'
        "[parameters.clipping]\nrail = 0.5\n"
        '[bearing]\nname = "6205"\nn_rollers = 9\nroller_diameter_mm = 7.94\npitch_diameter_mm = 39.04\n'
    )
    asked.write_text("record,speed_rpm,fs_hz,n_samples,fault\na,1500,12000,600,outer\n")
    command = ("simulate", twin, "--records", asked)
    refused(typed(*command, "--out", tmp_path / "none"), "'tones' found, a known model expected", "--effects FILE.py")
    peaks = []
    for pitch in (0.3, 0.9):
        own.write_text(SIMULATOR.format(pitch=pitch))
        made = typed(*command, "--out", tmp_path / f"at {pitch}", "--effects", own)
        assert made.status == 0, made.err
        x = read_record_set(tmp_path / f"at {pitch}")[0].samples
        assert np.abs(x).max() == pytest.approx(1.0)
        peaks.append(2 * np.pi * np.abs(np.fft.rfft(x)).argmax() / x.size)
    assert peaks == pytest.approx([0.3, 0.9], abs=0.02), "an edited file replaces what it registered"
    sent = [file.text for file in handed_effects().files]
    assert own.read_text() in sent, "workers know it too"
    assert SIMULATOR.format(pitch=0.3) not in sent


TINY = """
[profiles.tiny]
tasks = ["load_0_to_2"]
inputs = ["envelope_spectrum"]
seeds = 1
steps = 2
bearings_per_class = 2
records_per_bearing = 1
windows_per_recording = 2
evaluations = 0
rig_duration_s = 0.6
"""


@pytest.mark.slow
def test_a_papers_configuration_may_name_it(
    typed: Run, tmp_path: Path, new_database: Callable[[Path], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    own, config = tmp_path / "my_effects.py", tmp_path / "config.toml"
    own.write_text(FILE, encoding="utf-8")
    text = STUDY.config.read_text(encoding="utf-8").replace('["slip_jitter"]', '["slip_jitter", "soft_knee"]')
    for name, small in {"checkpoints": 1, "embedded": 0, "records_per_class": 1, "windows_per_record": 2}.items():
        text = re.sub(rf"(?m)^{name} = \d+", f"{name} = {small}", text)
    config.write_text(text + TINY, encoding="utf-8")

    def tiny(paper: str, profile: str, *, out: Path, tracker: Any, **given: Any) -> reproduce.Outcome:
        work = STUDY.run("tiny", out=out, config=config, draw=False, **given)
        return reproduce.Outcome({"inputs": work}, (), out, None)

    monkeypatch.delenv("TWINGAP_DATA", raising=False)
    monkeypatch.setattr(reproduce, "run", tiny)
    store = new_database(tmp_path / "runs.db")
    command = ("run", "paper3", "--out", tmp_path / "out", "--tracking-uri", store, "--json")
    refused(typed(*command), "'soft_knee' found", "source: effects")
    said = typed(*command, "--effects", own)  # trainings simulate in worker processes
    assert said.status == 0, said.err
    assert "DANN" in {row.get("method") for row in json.loads(said.out)}
