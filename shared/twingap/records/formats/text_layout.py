"""Layout of a table of numbers in a text file: encoding, separator, decimal mark, preamble, names, units.

first lines --separator and decimal mark that make all of them numbers--> where the table begins --> names, units, rate

What is found holds for the whole file or the file is refused: all rows are parsed by it when they are loaded. Where the
first lines allow two readings, neither is chosen.
"""

from __future__ import annotations

import codecs
import csv
import io
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

import numpy as np

from twingap.errors import TwingapError

_LOOK: Final = 1000
"""Lines that are inspected; more are slower and safer."""
_LOOK_BYTES: Final = 1 << 20
"""Bytes that are inspected at most, where lines are long."""
_BLOCK: Final = 1 << 16
_DIALECTS: Final = (
    ("\t", "."), ("\t", ","), (";", "."), (";", ","), ("|", "."), ("|", ","), (" ", ","), (",", "."), (" ", "."),
)  # fmt: skip
"""Separators and decimal marks, in the order in which they are tried."""
SHOWN: Final = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", " ": "blanks"}
_COMMENT: Final = re.compile(r"\s*(#|%|//|\*\*\*|;\s*(?=[A-Za-z]))")
_MARK: Final = re.compile(r"\W*(data|begin( of)? data|values|end of header)\W*", re.IGNORECASE)
"""Line between the names of the columns and the table."""
_LABELS: Final = ("signal", "headers", "header", "channel", "channels", "name", "names")
"""Words that stand before the names of the columns, in a field of their own."""
_NO_NAME: Final = re.compile(
    r"[+\-\u2212\u2013]?\s*[.,]?\d|[+-](nan|inf)|(n/?a|#n/a|null|none|nan\(.*)$", re.IGNORECASE
)
"""Beginnings of text that is a malformed number (a typographic minus sign, a date), or of a missing value."""
_COMMA_NUMBER: Final = re.compile(r"\s*[+-]?(\d+,\d*|,\d+|\d+)([eE][+-]?\d+)?\s*")
_WHOLE: Final = re.compile(r"[+-]?\d+")
_FRACTION: Final = re.compile(r"0\d+|-0")
_EMPTY_END: Final = re.compile(rb"(\A|[\r\n\x1a\x00])[ \t\r\n\x1a\x00]*\Z")
_PROBE: Final = 20
"""Last of the inspected lines that decide the separator; more tolerate more lines of another form."""
_GROUPED: Final = re.compile(r"\s*[+-]?[1-9]\d{0,2}(,\d{3})+\s*")
_PAIR: Final = re.compile(r"[^\W\d][^:=\t;,|]{0,60}[:=]")
_UNITS: Final = re.compile(
    r"s|secs?|seconds?|sek|ms|[uµμ]s|min|h|k?hz|rpm|1/min|min-1|u/min|m?v|volts?|m?a|k?n|nm|m?g|m/s(2|\^2|²|\*\*2)?|mm/s|mm|"
    r"[uµμ]m|m|in|in/s|bar|m?pa|k?w|deg|°|(deg)?c|°c|k|%|--?|ce|dbv?|counts?|samples?|sequence|date|time|hh:mm:ss",
    re.IGNORECASE,
)
_RATE: Final = re.compile(
    r"^\W*((sampl\w*|scan|abtast|acquisition)[ _-]*(rate|freq\w*)|sampling|samplerate|rate|fs|abtastrate|"
    r"abtastfrequenz|delta[ _]?x|dt)\b[^0-9+-]{0,20}([0-9.,]*[0-9](?:e[+-]?\d+)?)\s*"
    r"(khz|hz|hertz|s/s|sps|samples/s|samples/sec|samples/second|samples per second|1/s|ms|s)?\s*([;,|\t\"]|$)",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Layout:
    """How a text file is read.

    Parameters
    ----------
    names : tuple of str
        One per column; the column's index where there is no row of names.
    units : tuple of str
        One per column; empty = not stated.
    separator, decimal : str
    encoding : str
        "utf-8" for UTF-8 and latin-1, whose numbers are the same bytes; else a codec that must be decoded first.
    start : int
        Byte at which the first row of numbers begins (after decoding, where that is needed).
    skipped : int
        Lines above it.
    fs_hz : float or None
        Sampling rate that the preamble states.
    notes : tuple of str
    empty : frozenset of int
        Columns of which all inspected cells are empty.
    text : str or None
        The first field of the rows, where none of the inspected ones is a number.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    separator: str
    decimal: str
    encoding: str
    start: int
    skipped: int
    fs_hz: float | None
    notes: tuple[str, ...]
    empty: frozenset[int] = frozenset()
    text: str | None = None

    def cells(self, line: str) -> list[str]:
        """Fields of a line, without surrounding space."""
        return _cells(line, self.separator)

    def number(self, text: str) -> float | None:
        """The number that a field holds; None when it holds none."""
        return _number(text, self.decimal)


@dataclass(frozen=True, slots=True)
class _Line:
    text: str
    at: int
    number: int


def layout(path: Path) -> Layout:
    """Layout of a text file, from its first lines.

    Raises
    ------
    TwingapError
        Naming the line: no text, a decimal comma between commas, a first row that may be names or samples, rows above
        the table that may belong to it.
    """
    encoding, lines, whole = _first_lines(path)
    filled = [line for line in lines if line.text.strip()]
    if not filled:
        return Layout((), (), ",", ".", encoding, 0, 0, None, ())
    if not whole and len(filled) > 1:
        filled = filled[:-1]  # cut off
    if not whole and len(filled) == 1:
        raise TwingapError(f"has a line of more than {_LOOK_BYTES} bytes", where=f"{path}, line {filled[0].number}")
    try:
        return _layout(filled, encoding)
    except TwingapError as error:
        where = path if error.where is None else f"{path}, line {error.where}"
        raise TwingapError(error.what, where=where, mend=error.mend) from error


def data_rows(path: Path, found: Layout) -> int:
    """Number of lines that are not empty, from the first row of numbers on."""
    if not found.names:
        return 0
    if found.encoding != "utf-8":
        return _filled_lines(io.BytesIO(decoded(path, found.encoding)[found.start :]))
    with path.open("rb") as stream:
        end = last_byte(stream)
        stream.seek(found.start)
        return _filled_lines(stream, end - found.start)


def decoded(path: Path, encoding: str) -> bytes:
    """Content of a file as UTF-8, without surrounding space at its end."""
    data = path.read_bytes().decode(encoding).removeprefix("\ufeff").encode()
    return data[: last_byte(io.BytesIO(data))]


def last_byte(stream: IO[bytes]) -> int:
    """End of the last line of a file that is not empty."""
    end = stream.seek(0, io.SEEK_END)
    while end:
        start = max(0, end - _BLOCK)
        stream.seek(start)
        empty = _EMPTY_END.search(stream.read(end - start))
        if empty is None:
            return end
        end = start + empty.start()
        if empty.start():
            return end
    return 0


def _filled_lines(stream: IO[bytes], size: int | None = None) -> int:
    """Number of lines that are not empty in so many bytes; whatever ends a line: LF, CR LF or CR."""
    count, before = 0, b"\n"
    left = math.inf if size is None else size
    while left > 0 and (block := stream.read(int(min(left, _BLOCK)))):
        left -= len(block)
        block, before = before + block, block[-1:]
        values = np.frombuffer(block, np.uint8)
        ends = np.flatnonzero((values == 10) | (values == 13) if b"\r" in block else values == 10)
        if ends.size:
            count += ends.size - int(ends[0] == 0) - int(np.count_nonzero(np.diff(ends) == 1))
    return count + (before not in b"\r\n")


def _first_lines(path: Path) -> tuple[str, list[_Line], bool]:
    """Encoding, first lines, and whether they are all."""
    with path.open("rb") as stream:
        head = stream.read(_BLOCK)
        encoding = _encoding(head)
        while encoding == "utf-8" and len(head) < _LOOK_BYTES and head.count(b"\n") + head.count(b"\r") < _LOOK:
            more = stream.read(_BLOCK)
            if not more:
                break
            head += more
        whole = not stream.read(1)
    if encoding == "utf-8":
        start = len(codecs.BOM_UTF8) if head.startswith(codecs.BOM_UTF8) else 0
        return encoding, _lines(head, start), whole
    data = decoded(path, encoding)
    return encoding, _lines(data[:_LOOK_BYTES], 0), len(data) <= _LOOK_BYTES


def _encoding(head: bytes) -> str:
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    zeros = head[:4096]
    if b"\0" in zeros:
        even, odd = zeros[::2].count(0), zeros[1::2].count(0)
        if min(even, odd) == 0 and max(even, odd) > 0.3 * len(zeros):
            return "utf-16-be" if even else "utf-16-le"
        raise TwingapError("is no text: it holds null bytes", mend="name a file that was exported as text")
    return "utf-8"


def _lines(head: bytes, start: int) -> list[_Line]:
    lines = []
    for number, found in enumerate(re.finditer(rb"[^\r\n]*(\r\n|\r|\n|\Z)", head[start:]), 1):
        if not found[0] or number > _LOOK:
            break
        raw = found[0].rstrip(b"\r\n")
        try:
            text = raw.decode("utf-8")
        except UnicodeDecodeError:
            text = raw.decode("cp1252", errors="replace")
        lines.append(_Line(text, start + found.start(), number))
    return lines


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    if separator == "\t":
        return [cell.strip().strip('"') for cell in line.split("\t")]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]


def _number(text: str, decimal: str = ".") -> float | None:
    if "_" in text:  # Python accepts underscores as digit separators
        return None
    if decimal == ",":
        if not _COMMA_NUMBER.fullmatch(text):
            return None
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return None


def _layout(lines: list[_Line], encoding: str) -> Layout:
    head = max((i + 1 for i, line in enumerate(lines) if line.text.startswith("***End_of_Header")), default=0)
    head = head if head < len(lines) else 0
    separator, decimal, last = _dialect([line.text for line in lines[head:]])
    rows = [_cells(line.text, separator) for line in lines]
    if decimal == ",":
        _refuse_thousands(rows)
        rows = [[c.replace(",", ".") if _COMMA_NUMBER.fullmatch(c) else c for c in row] for row in rows]
    first, width = _first_row(rows[head:], last)
    first += head
    names: list[str] | None = None
    units: list[str] = []
    notes = []
    above = lines[:first]
    if first:
        names, units, used = _named_above(lines, rows, first, width, separator)
        above = above[: first - used]
    elif _names_columns(rows[0], lines[0], rows[1:]):
        names, first = rows[0], 1
    if separator == "," and names is None:
        _refuse_decimal_commas(rows[first:])
    if separator != "," and width > 1:
        notes.append(f"fields are separated by {SHOWN[separator]}")
    if decimal == ",":
        notes.append("numbers have decimal commas")
    if encoding != "utf-8":
        notes.append(f"text is encoded in {encoding.upper()}")
    if above:
        them = "1 line above the table is" if len(above) == 1 else f"{len(above)} lines above the table are"
        notes.append(f"{them} left out, the first {above[0].text.strip()[:60]!r}")
    if any(units):
        notes.append("units: " + ", ".join(f"{n} in {u}" for n, u in zip(names or (), units, strict=False) if u))
    rates = {rate for line in above if (rate := _rate(line.text, decimal)) is not None}
    if len(rates) > 1:
        notes.append(f"several sampling rates are stated: {', '.join(f'{rate:g}' for rate in sorted(rates))} Hz")
    table = lines[first] if first < len(lines) else None
    end = lines[-1].at + len(lines[-1].text.encode())
    named = names if names is not None else [str(i) for i in range(len(rows[first]) if table else len(rows[0]))]
    units += [""] * (len(named) - len(units))
    filled = [(place, cell) for row in rows[first:] for place, cell in enumerate(row) if cell]
    numbers = any(_is_number(cell) for _, cell in filled)
    return Layout(
        tuple(named), tuple(units), separator, decimal, encoding, table.at if table else end,
        table.number - 1 if table else lines[-1].number, rates.pop() if len(rates) == 1 else None, tuple(notes),
        frozenset(range(len(named))) - {place for place, _ in filled} if table else frozenset(),
        None if numbers or not filled else filled[0][1],
    )  # fmt: skip


def _dialect(lines: Sequence[str]) -> tuple[str, str, int]:
    """Separator and decimal mark that make the last lines rows of equal width with a column of numbers.

    Fewer of the last lines are taken where most lines lie above the table. Their number is the third value.
    """
    for part in (2, 4, 8, 16):
        last = min(_PROBE, -(-len(lines) // part))
        probe = [line for line in lines[-last:] if not _COMMENT.match(line)]
        for separator, decimal in _DIALECTS:
            if _fits(probe, separator, decimal):
                return separator, decimal, last
    return ",", ".", -(-len(lines) // 2)


def _fits(lines: Sequence[str], separator: str, decimal: str) -> bool:
    rows = [_cells(line, separator) for line in lines]
    if not rows:
        return False
    width, count = Counter(map(len, rows)).most_common(1)[0]
    if width < 2 or count < len(rows) / 2:
        return False
    rows = [row for row in rows if len(row) == width]
    numeric = [sum(_number(row[i], decimal) is not None for row in rows) for i in range(width)]
    enough = max(1.0, 0.5 * len(rows))
    good = [n >= enough for n in numeric]
    if separator == " ":
        marked = decimal == "." or any("," in cell for row in rows for cell in row)
        return marked and all(good) and sum(numeric) >= 0.9 * width * len(rows)
    filled = [sum(bool(row[i]) for row in rows) for i in range(width)]
    if decimal == "." and separator != ",":
        # A column that is numbers with decimal commas only is not text.
        commas = [sum(bool(_COMMA_NUMBER.fullmatch(row[i])) for row in rows) for i in range(width)]
        if any(c > n for c, n in zip(commas, numeric, strict=True)):
            return False
    return any(g and f for g, f in zip(good, filled, strict=True))


def _is_row(cells: Sequence[str], width: int, numeric: Sequence[bool]) -> bool:
    """Whether cells are a row of the table: numbers where the table has numbers, and not all empty."""
    if len(cells) != width:
        return False
    numbers = [_is_number(cell) for cell, wanted in zip(cells, numeric, strict=True) if wanted]
    empty = [not cell for cell, wanted in zip(cells, numeric, strict=True) if wanted]
    return any(numbers) and all(n or e for n, e in zip(numbers, empty, strict=True))


def _first_row(rows: list[list[str]], last: int) -> tuple[int, int]:
    """Place of the first row of numbers, 0 where the lines above are none of a preamble; and the table's width."""
    later = rows[-last:]
    width = Counter(map(len, later)).most_common(1)[0][0]
    table = [row for row in later if len(row) == width]
    numeric = [2 * sum(_is_number(row[i]) for row in table) >= len(table) for i in range(width)]
    if not any(numeric):
        return 0, width
    return next((place for place, cells in enumerate(rows) if _is_row(cells, width, numeric)), 0), width


def _named_above(
    lines: list[_Line], rows: list[list[str]], first: int, width: int, separator: str
) -> tuple[list[str] | None, list[str], int]:
    """Names and units in the lines right above the table, and how many lines they take.

    Lines further above are a preamble. What may be a row of the table is refused.
    """
    place = first - 1
    while place and _MARK.fullmatch(lines[place].text):
        place -= 1
    _refuse_lost_rows(lines, rows, first, width, separator)
    table = [row for row in rows[first:] if len(row) == width]
    used = [any(row[i] for row in table) for i in range(width)]
    header = _header(lines[place].text, rows, place, width, separator)
    units: list[str] = []
    if header is not None and place and any(header) and _are_units(header, used):
        names = _header(lines[place - 1].text, rows, place - 1, width, separator)
        if names is not None and any(names) and not any(map(_is_number, names)):
            units = [_bare(unit) if there else "" for unit, there in zip(header, used, strict=True)]
            header, place = names, place - 1
    if header is not None and _is_preamble(lines, rows, place, first, header):
        header, units, place = None, [], first - 1
    if header is not None and _names_columns(header, lines[place], rows[first:]):
        return [_COMMENT.sub("", header[0]).strip(), *header[1:]], units, first - place
    return None, [], 0


def _are_units(cells: list[str], used: list[bool]) -> bool:
    """Whether a row states units, where the table holds values."""
    return all(_is_unit(cell) for cell, there in zip(cells, used, strict=True) if there)


def _is_preamble(lines: list[_Line], rows: list[list[str]], place: int, first: int, cells: list[str]) -> bool:
    """Whether a line with as many fields as the table is a key with its value."""
    if len(cells) == 1:
        return bool(_PAIR.match(_COMMENT.sub("", cells[0]).strip()))
    if _COMMENT.match(lines[place].text):
        return False
    if len(cells) != 2 or _is_number(cells[0]) or not _is_number(cells[1]):
        return False
    apart = lines[first].number > lines[place].number + 1
    return apart or (place > 0 and len(rows[place - 1]) == 2 and not _is_number(rows[place - 1][0]))


def _refuse_lost_rows(lines: list[_Line], rows: list[list[str]], first: int, width: int, separator: str) -> None:
    """Refuse lines above the table that may be rows of it, or names of columns that have decimal commas."""
    above, cells = lines[first - 1], rows[first - 1]
    mend = f"separate fields by {SHOWN[separator]} and write decimal points"
    if _COMMENT.match(above.text):
        return
    fields = re.split(r"[\s;,|]+", above.text.strip())
    if any(cells) and len(cells) != width and all(map(_is_number, filter(None, fields))):
        raise TwingapError(f"has {len(cells)} fields, {width} expected", where=above.number, mend=mend)
    if separator == "," and len(cells) < width and all(_WHOLE.fullmatch(c) for c in rows[first] if c):
        if len(cells) == 1:
            raise TwingapError(
                f"has {width} fields, 1 expected", where=lines[first].number,
                mend="write decimal points: a comma separates fields here",
            )  # fmt: skip
        if not any(_is_number(cell) for cell in cells):
            raise _decimal_commas(lines[first].number)
    texts = [line for line in lines[: first - 1] if not _COMMENT.match(line.text)]
    is_unit = len(texts) == 1 and _is_unit(above.text.strip())
    lone = [line for line in texts if not _PAIR.match(line.text.strip()) and not re.search(r"[,;\t|]", line.text)]
    if width == 1 and lone and not is_unit:
        raise TwingapError(
            f"{above.text.strip()[:80]!r} found, a number expected",
            where=f"{above.number}, column {lone[0].text.strip()[:40]}",
            mend="leave one row of names above the numbers; mark other lines by #",
        )


def _header(text: str, rows: list[list[str]], place: int, width: int, separator: str) -> list[str] | None:
    """Names in a line above the table; None where it has another number of fields."""
    cells = rows[place]
    if separator == " " and len(cells) != width:
        text = _COMMENT.sub("", text)
        for cut in (r"\t+", r"\s{2,}", r"\s*[,;]\s*", r"\s+"):
            cells = [c.strip() for c in re.split(cut, text.strip())]
            if len(cells) == width:
                return cells
        return None
    if separator == "\t" and len(cells) == 1 and len(text.split()) == width:
        return text.split()
    if len(cells) == width + 1 and cells[-1] in ("", "Comment"):  # LabVIEW
        return cells[:-1]
    if len(cells) == width + 1 and cells[0].strip('#;%" ').lower() in _LABELS:
        return cells[1:]
    if len(cells) == width - 1 and not any(row[-1] for row in rows[place + 1 :] if len(row) == width):
        return [*cells, ""]  # rows end in a separator
    return cells if len(cells) == width else None


def _bare(unit: str) -> str:
    return unit.strip().strip("[]()").strip()


def _is_unit(cell: str) -> bool:
    return not cell or _UNITS.fullmatch(_bare(cell)) is not None or (cell[0] in "[(" and cell[-1] in "])")


def _rate(line: str, decimal: str) -> float | None:
    """Sampling rate that a line of a preamble states, Hz."""
    found = _RATE.match(line.strip().strip('"'))
    if found is None:
        return None
    text = found[4].rstrip(".,")
    value = _number(text, "," if "," in text and "." not in text and decimal == "," else ".")
    if not value:
        return None
    unit = (found[5] or "").lower()
    if re.match(r"delta|dt", found[1], re.IGNORECASE):
        return 1000 / value if unit == "ms" else 1 / value if unit in ("", "s") else None
    return None if unit in ("s", "ms") else value * 1000 if unit == "khz" else value


def _refuse_decimal_commas(table: list[list[str]]) -> None:
    """Refuse decimal commas in a comma-separated table without names.

    Their fractions would be read as columns of their own: whole numbers, of which some begin with 0.
    """
    cells = [cell for row in table for cell in row if cell]
    if (
        max(map(len, table), default=0) > 1
        and all(map(_WHOLE.fullmatch, cells))
        and any(map(_FRACTION.fullmatch, cells))
    ):
        raise _decimal_commas(None)


def _decimal_commas(line: int | None) -> TwingapError:
    return TwingapError(
        "has decimal commas in a comma-separated file, which cannot be told apart", where=line,
        mend="export it with decimal points, or with semicolons or tabs between fields",
    )  # fmt: skip


def _refuse_thousands(rows: list[list[str]]) -> None:
    """Refuse numbers that may have decimal commas or commas between thousands."""
    commas = [cell for row in rows for cell in row if "," in cell and _COMMA_NUMBER.fullmatch(cell)]
    if commas and all(map(_GROUPED.fullmatch, commas)):
        raise TwingapError(
            f"{commas[0]!r} may have a decimal comma or a comma between thousands",
            mend="export it with decimal points and without commas",
        )


def _names_columns(cells: list[str], line: _Line, below: Sequence[Sequence[str]]) -> bool:
    """Whether a row is a header, judged by it and the rows below; ambiguous files are refused.

    pandas names unnamed columns 0, 1, 2, ..., and then writes every sample with a decimal point.
    """
    filled = [cell for cell in cells if cell]
    texts = [cell for cell in filled if _number(cell) is None]
    numbers = [cell for cell in filled if _number(cell) is not None]
    second = list(below[0]) if below else []
    counted = numbers == [str(i) for i in range(len(numbers))]
    if texts:
        if _COMMENT.match(line.text):  # a header written by NumPy
            return True
        for text in texts:
            if _NO_NAME.match(text) or not any(c.isalpha() for c in text):
                raise TwingapError(
                    f"{text[:80]!r} is neither a number nor the name of a column", where=line.number,
                    mend="separate fields by commas and write decimal points, or put a row of column names first",
                )  # fmt: skip
        if not any(_is_number(cell) for row in below for cell in row):  # lines above a table that is missing
            return True
        if numbers and not (counted and all(_is_number(cell) for cell in second)):
            raise TwingapError(
                f"mixes numbers ({numbers[0][:80]!r}) and text ({texts[0][:80]!r})", where=line.number,
                mend="put a row of column names first, none of them a number",
            )  # fmt: skip
        return True
    if filled and not cells[0] and second and second[0]:  # the empty header of an index column
        if counted:
            return True
    elif not counted or not 0 < len(filled) == len(cells):
        return False
    elif len(cells) == 1:
        if not _all_pointed(below):
            return False
    elif _all_pointed(below) and not _counts_on(below):
        return True
    raise TwingapError(
        f"{','.join(cells)[:80]!r} may be the names of columns or samples", where=line.number,
        mend="put a row of names first that are no numbers, or write all samples with decimal points (0.0)",
    )  # fmt: skip


def _is_number(text: str) -> bool:
    return _number(text) is not None


def _all_pointed(below: Sequence[Sequence[str]]) -> bool:
    """Whether samples are present and none is written as a whole number."""
    return bool(below) and not any(cell.lstrip("+-").isdecimal() for row in below for cell in row)


def _counts_on(below: Sequence[Sequence[str]]) -> bool:
    """Whether the first column continues as a time axis that starts at 0 in the row above."""
    try:
        one, two = (float(row[0]) for row in below[:2])
    except (ValueError, IndexError):
        return False
    return one > 0 and math.isclose(two, 2 * one, rel_tol=1e-3)
