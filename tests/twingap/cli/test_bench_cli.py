"""`twingap bench`: runs, shows targets met and missed, logs; a user's mistakes are one line."""

from __future__ import annotations

import ast
import importlib
import json
import os
import re
import sqlite3
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from numba import cuda

import benchmarks
from benchmarks.harness import Measurement, Target
from twingap.errors import TwingapError

FAKE = """
from benchmarks.harness import Measurement, Target

def measure(quick, seed=0):
    rows = [
        {"rival": "ours \\u00fc [red]", "ms": 1.25, "ratio": float("nan")},
        {"rival": "peer", "ms": 12.5, "ratio": 10.0},
    ]
    targets = [Target("speed-up (x)", 10.0, 5.0), Target("agreement", 0.5, 1.0)]
    return Measurement("ours against a peer", rows, targets, [f"seed {seed}, quick {quick}"])
"""


@pytest.fixture
def fake(tmp_path: Path) -> Path:
    """A project folder whose package of benchmarks has one more, in a copy of its own."""
    package = tmp_path / "benchmarks"
    package.mkdir()
    for name in ("__init__.py", "harness.py", "_written.py"):
        (package / name).write_bytes((Path(benchmarks.__file__).parent / name).read_bytes())
    (package / "fake.py").write_text(FAKE, encoding="utf-8")
    (package / "needy.py").write_text("import no_such_peer_of_ours\n")
    return tmp_path


