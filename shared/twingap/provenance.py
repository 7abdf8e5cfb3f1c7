"""Provenance of a result: digests of settings, code and data, and versions of the software.

settings --canonical--> JSON text --+
code files -------------------------+--> sha256, the same on every machine and in every run
record set, manifest, any file -----+
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import hashlib
import importlib.metadata
import inspect
import json
import os
import platform
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from twingap import files

LIBRARIES = ("twingap", "numpy", "scipy", "pandas", "numba", "torch", "scikit-learn", "mlflow", "joblib")
"""Distributions whose versions are logged with every run."""


def plain(value: Any) -> Any:
    """`value` in JSON types: dataclasses become tables, tuples lists, paths and enums text or numbers.

    Raises
    ------
    TypeError
        For values without a lossless JSON form (sets, arrays, functions, keys that are not text).
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise TypeError(f"key {key!r} of type {type(key).__name__}, text expected")
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, enum.Enum):
        return plain(value.value)
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(f"{type(value).__name__} {value!r:.60} has no JSON form")


def canonical(value: Any) -> str:
    """JSON text that is identical for equal values: keys sorted, no spaces, floats at full precision."""
    return json.dumps(plain(value), sort_keys=True, separators=(",", ":"), ensure_ascii=True)


def digest_of_value(value: Any) -> str:
    """Hex sha256 of `canonical(value)`."""
    return hashlib.sha256(canonical(value).encode("ascii")).hexdigest()


def digest_of_path(path: str | os.PathLike[str]) -> str:
    """Hex sha256 of a file, or of a folder's relative file names and contents."""
    root = Path(path)
    if root.is_file():
        return files.sha256(root)
    inside = sorted(p.relative_to(root).as_posix() for p in root.rglob("*") if p.is_file())
    return digest_of_value({name: files.sha256(root / name) for name in inside})


def digest_of_code(*parts: ModuleType | Any) -> str:
    """Hex sha256 of the source of modules, packages (all their .py files), functions or classes.

    Parameters
    ----------
    *parts : module, function or class
        A function or class stands for the module that defines it.
    """
    found: dict[str, str] = {}
    for part in parts:
        module = part if isinstance(part, ModuleType) else inspect.getmodule(part)
        if module is not None and hasattr(module, "__path__"):
            for folder in module.__path__:
                for path in Path(folder).rglob("*.py"):
                    found[f"{module.__name__}/{path.relative_to(folder).as_posix()}"] = files.sha256(path)
        else:
            source = inspect.getsourcefile(part)
            if source is None:
                raise TypeError(f"{part!r} has no source file")
            found[getattr(module, "__name__", Path(source).stem)] = files.sha256(source)
    return digest_of_value(found)


@functools.cache
def versions() -> dict[str, str]:
    """Versions of Python and of the numerical libraries, the git commit if there is one, and the machine."""
    found = {"python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    found["platform"] = platform.platform()
    found["cores"] = str(os.cpu_count())
    if commit := _git_commit(Path(__file__).resolve().parent):
        found["git_commit"] = commit
    return found


def _git_commit(folder: Path) -> str | None:
    """Commit of the checkout that tracks `folder`, with "+changes" when files differ from it; None without git."""
    git = shutil.which("git")
    if git is None:
        return None

    def ask(*words: str) -> str | None:
        try:
            done = subprocess.run([git, "-C", str(folder), *words], capture_output=True, text=True, timeout=10)
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    # An installed copy may lie inside an unrelated repository (a virtual environment), whose commit is irrelevant.
    if ask("ls-files", "--error-unmatch", "provenance.py") is None:
        return None
    commit = ask("rev-parse", "HEAD")
    if commit is None:
        return None
    return commit + ("+changes" if ask("status", "--porcelain", "--untracked-files=no") else "")
