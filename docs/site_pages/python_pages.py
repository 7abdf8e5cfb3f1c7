"""Pages of the Python interface: the verbs, and the public names of each package."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path
from typing import Any, Final

PACKAGES: Final = {
    "twingap": "The verbs and the data model: records, twin, and what is done with them.",
    "twingap.records": "Record sets in memory and on disk.",
    "twingap.effects": "The catalogue of effects, and what an effect is.",
    "twingap.twins": "Twins, twin files, and simulators of your own.",
    "twingap.signal": "Spectra, envelopes, order tracking, features, mode decomposition.",
    "twingap.identification": "Parameters of twins from records.",
    "twingap.gap": "The diagnosis and its report.",
    "twingap.fleet": "The diagnosis of many machines, and what they share.",
    "twingap.adapt": "Classification of unlabelled records.",
    "twingap.prognosis": "Health indicators and remaining life.",
    "twingap.data": "Public data sets.",
    "twingap.rigs": "Virtual machines that play reality.",
    "twingap.study": "The blind study of the diagnosis.",
    "twingap.sweep": "Many independent jobs, on one machine or a cluster.",
    "twingap.track": "Tracked runs.",
}
"""Public packages and what each is for."""

FURTHER: Final = {
    "twingap.gap": ("twingap.gap.report.model", ("Verdict", "Place", "Candidate", "Metric", "ParameterValue", "Curve")),
}
"""Classes that objects of a package's public classes are made of: package -> their module and names."""


def public(package: str) -> list[tuple[str, Any]]:
    """Its public names and what they are, in the order of `__all__`."""
    module = importlib.import_module(package)
    return [(name, getattr(module, name)) for name in module.__all__ if not name.startswith("__")]


def pages(docs: Path) -> dict[str, str]:
    """reference/python/PACKAGE.rst, and their index."""
    found, seen = {}, set()
    for package, about in PACKAGES.items():
        names = [(f"{package}.{name}", thing) for name, thing in public(package)]
        if package in FURTHER:
            module, further = FURTHER[package]
            names += [(f"{module}.{name}", getattr(importlib.import_module(module), name)) for name in further]
        # What an earlier package has shown is linked there.
        own = [(path, thing) for path, thing in names if not _documented(thing, seen)]
        found[f"reference/python/{package}.rst"] = page(package, about, own)
    rows = "\n".join(f"   {package}" for package in PACKAGES)
    index = _title("Python") + f".. toctree::\n   :maxdepth: 1\n\n{rows}\n"
    listing = "\n".join(f"* :doc:`{package}`: {about}" for package, about in PACKAGES.items())
    found["reference/python/index.rst"] = (
        _title("Python") + "Verbs take records and a twin first, and ``seed`` and ``progress`` by name.\n\n"
        f"{listing}\n\n" + index.split("\n\n", 1)[1].replace(":maxdepth: 1", ":hidden:")
    )
    return found


_ROUTING = "set_fit_request, set_predict_proba_request, set_predict_request, set_score_request"
"""Methods that scikit-learn adds to every estimator, with references into its own documentation."""


def _documented(thing: Any, seen: set[int]) -> bool:
    """Whether this class or function is documented already."""
    if not (inspect.isclass(thing) or inspect.isfunction(thing)):
        return False
    there = id(thing) in seen
    seen.add(id(thing))
    return there


def page(package: str, about: str, names: list[tuple[str, Any]]) -> str:
    """The page of one package."""
    shown = [(path, thing) for path, thing in names if inspect.isclass(thing) or inspect.isfunction(thing)]
    listing = "\n".join(f"   {path}" for path, _ in shown)
    parts = [_title(package), about, "", ".. autosummary::", "", listing, ""]
    for path, thing in shown:
        if inspect.isclass(thing):
            parts += [f".. autoclass:: {path}", "   :members:", f"   :exclude-members: {_ROUTING}", ""]
        else:
            parts += [f".. autofunction:: {path}", ""]
    return "\n".join(parts) + "\n"


def _title(text: str) -> str:
    return f"{text}\n{'=' * len(text)}\n\n"
