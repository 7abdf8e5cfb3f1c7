"""Transfer of a user's own effects and twin models to worker processes and clusters, and a digest that detects edits.

A task takes `HandedEffects` as its first argument. Where that is unpickled, the effects of its sender are registered
before any later argument is read: those of a file from the file's text, those registered in Python by value. A worker
that served another sender, or an earlier version, knows just the sender's effects from then on.
"""

from __future__ import annotations

import dataclasses
import hashlib
import secrets
import sys
import types
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, get_type_hints

import numpy as np

from twingap.effects import registry
from twingap.effects.base import Effect
from twingap.effects.registry import EffectFile, load_file
from twingap.errors import TwingapError
from twingap.provenance import digest_of_code, digest_of_value

_PROCESS = secrets.token_hex(8)
_received = ""  # process and digest of the effects that were registered here last


@dataclass(frozen=True)
class HandedEffects:
    """A user's own effects in a form that can be sent.

    Parameters
    ----------
    names : tuple of (str, str)
        Each effect and the module of its file, "" for one registered in Python; in the order of registration.
    files : tuple of EffectFile
    classes : bytes
        Those registered in Python, pickled by value.
    digest : str
        Of all their source; "" without any.
    sender : str
        The process that they come from.
    fault : str
        Why they could not be registered in this process.
    """

    names: tuple[tuple[str, str], ...]
    files: tuple[EffectFile, ...]
    classes: bytes
    digest: str
    sender: str
    fault: str = ""

    def __reduce__(self) -> tuple[Any, ...]:
        return _received_from, (self.names, self.files, self.classes, self.digest, self.sender)

    def check(self) -> None:
        """Raise an error where the sender's effects are not registered.

        Raises
        ------
        TwingapError
        """
        if self.fault:
            raise TwingapError(f"a worker process cannot load your effects: {self.fault}")


def handed_effects() -> HandedEffects:
    """The user's own effects that are registered now."""
    own = registry.own_effects()
    files = {name: file for name, kind in own.items() if (file := registry.file_of(kind)) is not None}
    names = tuple((name, files[name].module if name in files else "") for name in own)
    classes = _by_value({name: kind for name, kind in own.items() if name not in files})
    sent = tuple(dict.fromkeys((*files.values(), *registry.files_of_models())))
    return HandedEffects(names, sent, classes, digest_of_effects(), _PROCESS)


def digest_of_effects() -> str:
    """Hex sha256 of the source of the user's own effects and of files with twin models; "" without any.

    It is part of every stored result's key.
    """
    own = [list(item) for item in digests_of_effects().items()]
    own += [["", hashlib.sha256(file.text.encode()).hexdigest()] for file in registry.files_of_models()]
    return digest_of_value(own) if own else ""


def digests_of_effects() -> dict[str, str]:
    """Hex sha256 of the source of each of the user's own effects, by name, in the order of registration."""
    return {name: _digest(kind) for name, kind in registry.own_effects().items()}


def _received_from(
    names: tuple[tuple[str, str], ...], files: tuple[EffectFile, ...], classes: bytes, digest: str, sender: str
) -> HandedEffects:
    """Register here what is registered in the sending process, and nothing else."""
    global _received
    fault = ""
    if sender != _PROCESS and _received != sender + digest:
        try:
            kinds = {file.module: load_file(file) for file in files}
            if classes:
                kinds[""] = _from_value(classes)
            registry.without_entry_points()
            registry.replace_own({name: kinds[module][name] for name, module in names})
            _received = sender + digest
        except Exception as error:  # raised by `check`: a task that cannot be unpickled would stop its worker
            fault = str(error) if isinstance(error, TwingapError) else f"{type(error).__name__}: {error}"
    return HandedEffects(names, files, classes, digest, sender, fault)


