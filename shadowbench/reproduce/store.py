"""Measured cells, kept: an append-only file, so that a `reproduce` that was killed goes on where it stopped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from shadowbench.reproduce.items import Measurement
from shadowbench.results import CellResult, append_line, make_folder


class Origin(NamedTuple):
    """Where a cell was measured.

    Attributes
    ----------
    commit : commit of the package, "-dirty" appended if it had local changes; "unknown" outside a checkout.
    machine : processor.
    threads : threads of the kernels.
    """

    commit: str
    machine: str
    threads: int


class Kept(NamedTuple):
    """A cell of the file, where it was measured, and whether its timings had a warm-up."""

    cell: CellResult
    origin: Origin
    warm_up: bool


class CellStore:
    """Cells by key, in ``cells.jsonl``, with their pictures beside it.

    Parameters
    ----------
    path : the folder; made when the first cell arrives.
    origin : where this process measures.
    """

    def __init__(self, path: Path, origin: Origin) -> None:
        self.path, self.origin = path, origin
        self.file = path / "cells.jsonl"
        self._kept: dict[str, list[Kept]] = {}
        text = self.file.read_text(encoding="utf-8") if self.file.exists() else ""
        self._cut_short = not text.endswith("\n") and text != ""
        for line in text.splitlines():
            try:
                self._keep(json.loads(line))
            except (ValueError, TypeError, KeyError):            # cut short by a kill, or of another version: measure anew
                continue

    def _keep(self, entry: dict[str, Any]) -> None:
        kept = Kept(CellResult.model_validate(entry["cell"]), Origin(**entry["origin"]), entry["warm_up"])
        self._kept.setdefault(kept.cell.key, []).append(kept)

    def find(self, key: str, wanted: Measurement) -> Kept | None:
        """Look for a cell that has all that is wanted; the latest counts."""
        return next((kept for kept in reversed(self._kept.get(key, [])) if self._serves(kept, wanted)), None)

    def _serves(self, kept: Kept, wanted: Measurement) -> bool:
        """Tell if a kept cell has the accuracy, timings of this machine, and pictures that are wanted."""
        cell, here = kept.cell, (self.origin.machine, self.origin.threads)
        timed = not wanted.repeats or (len(cell.total_seconds) >= wanted.repeats and kept.origin[1:] == here
                                       and (kept.warm_up or not wanted.warm_up))
        pictured = not wanted.images or ("gbuffer_exr" in cell.files
                                         and all((self.path / f).exists() for f in cell.files.values()))
        return timed and pictured and (cell.accuracy is not None or not wanted.verify)

    def add(self, cell: CellResult, warm_up: bool) -> None:
        """Keep a finished cell and flush it to the disk."""
        make_folder(self.path)
        entry = {"origin": self.origin._asdict(), "warm_up": warm_up, "cell": cell.model_dump(mode="json", by_alias=True)}
        append_line(self.file, ("\n" if self._cut_short else "") + json.dumps(entry))
        self._cut_short = False
        self._keep(entry)


class StoreFolder:
    """The store as the measuring code sees it: it takes the cells of one measurement.

    Parameters
    ----------
    store : where finished cells go; those that failed only to `cells`.
    keys : the cells' keys by frame and label.
    warm_up : whether the timings have a warm-up.
    """

    def __init__(self, store: CellStore, keys: dict[tuple[int, str], str], warm_up: bool) -> None:
        self.path = store.path
        self.cells: list[CellResult] = []
        self._store, self._keys, self._warm_up = store, keys, warm_up

    def append(self, cell: CellResult) -> None:
        """Take a finished cell; the view samples of its frame count among its pictures."""
        if cell.files:
            samples = self.image_folder(cell.frame) / "gbuffer.exr"
            cell.files["gbuffer_exr"] = samples.relative_to(self.path).as_posix()
        self.cells.append(cell)
        if cell.status == "done":
            self._store.add(cell, self._warm_up)

    def image_folder(self, frame: int, label: str | None = None) -> Path:
        """Make and return the folder for a cell's pictures, named by its key, or for the view samples of its frame."""
        key = (self._keys[frame, label] if label is not None
               else next(key for (other, _), key in self._keys.items() if other == frame))
        return make_folder(self.path / "pictures" / (f"{key}-samples" if label is None else key))