def bench(folder: Path, *words: str, **env: str) -> subprocess.CompletedProcess[str]:
    clean = {k: v for k, v in os.environ.items() if k not in ("MLFLOW_TRACKING_URI", "TWINGAP_HOME")}
    return subprocess.run(
        [sys.executable, "-m", "twingap.cli", "bench", *words],
        cwd=folder,
        env={**clean, "PYTHONPATH": os.pathsep.join([str(folder), *filter(None, sys.path)]), **env},
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_names_are_the_modules_beside_the_harness() -> None:
    folder = Path(benchmarks.__file__).parent
    expected = {p.stem for p in folder.glob("[a-z]*.py")} - {"harness"}
    assert set(benchmarks.names()) == expected


def test_a_target_is_met_from_its_value_on() -> None:
    assert Target("t", 5.0, 5.0).met and not Target("t", 4.999, 5.0).met
    assert not Target("t", float("nan"), 0.0).met
    assert Measurement("m", []).targets == ()


def test_it_prints_table_targets_and_notes_and_logs_them(fake: Path) -> None:
    done = bench(fake, "fake", "--quick", "--seed", "7")
    assert done.returncode == 0, done.stderr
    assert "ours ü [red]" in done.stdout and "12.5" in done.stdout
    assert "met     speed-up (x): 10 (at least 5)" in done.stdout
    assert "missed  agreement: 0.5 (at least 1)" in done.stdout
    assert "seed 7, quick True" in done.stdout
    assert done.stdout.splitlines()[-1].endswith("mlflow.db")
    with sqlite3.connect(fake / ".twingap" / "mlflow.db") as database:
        assert database.execute("SELECT name, status FROM runs").fetchall() == [("bench fake", "FINISHED")]
        assert dict(database.execute("SELECT key, value FROM metrics"))["speed-up x"] == 10.0
    logged = next((fake / ".twingap" / "artifacts").rglob("measured.csv"))
    assert logged.read_text(encoding="utf-8").splitlines()[0] == "rival,ms,ratio"


def test_json_is_valid_in_any_alphabet_and_strict_fails_on_a_miss(fake: Path) -> None:
    done = bench(fake, "fake", "--json", "--strict", "--no-track", "--out", "to", PYTHONIOENCODING="ascii", LANG="C")
    assert done.returncode == 1, done.stderr

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    (report,) = json.loads(done.stdout, parse_constant=refuse)
    assert report["rows"][0] == {"rival": "ours ü [red]", "ms": 1.25, "ratio": None}
    assert [t["met"] for t in report["targets"]] == [True, False]
    assert not (fake / ".twingap").exists()
    (written,) = json.loads((fake / "to" / "bench.json").read_text(encoding="utf-8"))["benchmarks"]
    assert {key: written[key] for key in report} == report
    page = (fake / "to" / "benchmarks.md").read_text(encoding="utf-8")
    assert "| ours ü \\[red] | 1.25 |  |" in page and "| agreement | 0.5 | 1 | no |" in page
    chart = (fake / "to" / "benchmarks.svg").read_text(encoding="utf-8")
    assert "fake: agreement" in chart and "> 0.5<" in chart
    # The bar of what was missed, hatched, has a width.
    (path,) = re.findall(r'<path d="([^"]*)"[^>]*fill: url', chart)
    places = [float(x) for x in re.findall(r"[ML] ([\d.]+)", path)]
    assert max(places) - min(places) > 10
    shown = bench(fake, "fake", "--no-track", PYTHONIOENCODING="ascii", LANG="C")
    assert shown.returncode == 0 and "ours \\xfc [red]" in shown.stdout


def test_result_of_a_benchmark_replaces_its_own_former_one_only(tmp_path: Path) -> None:
    from benchmarks import _written

    def report(name: str, measured: float) -> dict[str, object]:
        target = {"target": "t", "measured": measured, "at least": 1.0, "met": measured >= 1}
        return {"benchmark": name, "title": "t", "quick": False, "rows": [], "targets": [target], "notes": []}

    _written.write([report("a", 2.0), report("b", 3.0)], tmp_path)
    _written.write([report("b", 0.5)], tmp_path)
    held = _written.read(tmp_path / "bench.json")
    assert [(one["benchmark"], *_written.targets(one)) for one in held] == [
        ("a", ("t", 2.0, True)),
        ("b", ("t", 0.5, False)),
    ]
    (tmp_path / "bench.json").write_text("{}")
    with pytest.raises(TwingapError, match="no result of benchmarks"):
        _written.write([report("b", 1.0)], tmp_path)


def test_mistakes_are_one_line(fake: Path) -> None:
    (fake / "file").write_text("")
    for words, expected in (
        (["nothing"], "unknown benchmark 'nothing'; known: fake, needy"),
        (["needy", "--no-track"], "needs no_such_peer_of_ours, which is not installed; pip install 'twingap[bench]'"),
        (["fake", "--tracking-uri", f"sqlite:///{fake / 'file' / 'x.db'}"], "cannot be used"),
    ):
        done = bench(fake, *words)
        assert done.returncode == 2 and done.stdout == ""
        assert done.stderr.count("\n") == 1 and expected in done.stderr


def test_one_that_cannot_run_is_left_out_of_all(fake: Path) -> None:
    done = bench(fake, "--no-track")
    assert done.returncode == 0 and "ours against a peer" in done.stdout
    assert done.stderr.splitlines()[-1].startswith("left out: benchmark needy: needs no_such_peer")


@pytest.mark.skipif(cuda.is_available(), reason="there is a GPU")
def test_without_a_gpu_it_says_so(tmp_path: Path) -> None:
    done = bench(tmp_path, "gpu", "--no-track")
    assert done.returncode == 2 and done.stdout == ""
    last = done.stderr.splitlines()[-1]
    assert last.startswith("twingap: benchmark gpu: there is no GPU that CUDA can use; it takes")


def test_what_benchmarks_import_from_the_project_exists() -> None:
    """Benchmarks import when they run, so that a name that was moved would be missed by every other test."""
    for file in sorted(Path(benchmarks.__file__).parent.glob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).partition(".")[0] in ("twingap", "papers"):
                module = importlib.import_module(str(node.module))
                missing = [
                    name.name for name in node.names
                    if not hasattr(module, name.name) and find_spec(f"{node.module}.{name.name}") is None
                ]  # fmt: skip
                assert not missing, f"{file.name}: {node.module} has no {missing}"
