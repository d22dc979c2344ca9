"""Rows of ``data.csv``: made from measured cells, written, read back, selected and summed up."""

from __future__ import annotations

import csv
import io
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path

from shadowbench.reproduce.items import Measured, Row

WHERE = ("scene", "size", "published_size", "frame", "method")
"""The columns that every table begins with: what was measured."""


def cell_rows(*columns: str) -> Callable[[Sequence[Measured]], list[Row]]:
    """Make a function that turns each cell into one row.

    Parameters
    ----------
    *columns : counters by name; ``wrong``, ``false_shadow``, ``false_light`` and
        ``lit_candidates``, samples; ``seconds``, the median time; ``stage.NAME``, the
        median time of a stage; ``memory.NAME``, the bytes of a structure; ``COUNTER.level``, one column per tree level.
    """
    def rows(measured: Sequence[Measured]) -> list[Row]:
        return [{**where(each), **{name: value for column in columns for name, value in _values(each, column).items()}}
                for each in measured]
    return rows


def where(measured: Measured) -> dict[str, int | float | str]:
    """Say what was measured, in the columns `WHERE`; also ``height``, ``triangles`` and ``light`` where they are not the
    usual ones."""
    measurement, cell = measured
    light = "" if measurement.light is None else " ".join(f"{value:g}" for value in measurement.light)
    unusual: dict[str, int | float | str] = {"height": measurement.height, "triangles": measurement.triangles,
                                             "light": light}
    return {"scene": cell.scene, "size": measurement.size, "published_size": measurement.published_size or measurement.size,
            "frame": cell.frame, "method": cell.label, **{name: value for name, value in unusual.items() if value}}


def _values(measured: Measured, column: str) -> dict[str, int | float]:
    """Look a column up in a cell; a level gives several, or none if the method does not count that by level."""
    cell = measured.cell
    kind, _, name = column.partition(".")
    if kind == "seconds":
        return {column: round(statistics.median(cell.total_seconds), 6)}
    if kind == "stage":
        return {column: round(statistics.median(cell.stages.get(name, [0.0])), 6)}
    if kind == "memory":
        return {column: cell.memory_bytes.get(name, 0)}
    if name == "level":
        return {f"{kind}.{level}": value for level, value in enumerate(cell.levels.get(kind, []))}
    if column == "wrong" and cell.accuracy is not None:
        return {column: cell.accuracy.false_shadow + cell.accuracy.false_light}
    if column in ("false_shadow", "false_light", "lit_candidates") and cell.accuracy is not None:
        return {column: getattr(cell.accuracy, column)}
    return {column: cell.counts.get(column, 0)}


def to_csv(rows: Sequence[Row]) -> str:
    """Write rows as CSV text; a column that a row lacks stays empty."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def read_csv(file: Path) -> list[Row]:
    """Read ``data.csv`` back: whole numbers, other numbers, text; empty fields are left out."""
    with file.open(encoding="utf-8", newline="") as stream:
        return [{name: _parse(text) for name, text in row.items() if text != ""} for row in csv.DictReader(stream)]


def _parse(text: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def values(rows: Sequence[Row], column: str, **where: int | str) -> list[float]:
    """Numbers of a column, in order, of the rows that have the given values in other columns.

    Raises
    ------
    LookupError
        If there is no such row.
    """
    found = [float(row[column]) for row in rows if all(row.get(name) == value for name, value in where.items())]
    if not found:
        raise LookupError(f"no row with {where}")
    return found


def mean(rows: Sequence[Row], column: str, **where: int | str) -> float:
    """Mean of `values`."""
    return statistics.fmean(values(rows, column, **where))


def variation(rows: Sequence[Row], column: str, **where: int | str) -> float:
    """Coefficient of variation of `values`: their standard deviation over their mean."""
    found = values(rows, column, **where)
    return statistics.pstdev(found) / statistics.fmean(found)
