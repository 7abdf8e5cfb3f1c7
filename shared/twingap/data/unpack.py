"""Archives of data sets: unpacked, with the archives inside them, into the readers' layout.

owner's archive --unpack--> temporary folder --each file that a pattern of the manifest matches--> <root>/<name>/...

Zip files are unpacked by Python; .7z and .rar need an external program.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import Final

from twingap.data.manifest import FilePattern
from twingap.errors import TwingapError

_DEEPEST: Final = 6
"""Levels of archives within archives that are unpacked; a larger value lets hostile archives take longer."""
_PROGRAMS: Final = {
    # IMS uses an old RAR method that 7z cannot read, so it comes last for .rar.
    ".rar": ("unar", "unrar", "bsdtar", "7z"),
    ".7z": ("7z", "7zz", "bsdtar", "unar"),
}


def _command(program: str, archive: Path, folder: Path) -> list[str]:
    match program:
        case "unar":
            return [
                "unar",
                "-quiet",
                "-force-overwrite",
                "-no-directory",
                "-output-directory",
                str(folder),
                str(archive),
            ]
        case "unrar":
            return ["unrar", "x", "-y", "-idq", str(archive), f"{folder}{os.sep}"]
        case "bsdtar":
            return ["bsdtar", "-xf", str(archive), "-C", str(folder)]
        case _:
            return [program, "x", "-y", "-bso0", f"-o{folder}", str(archive)]


def require_unpackers(endings: Iterable[str]) -> None:
    """Check that archives with these suffixes can be unpacked, before a long download.

    Raises
    ------
    TwingapError
        Naming the programs of which one has to be installed.
    """
    for ending in endings:
        programs = _PROGRAMS.get(ending, ())
        if programs and not any(shutil.which(program) for program in programs):
            raise TwingapError(
                f"no program for {ending} archives is installed", mend=f"install one of {', '.join(programs)}"
            )


def unpack(archive: Path, folder: Path, name: str, patterns: Iterable[FilePattern]) -> int:
    """Unpack an archive and move the files that the patterns match to their places.

    Parameters
    ----------
    archive : Path
    folder : Path
        The data set's folder.
    name : str
        The data set's name, the first part of the patterns.
    patterns : iterable of FilePattern

    Returns
    -------
    int
        Number of files put in place.

    Raises
    ------
    TwingapError
        When an archive is damaged or hostile, holds none of the files, or no program can unpack it.
    """
    wanted = list(patterns)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".unpack-", dir=folder) as temporary:
        within = Path(temporary)
        _extract(archive, within / "0", set())
        n = 0
        for path in sorted(p for p in within.rglob("*") if p.is_file()):
            place = _place(path.relative_to(within), name, wanted)
            if place is not None:
                target = folder / place
                target.parent.mkdir(parents=True, exist_ok=True)
                path.replace(target)
                n += 1
    if not n:
        raise TwingapError(
            f"holds none of {', '.join(p.pattern for p in wanted)}", where=archive, mend="fetch the archive anew"
        )
    return n


def _place(path: Path, name: str, patterns: list[FilePattern]) -> PurePosixPath | None:
    """The shortest tail of an unpacked path that matches a pattern: the file's path below the set's folder."""
    parts = path.parts
    for start in range(len(parts) - 1, -1, -1):
        tail = PurePosixPath(*parts[start:])
        if any(p.matches(f"{name}/{tail}") for p in patterns):
            return tail
    return None


def _extract(archive: Path, folder: Path, done: set[str], depth: int = 0) -> None:
    """Extract an archive and the archives inside it; names in `done` are skipped."""
    if depth > _DEEPEST:
        raise TwingapError(f"holds archives within archives, more than {_DEEPEST} deep", where=archive)
    folder.mkdir(parents=True, exist_ok=True)
    if archive.suffix.lower() == ".zip":
        try:
            with zipfile.ZipFile(archive) as held:
                _refuse_bombs(held, archive, folder)
                held.extractall(folder)
        except (zipfile.BadZipFile, zlib.error, OSError, EOFError, ValueError, RuntimeError) as error:
            raise TwingapError(f"cannot be unpacked: {error}", where=archive, mend="fetch it anew") from error
    else:
        _by_program(archive, folder)
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():  # may lead out of the folder
            path.unlink()
    inner = [p for p in sorted(folder.rglob("*")) if p.is_file() and p.suffix.lower() in (".zip", *_PROGRAMS)]
    for path in inner:
        if path.name not in done:
            done.add(path.name)
            _extract(path, path.parent / f"{path.stem}.unpacked", done, depth + 1)
        path.unlink()


def _refuse_bombs(held: zipfile.ZipFile, archive: Path, folder: Path) -> None:
    """Refuse a zip file whose content has no space here; members never unpack to more than they state."""
    needed, free = sum(member.file_size for member in held.infolist()), shutil.disk_usage(folder).free
    if needed > free:
        what = f"unpacks to {needed / 1e9:.1f} GB, {free / 1e9:.1f} GB are free"
        raise TwingapError(what, where=archive, mend="make space, or fetch the archive anew if that is not its size")


def _by_program(archive: Path, folder: Path) -> None:
    ending = archive.suffix.lower()
    require_unpackers([ending])
    output = ""
    for program in _PROGRAMS.get(ending, ()):
        if shutil.which(program):
            run = subprocess.run(_command(program, archive, folder), capture_output=True, text=True, check=False)
            if run.returncode == 0:
                return
            output = f"{program}: {(run.stderr or run.stdout).strip()[-200:]}"
    raise TwingapError(f"cannot be unpacked: {output}", where=archive, mend="install unar, or unpack it by hand")
