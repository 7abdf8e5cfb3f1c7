"""Compiled kernels: where nothing can be written, and how much the first call has to compile."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

KERNEL = """
from twingap._compiled import njit

@njit()
def total(x):
    out = 0.0
    for i in range(x.size):
        out += x[i]
    return out
"""
RUN = "import sys; sys.path.insert(0, sys.argv[1]); import numpy, kernel; print(kernel.total(numpy.arange(5.0)))"
FEATURES = """
import json
from numba.core import event

class Compiled(event.Listener):
    names = []
    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        self.names.append(f"{function.__module__}.{function.__name__}")
    def on_end(self, event):
        pass

event.register("numba:compile", Compiled())
from twingap.gap.knowledge.examples import examples
examples(7, range(1), 8)
print(json.dumps(Compiled.names))
"""


def _python(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "XDG_"))}
    return subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", *arguments], env=kept | environment, capture_output=True,
        text=True, check=False,
    )  # fmt: skip


def test_compiles_in_memory_where_no_folder_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "__pycache__").write_text("a file: no folder of this name can be made, not even by root")
    nowhere = str(tmp_path / "__pycache__" / "below")
    done = _python("-c", RUN, str(tmp_path), HOME=nowhere, XDG_CACHE_HOME=nowhere, NUMBA_CACHE_DIR=nowhere)
    assert (done.returncode, done.stdout, done.stderr) == (0, "10.0\n", "")


def test_keeps_what_it_compiled_where_it_can(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    done = _python("-c", RUN, str(tmp_path), NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert done.stdout == "10.0\n"
    assert list((tmp_path / "cache").rglob("*.nbc"))


@pytest.mark.slow
def test_features_compile_few_functions_besides_their_kernels(tmp_path: Path) -> None:
    # A slice assignment or a sort in one kernel compiles dozens of numba's own functions, seconds of every first run.
    done = _python("-c", FEATURES, NUMBA_CACHE_DIR=str(tmp_path))
    assert done.returncode == 0, done.stderr
    names = json.loads(done.stdout.splitlines()[-1])
    kernels = [name for name in names if name.startswith("twingap.")]
    assert len(kernels) == len(set(kernels)), f"several specialisations: {sorted(kernels)}"
    assert len(names) - len(kernels) <= 12, sorted(set(names) - set(kernels))
