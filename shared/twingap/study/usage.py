"""Wall time and peak memory of a block.

with Usage() as used: ...  -->  used.seconds, used.peak_mb
"""

from __future__ import annotations

import contextlib
import resource
import sys
import time
from pathlib import Path
from types import TracebackType

_STATUS, _CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class Usage:
    """Wall time of a block, and the peak resident memory of this process, libraries included: on Linux within the
    block, elsewhere since the process began."""

    seconds: float
    peak_mb: float

    def __enter__(self) -> Usage:
        with contextlib.suppress(OSError):
            _CLEAR.write_text("5", encoding="ascii")  # resets the peak: man 5 proc_pid_clear_refs
        self._begin = time.perf_counter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.seconds = time.perf_counter() - self._begin
        self.peak_mb = _peak_mb()


def _peak_mb() -> float:
    try:
        line = next(r for r in _STATUS.read_text(encoding="ascii").splitlines() if r.startswith("VmHWM:"))
        return float(line.split()[1]) / 1024
    except (OSError, StopIteration):
        largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return largest / (2**20 if sys.platform == "darwin" else 1024)
