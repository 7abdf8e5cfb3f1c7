"""Digest of a module and of everything in this project that it imports: the code that a result depends on.

Imports inside functions count, those for type checkers do not. Standard library and installed packages are left out.
"""

import ast
import functools
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from twingap import files
from twingap.provenance import digest_of_value

HOME: Final = frozenset({"papers", "twingap"})
"""Top-level packages that are followed, besides that of the module itself."""
RUNNER: Final = "papers.framework"
"""What runs jobs makes no results: it is not followed."""


@functools.cache
def digest_of_imports(module: str) -> str:
    """Hex sha256 of the sources in `closure`."""
    return digest_of_value({name: files.sha256(path) for name, path in closure(module).items()})


@functools.cache
def closure(module: str) -> dict[str, Path]:
    """Sources of a module and of all modules in its packages that it imports, directly or not: dotted name -> file,
    sorted. The packages that hold the module are not followed: they declare studies."""
    home = HOME | {module.partition(".")[0]}
    found: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = _source(name)
        if name in found or name == RUNNER or path is None:
            continue
        found[name] = path
        waiting += [other for other in _imported(name, path) if other.partition(".")[0] in home]
    return dict(sorted(found.items()))


@functools.cache
def _imported(module: str, path: Path) -> frozenset[str]:
    """Modules, with the packages that hold them, that a module's statements import."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    names: set[str] = set()
    for node, typing_only in _statements(path):
        if typing_only:
            continue
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
            continue
        base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
        names.add(base)
        for alias in node.names:
            inner = f"{base}.{alias.name}"
            names.add(inner if _source(inner) else _lazy(base).get(alias.name, base))
    parts = (name.split(".") for name in names)
    return frozenset(".".join(p[:i]) for p in parts for i in range(1, len(p) + 1))


@functools.cache
def _lazy(package: str) -> dict[str, str]:
    """Names that a package imports when they are first used, which it declares for type checkers: name -> module."""
    path = _source(package)
    if path is None or path.name != "__init__.py":
        return {}
    nodes = (node for node, typing_only in _statements(path) if typing_only and isinstance(node, ast.ImportFrom))
    return {alias.asname or alias.name: node.module or package for node in nodes for alias in node.names}


def _statements(path: Path) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    """Import statements, and whether only a type checker executes them."""
    waiting: list[tuple[ast.AST, bool]] = [(ast.parse(path.read_text(encoding="utf-8")), False)]
    while waiting:
        node, typing_only = waiting.pop()
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node, typing_only
        elif isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING"):
            waiting += [(child, True) for child in node.body] + [(child, typing_only) for child in node.orelse]
        else:
            waiting += [(child, typing_only) for child in ast.iter_child_nodes(node)]


@functools.cache
def _source(module: str) -> Path | None:
    """Source file of a module; None where there is no such module, or it is not written in Python."""
    try:
        spec = importlib.util.find_spec(module)
    except (ModuleNotFoundError, AttributeError, ValueError):
        return None
    return Path(spec.origin) if spec is not None and spec.origin and spec.origin.endswith(".py") else None
