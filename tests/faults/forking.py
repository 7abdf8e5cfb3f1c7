"""Server that runs `twingap ...` in forked copies of itself, which are killed, limited or watched as is asked.

A fork has all imports already, so that a trial costs what the command costs. Requests and replies are lines of JSON.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.link", "os.symlink")
NETWORK = ("socket.connect", "socket.getaddrinfo", "socket.sendto", "socket.gethostbyname")


def _writes(event: str, arguments: tuple[Any, ...]) -> bool:
    """Whether an audit event changes files, other than the output of the command itself."""
    if event == "open":
        return isinstance(arguments[0], (str, bytes, Path)) and bool(arguments[2] & WRITING)
    return event in CHANGES


def _leaves_machine(event: str, arguments: tuple[Any, ...]) -> bool:
    """Whether an audit event is an attempt to reach another machine."""
    if event not in NETWORK:
        return False
    target = arguments[0] if event in ("socket.getaddrinfo", "socket.gethostbyname") else arguments[1]
    host = target[0] if isinstance(target, tuple) else target
    if isinstance(host, bytes):
        host = host.decode(errors="replace")
    return not (host in (None, "", "localhost") or str(host).startswith(("127.", "::1", "/", "\0")))


def _watch(kill_at: int | None, watch_network: bool, note: int) -> Callable[[], int]:
    """Count changes of files, end this process at one of them, and note attempts to reach other machines."""
    count = 0

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        nonlocal count
        if _writes(event, arguments):
            count += 1
            if count == kill_at:
                os.kill(os.getpid(), signal.SIGKILL)
        elif watch_network and _leaves_machine(event, arguments):
            os.write(note, f"{event} {arguments[-1]!r}\n".encode())

    sys.addaudithook(hook)
    return lambda: count


def _child(asked: dict[str, Any], out: int, err: int, note: int, begins: int) -> None:
    """Run one command, after its function `prepare` (as module:function); never returns.

    `begins`, the end of a pipe, is closed when the command begins.
    """
    status, changes = 99, lambda: 0
    try:
        os.setsid()
        os.dup2(out, 1)
        os.dup2(err, 2)
        sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
        os.environ.update(asked["env"])
        os.chdir(asked["cwd"])
        for name, value in asked["limits"].items():
            resource.setrlimit(getattr(resource, name), (value, value))
        if asked["uid"]:
            os.setgroups([])
            os.setgid(asked["uid"])
            os.setuid(asked["uid"])
        if asked["clock_s"]:
            true = time.time
            time.time = lambda: true() + asked["clock_s"]
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if asked["prepare"]:
            module, function = asked["prepare"].split(":")
            getattr(importlib.import_module(module), function)()
        changes = _watch(asked["kill_at"], asked["watch_network"], note)
        sys.argv = ["twingap", *asked["words"]]
        from twingap.cli import main

        os.close(begins)
        main()
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1 if end.code else 0
    except BaseException:
        traceback.print_exc()
        status = 98
    finally:
        os.write(note, f"changes {changes()}\n".encode())
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _serve_one(asked: dict[str, Any]) -> dict[str, Any]:
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err, tempfile.TemporaryFile() as note:
        wait, begins = os.pipe()
        pid = os.fork()
        if not pid:
            os.close(wait)
            _child(asked, out.fileno(), err.fileno(), note.fileno(), begins)
        os.close(begins)
        os.read(wait, 1)  # times of signals count from the beginning of the command
        os.close(wait)
        begin = time.monotonic()
        interrupts = sorted(asked["signals"], key=lambda item: item[0])
        timed_out = False
        while True:
            done, status, usage = os.wait4(pid, os.WNOHANG)
            if done:
                break
            passed = time.monotonic() - begin
            while interrupts and passed >= interrupts[0][0]:
                os.kill(pid, interrupts.pop(0)[1])
            if passed > asked["timeout_s"]:
                timed_out = True
                os.killpg(pid, signal.SIGKILL)
            time.sleep(0.003)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)  # workers that it has left
        said = []
        for stream in (out, err, note):
            stream.seek(0)
            said.append(stream.read().decode(errors="replace"))
        lines = said[2].splitlines()
        changes = [int(line.split()[1]) for line in lines if line.startswith("changes ")]
        return {
            "status": os.waitstatus_to_exitcode(status), "out": said[0], "err": said[1], "timed_out": timed_out,
            "seconds": time.monotonic() - begin, "cpu_s": usage.ru_utime + usage.ru_stime,
            "peak_mb": usage.ru_maxrss / 1024, "changes": changes[0] if changes else None,
            "network": [line for line in lines if not line.startswith("changes ")],
        }  # fmt: skip


MODULES = (
    "twingap.cli", "twingap.gap", "twingap.gap.report.tracking", "twingap.fleet", "twingap.fleet.tracking",
    "twingap.records.folder", "twingap.records.conditions", "twingap.data.importing", "twingap.twins.contact",
    "twingap.twins.phenomenological", "twingap.identification", "h5py", "scipy.io", "pyarrow.parquet",
)  # fmt: skip
"""What the ordinary suite's commands import."""
LATER = (
    "twingap.gap.api", "twingap.gap.closest", "twingap.gap.report.files", "twingap.gap.report.page",
    "twingap.gap.report.figures", "twingap.study.runner", "twingap.study.written", "twingap.study.closure",
    "twingap.study.prepare", "twingap.rigs.worlds", "papers.paper1_rul_varying_speed.lives.study", "torch", "mlflow",
    "matplotlib.pyplot",
)  # fmt: skip
"""What the full run's commands import beyond that: some seconds for the server, saved by each of its forks."""


def main() -> None:
    """Import what commands import, then answer requests until the input ends."""
    for module in (*MODULES, *(LATER if os.environ.get("TWINGAP_FAULTS") == "full" else ())):
        with contextlib.suppress(ImportError):
            importlib.import_module(module)
    replies = os.fdopen(os.dup(1), "w")
    print(json.dumps({"ready": True}), file=replies, flush=True)
    for line in sys.stdin:
        print(json.dumps(_serve_one(json.loads(line))), file=replies, flush=True)


if __name__ == "__main__":
    main()
