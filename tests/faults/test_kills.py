"""Long commands killed at random moments, run again, and compared with an uninterrupted run."""

from __future__ import annotations

import random
import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from tests.faults.conftest import FULL, Ended, Forks, hidden, tree


@dataclass(frozen=True)
class Command:
    """A command, run in an empty folder.

    Parameters
    ----------
    words : callable
        Words of the command, given the folder of inputs.
    out : str
        Its output.
    trials : tuple of int
        Kills in the ordinary suite, and in the full run.
    parts : tuple of str
        Beginnings of the paths in it that are compared.
    resumes : bool
        Whether a second run goes on where the first was; False = it starts anew.
    env : dict
    prepare : str
        Function called in the process of the command before it starts, as module:function.
    """

    words: Callable[[Path], list[object]]
    out: str
    trials: tuple[int, int]
    parts: tuple[str, ...] = ("",)
    resumes: bool = False
    env: dict[str, str] = field(default_factory=dict)
    prepare: str = ""

    @property
    def given(self) -> dict[str, Any]:
        """What its process is given; see `Forks`."""
        return {"env": self.env, "prepare": self.prepare}


SIMULATE = ("--fs-hz", 8000, "--duration-s", 0.25)
COMMANDS = {
    "simulate": Command(
        lambda at: ["simulate", at / "twin.toml", "--records", at / "table.csv", *SIMULATE, "--out", "new/sim"],
        "new/sim", (4, 20),
    ),
    "import": Command(
        lambda at: ["import", at / "exports", "--names", "{fault}_{speed_rpm:d}.csv", "--out", "new/set"],
        "new/set", (4, 20),
    ),
    "gap": Command(
        lambda at: ["gap", at / "set", "--twin", at / "twin.toml", "--out", "new/gap", "--quick", "--no-track"],
        "new/gap", (0, 20),
    ),
    "fleet": Command(
        lambda at: ["fleet", at / "fleet", "--twin", at / "twin.toml", "--out", "new/fleet", "--quick", "--no-track",
                    "--jobs", 1],
        "new/fleet", (0, 20), resumes=True,
    ),
    "study": Command(
        lambda at: ["study", "blind", "--cases", 6, "--rival-worlds", 0, "--jobs", 1, "--no-track", "--out",
                    "new/study"],
        "new/study", (0, 8), parts=("study.json",), resumes=True, prepare="tests.faults.small:worlds",
    ),
    "run": Command(
        lambda at: ["run", "paper1", "--out", "new/paper1", "--tracking-uri", "sqlite:///new/runs.db"], "new/paper1",
        (0, 12), parts=("tables/",), resumes=True, prepare="tests.faults.small:lives", env={"LOKY_MAX_CPU_COUNT": "1"},
    ),
    "train": Command(
        lambda at: ["train", "--out", "new/train", "--machines", 60, "--jobs", 1], "new/train", (0, 4),
        parts=("learnt/", "classifier/"), resumes=True, prepare="tests.faults.small:training",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def uninterrupted(twingap: Forks, inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Any]:
    """Output and end of each command that nothing disturbs; each is run once."""
    known: dict[str, tuple[dict[str, bytes], Ended]] = {}

    def ask(name: str) -> tuple[dict[str, bytes], Ended]:
        if name not in known:
            folder, command = tmp_path_factory.mktemp(name), COMMANDS[name]
            ended = twingap(folder, *command.words(inputs), **command.given)
            assert ended.status == 0, ended.err
            known[name] = tree(folder / command.out, command.parts), ended
            assert known[name][0]
        return known[name]

    return ask


def trials() -> list[Any]:
    """Command and number of each trial."""
    return [
        pytest.param(name, i, id=f"{name}-{i}")
        for name, command in COMMANDS.items()
        for i in range(command.trials[FULL])
    ]


@pytest.mark.parametrize(("name", "trial"), trials())
def test_killed_command_run_again_gives_the_same(
    twingap: Forks, inputs: Path, tmp_path: Path, uninterrupted: Callable[[str], Any], name: str, trial: int
) -> None:
    command = COMMANDS[name]
    whole, ended = uninterrupted(name)
    rng = random.Random(f"{name} {trial}")
    # Every other kill comes at a change of a file, where it does the most harm.
    if trial % 2:
        how: dict[str, Any] = {"signals": [(rng.uniform(0, ended.seconds), signal.SIGKILL)]}
    else:
        how = {"kill_at": rng.randint(1, ended.changes)}
    killed = twingap(tmp_path, *command.words(inputs), **command.given, **how)
    assert killed.status in (-signal.SIGKILL, 0)

    left = tree(tmp_path / command.out, command.parts)
    final = {path: content for path, content in left.items() if path in whole}
    assert all(whole[path] == content for path, content in final.items()), "a file that is there is whole"
    if not command.resumes and len(final) == len(whole) and name in ("simulate", "import"):
        return  # it was finished
    again = twingap(tmp_path, *command.words(inputs), **command.given)
    assert again.status == 0, again.err
    assert tree(tmp_path / command.out, command.parts) == whole


@pytest.mark.parametrize("name", ["simulate", "import", *(["gap", "fleet", "study"] if FULL else [])])
def test_interrupted_command_leaves_nothing_half_written(
    twingap: Forks, inputs: Path, tmp_path: Path, uninterrupted: Callable[[str], Any], name: str
) -> None:
    command = COMMANDS[name]
    whole, ended = uninterrupted(name)
    for part in (0.05, 0.2, 0.5, 0.95) if FULL else (0.1, 0.6):
        folder = tmp_path / str(part)
        folder.mkdir()
        said = twingap(folder, *command.words(inputs), **command.given, signals=[(part * ended.seconds, signal.SIGINT)])
        if said.status == 0:
            continue
        assert said.status == 130, said.err
        assert "interrupted" in said.err and "Traceback" not in said.err
        assert all(
            whole[path] == content
            for path, content in tree(folder / command.out, command.parts).items()
            if path in whole
        )
        kept = [path for path in hidden(folder) if not path.startswith(("new/fleet/.diagnoses", "new/study/work"))]
        assert not kept


@pytest.mark.parametrize("name", ["import", *(["gap", "fleet", "study"] if FULL else [])])
def test_clock_that_was_set_back_changes_nothing(
    twingap: Forks, inputs: Path, tmp_path: Path, uninterrupted: Callable[[str], Any], name: str
) -> None:
    command = COMMANDS[name]
    whole, ended = uninterrupted(name)
    first = {"signals": [(0.7 * ended.seconds, signal.SIGKILL)]} if command.resumes else {"kill_at": ended.changes}
    twingap(tmp_path, *command.words(inputs), **command.given, **first)
    again = twingap(tmp_path, *command.words(inputs), **command.given, clock_s=-400 * 86400)
    assert again.status == 0, again.err
    assert tree(tmp_path / command.out, command.parts) == whole
