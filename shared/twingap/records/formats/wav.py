""".wav files: a channel per index; integers are scaled to full scale = 1."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from twingap.errors import TwingapError
from twingap.records.formats.base import Contents, Entry, Format, truncated


def _read_wav(path: Path) -> tuple[int, NDArray[Any]]:
    from scipy.io import wavfile

    _check_wav(path)
    with warnings.catch_warnings():
        # Recorders add chunks of their own, which are irrelevant here.
        warnings.simplefilter("ignore", wavfile.WavFileWarning)
        try:
            return wavfile.read(path, mmap=True)
        except ValueError:
            return wavfile.read(path)  # 24-bit samples cannot be mapped


def _check_wav(path: Path) -> None:
    """Refuse a file with missing samples, or whose header does not state their number.

    SciPy reads the samples that it finds, and none where a recorder left the sizes at 0.
    """
    with path.open("rb") as stream:
        head = stream.read(12)
        if head[:4] not in (b"RIFF", b"RIFX", b"RF64") or head[8:] != b"WAVE":
            return  # SciPy reports the error
        order: Literal["little", "big"] = "big" if head[:4] == b"RIFX" else "little"
        there = stream.seek(0, os.SEEK_END)
        stated = there if head[:4] == b"RF64" else int.from_bytes(head[4:8], order) + 8
        if stated == 2**32 + 7:
            raise _open_wav()
        at, long = 12, 0
        while at < min(stated, there):
            stream.seek(at)
            chunk = stream.read(32)
            size = int.from_bytes(chunk[4:8], order)
            if chunk[:4] == b"ds64":
                long = int.from_bytes(chunk[16:24], "little")
            if chunk[:4] == b"data":
                size = long if head[:4] == b"RF64" else size
                if size == 2**32 - 1 or (size == 0 and stated < there):
                    raise _open_wav()
            if at + 8 + size > there:
                raise truncated(at + 8 + size - there)
            if chunk[:4] == b"data":
                break
            at += 8 + size + size % 2
        else:
            if stated < there:
                raise _open_wav()
            raise TwingapError("ends before its samples begin", mend="copy or write it again")
        if stated > there:
            raise truncated(stated - there)


def _open_wav() -> TwingapError:
    return TwingapError(
        "does not say how many samples it holds, as recorders leave it that crash or write to a pipe",
        mend="save it again with an audio tool that counts them",
    )


def _inspect(path: Path) -> Contents:
    rate, data = _read_wav(path)
    channels = 1 if data.ndim == 1 else data.shape[1]
    return Contents(tuple(Entry(str(i), len(data)) for i in range(channels)), fs_hz=float(rate))


def _load(path: Path, name: str, place: int) -> Any:
    _, data = _read_wav(path)
    values = data if data.ndim == 1 else data[:, place]
    # Full scale = 1, the convention of audio software, so that a recording reads the same in 8, 16, 24 or 32 bits or as
    # float. SciPy returns 24-bit samples in the upper bytes of 32.
    if values.dtype.kind == "u":
        return (values.astype(np.float64) - 128) / 128
    if values.dtype.kind == "i":
        return values / 2.0 ** (8 * values.dtype.itemsize - 1)
    return values


WAV = Format(_inspect, _load)
