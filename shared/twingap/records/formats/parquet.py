""".parquet files: a channel per column of numbers; lists of numbers as `x[row 0]`, or `x` where there is one row."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from twingap.errors import TwingapError
from twingap.records.formats.base import MOST_PARTS, MOST_SAMPLES, Contents, Entry, Format, row_or_column


def _inspect(path: Path) -> Contents:
    import pyarrow.parquet as pq

    entries: list[Entry] = []
    with pq.ParquetFile(path) as file:
        rows, schema = file.metadata.num_rows, file.schema_arrow
        for field in schema:
            if _is_list(field.type) and _is_number(field.type.value_type):
                entries += _lists(file, field.name, rows)
                continue
            problem = None if _is_number(field.type) else f"holds values of type {field.type}, real numbers expected"
            if rows > MOST_SAMPLES:
                problem = problem or f"states {rows} values, at most {MOST_SAMPLES} are read"
            entries.append(Entry(field.name, rows, problem))
    return Contents(tuple(entries))


def _is_number(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind))


def _is_list(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def _lists(file: Any, name: str, rows: int) -> list[Entry]:
    """A channel per row of a column of lists."""
    import pyarrow.compute as pc

    leaves = [
        i
        for i in range(file.metadata.num_columns)
        if file.metadata.schema.column(i).path.split(".")[0] == name and file.metadata.num_row_groups
    ]
    groups = range(file.metadata.num_row_groups)
    values = sum(file.metadata.row_group(g).column(i).num_values for g in groups for i in leaves)
    if rows > MOST_PARTS or values > MOST_SAMPLES:
        return [Entry(name, values, f"holds {rows} lists with {values} values, more than are read")]
    lengths = [
        int(length or 0)
        for batch in file.iter_batches(batch_size=64, columns=[name], use_threads=False)
        for length in pc.list_value_length(batch.column(0)).to_pylist()
    ]
    if rows == 1:
        return [Entry(name, lengths[0])]
    return [Entry(f"{name}[row {i}]", length) for i, length in enumerate(lengths)]


def _load(path: Path, name: str, place: int) -> Any:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        names = file.schema_arrow.names
        part = None if name in names else row_or_column(name)
        key, row = (name, 0) if part is None else (part[0], part[2])
        if names.count(key) > 1:
            raise TwingapError(f"has several columns {key!r}", where=path, mend="rename them")
        if _is_list(file.schema_arrow.field(key).type):
            column = _row(file, key, row)
        else:
            column = file.read(columns=[key], use_threads=False).column(key)
    if column.null_count:
        gap = column.is_null().index(True).as_py()
        where = f"{path}, channel {name}"
        raise TwingapError(f"sample {gap} is missing", where=where, mend="mend it or leave the record out")
    return column.to_numpy()


def _row(file: Any, name: str, row: int) -> Any:
    """The values of one list."""
    first = 0
    for batch in file.iter_batches(batch_size=64, columns=[name], use_threads=False):
        if row < first + batch.num_rows:
            return batch.column(0).slice(row - first, 1).flatten()
        first += batch.num_rows
    raise IndexError(row)


PARQUET = Format(_inspect, _load)