def _by_value(kinds: dict[str, type[Effect]]) -> bytes:
    """The classes themselves rather than the names of their modules, which a cluster need not have."""
    if not kinds:
        return b""
    import cloudpickle

    already = cloudpickle.list_registry_pickle_by_value()
    with ExitStack() as undo:
        for name in {kind.__module__ for kind in kinds.values()} - already - {"__main__"}:
            if (module := sys.modules.get(name)) is not None:
                cloudpickle.register_pickle_by_value(module)
                undo.callback(cloudpickle.unregister_pickle_by_value, module)
        try:
            return bytes(cloudpickle.dumps({name: (kind, get_type_hints(kind)) for name, kind in kinds.items()}))
        except Exception as error:
            mend = "put them into a file and load that with load_effects"
            raise TwingapError(
                f"effects {', '.join(kinds)} cannot be sent to worker processes: {error}", mend=mend
            ) from error


def _from_value(classes: bytes) -> dict[str, type[Effect]]:
    """The classes that `_by_value` has pickled."""
    import cloudpickle

    found: dict[str, tuple[type[Effect], dict[str, Any]]] = cloudpickle.loads(classes)
    for kind, hints in found.values():
        for base in kind.__mro__:  # types in quotes are looked up in the module, which may not be here
            if issubclass(base, Effect) and not base.__module__.startswith("twingap.effects."):
                base.__annotations__ = {name: hints[name] for name in base.__annotations__}
    return {name: kind for name, (kind, _) in found.items()}


def _digest(kind: type[Effect]) -> str:
    """Of an effect's source: the file's text, or the code that runs and the files of the package that it is in."""
    if (file := registry.file_of(kind)) is not None:
        return hashlib.sha256(file.text.encode()).hexdigest()
    module, package = (sys.modules.get(name) for name in (kind.__module__, kind.__module__.partition(".")[0]))
    source = next((part for part in (package, module) if getattr(part, "__file__", None)), None)
    return digest_of_value([_code(kind, kind.__module__, set()), "" if source is None else digest_of_code(source)])


def _code(value: Any, module: str, seen: set[int]) -> Any:
    """What a class, function or constant is made of, in plain JSON form and the same in every process."""
    if isinstance(value, (type, types.FunctionType)):
        known = f"{value.__module__}.{value.__qualname__}"
        if id(value) in seen or str(value.__module__).partition(".")[0] != module.partition(".")[0]:
            return known
        seen.add(id(value))
        if isinstance(value, types.FunctionType):
            held = [cell.cell_contents for cell in value.__closure__ or ()]
            used = [value.__globals__[name] for name in _names(value.__code__) if name in value.__globals__]
            parts = [value.__code__, *(value.__defaults__ or ()), value.__kwdefaults__, *held, *used]
            return [_code(part, module, seen) for part in parts]
        own = {k: v for k, v in vars(value).items() if not k.startswith(("__", "_abc_")) or k == "__post_init__"}
        fields = dataclasses.fields(value) if dataclasses.is_dataclass(value) else ()
        about = [[field.name, repr(field.default), dict(field.metadata)] for field in fields]
        return [known, _code([*value.__bases__, about, dict(sorted(own.items()))], module, seen)]
    if isinstance(value, types.CodeType):
        return [value.co_code.hex(), list(value.co_names), [_code(part, module, seen) for part in value.co_consts]]
    if isinstance(value, (staticmethod, classmethod)):
        return _code(value.__func__, module, seen)
    if isinstance(value, property):
        return _code([value.fget], module, seen)
    if isinstance(value, (list, tuple)):
        return [_code(part, module, seen) for part in value]
    if isinstance(value, dict):
        return {str(key): _code(part, module, seen) for key, part in value.items()}
    if isinstance(value, (set, frozenset)):
        return sorted(repr(part) for part in value)
    if isinstance(value, np.ndarray):
        return [value.dtype.str, list(value.shape), hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if value is None or isinstance(value, (bool, int, float, str, bytes, complex, np.generic)):
        return repr(value)
    return type(value).__qualname__


def _names(code: types.CodeType) -> list[str]:
    """Names that the code looks up, in functions within it too."""
    inner = [name for part in code.co_consts if isinstance(part, types.CodeType) for name in _names(part)]
    return list(dict.fromkeys([*code.co_names, *inner]))
