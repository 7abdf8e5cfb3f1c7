"""A user's own effects in worker processes: known there, in the version at hand, and part of every result's key."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import pytest

from twingap.effects import Effect, Stage, load_effects, parameter, register, registry
from twingap.effects.handover import digest_of_effects
from twingap.errors import TwingapError
from twingap.sweep import SweepError, sweep

HERE = Path(__file__).parent
FILE = """
from dataclasses import dataclass
from typing import ClassVar
from twingap.effects import Effect, Stage, parameter, register

LEVEL = 0.5

@register
@dataclass(frozen=True)
class Hum(Effect):
    stage: ClassVar[Stage] = Stage.DISTURBANCE
    level: float = parameter(LEVEL, unit="healthy rms", plausible=(0.01, 1.0), doc="amplitude of the tone")

    def apply(self, draft, rng):
        draft.x += self.level
"""


@pytest.fixture(autouse=True)
def jobs(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module of jobs; effects that a test registers are gone after it."""
    monkeypatch.setattr(registry, "_OWN", {})
    monkeypatch.syspath_prepend(str(HERE))
    import sweep_jobs

    return sweep_jobs


def ask(jobs: Any, backend: str, store: Path | None = None, **given: Any) -> tuple[float, set[int], list[str], str]:
    """The effect's level in the workers, their process ids, their catalogue, and why the jobs ran."""
    todo = [{"name": "hum", "i": i} for i in range(4)]
    results = sweep(jobs.level_of, todo, store=store, backend=backend, n_jobs=2, **given)
    (level,) = {r.value[0] for r in results}
    return level, {r.value[1] for r in results}, results[0].value[2], results[0].why


@pytest.mark.parametrize("backend", ["loky", "dask"])
def test_workers_know_an_edited_file_anew(jobs: Any, tmp_path: Path, backend: str) -> None:
    path, store = tmp_path / "mine.py", tmp_path / "store"
    if backend == "dask":
        distributed = pytest.importorskip("distributed", reason="the dask extra is not installed")
        cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
        given = {"address": cluster.scheduler_address}
    else:
        given = {}
    seen: list[set[int]] = []
    for text, level in ((FILE, 0.5), (FILE.replace("0.5", "0.25"), 0.25), (FILE, 0.5)):
        path.write_text(text)
        load_effects(path)
        path.unlink()  # as on a cluster, where the file is not
        found, processes, known, why = ask(jobs, backend, store, **given)
        assert found == level
        assert known == list(registry.catalogue())
        assert why == ("no result" if not seen else "data changed" if level == 0.25 else "")
        assert os.getpid() not in processes
        if level == 0.25:
            assert processes & seen[0], "a worker that knew the former version is asked again"
        seen.append(processes)
    registry.replace_own({})
    with pytest.raises(SweepError, match="unknown effect 'hum'"):
        ask(jobs, backend, **given)
    if backend == "dask":
        cluster.close()


def _half() -> float:
    return 0.5


@dataclass(frozen=True)
class Hum(Effect):
    """Registered in Python."""

    stage: ClassVar[Stage] = Stage.DISTURBANCE
    level: float = parameter(0.75, unit="healthy rms", plausible=(0.01, 1.0), doc="amplitude of the tone")

    def apply(self, draft: Any, rng: Any) -> None:
        draft.x += self.level * _half()


def test_workers_know_a_class_registered_in_python(jobs: Any) -> None:
    register(Hum)
    assert ask(jobs, "loky")[0] == 0.75


def test_file_that_workers_cannot_load_is_named(jobs: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.py").write_text("import package_that_is_only_here\n" + FILE)
    monkeypatch.setitem(sys.modules, "package_that_is_only_here", sys)
    load_effects(tmp_path / "mine.py")
    with pytest.raises(SweepError, match=r"cannot load your effects: .*mine.py: line 1: ModuleNotFoundError"):
        ask(jobs, "loky")


NOTEBOOK = """
from __future__ import annotations
import sys
from dataclasses import dataclass
from typing import ClassVar
from twingap.effects import Effect, Stage, parameter, register
from twingap.effects.handover import digest_of_effects

STRENGTH = {strength}

def helper():
    return {helper}

@register
@dataclass(frozen=True)
class Hum(Effect):
    stage: ClassVar[Stage] = Stage.DISTURBANCE
    level: float = parameter({default}, unit="healthy rms", plausible=(0.01, 1.0), doc="amplitude of the tone")

    def apply(self, draft, rng):
        draft.x += self.level * max(helper(), *(STRENGTH for _ in "ab"))

print(digest_of_effects())
if "work" in sys.argv:
    sys.path.insert(0, {here!r})
    from sweep_jobs import level_of
    from twingap.sweep import sweep
    print([r.value[0] for r in sweep(level_of, [dict(name="hum", i=i) for i in range(3)], n_jobs=2)])
"""


FORKED = """
import os, sys, twingap.effects.handover
for text in sys.argv[1:]:
    if not os.fork():
        exec(text)
        sys.stdout.flush()
        os._exit(0)
    assert os.wait()[1] == 0
"""
"""Runs each text in a process of its own, as a cell of a notebook."""


def notebook(**parts: Any) -> str:
    """A main module without a file, as a notebook is one."""
    return NOTEBOOK.format(**{"strength": 1, "helper": 2, "default": 0.5, "here": str(HERE)} | parts)


def printed(*words: str) -> list[str]:
    """Lines that Python prints."""
    return subprocess.run([sys.executable, "-c", *words], capture_output=True, text=True, check=True).stdout.split("\n")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
def test_notebook_effects_reach_workers_and_tell_their_edits() -> None:
    first, levels, *_ = printed(notebook(), "work")
    assert levels == "[0.5, 0.5, 0.5]"
    again, *edited = printed(
        FORKED, notebook(), *(notebook(**{part: 0.125}) for part in ("strength", "helper", "default"))
    )
    assert again == first, "the same in every process"
    assert len({first, *edited[:3]}) == 4


def test_no_own_effects_no_digest() -> None:
    assert digest_of_effects() == ""


def test_effect_that_cannot_be_sent_is_named(jobs: Any) -> None:
    class Stuck(Hum):
        held = threading.Lock()

    register(Stuck)
    with pytest.raises(TwingapError, match=r"effects stuck cannot be sent to worker processes: .*load_effects"):
        ask(jobs, "loky")
