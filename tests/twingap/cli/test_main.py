"""What all commands have in common: how they refuse, how they end when told to."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.main import get_command

from tests.twingap.cli.typed import Run, refused
from twingap.bearing import BEARINGS
from twingap.cli import app, main
from twingap.effects import catalogue, registry
from twingap.records import Condition, Record
from twingap.records.folder import write_records
from twingap.twins.twin_file import TwinSpec, write_twin


@pytest.mark.parametrize(
    ("typed", "parts"),
    [
        (["frob"], ("no such command 'frob'", "see `twingap --help`")),
        (["data", "frob"], ("no such command 'frob'", "see `twingap data --help`")),
        (["simulate", "a.toml", "--frob"], ("no such option", "--frob", "see `twingap simulate --help`")),
        (["simulate", "a.toml"], ("missing option", "--records")),
        (["identify", "a.toml"], ("missing argument", "RECORDSET")),
        (["data", "export", "cwru", "--out", "o", "--seed", "-3"], ("--seed", "0")),
        (["data", "export", "cwru", "--out", "o", "--seed", "many"], ("--seed", "integer")),
        (["run", "paper9"], ("paper9", "paper1")),
        (["ui", "--port", "0"], ("--port",)),
        (["data", "export", "virtual_cwru", "--out", "o", "--option", "seed=-1"], ("seed = -1", "at least 0")),
    ],
)
def test_what_was_mistyped_is_told_in_one_line(
    typed: list[str], parts: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["twingap", *typed])
    with pytest.raises(SystemExit) as left:
        main()
    said = capsys.readouterr()
    assert left.value.code == 2
    assert said.out == ""
    assert said.err.startswith("twingap: ")
    assert said.err.count("\n") == 1
    for part in parts:
        assert part in said.err


@pytest.mark.parametrize("command", [["run", "paper3"], ["study", "public"]])
def test_commands_with_a_bar_refuse_in_one_line_too(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where standard error is no terminal, a bar that was begun leaves nothing there."""
    monkeypatch.setenv("TWINGAP_HOME", str(tmp_path / "home"))
    words = ["twingap", *command, "--root", str(tmp_path / "nowhere"), "--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as left:
        main()
    said = capsys.readouterr()
    assert left.value.code == 2 and said.out == ""
    assert said.err.startswith("twingap: ") and said.err.count("\n") == 1 and "nowhere" in said.err


@pytest.mark.parametrize("command", [["data", "list"], ["data", "verify"]])
def test_every_command_takes_a_seed_and_json(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["twingap", *command, "--root", str(tmp_path), "--seed", "3", "--json"])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 0
    assert {entry["name"] for entry in json.loads(capsys.readouterr().out)} >= {"cwru", "xjtu_sy"}


def test_help_of_all_commands_alone_is_shown_when_none_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["twingap"])
    with pytest.raises(SystemExit) as left:
        main()
    said = capsys.readouterr()
    assert left.value.code == 2
    assert "simulate" in said.out
    assert said.err == ""


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_command_told_to_end_leaves_nothing(tmp_path: Path, number: signal.Signals, status: int) -> None:
    write_twin(tmp_path / "twin.toml", TwinSpec("phenomenological", bearing=BEARINGS["6205"]))
    rows = "".join(f"r{i},1797,inner,12000,12000\n" for i in range(100_000))
    (tmp_path / "table.csv").write_text("record,speed_rpm,fault,fs_hz,n_samples\n" + rows, encoding="utf-8")
    out = tmp_path / "out"
    typed = [sys.executable, "-m", "twingap.cli", "simulate", "twin.toml", "--records", "table.csv", "--out", "out"]
    with subprocess.Popen(typed, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        for _ in range(600):  # until it is in the midst of writing
            if any(tmp_path.glob(".out-*/samples/0000/*.npy")) or process.poll() is not None:
                break
            time.sleep(0.1)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    assert process.returncode == status, err
    assert not out.exists()
    assert not list(tmp_path.glob(".out*"))
    assert "Traceback" not in err
    assert ("interrupted" in err) == (number == signal.SIGINT)


@pytest.mark.parametrize("gain", [1e-200, 1e200])
def test_samples_that_no_accelerometer_measures_are_refused(
    gain: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(0)
    faults = ("healthy", "inner")
    records = [Record(Condition(f, 1797.0, 12000.0, 4096, f), gain * rng.standard_normal(4096)) for f in faults]
    write_records(tmp_path / "set", "set", "g", BEARINGS["6205"], None, records)
    write_twin(tmp_path / "twin.toml", TwinSpec("phenomenological"))
    out = tmp_path / "out.toml"
    typed = ["twingap", "identify", str(tmp_path / "twin.toml"), str(tmp_path / "set"), "--out", str(out)]
    monkeypatch.setattr(sys, "argv", typed)
    with pytest.raises(SystemExit) as left:
        main()
    said = capsys.readouterr()
    assert left.value.code == 2
    assert "check the unit" in said.err
    assert said.err.count("\n") == 1
    assert not out.exists()


def test_version_and_help_import_nothing_that_computes_or_tracks() -> None:
    text = (
        "import sys; sys.argv = ['twingap', *sys.argv[1:]]\n"
        "from twingap.cli import main\n"
        "slow = {'torch', 'mlflow', 'numba', 'scipy', 'sklearn', 'pandas', 'matplotlib'}\n"
        "try: main()\n"
        "finally: print(sorted(slow & {*sys.modules}))"
    )
    for words, part in ((["--version"], "twingap 0."), (["gap", "--help"], "RECORDSET"), (["bearings"], "BPFO")):
        done = subprocess.run([sys.executable, "-c", text, *words], capture_output=True, text=True, check=True)
        assert part in done.stdout
        assert done.stdout.splitlines()[-1] == "[]", words


HUM = """
from dataclasses import dataclass
from typing import ClassVar
from twingap.effects import Effect, Stage, parameter, register

@register
@dataclass(frozen=True)
class Hum(Effect):
    "A tone that nobody modelled."

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    level: float = parameter(0.5, unit="healthy rms", plausible=(0.01, 1.0), doc="height of the tone")
    look_alikes = ("mains_interference",)
    deciding_measurement = "Switch the neighbour off."

    def apply(self, draft, rng):
        draft.x += self.level
"""


def test_effects_of_the_users_own_are_known_to_commands(
    typed: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "_OWN", {})
    file = tmp_path / "meine.py"
    file.write_text(HUM)
    refused(typed("effects", "hum"), "unknown effect 'hum'")
    said = typed("effects", "hum", "--effects", file)
    for part in ("hum (disturbance", "A tone that nobody", "height of the tone", "0.01 to 1", "Switch the neighbour"):
        assert part in said.out
    about = json.loads(typed("effects", "hum", "--json", "--effects", file).out)
    assert about["look_alikes"] == ["mains_interference"]
    assert about["parameters"][0]["plausible"] == [0.01, 1.0] and about["parameters"][0]["default"] == 0.5
    registry.replace_own({})
    twin, table = tmp_path / "twin.toml", tmp_path / "table.csv"
    geometry = "[bearing]\nname = '6205'\nn_rollers = 9\nroller_diameter_mm = 7.94\npitch_diameter_mm = 39.04\n"
    twin.write_text("[twin]\nmodel = 'phenomenological'\neffects = ['hum']\n" + geometry)
    table.write_text("record,speed_rpm,fault,fs_hz,n_samples\na,1797,healthy,12000,4096\n")
    simulate = ("simulate", twin, "--records", table, "--out", tmp_path / "out")
    refused(typed(*simulate), "hum")
    assert typed(*simulate, "--effects", file).status == 0
    refused(typed(*simulate, "--effects", tmp_path / "none.py"), "none.py: cannot be read")


def _all_commands() -> list[list[str]]:
    top: Any = get_command(app)
    return [
        [name, *below]
        for name, command in top.commands.items()
        for below in ([[each] for each in command.commands] if hasattr(command, "commands") else [[]])
    ]


def test_every_command_takes_effects_and_shows_an_example(typed: Run) -> None:
    for command in _all_commands():
        shown = typed(*command, "--help").out
        assert "--effects" in shown, command
        assert f"twingap {' '.join(command)}" in shown.partition("Example")[2], command


def test_catalogue_and_bearings_are_listed(typed: Run) -> None:
    listed = json.loads(typed("effects", "--json").out)
    assert [each["effect"] for each in listed] == list(catalogue())
    assert all(each["summary"] and each["parameters"] and each["references"] for each in listed)
    assert "slip_jitter" in typed("effects").out
    rows = json.loads(typed("bearings", "--json").out)
    assert [row["bearing"] for row in rows] == [bearing.name for bearing in BEARINGS.values()]
    (one,) = json.loads(typed("bearings", "6205", "--json").out)
    assert one["bpfo"] == BEARINGS["6205"].bpfo and one["rollers"] == 9
    refused(typed("bearings", "9999"), "unknown bearing '9999'", "[bearing] table")
    refused(typed("effects", "slip"), "unknown effect 'slip'", "slip_jitter")
