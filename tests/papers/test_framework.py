"""Studies: declared, run, resumed, tracked; keys that follow the code that makes results; one command line for all."""

from __future__ import annotations

import dataclasses
import importlib
import itertools
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from matplotlib.figure import Figure

from papers import imports, reproduce
from papers.__main__ import main
from papers.framework import Step, Study, Work, load_study
from papers.imports import closure
from papers.reproduce import check_configurations, short_names
from twingap.effects import registry
from twingap.errors import TwingapError
from twingap.sweep import SweepError
from twingap.track import FolderTracker

STUDIES = short_names()
PAPERS = Path(reproduce.__file__).parent
CONTRIBUTING = Path(__file__).parents[2] / "CONTRIBUTING.md"


# -- a study of a newcomer's -------------------------------------------------------------------------------------------


@pytest.fixture
def newcomer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The study of CONTRIBUTING.md, written into a folder as that page says."""
    section = CONTRIBUTING.read_text(encoding="utf-8").partition("## Add a study")[2].partition("\n## ")[0]
    config, jobs, study = re.findall(r"(?ms)^```\w+\n(.*?)^```", section)
    folder = tmp_path / "my_studies" / "jitter"
    folder.mkdir(parents=True)
    for name, text in {"config.toml": config, "jobs.py": jobs, "study.py": study}.items():
        (folder / name).write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield folder
    forget()


def forget() -> None:
    """Forget the modules of a newcomer's study and what was read of all modules, as a new process does."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "my_studies"]:
        del sys.modules[name]
    importlib.invalidate_caches()
    for cached in (imports.closure, imports.digest_of_imports, imports._imported, imports._lazy, imports._source):
        cached.cache_clear()


