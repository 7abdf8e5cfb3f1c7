"""Mutated files and words given to readers and commands, in one process: samples, results or one line.

    python fuzzing.py FOLDER SEED COUNT

FOLDER holds whole files. What goes wrong is printed as a line of JSON for each input; the last line is a summary.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import os
import random
import resource
import shutil
import signal
import struct
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from twingap.errors import TwingapError

CPU_S = 20.0
"""Time limit of one input."""
MEMORY = 3 << 30
"""Address space beyond that of the imports that one input may take, in bytes."""
NUMBERS = (
    "nan", "inf", "-inf", "-1", "0", "-0.0", "1e308", "1e-320", "1e30", "9" * 400, "2147483648", "1_0", "0x1f", "",
    "\0", "ü轴", "=1+1", "true", "[]", "{}", "[[[[", '"', "'", "\\u0000", ",", ";;", "\r", "null",
    "1979-05-27T07:32:00Z",
)  # fmt: skip
INTEGERS = (0, 1, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1)
TEXT = (".toml", ".csv", ".json", ".txt", ".tsv", ".asc", ".dat", ".lvm")


def mutated(data: bytes, rng: random.Random, text: bool) -> bytes:
    """A few changes of the bytes: single ones, blocks, integers of the format, or numbers of a text."""
    changed = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        size = len(changed)
        at = int(rng.random() ** (1 if rng.random() < 0.5 else 6) * size)  # headers come first
        match rng.randrange(8 if text else 6):
            case 0 if size:
                changed[min(at, size - 1)] = rng.randrange(256)
            case 1:
                changed[at:at] = rng.randbytes(rng.choice((1, 4, 300)))
            case 2:
                del changed[at : at + rng.choice((1, 4, 8, 64, 1000))]
            case 3:
                block = changed[at : at + rng.choice((4, 16, 200))]
                other = rng.randrange(size + 1)
                changed[other:other] = block
            case 4:
                kind = rng.choice(["<I", ">I", "<Q", ">Q", "<H"])
                value = rng.choice(INTEGERS) & (256 ** struct.calcsize(kind) - 1)
                changed[at : at + struct.calcsize(kind)] = struct.pack(kind, value)
            case 5 if rng.random() < 0.3:
                del changed[at:]
            case _ if text:
                parts = changed.decode("utf-8", "replace")
                marks = [i for i, c in enumerate(parts) if c in '=,\n "']
                if marks:
                    start = rng.choice(marks) + 1
                    end = next((i for i in range(start, len(parts)) if parts[i] in ",\n "), len(parts))
                    parts = parts[:start] + rng.choice(NUMBERS) + parts[end:]
                changed = bytearray(parts.encode())
    return bytes(changed)


class _OverTimeError(BaseException):
    """An input takes too long."""


def _over(*_: object) -> None:
    raise _OverTimeError


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    signal.signal(signal.SIGPROF, _over)
    signal.setitimer(signal.ITIMER_PROF, CPU_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def _one_line(error: TwingapError) -> None:
    text = str(error)
    assert text.strip() and len(text.splitlines()) == 1 and len(text) < 2000, f"not one line: {text[:400]!r}"


def command(folder: Path, *words: object) -> None:
    """Run a command in this process; it ends well, or with status 2, one line, and nothing written."""
    from twingap.cli import main
    from twingap.effects import registry

    out, err = io.StringIO(), io.StringIO()
    before = {path.name for path in folder.iterdir()}
    own = registry.own_effects()
    sys.argv = ["twingap", *map(str, words)]
    status: Any = None
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), contextlib.chdir(folder):
        try:
            main()
        except SystemExit as end:
            status = end.code or 0
    registry.replace_own(own)
    said = [line for line in err.getvalue().splitlines() if line.strip()]
    if status == 0:
        return
    assert status == 2, f"status {status}: {said}"
    assert len(said) == 1 and said[0].startswith("twingap: ") and len(said[0]) < 3000, f"{len(said)} lines: {said[:9]}"
    left = {path.name for path in folder.iterdir()} - before
    assert not left, f"left behind: {left}"


def read_samples(path: Path, rng: random.Random, folder: Path) -> None:
    """All channels of a file; every fifth file through `twingap import`."""
    from twingap.records.samples import inspect

    if rng.random() < 0.2:
        rate = ["--fs-hz", 12000] if rng.random() < 0.8 else []
        command(
            folder,
            "import",
            path.name,
            "--speed-rpm",
            1800,
            *rate,
            "--out",
            "new",
            *(["--dry-run"] * (rng.random() < 0.3)),
        )
        return
    for channel in inspect(path).channels[:6]:
        if channel.problem is None:
            with contextlib.suppress(TwingapError):
                samples = channel.load()
                assert samples.dtype == np.float64 and samples.ndim == 1 and np.isfinite(samples).all()


def simulate(path: Path, rng: random.Random, folder: Path) -> None:
    """`twingap simulate` with a mutated twin or table."""
    twin, table = (path.name, "table.csv") if path.suffix == ".toml" else ("twin.toml", path.name)
    command(folder, "simulate", twin, "--records", table, "--fs-hz", 8192, "--duration-s", 0.1, "--out", "new")


def read_set(path: Path, rng: random.Random, folder: Path) -> None:
    """A record set with one mutated file, read, or given to a command that has to refuse it or simulate it."""
    from twingap.records.folder import read_record_set

    if rng.random() < 0.3:
        command(folder, "simulate", "twin.toml", "--records", "set", "--out", "new")
        return
    for record in read_record_set(folder / "set"):
        assert np.isfinite(record.samples).all()


def health(path: Path, rng: random.Random, folder: Path) -> None:
    """`twingap health` on a mutated table of features."""
    command(folder, "health", path.name, "--healthy", 8, "--out", "new")


def lives(path: Path, rng: random.Random, folder: Path) -> None:
    """`twingap rul` with a mutated table of former runs; it has no record set to start with."""
    command(folder, "rul", "set", "--prior", path.name, "--healthy-rows", 8, "--out", "new.csv")


def report(path: Path, rng: random.Random, folder: Path) -> None:
    """gap.json, read back."""
    from twingap.gap.report.files import read_report

    read_report(path)


def words(path: Path, rng: random.Random, folder: Path) -> None:
    """Commands with values that no option expects."""
    values = [*NUMBERS, "set", "twin.toml", "nowhere", "/dev/null", "/proc/self/mem", "..", "-", "--"]
    options = (
        "--out",
        "--seed",
        "--twin",
        "--records",
        "--fs-hz",
        "--json",
        "--names",
        "--effects",
        "--limit",
        "--root",
    )
    name = rng.choice(
        ("simulate", "import", "identify", "gap", "fleet", "close", "classify", "rul", "health", "effects", "bearings",
         "data list", "data verify", "data export", "run", "bench", "train", "study blind", "study public", "nonsense")
    )  # fmt: skip
    given: list[str] = []
    for _ in range(rng.randint(0, 3)):
        given += [rng.choice(options)] * (rng.random() < 0.7) + [rng.choice(values)]
    # Nothing that would really start: the option is unknown everywhere, and comes after what is parsed before it.
    command(folder, *name.split(), *(word for word in given if "\0" not in word), "--no-such-option")
    if name in ("effects", "bearings", "data list", "data verify", "nonsense", "import"):
        typed = [word for word in given if "\0" not in word and word not in ("--out", "--root")]
        command(folder, *name.split(), *typed, *(["--dry-run"] if name == "import" else []))


TARGETS: dict[str, tuple[float, Callable[[Path, random.Random, Path], None]]] = {
    "samples": (0.55, read_samples), "twin": (0.08, simulate), "table": (0.06, simulate), "set": (0.1, read_set),
    "features": (0.03, health), "lives": (0.03, lives), "report": (0.05, report), "words": (0.1, words),
}  # fmt: skip


def _try(kind: str, number: int, seed: int, corpus: Path, top: Path) -> str | None:
    """What goes wrong with one input; None when nothing does."""
    rng = random.Random(f"{seed} {number}")
    folder = top / str(number)
    shutil.copytree(corpus / "base", folder)
    sources = sorted((corpus / kind).rglob("*.*")) if kind != "words" else [corpus / "base" / "twin.toml"]
    source = rng.choice(sources)
    path = folder / "set" / source.relative_to(corpus / "set") if kind == "set" else folder / f"input{source.suffix}"
    if kind != "words":
        path.write_bytes(mutated(source.read_bytes(), rng, source.suffix in TEXT))
    try:
        with _limited():
            TARGETS[kind][1](path, rng, folder)
    except TwingapError as error:
        try:
            _one_line(error)
        except AssertionError as wrong:
            return f"{source.name}: {wrong}"
    except _OverTimeError:
        return f"{source.name}: takes more than {CPU_S:g} s: {_last_frames()}"
    except MemoryError:
        return f"{source.name}: memory ran out: {traceback.format_exc()[-700:]}"
    except BaseException:
        return f"{source.name}: {traceback.format_exc()[-1500:]}"
    finally:
        if not os.environ.get("TWINGAP_FUZZ_KEEP"):
            shutil.rmtree(folder, ignore_errors=True)
    return None


def _last_frames() -> str:
    return traceback.format_exc()[-700:]


def main() -> None:
    """Try inputs; the number of the one in progress is in FOLDER/now, should it end the process."""
    corpus, seed, count = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    import typer.main

    import twingap.cli
    import twingap.gap.report.files
    import twingap.records.folder  # noqa: F401

    # Commands are built from their functions once, not for each input: that took most of the time.
    typer.main.get_command = functools.cache(typer.main.get_command)

    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (held + MEMORY, held + MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    top = corpus / f"work-{seed}"
    top.mkdir()
    kinds, shares = list(TARGETS), [share for share, _ in TARGETS.values()]
    choose = random.Random(seed)
    only = os.environ.get("TWINGAP_FUZZ_ONLY")
    wrong, cpu = 0, dict.fromkeys(TARGETS, 0.0)
    for number in range(count):
        kind = choose.choices(kinds, shares)[0]
        if only and only != f"{number}":
            continue
        (corpus / f"now-{seed}").write_text(f"{kind} {number}")
        begin = time.process_time()
        problem = _try(kind, number, seed, corpus, top)
        cpu[kind] += time.process_time() - begin
        if problem:
            wrong += 1
            print(json.dumps({"kind": kind, "number": number, "problem": problem}), flush=True)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"tried": count, "wrong": wrong, "peak_mb": peak, "cpu_s": cpu}), flush=True)


if __name__ == "__main__":
    main()
