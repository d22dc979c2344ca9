"""Pairs the cells of two runs, and finds what differs between the two of a pair."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench import image_io
from shadowbench.compare.times import TimeChange, compare_times
from shadowbench.report.gather import Run
from shadowbench.results import CellResult

CellKey = tuple[str, int, str]
"""Scene, frame and label."""


@dataclass(frozen=True)
class Pair:
    """One cell in both runs.

    Attributes
    ----------
    key : scene, frame and label.
    counts : values of A and B by counter, all counters of either; None where a side lacks it.
    accuracy : numbers of samples of A and B by class; empty unless both were verified.
    memory : bytes that A and B held.
    time : timings of A and B.
    pictures : pixels or samples that differ, by picture; None where the sizes differ. Without those that a side lacks.
    status : of A and B.
    """

    key: CellKey
    counts: dict[str, tuple[int | None, int | None]]
    accuracy: dict[str, tuple[int, int]]
    memory: tuple[int, int]
    time: TimeChange
    pictures: dict[str, int | None]
    status: tuple[str, str]

    @property
    def changed_counts(self) -> dict[str, tuple[int | None, int | None]]:
        """Counters whose values differ."""
        return {name: values for name, values in self.counts.items() if values[0] != values[1]}

    @property
    def changed_pictures(self) -> dict[str, int | None]:
        """Pictures that differ."""
        return {name: n for name, n in self.pictures.items() if n != 0}


@dataclass(frozen=True)
class Comparison:
    """Two runs.

    Attributes
    ----------
    a, b : the runs.
    pairs : cells that both have.
    only_a, only_b : cells that only one has.
    notes : sentences about what makes the runs less comparable.
    """

    a: Run
    b: Run
    pairs: list[Pair]
    only_a: list[CellKey]
    only_b: list[CellKey]
    notes: list[str]


def compare_runs(a: Run, b: Run) -> Comparison:
    """Compare two runs cell by cell."""
    cells_a, cells_b = ({(c.scene, c.frame, c.label): c for c in run.cells} for run in (a, b))
    pairs = [_pair(key, a.path, cells_a[key], b.path, cells_b[key]) for key in cells_a if key in cells_b]
    return Comparison(a, b, pairs, [key for key in cells_a if key not in cells_b],
                      [key for key in cells_b if key not in cells_a], _notes(a, b))


def _notes(a: Run, b: Run) -> list[str]:
    """Say which circumstances differ, and what that means."""
    checks: tuple[tuple[str, Callable[[Run], object], str], ...] = (
        ("image size", lambda run: run.document["image"], "counts, times and pictures are of different work"),
        ("bias", lambda run: run.document["bias"], "answers may differ by intent"),
        ("geometry", lambda run: run.document["digests"], "counts, times and pictures are of different work"),
        ("processor", lambda run: run.document["processor"]["model"], "times can't be compared"),
        ("number of threads", lambda run: run.document["threads"], "times can't be compared"),
        ("Numba version", lambda run: run.document["packages"].get("numba"), "times may differ for that reason alone"))
    notes = [f"the {name} differs: {meaning}" for name, value, meaning in checks if value(a) != value(b)]
    for name, run in (("A", a), ("B", b)):
        if run.document["git"]["dirty"]:
            notes.append(f"{name} was measured with local changes to the sources")
    return notes


def _pair(key: CellKey, folder_a: Path, a: CellResult, folder_b: Path, b: CellResult) -> Pair:
    """Compare one cell."""
    names = sorted({*a.counts, *b.counts}) if a.counts and b.counts else []
    accuracy = {}
    if a.accuracy is not None and b.accuracy is not None:
        of_a, of_b = a.accuracy.model_dump(exclude_none=True), b.accuracy.model_dump(exclude_none=True)
        accuracy = {name: (of_a[name], of_b[name]) for name in of_a if name in of_b}
    memory = (sum(a.memory_bytes.values()), sum(b.memory_bytes.values()))
    return Pair(key, {name: (a.counts.get(name), b.counts.get(name)) for name in names}, accuracy, memory,
                compare_times(a.total_seconds, b.total_seconds), _pictures(folder_a, a, folder_b, b), (a.status, b.status))


def _pictures(folder_a: Path, a: CellResult, folder_b: Path, b: CellResult) -> dict[str, int | None]:
    """Count what differs in the pictures that both cells have."""
    found: dict[str, int | None] = {}
    for name in (name for name in a.files if name in b.files):
        files = folder_a / a.files[name], folder_b / b.files[name]
        if not all(file.is_file() for file in files):
            continue
        if name == "shadow_exr":
            first, second = (image_io.read_exr(file) for file in files)
            for channel, title in (("shadow", "shadow buffer"), ("tests", "heat map"), ("error", "errors")):
                found[title] = _differing(first[channel][..., None], second[channel][..., None])
        elif name not in ("shadow_png", "heatmap_png", "error_png"):          # made from shadow.exr
            found[name.removesuffix("_png")] = _differing(*(image_io.read_png(file) for file in files))
    return found


def _differing(a: NDArray, b: NDArray) -> int | None:
    """Pixels that differ in any channel; None if the sizes differ."""
    return int(np.count_nonzero(np.any(a != b, axis=-1))) if a.shape == b.shape else None
