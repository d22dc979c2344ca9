"""What a report is about: run folders, read back, and the methods in them, numbered in one order for all figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shadowbench.errors import InputError
from shadowbench.results import CellResult, read_run


@dataclass(frozen=True, eq=False)
class Run:
    """A run folder's content.

    Attributes
    ----------
    path : the folder.
    name : short name, different for each run of a report.
    document : content of ``run.json``.
    cells : results, in the order of the folder.
    """

    path: Path
    name: str
    document: dict[str, Any]
    cells: list[CellResult]

    @property
    def frames(self) -> list[int]:
        """Frames that have results, ascending."""
        return sorted({cell.frame for cell in self.cells})


@dataclass(frozen=True, eq=False)
class Series:
    """One method, with its parameters, in one run.

    Attributes
    ----------
    index : number in the report: decides colour and marker.
    run : the run it belongs to.
    algorithm, label : as in the results.
    title : the label, with the run's name before it where a report has several runs.
    cells : its results by frame.
    """

    index: int
    run: Run
    algorithm: str
    label: str
    title: str
    cells: dict[int, CellResult]

    @property
    def done(self) -> list[CellResult]:
        """Results of cells that were measured, by ascending frame."""
        return [cell for _, cell in sorted(self.cells.items()) if cell.status == "done"]


def read_runs(paths: Sequence[Path]) -> list[Run]:
    """Read run folders.

    Raises
    ------
    InputError
        If a folder holds no run, or is named twice.
    """
    resolved = [path.resolve() for path in paths]
    for i, path in enumerate(resolved):
        if path in resolved[:i]:
            raise InputError(f"{paths[i]} is named twice: name every run once")
    runs = []
    for path, name in zip(paths, short_names(resolved), strict=True):
        document, cells = read_run(path)
        if not cells:
            raise InputError(f"{path} holds no results yet: results.jsonl is missing or empty")
        runs.append(Run(path, name, document, cells))
    return runs


def short_names(paths: Sequence[Path]) -> list[str]:
    """Name folders by as few of their last parts as tell them apart."""
    longest = max(len(path.parts) for path in paths)
    for n in range(1, longest + 1):
        names = ["/".join(path.parts[-n:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    raise ValueError("the same folder twice")


def series_of(runs: Sequence[Run]) -> list[Series]:
    """List the methods of all runs in the order in which they first appear."""
    found: dict[tuple[int, str, str], Series] = {}
    for number, run in enumerate(runs):
        scenes = {cell.scene for cell in run.cells}
        for cell in run.cells:
            key = (number, cell.scene, cell.label)
            if key not in found:
                parts = [run.name] * (len(runs) > 1) + [cell.scene] * (len(scenes) > 1) + [cell.label]
                found[key] = Series(len(found), run, cell.algorithm, cell.label, " / ".join(parts), {})
            found[key].cells[cell.frame] = cell
    return list(found.values())
