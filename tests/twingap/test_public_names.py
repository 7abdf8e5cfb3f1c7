"""What packages give by name: all that they promise, functions before modules of that name, nothing heavy unasked."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys

import pytest

PACKAGES = (
    "adapt",
    "data",
    "effects",
    "fleet",
    "gap",
    "identification",
    "prognosis",
    "records",
    "rigs",
    "signal",
    "sweep",
    "twins",
)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_promised_name_is_there_once(package: str) -> None:
    module = importlib.import_module(f"twingap.{package}")
    assert len(set(module.__all__)) == len(module.__all__)
    assert not [name for name in module.__all__ if not hasattr(module, name)]


@pytest.mark.parametrize("name", ["adapt.classify", "prognosis.degrade", "prognosis.follow"])
def test_a_function_is_had_by_its_name_whatever_was_imported_before(name: str) -> None:
    package, function = name.split(".")
    importlib.import_module(f"twingap.{name}")  # binds the module's name in the package where nothing else has
    found = getattr(importlib.import_module(f"twingap.{package}"), function)
    assert inspect.isfunction(found) and found.__module__ == f"twingap.{name}"


def test_prognosis_does_without_torch_and_what_draws() -> None:
    asked = "import sys, twingap.prognosis; print(*{'torch', 'sklearn', 'pandas', 'matplotlib'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


VERBS = ("classify", "diagnose", "identify", "read_records", "read_twin", "simulate")


def test_verbs_are_functions_whatever_was_imported_before() -> None:
    import twingap

    for package in PACKAGES:
        importlib.import_module(f"twingap.{package}")
    assert all(inspect.isfunction(getattr(twingap, name)) for name in VERBS)
    assert set(VERBS) < set(twingap.__all__)


@pytest.mark.parametrize("verb", ["classify", "diagnose", "identify", "simulate"])
def test_verbs_take_records_twin_seed_and_progress(verb: str) -> None:
    import twingap

    parameters = inspect.signature(getattr(twingap, verb)).parameters
    assert list(parameters)[:2] == ["records", "twin"]
    for name, default in (("seed", 0), ("progress", None)):
        assert parameters[name].kind is inspect.Parameter.KEYWORD_ONLY
        assert parameters[name].default == default


def test_importing_twingap_loads_nothing_heavy() -> None:
    asked = "import sys, twingap; print(*{'torch', 'sklearn', 'pandas', 'numba', 'scipy', 'mlflow'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
