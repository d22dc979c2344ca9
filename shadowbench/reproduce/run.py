"""The `reproduce` command: measures items, writes their folders and prints published beside measured."""

from __future__ import annotations

from pathlib import Path

import click

from shadowbench.cli import EXIT_INTERRUPTED, EXIT_SOME_FAILED
from shadowbench.reproduce.items import Item
from shadowbench.reproduce.measure import MeasurementError, measure, pictures_of, this_origin
from shadowbench.reproduce.output import Circumstances, verdict_table, write_item
from shadowbench.reproduce.output import redraw as redraw_item
from shadowbench.reproduce.overview import write_overview
from shadowbench.reproduce.store import CellStore
from shadowbench.results import RunFolderError


def reproduce(items: tuple[Item, ...], quick: bool, out: Path) -> int:
    """Reproduce items one after the other, and list all that are there in ``README.md``; returns the exit code.

    Parameters
    ----------
    items : what to reproduce.
    quick : True for small sizes.
    out : parent of the papers' folders; measured cells are kept in ``runs/reproduce`` below it.
    """
    code = 0
    try:
        store = CellStore(out / "runs" / "reproduce", this_origin())
        for item in items:
            try:
                click.echo(_one(item, quick, out, store) + "\n")
            except MeasurementError as error:
                click.echo(f"error: {item.id}: {error}", err=True)
                code = EXIT_SOME_FAILED
        write_overview(out)
    except (RunFolderError, OSError) as error:
        click.echo(f"error: {error}", err=True)
        return EXIT_SOME_FAILED
    except KeyboardInterrupt:
        click.echo("interrupted; what was measured is kept: the same command goes on from there", err=True)
        return EXIT_INTERRUPTED
    return code


def redraw(items: tuple[Item, ...], out: Path) -> int:
    """Write anew what follows from the ``data.csv`` that are there; measures nothing. Returns the exit code."""
    code = 0
    for item in items:
        folder = out / item.paper / item.id
        try:
            verdicts = redraw_item(item, folder)
        except (OSError, LookupError, ValueError) as error:     # not there, or of an item that asked for something else
            click.echo(f"error: {item.id}: {error}: reproduce it first", err=True)
            code = EXIT_SOME_FAILED
        else:
            click.echo(f"{verdict_table(item, verdicts)}\nfiles: {folder}\n")
    write_overview(out)
    return code


def _one(item: Item, quick: bool, out: Path, store: CellStore) -> str:
    """Measure and write one item; returns its text for the terminal."""
    cells = measure(item.quick if quick else item.full, store)
    command = f"shadowbench reproduce {item.paper}/{item.id}" + (" --quick" if quick else "")
    folder = out / item.paper / item.id
    verdicts = write_item(item, cells.measured, pictures_of(cells.measured, store), folder,
                          Circumstances(command, cells.origins))
    return f"{verdict_table(item, verdicts)}\nfiles: {folder}"
