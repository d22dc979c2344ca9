"""The report's tables as rows of cells: text to read beside the value to sort by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shadowbench.counters import ALL_COUNTERS
from shadowbench.report import commands
from shadowbench.report.gather import Series
from shadowbench.report.remarks import remarks
from shadowbench.report.summary import MethodSummary, median_ms, memory_held, wrong_samples
from shadowbench.results import CellResult


@dataclass(frozen=True)
class Column:
    """A column of the table of all measurements.

    Attributes
    ----------
    name : identifier and heading; help : what it means.
    shown : False for columns that the reader switches on.
    """

    name: str
    help: str
    shown: bool = True


@dataclass(frozen=True)
class Entry:
    """A cell of a table.

    Attributes
    ----------
    text : what is shown, empty if there is nothing.
    value : what is sorted by.
    """

    text: str = ""
    value: float | str = ""


@dataclass(frozen=True)
class Row:
    """A row of the table of all measurements."""

    series: Series
    frame: int
    status: str
    entries: list[Entry]


@dataclass(frozen=True)
class Failure:
    """Something that went wrong, and the command that shows it again.

    Attributes
    ----------
    kind : "failed", "wrong" or "unsupported".
    """

    series: Series
    frame: int
    kind: str
    what: str
    command: str


TIME_SPREAD = "slowest less fastest repeat, as a share of the median"

FIXED = (Column("wrong", "samples that differ from the certified reference although their answer is certain"),
         Column("ties", "samples that differ where the answer hangs on a ten-thousandth of a pixel or on the bias"),
         Column("shadowed", "share of the lit candidates that is in shadow"),
         Column("time ms", "median of the repeats"), Column("spread", TIME_SPREAD),
         Column("memory KiB", "structures that live during the frame"))

TOTALS = ("test_and_set", "all_work")


def columns(series: Sequence[Series]) -> list[Column]:
    """Columns of the table: accuracy, both totals, time and memory, then every other count that some method has."""
    used = {name for s in series for cell in s.done for name in cell.counts}
    counts = [Column(c.name, c.definition, c.name in TOTALS) for c in ALL_COUNTERS if c.name in used]
    totals, others = [c for c in counts if c.shown], [c for c in counts if not c.shown]
    return [*FIXED[:3], *totals, *FIXED[3:], *others, Column("remark", "")]


def rows(series: Sequence[Series], wanted: Sequence[Column]) -> list[Row]:
    """One row per cell, frame by frame."""
    cells = [(s, cell) for s in series for cell in s.cells.values()]
    cells.sort(key=lambda pair: (pair[1].frame, pair[0].index))
    return [Row(s, cell.frame, cell.status, _entries(cell, wanted)) for s, cell in cells]


def _entries(cell: CellResult, wanted: Sequence[Column]) -> list[Entry]:
    """The cell's values, in the order of the columns."""
    known = _values(cell)
    return [known.get(column.name, Entry()) for column in wanted]


def _values(cell: CellResult) -> dict[str, Entry]:
    if cell.status != "done":
        return {"remark": _words(f"{cell.status}: {cell.reason}")}
    values = {name: _integer(value) for name, value in cell.counts.items()}
    if cell.accuracy is not None:
        a = cell.accuracy
        values |= {"wrong": _integer(wrong_samples(cell) or 0), "ties": _integer(a.edge_tie)}
        if a.lit_candidates:
            values["shadowed"] = Entry(f"{100.0 * a.shadowed / a.lit_candidates:.2f} %", a.shadowed / a.lit_candidates)
    ms = median_ms(cell)
    if ms is not None:
        spread = 1e3 * (max(cell.total_seconds) - min(cell.total_seconds)) / ms if ms else 0.0
        values |= {"time ms": Entry(f"{ms:.2f}", ms), "spread": Entry(f"{100 * spread:.0f} %", spread)}
    if cell.memory_bytes:
        values["memory KiB"] = Entry(f"{memory_held(cell) / 1024:,.0f}", memory_held(cell))
    values["remark"] = _words("; ".join(remarks(cell)))
    return values


def _integer(value: int) -> Entry:
    return Entry(f"{value:,}", value)


def _words(text: str) -> Entry:
    return Entry(text, text)


def failures(methods: Sequence[MethodSummary]) -> list[Failure]:
    """List cells that failed, exact methods that were wrong, and cells that were not supported, in this order."""
    found: list[tuple[str, Series, int, str]] = []
    for method in methods:
        for frame, cell in sorted(method.series.cells.items()):
            wrong = wrong_samples(cell) or 0
            if cell.status != "done":
                found.append((cell.status, method.series, frame, cell.reason or "no reason given"))
            elif remarks(cell):
                found.append(("wrong", method.series, frame, "; ".join(remarks(cell))))
            elif wrong and method.exact:
                found.append(("wrong", method.series, frame, f"meant to be exact, but {wrong:,} samples are wrong"))
    order = ("failed", "wrong", "unsupported")
    found.sort(key=lambda entry: order.index(entry[0]))
    return [Failure(s, frame, kind, what, commands.again(s.run, s.cells[frame])) for kind, s, frame, what in found]
