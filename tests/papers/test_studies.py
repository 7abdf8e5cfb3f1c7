"""What studies share: sizes, counting, tables and figures, the command line; and that a study has one name only."""

from __future__ import annotations

import ast
import runpy
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from matplotlib.figure import Figure

import papers
from papers import studies
from papers.paper2_digital_twin import dynamics
from papers.paper3_zoa_dann import comparison_study
from twingap.effects import registry
from twingap.errors import TwingapError
from twingap.sweep import sweep
from twingap.track import FolderTracker

SWEEP_JOBS = Path(__file__).parents[1] / "twingap" / "sweep"
TABLE = pd.DataFrame({"name": ["a", "b"], "value": [1.23456789, float("nan")], "met": [True, None]})


@dataclass
class Study:
    tables: dict[str, pd.DataFrame]


def test_a_profile_is_had_by_name() -> None:
    assert studies.profile_of({"smoke": 3}, "smoke", Path("a.toml")) == 3
    with pytest.raises(TwingapError, match=r"a.toml: unknown profile 'huge'; use one of smoke, full"):
        studies.profile_of({"smoke": 3, "full": 4}, "huge", Path("a.toml"))


def test_results_are_counted_and_never_more_than_there_are() -> None:
    said: list[tuple[str, int, int]] = []
    step = studies.Count("work", 1, lambda *told: said.append(told))
    step(None)
    step(None)  # the total is not known yet
    step.total = 4
    step(None)
    assert said == [("work", 1, 1), ("work", 2, 2), ("work", 3, 4)] and step.done == 3


def test_tables_and_figures_are_written_and_logged(tmp_path: Path) -> None:
    figure = Figure(figsize=(1.0, 1.0))
    figure.subplots().plot([0, 1])
    with FolderTracker(tmp_path / "runs").run("study") as log:
        studies.keep_tables({"of-a": TABLE}, tmp_path, log, "made up")
        studies.keep_tables({"of-b": TABLE}, tmp_path, None)
        studies.keep_figures([("of-a", figure)], tmp_path, log)
    assert (tmp_path / "tables" / "of-a.csv").read_text() == "name,value,met\na,1.23457,True\nb,,\n"
    body = "\n\n| name | value | met |\n|---|---|---|\n| a | 1.235 | True |\n| b |  |  |\n"
    assert (tmp_path / "tables" / "of-a.md").read_text() == f"of-a (made up){body}"
    assert (tmp_path / "tables" / "of-b.md").read_text() == f"of-b{body}"
    assert (tmp_path / "figures" / "of-a.png").read_bytes().startswith(b"\x89PNG")
    logged = {p.name for p in (tmp_path / "runs").rglob("*") if p.is_file()}
    assert "of-a.csv" in logged and "of-a.png" in logged and "of-b.csv" not in logged


OWN_EFFECT = """
from dataclasses import dataclass
from typing import ClassVar
from twingap.effects import Effect, Stage, parameter, register

@register
@dataclass(frozen=True)
class Hum(Effect):
    stage: ClassVar[Stage] = Stage.DISTURBANCE
    level: float = parameter(0.25, unit="healthy rms", plausible=(0.01, 1.0), doc="amplitude of the tone")

    def apply(self, draft, rng):
        draft.x += self.level
"""


def test_a_studys_configuration_may_name_an_effect_of_the_users_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(registry, "_OWN", {})
    monkeypatch.syspath_prepend(str(SWEEP_JOBS))
    import sweep_jobs

    config, own = tmp_path / "comparison.toml", tmp_path / "mine.py"
    text = comparison_study.CONFIG.read_text(encoding="utf-8")
    config.write_text(text.replace('A = ["foreign_bearing", ', 'A = ["hum", '), encoding="utf-8")
    own.write_text(OWN_EFFECT, encoding="utf-8")

    def run(profile: str, *, backend: str, **options: Any) -> Study:
        (name, *_) = comparison_study.read_comparison(config).closed["A"]
        found = sweep(sweep_jobs.level_of, [{"name": name, "i": i} for i in range(2)], backend=backend, n_jobs=2)
        return Study({"levels": pd.DataFrame({"level": [result.value[0] for result in found]})})

    typed = ["--out", str(tmp_path), "--no-track"]
    with pytest.raises(SystemExit) as ended:
        studies.command(run, "A study.", lambda study: study.tables, typed)
    assert ended.value.code == 2 and "unknown effect 'hum'" in capsys.readouterr().err
    studies.command(run, "A study.", lambda study: study.tables, [*typed, "--effects", str(own)])
    assert capsys.readouterr().out.split()[1:4] == ["level", "0.25", "0.25"]


