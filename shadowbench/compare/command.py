"""The `compare` command."""

from __future__ import annotations

from pathlib import Path

import click

from shadowbench.cli import EXIT_NOTHING, EXIT_OK
from shadowbench.compare.pairs import Comparison, compare_runs
from shadowbench.compare.tables import Table, as_csv, heading, tables
from shadowbench.compare.times import DRIFT
from shadowbench.report.gather import read_runs
from shadowbench.report.table import align

LEGEND = ("Times are sums over the frames, median ± half the range of the repeats. “noise”: the ranges of the repeats "
          f"overlap, or the medians differ by less than {100 * DRIFT:.0f} %. Counts have no noise: any change of one is a "
          "change of the work.")


def compare(a: Path, b: Path, style: str) -> int:
    """Print what differs between two runs; return the exit code: 5 if they have no cell in common."""
    comparison = compare_runs(*read_runs([a, b]))
    if style == "csv":
        click.echo(as_csv(comparison), nl=False)
    else:
        click.echo(as_markdown(comparison) if style == "md" else as_text(comparison))
    if not comparison.pairs:
        click.echo("the runs have no scene, frame and method in common", err=True)
        return EXIT_NOTHING
    return EXIT_OK


def as_text(comparison: Comparison) -> str:
    """Aligned tables for the terminal."""
    lines = [f"A: {heading(comparison.a)}", f"B: {heading(comparison.b)}", *[f"note: {note}" for note in comparison.notes]]
    for table in tables(comparison):
        left = [i for i, name in enumerate(table.header) if name in table.words]
        lines += ["", table.title, align(table.header, table.rows, left)]
    return "\n".join([*lines, "", LEGEND])


def as_markdown(comparison: Comparison) -> str:
    """Markdown, for a pull request or a CI summary."""
    lines = [f"- A: {heading(comparison.a)}", f"- B: {heading(comparison.b)}",
             *[f"- note: {note}" for note in comparison.notes]]
    for table in tables(comparison):
        lines += ["", f"### {table.title}", "", *_markdown(table)]
    return "\n".join([*lines, "", LEGEND])


def _markdown(table: Table) -> list[str]:
    rule = ["---" if name in table.words else "---:" for name in table.header]
    rows = [[f"`{cell}`" if i == 0 else cell for i, cell in enumerate(row)] for row in table.rows]
    return ["| " + " | ".join(row) + " |" for row in (list(table.header), rule, *rows)]
