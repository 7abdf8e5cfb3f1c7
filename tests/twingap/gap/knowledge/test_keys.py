"""What is learnt is kept under a key of the code that made it: none of that code may be left out of the key."""

from __future__ import annotations

import ast
import importlib
import inspect
from collections.abc import Iterator
from types import ModuleType

import pytest

from twingap.gap.knowledge import behind_examples, behind_learning, examples, searches

PLAIN = ("twingap.gap.report.model", "twingap.gap.knowledge", "twingap.gap.knowledge.learn")
"""Records of results and of examples; the package that holds the key itself."""


def imported(module: ModuleType) -> Iterator[str]:
    """Modules of the gap diagnosis that this one needs when it runs."""
    tree = ast.parse(inspect.getsource(module))
    for_types = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.ImportFrom) or id(node) in for_types or not str(node.module).startswith("twingap."):
            continue
        for name in (f"{node.module}.{alias.name}" for alias in node.names):
            try:
                importlib.import_module(name)
            except ModuleNotFoundError:  # something in a module
                name = str(node.module)
            if name.startswith("twingap.gap."):
                yield name


def reached(start: ModuleType) -> set[str]:
    """All that it needs, and what these need."""
    found, left = set[str](), [start.__name__]
    while left:
        name = left.pop()
        if name not in found and name not in PLAIN:
            found.add(name)
            left += imported(importlib.import_module(name))
    return found


@pytest.mark.parametrize(
    ("start", "behind"), [(examples, behind_examples()), (searches, (*behind_examples(), *behind_learning()))]
)
def test_all_code_behind_what_is_learnt_is_in_its_key(start: ModuleType, behind: tuple[ModuleType, ...]) -> None:
    known = {module.__name__ for module in behind}
    whole = tuple(f"{module.__name__}." for module in behind if hasattr(module, "__path__"))
    missing = {name for name in reached(start) if not name.startswith(whole) and name not in (*known, *PLAIN)}
    assert not missing
