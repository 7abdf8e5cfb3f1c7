"""Stored records of a rig: simulated once, then read from one verified file per run.

rig, seed --key--> folder/A148.npy [records, samples] int16 + A148.npy.sha256   --verified, one row at a time--> records

Samples are stored as 16-bit steps of the converter. A complete file is moved into place after its checksum; a file that
does not match its checksum is made again. The truth of a run is not stored.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.files import replacing, sha256
from twingap.records import RecordSet
from twingap.rigs.life_bench import STEP_G
from twingap.rigs.smart_maintenance import SmartMaintenanceRig

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]

_CODE: Final = (
    "life_bench.py", "rolling.py", "smart_maintenance.py", "spall.py", "speed_profile.py", "stored.py", "structure.py",
    "../bearing.py", "../streams.py",
)  # fmt: skip
"""Source files on which the samples depend; a change of any of them gives another folder."""


def stored_folder() -> Path:
    """Folder of stored records: ``TWINGAP_HOME``/rigs, or one in the user's cache folder."""
    home = os.environ.get("TWINGAP_HOME")
    if home:
        return Path(home).absolute() / "rigs"
    import pooch

    return Path(pooch.os_cache("twingap")) / "rigs"


def quiet(what: str, fraction: float) -> None:
    """Do nothing."""


def stored_records(
    rig: SmartMaintenanceRig, seed: int = 0, *, folder: str | os.PathLike[str] | None = None, progress: Progress = quiet
) -> RecordSet:
    """Records of `rig.records(seed)`, read from files that are made when missing.

    Parameters
    ----------
    rig : SmartMaintenanceRig
    seed : int
    folder : path-like, optional
        `stored_folder()` when absent. It has a subfolder for each rig, seed and version of the code; rigs that differ
        only in their bearings share it.
    progress : callable (what, fraction)
        Called while records are made.

    Returns
    -------
    RecordSet
        The same records to the bit; one is in memory at a time.

    Raises
    ------
    TwingapError
        When the folder cannot be written, or a file is changed after this call.
    """
    made = rig.records(seed)
    place = (stored_folder() if folder is None else Path(folder)).absolute() / f"{rig.name}-{key(rig, seed)}"
    paths: list[Path] = []
    rows: list[int] = []
    first = 0
    for bearing_id in rig.bearings:
        count = rig.times_s(bearing_id).size
        path = place / f"{bearing_id}.npy"
        if not _is_complete(path):
            _write(path, made[first : first + count], rig.n_samples, partial(progress, bearing_id))
        paths += [path] * count
        rows += range(count)
        first += count
    return RecordSet(made.name, made.unit, made.bearing, made.conditions, _Stored(tuple(paths), tuple(rows)))


def key(rig: SmartMaintenanceRig, seed: int) -> str:
    """Digest of all that the samples of a run depend on."""
    digest = hashlib.sha256()
    for name in _CODE:
        digest.update((Path(__file__).parent / name).read_bytes())
    about = {name: value for name, value in asdict(rig).items() if name != "bearings"}
    digest.update(repr((seed, sorted(about.items()), np.__version__)).encode())
    return digest.hexdigest()[:16]


@dataclass(frozen=True)
class _Stored:
    """Loader of the samples of record i, as a class, so that it can be pickled for worker processes."""

    paths: tuple[Path, ...]
    rows: tuple[int, ...]
    _verified: set[Path] = field(default_factory=set, compare=False, repr=False)

    def __call__(self, index: int) -> Array:
        path, row = self.paths[index], self.rows[index]
        mend = "make the records again"
        if path not in self._verified:
            if not _is_complete(path):
                raise TwingapError("is missing or does not match its checksum", where=path, mend=mend)
            self._verified.add(path)
        try:
            # Mapped for this row only, so that its memory is released.
            return np.asarray(np.load(path, mmap_mode="r")[row] * STEP_G, dtype=np.float64)
        except (OSError, ValueError, IndexError) as error:
            raise TwingapError(f"cannot be read: {error}", where=path, mend=mend) from error

    def __getstate__(self) -> dict[str, object]:
        return {"paths": self.paths, "rows": self.rows, "_verified": set()}  # every process verifies files itself


def _checksum(path: Path) -> Path:
    return path.with_name(path.name + ".sha256")


def _is_complete(path: Path) -> bool:
    """Whether a file exists and matches its checksum."""
    try:
        found = path.stat()
        expected = _checksum(path).read_text(encoding="ascii").split()[0]
    except (OSError, ValueError, IndexError):
        return False
    return _digest(path, found.st_size, found.st_mtime_ns, found.st_ino) == expected


@lru_cache(maxsize=64)
def _digest(path: Path, size: int, mtime_ns: int, inode: int) -> str:
    """sha256 of a file; the other arguments make the cache depend on its state."""
    return sha256(path)


def _write(path: Path, records: RecordSet, n_samples: int, progress: Callable[[float], None]) -> None:
    """Write the records of a run; an interrupted write leaves no file."""
    header = {"descr": "<i2", "fortran_order": False, "shape": (len(records), n_samples)}
    with replacing(path) as temporary:
        with temporary.open("wb") as stream:
            np.lib.format.write_array_header_1_0(stream, header)
            for place, record in enumerate(records):
                progress(place / len(records))
                stream.write(np.round(record.samples / STEP_G).astype("<i2").tobytes())
        # The checksum is replaced first: if the second replacement fails, the run does not match and is made again.
        with replacing(_checksum(path)) as checksum:
            checksum.write_text(f"{sha256(temporary)}  {path.name}\n", encoding="ascii")
    progress(1.0)