def test_a_study_written_from_the_page_runs_and_is_small(
    newcomer: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = "".join((newcomer / name).read_text(encoding="utf-8") for name in ("jobs.py", "study.py"))
    assert sum(bool(line.strip()) for line in code.splitlines()) <= 80
    main(["my_studies.jitter", "--check-configs"])
    assert capsys.readouterr().out == "my_studies.jitter: profiles smoke, full\n"
    typed = ["my_studies.jitter", "--out", str(tmp_path / "out"), "--backend", "sequential", "--no-track"]
    main(typed)
    said = capsys.readouterr()
    assert said.out.endswith(f"{tmp_path / 'out' / 'tables'}\n"), "no folder of figures where there are none"
    assert "jitter, prominence: 4 of 4" in said.err and "jitter: 4 jobs, 4 of them run now" in said.out
    table = pd.read_csv(tmp_path / "out" / "tables" / "jitter.csv").set_index("jitter")["prominence"]
    assert table[0.001] > 1.2 * table[0.05]
    main(typed)
    assert "jitter: 4 jobs, 0 of them run now" in capsys.readouterr().out


def test_what_is_stored_holds_until_code_that_makes_it_changes(
    newcomer: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A table's code does not make results; a module that the jobs import does."""

    def computed() -> str:
        forget()
        main(["my_studies.jitter", "--out", str(tmp_path / "out"), "--backend", "sequential", "--no-track"])
        (number,) = re.findall(r"(\d) of them run now", capsys.readouterr().out)
        return str(number)

    assert computed() == "4"
    for name, old, new, wanted in (
        ("study.py", "prominence of the", "height of the", "0"),
        ("jobs.py", "bearing.bpfo", "bearing.bpfi", "4"),
        ("helper.py", "", "A = 1", "0"),
        ("jobs.py", "import numpy as np", "import numpy as np\n\nfrom my_studies.jitter import helper", "4"),
        ("helper.py", "A = 1", "A = 2", "4"),
    ):
        path = newcomer / name
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        assert old in text
        path.write_text(text.replace(old, new, 1) if old else new, encoding="utf-8")
        assert computed() == wanted, (name, new)


# -- keys --------------------------------------------------------------------------------------------------------------


def job_functions(study: Study) -> set[str]:
    """Modules whose closure is part of the keys of a study's results, as far as its steps name them."""
    return {step.function.__module__ for step in study.steps if step.jobs is not None}


@pytest.mark.parametrize("package", STUDIES.values(), ids=list(STUDIES))
def test_keys_do_not_hold_what_only_lays_out_or_shows(package: str) -> None:
    for module in job_functions(load_study(package)):
        held = set(closure(module))
        assert module in held and "twingap.errors" in held
        shown = {name for name in held if name.startswith("papers.") and name.endswith((".figures", ".study"))}
        assert not shown and "papers.framework" not in held, module


LOADED = """
import importlib, json, os, sys, types, unittest.mock, numba, pandas, scipy.signal, torch
runner = types.ModuleType("papers.framework")
runner.__getattr__ = lambda name: unittest.mock.MagicMock()
sys.modules["papers.framework"] = runner
for module in sys.argv[1:]:
    if not os.fork():
        importlib.import_module(module)
        print(json.dumps([name for name, held in sys.modules.items() if held]), flush=True)
        os._exit(0)
    assert os.wait()[1] == 0
"""
"""What each module loads in a process that has loaded only the slowest libraries, beside what runs jobs."""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
def test_keys_hold_every_module_that_python_loads() -> None:
    modules = [
        "papers.paper1_rul_varying_speed.job",
        "papers.paper2_digital_twin.dynamics.jobs",
        "papers.paper3_zoa_dann.comparison.trial",
    ]
    said = subprocess.run([sys.executable, "-c", LOADED, *modules], check=True, capture_output=True, text=True).stdout
    for module, line in zip(modules, said.splitlines(), strict=True):
        own = {name for name in json.loads(line) if name.partition(".")[0] in ("papers", "twingap")}
        parents = {module.rsplit(".", k)[0] for k in range(1, module.count(".") + 1)}
        assert len(own) > 20 and own - parents - {imports.RUNNER} <= set(closure(module)), module


def test_names_that_a_package_loads_when_they_are_used_are_followed() -> None:
    assert "twingap.gap.api" in closure("papers.extra.life_gap.diagnoses")


def test_what_runs_jobs_and_what_is_imported_for_types_alone_are_not_followed(newcomer: Path) -> None:
    typed = "from typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n    from my_studies.jitter import study\n"
    jobs = newcomer / "jobs.py"
    jobs.write_text(jobs.read_text(encoding="utf-8") + typed, encoding="utf-8")
    held = closure("my_studies.jitter.jobs")
    assert not {"papers.framework", "my_studies.jitter.study"} & set(held) and "twingap.effects" in held


# -- configurations ----------------------------------------------------------------------------------------------------


def test_every_configuration_is_valid() -> None:
    assert len(check_configurations()) == len(STUDIES)
    declared = {".".join(path.relative_to(PAPERS.parent).parent.parts) for path in PAPERS.rglob("study.py")}
    assert set(STUDIES.values()) == declared, "every study of the project is named in papers/reproduce.py"


def test_a_wrong_configuration_is_found_without_a_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = load_study(STUDIES["paper2.dynamics"])
    text = study.config.read_text(encoding="utf-8")
    wrong = tmp_path / "config.toml"
    wrong.write_text(text.replace("fs_hz = 20000.0", 'fs_hz = "fast"'), encoding="utf-8")
    monkeypatch.setattr(
        sys.modules[f"{STUDIES['paper2.dynamics']}.study"], "STUDY", dataclasses.replace(study, config=wrong)
    )
    with pytest.raises(SystemExit) as left:
        main(["--check-configs"])
    said = capsys.readouterr().err
    assert left.value.code == 2 and said.count("\n") == 1 and "fs_hz" in said and "a finite number expected" in said


@pytest.mark.parametrize("package", STUDIES.values(), ids=list(STUDIES))
def test_every_entry_of_a_configuration_is_explained_and_read(package: str) -> None:
    """An entry has a comment where it stands first: on its line, on the one above, or with its table."""
    study = load_study(package)
    lines = ["", *study.config.read_text(encoding="utf-8").splitlines()]
    seen: set[str] = set()
    table = False
    for above, line in itertools.pairwise(lines):
        said = "#" in line or above.startswith("#")
        if line.startswith("["):
            table = said and not line.startswith("[profiles")
        if (entry := re.match(r"(\w+) =", line)) and entry[1] not in seen:
            seen.add(entry[1])
            assert said or table, f"{entry[1]} is not explained"
    code = "".join(path.read_text(encoding="utf-8") for path in PAPERS.rglob("*.py"))
    for name in (one.name for one in dataclasses.fields(study.options)):
        assert name == "profiles" or f".{name}" in code, f"{name} is not read"


# -- the runner --------------------------------------------------------------------------------------------------------


def made(study: Work) -> dict[str, pd.DataFrame]:
    return {"of-a": pd.DataFrame({"name": ["a", "b"], "value": [1.23456789, float("nan")], "met": [True, None]})}


def drawn(work: Work) -> Iterator[tuple[str, Figure]]:
    figure = Figure(figsize=(1.0, 1.0))
    figure.subplots().plot([0, 1])
    yield "of-a", figure


def doubled(job: Mapping[str, int], plus: int) -> int:
    if job["n"] < 0:
        raise ValueError("negative")
    return 2 * job["n"] + plus


@dataclasses.dataclass(frozen=True)
class Size:
    n: int


@dataclasses.dataclass(frozen=True)
class Options:
    profiles: dict[str, Size]


@pytest.fixture
def study(tmp_path: Path) -> Study:
    config = tmp_path / "config.toml"
    config.write_text("[profiles.smoke]\nn = 3\n[profiles.wrong]\nn = -1\n", encoding="utf-8")
    return Study(
        name="sums", title="sums", config=config, options=Options,
        steps=(
            Step("plus", lambda work: 10),
            Step("doubled", doubled, lambda work: [{"n": work.size.n + k} for k in range(2)],
                 lambda work: {"plus": (work["plus"], str(work["plus"]))}),
        ),
        tables=made, figures=drawn, headlines=("of-a",), columns={"of-a": ("name", "value")}, data="made up",
        metrics=lambda work: {"first": work["doubled"][0].value},
    )  # fmt: skip


def test_steps_run_in_order_and_all_is_written_logged_and_shown(study: Study, tmp_path: Path) -> None:
    said: list[tuple[str, int, int]] = []
    given: dict[str, Any] = {"out": tmp_path / "out", "backend": "sequential"}
    with FolderTracker(tmp_path / "runs").run("sums") as log:
        work = study.run(**given, log=log, progress=lambda *told: said.append(told))
    assert [r.value for r in work["doubled"]] == [16, 18]
    assert said == [("sums, doubled", 1, 2), ("sums, doubled", 2, 2)]
    tables = tmp_path / "out" / "tables"
    assert (tables / "of-a.csv").read_text() == "name,value,met\na,1.23457,True\nb,,\n"
    body = "\n\n| name | value | met |\n|---|---|---|\n| a | 1.235 | True |\n| b |  |  |\n"
    assert (tables / "of-a.md").read_text() == f"of-a (made up){body}"
    assert (tmp_path / "out" / "figures" / "of-a.png").read_bytes().startswith(b"\x89PNG")
    (run,) = (tmp_path / "runs").iterdir()
    parameters = json.loads((run / "parameters.json").read_text(encoding="utf-8"))
    assert "profiles.smoke.n" in parameters and "profiles.wrong.n" not in parameters
    assert {"of-a.csv", "of-a.png", "metrics.csv"} <= {path.name for path in run.rglob("*")}
    ((title, shown),) = work.shown()
    assert title == "sums: of-a (made up)" and list(shown) == ["name", "value"]
    assert work.rows[0]["study"] == "sums" and work.rows[0]["table"] == "of-a"
    again = study.run(**given, draw=False)
    assert (again.finished, again.computed, work.computed) == (2, 0, 2)
    changed = dataclasses.replace(study, steps=(Step("plus", lambda work: 11), study.steps[1]))
    assert [r.value for r in changed.run(**given, draw=False)["doubled"]] == [17, 19], "an input is part of the key"


def test_a_job_that_fails_is_named(study: Study, tmp_path: Path) -> None:
    with pytest.raises(SweepError, match=r"n=-1.*negative"):
        study.run("wrong", out=tmp_path / "out", backend="sequential")


@pytest.mark.parametrize(
    ("given", "said"),
    [({"profile": "huge"}, "unknown profile 'huge'; use one of smoke, wrong"), ({"backend": "slurm"}, "'slurm'")],
)
def test_wrong_input_is_one_line(study: Study, tmp_path: Path, given: dict[str, Any], said: str) -> None:
    with pytest.raises(TwingapError, match=said):
        study.run(**{"out": tmp_path, **given})


# -- papers and the command line --------------------------------------------------------------------------------------


def test_a_paper_is_tracked_resumed_and_gives_headlines(tmp_path: Path) -> None:
    """Dynamics takes seconds; the others have tests of their own."""
    given: dict[str, Any] = {"out": tmp_path / "out", "backend": "sequential", "draw": False, "only": ("dynamics",)}
    first = reproduce.run("paper2", "smoke", **given, tracker=FolderTracker(tmp_path / "runs"))
    assert {(row["study"], row["table"]) for row in first.rows} == {
        ("dynamics", "dynamics-balance"), ("dynamics", "dynamics-faults"),
    }  # fmt: skip
    (inside,) = (tmp_path / "runs").glob("000-paper2*/runs/000-dynamics")
    assert (inside / "tables" / "dynamics-balance.csv").is_file()
    again = reproduce.run("paper2", "smoke", **given)
    assert again.rows == first.rows and not again.works["dynamics"].computed
    assert list(again.notes()) == ["dynamics: 8 jobs, 0 of them run now"]


def test_a_study_whose_data_are_not_at_hand_is_left_out_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TWINGAP_DATA", str(tmp_path))
    outcome = reproduce.run("paper1", "full", out=tmp_path, backend="sequential", only=("femto", "femto_lives"))
    assert outcome.missing == ("femto", "femto_lives") and not outcome.works
    assert list(outcome.notes()) == ["left out, since data are not available: femto, femto_lives"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"profile": "huge"}, "unknown profile 'huge'; use one of smoke, full"),
        ({"only": ("fate",)}, "unknown study 'fate'"),
        ({"backend": "slurm"}, "unknown backend 'slurm'"),
    ],
)
def test_what_no_paper_has_is_one_line(tmp_path: Path, given: dict[str, Any], said: str) -> None:
    with pytest.raises(TwingapError, match=said):
        reproduce.run(**{"paper": "paper2", "out": tmp_path, **given})


