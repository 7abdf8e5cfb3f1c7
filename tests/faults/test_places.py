"""Places that cannot be written, and commands that share one: one line, and nothing half-written."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from tests.faults.conftest import FULL, Ended, Forks, hidden, small_disk, tree
from tests.faults.test_kills import COMMANDS

NAMES = ("simulate", "import", *(("gap", "fleet", "study") if FULL else ()))


@pytest.mark.parametrize("kilobytes", (8, 40, 60, 200, 1000) if FULL else (40,))
def test_full_disk_is_one_line(twingap: Forks, inputs: Path, tmp_path: Path, kilobytes: int) -> None:
    refused = 0
    for name in NAMES:
        with small_disk(tmp_path / name, kilobytes):
            said = twingap(tmp_path / name, *COMMANDS[name].words(inputs), **COMMANDS[name].given)
            if said.status == 0:
                continue
            assert "space" in said.refused() or "disk may be full" in said.refused()
            refused += 1
            kept = [path for path in hidden(tmp_path / name) if not path.startswith(("new/fleet/.diag", "new/study"))]
            assert not kept
            if not COMMANDS[name].resumes:
                assert not tree(tmp_path / name)
    assert refused


def test_limit_of_a_file_is_one_line(twingap: Forks, inputs: Path, tmp_path: Path) -> None:
    for name in NAMES[:2]:  # larger than what is printed, smaller than a record
        said = twingap(tmp_path, *COMMANDS[name].words(inputs), limits={"RLIMIT_FSIZE": 4000})
        assert "File too large" in said.refused()
        assert not list(tmp_path.iterdir())


def test_read_only_folder_is_one_line(twingap: Forks, inputs: Path, tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 1000) as make_read_only:
        make_read_only()
        for name, command in COMMANDS.items():
            home = {"TWINGAP_HOME": str(tmp_path / "home"), "MLFLOW_TRACKING_URI": ""}
            said = twingap(tmp_path / "disk", *command.words(inputs), **{**command.given, "env": home})
            assert "Read-only file system" in said.refused(), name
            assert said.seconds < 60


def test_home_that_cannot_be_written_does_not_stop_commands(twingap: Forks, inputs: Path, tmp_path: Path) -> None:
    nowhere = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "TWINGAP_HOME"), "/proc/nowhere")
    for name in NAMES[:2]:
        said = twingap(tmp_path, *COMMANDS[name].words(inputs), env=nowhere)
        assert said.status == 0, said.err


@pytest.mark.parametrize("name", ["simulate", "import", *(("fleet", "study", "gap") if FULL else ())])
def test_two_runs_in_one_folder(twingap: Forks, inputs: Path, tmp_path: Path, name: str) -> None:
    command, ended = COMMANDS[name], dict[str, Ended]()
    other = Forks()
    (tmp_path / "alone").mkdir()
    alone = twingap(tmp_path / "alone", *command.words(inputs), **command.given)
    assert alone.status == 0

    def run(who: str, forks: Forks) -> None:
        ended[who] = forks(tmp_path, *command.words(inputs), **command.given)

    both = [threading.Thread(target=run, args=pair) for pair in (("first", twingap), ("second", other))]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join()
    other.close()
    assert 0 in {one.status for one in ended.values()}
    for one in ended.values():
        assert one.status == 0 or one.refused()
    assert tree(tmp_path / command.out, command.parts) == tree(tmp_path / "alone" / command.out, command.parts)
