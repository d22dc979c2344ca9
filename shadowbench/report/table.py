"""Results as plain text tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shadowbench.report.remarks import remarks
from shadowbench.results import CellResult

HEADER = ("frame", "method", "wrong", "ties", "shadowed", "test_and_set", "all_work", "time ms", "memory KiB", "")


def summary_row(cell: CellResult) -> tuple[str, ...]:
    """One cell as text, in the columns of `HEADER`."""
    if cell.status != "done" or cell.accuracy is None:
        return (str(cell.frame), cell.label, *[""] * 7, f"{cell.status}: {cell.reason}")
    a = cell.accuracy
    milliseconds = f"{1e3 * float(np.median(cell.total_seconds)):.1f}" if cell.total_seconds else ""
    counts = [f"{cell.counts[name]:,}" if cell.counts else "" for name in ("test_and_set", "all_work")]
    held = sum(size for name, size in cell.memory_bytes.items() if not name.startswith("modelled_"))
    memory = f"{held / 1024:,.0f}"
    share = f"{100.0 * a.shadowed / a.lit_candidates:.2f} %" if a.lit_candidates else ""
    return (str(cell.frame), cell.label, f"{a.false_shadow + a.false_light:,}", f"{a.edge_tie:,}",
            share, *counts, milliseconds, memory, "; ".join(remarks(cell)))


def format_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Align columns: the second and the last (a remark) to the left, numbers to the right."""
    return align(header, rows, (1, len(header) - 1))


def align(header: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[int]) -> str:
    """Align columns: those numbered in `left` to the left, the others to the right."""
    table = [tuple(header), *[tuple(row) for row in rows]]
    widths = [max(len(row[i]) for row in table) for i in range(len(header))]

    def line(row: tuple[str, ...]) -> str:
        cells = [text.ljust(width) if i in left else text.rjust(width)
                 for i, (text, width) in enumerate(zip(row, widths, strict=True))]
        return "  ".join(cells).rstrip()

    rule = "  ".join("-" * width for width in widths).rstrip()
    return "\n".join([line(table[0]), rule, *[line(row) for row in table[1:]]])


def summary(cells: Sequence[CellResult]) -> str:
    """Table of all cells of a run."""
    return format_table(HEADER, [summary_row(cell) for cell in cells])