def test_a_study_run_alone_is_tracked_as_the_papers_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], new_database: Callable[[Path], str]
) -> None:
    from mlflow import MlflowClient

    uri = new_database(tmp_path / "runs" / "mlflow.db")
    main(["paper2.dynamics", "--out", str(tmp_path / "out"), "--backend", "sequential", "--tracking-uri", uri])
    client = MlflowClient(uri)
    (experiment,) = [e for e in client.search_experiments() if e.name == "paper2 dynamics"]
    (kept,) = client.search_runs([experiment.experiment_id])
    assert kept.info.run_name == "dynamics · smoke · seed 0" and kept.data.params["profile"] == "smoke"
    assert {name: kept.data.tags[name] for name in ("paper", "study")} == {"paper": "paper2", "study": "dynamics"}
    assert any("dynamics-balance" in found.path for found in client.list_artifacts(kept.info.run_id, "tables"))
    assert "dynamics-balance" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (["paper2.fate"], "no study 'papers.paper2_digital_twin.fate'"),
        (["paper2.dynamics", "--profile", "huge"], "unknown profile 'huge'"),
        (["extra.lines", "--root", "nowhere"], "nowhere"),
    ],
)
def test_a_mistake_on_the_command_line_is_one_line(
    typed: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main([*typed, "--out", str(tmp_path), "--no-track"])
    error = capsys.readouterr().err
    assert left.value.code == 2 and error.count("\n") == 1 and said in error


def test_an_interruption_says_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*given: Any, **more: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Study, "run", interrupted)
    with pytest.raises(SystemExit) as left:
        main(["paper2.dynamics", "--out", str(tmp_path), "--no-track"])
    assert left.value.code == 130 and "the same command" in capsys.readouterr().err


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


def test_a_configuration_may_name_an_effect_of_the_users_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where it stands in the file of another study, the check of all configurations needs the user's file."""
    monkeypatch.setattr(registry, "_OWN", {})
    study = load_study(STUDIES["paper3.comparison"])
    config, own = tmp_path / "config.toml", tmp_path / "mine.py"
    text = study.config.read_text(encoding="utf-8")
    config.write_text(text.replace('A = ["foreign_bearing", ', 'A = ["hum", '), encoding="utf-8")
    own.write_text(OWN_EFFECT, encoding="utf-8")
    module = sys.modules[f"{STUDIES['paper3.comparison']}.study"]
    monkeypatch.setattr(module, "STUDY", dataclasses.replace(study, config=config))
    with pytest.raises(SystemExit):
        main(["--check-configs"])
    assert "closed.A: 'hum' found, one of" in capsys.readouterr().err
    main(["--check-configs", "--effects", str(own)])
    assert "paper3.comparison: profiles smoke" in capsys.readouterr().out
