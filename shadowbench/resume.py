"""Going on with a run that was stopped: which cells of its folder still hold, and why the others are run again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from shadowbench import environment
from shadowbench.errors import InputError
from shadowbench.plan import Cell, RunOptions
from shadowbench.results import CellResult, read_run

LOOKED_THROUGH = 20
"""Latest run folders in which earlier times of the same cells are looked for."""


@dataclass(frozen=True)
class Decision:
    """What becomes of a planned cell: the result that is kept, or None, and the reason in words."""

    cell: Cell
    kept: CellResult | None
    reason: str


def decide(cells: Iterable[Cell], folder: Path, scene: str, options: RunOptions) -> list[Decision]:
    """Decide for each planned cell if the result in a run folder serves.

    Raises
    ------
    InputError
        If the folder holds another scene, or finished cells that are not planned: a resumed run only grows.
    """
    if not (folder / "run.json").exists():
        return [Decision(cell, None, "not measured yet") for cell in cells]
    document, found = read_run(folder)
    if document.get("scene") != scene:
        raise InputError(f"{folder} holds a run of the scene {document.get('scene')}, not of {scene}: choose another --out")
    here = (environment.processor()["model"], options.threads)
    same_machine = (document.get("processor", {}).get("model"), document.get("threads")) == here
    earlier = {(cell.frame, cell.label): cell for cell in found}
    decisions = []
    for cell in cells:
        result = earlier.pop((cell.frame, cell.label), None)
        reason = _why_not(cell, result, folder, options, same_machine)
        decisions.append(Decision(cell, None if reason else result, reason or "kept from before"))
    left = next((cell for cell in earlier.values() if cell.status == "done"), None)
    if left is not None:
        raise InputError(f"{folder} holds frame {left.frame} of {left.label}, which this command does not ask for: add it, "
                         "or choose another --out")
    return decisions


def _why_not(cell: Cell, result: CellResult | None, folder: Path, options: RunOptions, same_machine: bool) -> str:
    """Why an earlier result does not serve; empty if it does."""
    if result is None:
        return "not measured yet"
    if result.status == "failed":
        return f"failed before: {result.reason}"
    if result.key != cell.key:
        return "the scene, the parameters or the sources have changed"
    if result.status == "unsupported":
        return ""
    if "counts" in options.only and not result.counts:
        return "has no counts"
    if "timings" in options.only:
        if len(result.total_seconds) < options.repeats:
            return f"has {len(result.total_seconds)} of {options.repeats} timings"
        if not same_machine:
            return "was timed on another machine, or with another number of threads"
    if "images" in options.only and not (result.files and all((folder / file).is_file() for file in result.files.values())):
        return "has no pictures"
    return ""


def estimate(decisions: Sequence[Decision], scene: str, folders: Iterable[Path]) -> list[float | None]:
    """Seconds that each cell will take: as before, or as other frames of its method did; None if that is unknown.

    Parameters
    ----------
    decisions : the cells; those that are kept take no time.
    scene : name of the scene.
    folders : run folders to look through.
    """
    by_key: dict[str, float] = {}
    by_label: dict[str, list[float]] = {}
    for folder in folders:
        for cell in _measured(folder):
            if cell.scene == scene and cell.wall_seconds:
                by_key[cell.key] = cell.wall_seconds
                by_label.setdefault(cell.label, []).append(cell.wall_seconds)
    known: dict[str, float] = {label: median(seconds) for label, seconds in by_label.items()}
    return [0.0 if d.kept else by_key.get(d.cell.key, known.get(d.cell.label)) for d in decisions]


def earlier_folders(beside: Path) -> list[Path]:
    """Run folders in the folder that `beside` lies in, itself included, the oldest first, at most `LOOKED_THROUGH`."""
    try:
        folders = {beside, *beside.parent.iterdir()}
        found = [(path.stat().st_mtime, path) for path in folders if (path / "run.json").is_file()]
    except OSError:
        return []
    return [path for _, path in sorted(found)[-LOOKED_THROUGH:]]


def _measured(folder: Path) -> list[CellResult]:
    """Finished cells of a folder; none if it can't be read."""
    try:
        cells: list[CellResult] = read_run(folder)[1]
    except InputError:
        return []
    return [cell for cell in cells if cell.status == "done"]