def test_a_command_line_runs_the_study_and_prints_its_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given: dict[str, Any] = {}

    def run(profile: str, **options: Any) -> Study:
        given.update(options, profile=profile)
        options["progress"]("work", 1, 2)
        options["progress"]("work", 2, 2)
        return Study({"of-a": TABLE})

    typed = ["--out", str(tmp_path), "--root", "here", "--backend", "sequential"]
    studies.command(run, "A study.", lambda study: study.tables, typed, takes=("root",))
    assert {name: given.pop(name) is not None for name in ("progress", "log")} == {"progress": True, "log": True}
    assert given == {"profile": "smoke", "out": tmp_path, "root": Path("here"), "backend": "sequential"}
    said = capsys.readouterr()
    assert said.out.startswith("\nof-a\n") and "1.235" in said.out
    assert said.out.endswith(f"{tmp_path / 'tables'}\n{tmp_path / 'figures'}\n")
    assert said.err == "\rwork: 1 of 2\rwork: 2 of 2\n"


def test_a_study_run_alone_is_tracked_as_the_pipeline_is_and_taken_up_by_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from mlflow import MlflowClient

    options = dynamics.read_dynamics()
    small = replace(options, settings=("physical",), faults=("inner",), settle_s=0.03, fault_s=0.2, reference_s=0.002)
    monkeypatch.setattr(dynamics, "read_dynamics", lambda path: small)
    uri = f"sqlite:///{tmp_path / 'runs' / 'mlflow.db'}"
    typed = ["--out", str(tmp_path / "out"), "--backend", "sequential", "--tracking-uri", uri]
    monkeypatch.setattr(sys, "argv", ["dynamics", *typed])
    runpy.run_path(str(dynamics.__file__), run_name="__main__")
    dynamics.main([*typed, "--no-track"])
    client = MlflowClient(uri)
    (experiment,) = [e for e in client.search_experiments() if e.name == "paper2 dynamics"]
    (kept,) = client.search_runs([experiment.experiment_id])
    assert kept.info.run_name == "dynamics · smoke · seed 0" and kept.data.params["profile"] == "smoke"
    assert {name: kept.data.tags[name] for name in ("paper", "study")} == {"paper": "paper2", "study": "dynamics"}
    assert any("dynamics-balance" in found.path for found in client.list_artifacts(kept.info.run_id, "tables"))
    assert "dynamics-balance" in capsys.readouterr().out
    again = dynamics.run("smoke", out=tmp_path / "out", backend="sequential", draw=False)
    assert not any(result.why for result in (*again.healthy, *again.faulty))


@pytest.mark.parametrize(
    ("raised", "status", "words"),
    [
        (TwingapError("no such thing"), 2, "twingap: no such thing\n"),
        (KeyboardInterrupt(), 130, "the same command"),
    ],
)
def test_a_command_line_ends_in_one_line(
    raised: BaseException, status: int, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(profile: str, **options: Any) -> Study:
        raise raised

    with pytest.raises(SystemExit) as left:
        studies.command(run, "A study.", lambda study: study.tables, ["--out", str(tmp_path)])
    said = capsys.readouterr()
    assert left.value.code == status and words in said.err and said.err.strip().count("\n") == 0 and said.out == ""


FOLDER = Path(papers.__file__).parent
RUN_ALONE = [p for p in sorted(FOLDER.rglob("*.py")) if '__name__ == "__main__"' in p.read_text(encoding="utf-8")]


@pytest.mark.parametrize("path", RUN_ALONE, ids=lambda p: p.stem)
def test_a_study_run_alone_starts_under_its_own_name(path: Path) -> None:
    """As ``__main__`` its jobs would have other keys than those of the pipeline, and run a second time."""
    own = ".".join(["papers", *path.relative_to(FOLDER).with_suffix("").parts])
    block = ast.parse(path.read_text(encoding="utf-8")).body[-1]
    assert isinstance(block, ast.If)
    (fetched,) = (node for node in block.body if isinstance(node, ast.ImportFrom))
    ((name, known_as),) = ((alias.name, alias.asname) for alias in fetched.names)
    called = {
        node.func.id for node in ast.walk(block) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    assert fetched.module == own and name == "main" and known_as in called and "main" not in called


def test_every_study_is_looked_at() -> None:
    """A study is known by what it takes from :mod:`papers.studies`; the block that runs it alone may be misspelt."""
    with_a_command = {
        path
        for path in FOLDER.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module == "papers.studies"
        if any(alias.name == "command" for alias in node.names)
    }
    assert set(RUN_ALONE) == with_a_command and len(with_a_command) > 10
