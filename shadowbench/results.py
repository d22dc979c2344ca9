"""The run folder: the only module that knows how results are laid out on disk.

``results.jsonl`` is the truth: one line per cell, flushed as the cell finishes. Everything else can be made from it
again. ``run.json`` says what ran where; the CSV files are for spreadsheets and for the count gate.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, Protocol

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from shadowbench.algorithms import PEERS
from shadowbench.errors import InputError
from shadowbench.triangle_work import TriangleWork

SCHEMA = 1
"""Version of every format in the run folder; grows when a field changes its meaning."""

DEFAULT_PARENT = Path("results/runs")

CellStatus = Literal["done", "unsupported", "failed"]
RunStatus = Literal["running", "done", "partial", "interrupted"]


class RunFolderError(Exception):
    """The run folder can't be written to, for instance because the disk is full; what was finished is kept."""


class AccuracyRecord(BaseModel):
    """Samples by class; see `shadowbench.accuracy.Accuracy`."""

    model_config = ConfigDict(extra="forbid")
    samples: int
    lit_candidates: int
    shadowed: int
    ambiguous: int
    false_shadow: int
    false_light: int
    edge_tie: int
    caster_difference: int | None = Field(
        None, description="samples whose answer changes because only some triangles cast; None if all do")
    transparency_difference: int | None = Field(
        None, description="samples whose answer changes because casters that let light through are taken as opaque; None "
        "if there are none, or they are taken as what they are")
    antialiasing_difference: int | None = Field(
        None, description="pixels whose shadow by derivative antialiasing is not that of supersampling; None without it")


class CellResult(BaseModel):
    """One line of ``results.jsonl``: one scene, frame, algorithm and set of parameters."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True)
    format: int = Field(SCHEMA, alias="schema", description="version of this format")
    key: str = Field(description="digest of all that decides the counts of this cell")
    scene: str
    frame: int
    algorithm: str
    label: str = Field(description="algorithm and its non-default parameters, a valid file name")
    params: dict[str, Any]
    status: CellStatus
    reason: str | None = Field(None, description="why the cell is unsupported or failed")
    counts: dict[str, int] = Field(default_factory=dict)
    levels: dict[str, list[int]] = Field(default_factory=dict, description="counts per tree level, from the root")
    largest: dict[str, list[int]] = Field(
        default_factory=dict, description="largest single values of a count, such as those of jobs, from the largest down")
    triangles: dict[str, TriangleWork] = Field(
        default_factory=dict, description="counts by the triangle that caused them, as classes and the heaviest")
    stages: dict[str, list[float]] = Field(default_factory=dict, description="seconds per stage and repeat")
    total_seconds: list[float] = Field(default_factory=list, description="seconds per repeat, preparation left out")
    jit_seconds: float = Field(0.0, description="seconds spent compiling, outside every timing")
    memory_bytes: dict[str, int] = Field(default_factory=dict)
    wall_seconds: float = Field(0.0, description="seconds that the whole cell took: all repeats, comparison and pictures")
    accuracy: AccuracyRecord | None = None
    files: dict[str, str] = Field(default_factory=dict, description="paths inside the run folder")


def make_label(algorithm: str, changed: dict[str, Any]) -> str:
    """Name a variant: the id plus its non-default parameters, as a file name that needs no quoting."""
    parts = [algorithm] + [f"{key}={value}" for key, value in sorted(changed.items())]
    label = re.sub(r"[^A-Za-z0-9._=+-]", "-", "+".join(parts))
    if len(label) > 120:
        label = f"{label[:100]}+{hashlib.sha256(label.encode()).hexdigest()[:12]}"
    return label


def make_key(**decisive: Any) -> str:
    """Digest of everything that decides a cell's counts, as 32 hexadecimal digits."""
    text = json.dumps(decisive, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def default_folder(scene_name: str) -> Path:
    """``results/runs/<UTC time>-<scene>``, with a number added if that exists."""
    stem = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{re.sub(r'[^A-Za-z0-9._-]', '-', scene_name)}"
    folder, n = DEFAULT_PARENT / stem, 1
    while folder.exists():
        n += 1
        folder = DEFAULT_PARENT / f"{stem}-{n}"
    return folder


def check_writable(folder: Path, resume: bool = False) -> None:
    """Make sure that the run folder can be made or written to, and leave nothing behind.

    Raises
    ------
    InputError
        If the folder can't be written to, or holds another run that is not to be resumed.
    """
    if (folder / "run.json").exists() and not resume:
        raise InputError(f"{folder} already holds a run: add --resume to go on with it, or choose another --out")
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        raise InputError(f"cannot write to {folder}: {existing} is not a folder; choose another --out")
    trial = existing / f".shadowbench-write-test-{os.getpid()}"
    try:
        trial.touch(exist_ok=False)
        trial.unlink()
    except OSError as error:
        raise InputError(f"cannot write to {folder}: {error.strerror}; choose another --out") from error


class CellFolder(Protocol):
    """Where measured cells go, and the pictures that belong to them."""

    path: Path
    cells: list[CellResult]

    def append(self, cell: CellResult) -> None:
        """Take a finished cell."""

    def image_folder(self, frame: int, label: str | None = None) -> Path:
        """Make and return the folder for a frame's pictures, or for one algorithm's within it."""


class RunFolder:
    """One run's folder on disk.

    Parameters
    ----------
    path : the folder; made here, with its parents.
    description : fields of ``run.json`` other than ``schema``, ``status``, ``created`` and ``cells``.
    planned : number of cells.
    kept : cells of an earlier run in this folder that still hold.
    """

    def __init__(self, path: Path, description: dict[str, Any], planned: int, kept: Iterable[CellResult] = ()) -> None:
        self.path = path
        self.cells: list[CellResult] = list(kept)
        self._description = description
        self._planned = planned
        self._created = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make {path}: {error.strerror}; choose another --out") from error
        self.write_status("running")

    def write_text(self, name: str, text: str) -> None:
        """Write a small file in one step, so that no reader and no crash sees half of it."""
        target = self.path / name
        temporary = target.with_name(target.name + ".part")
        try:
            temporary.write_text(text, encoding="utf-8")
            temporary.replace(target)
        except OSError as error:
            raise RunFolderError(f"cannot write {target}: {error.strerror}; free some space and run again") from error

    def write_status(self, status: RunStatus, **more: Any) -> None:
        """Write ``run.json``."""
        by_status = {s: sum(cell.status == s for cell in self.cells) for s in ("done", "unsupported", "failed")}
        document = {"schema": SCHEMA, "status": status, "created": self._created, **self._description, **more,
                    "cells": {"planned": self._planned, **by_status}}
        self.write_text("run.json", json.dumps(document, indent=2) + "\n")

    def append(self, cell: CellResult) -> None:
        """Add a finished cell to ``results.jsonl`` and flush it to the disk."""
        self._check_there()
        self.cells.append(cell)
        append_line(self.path / "results.jsonl", cell.model_dump_json(by_alias=True))

    def image_folder(self, frame: int, label: str | None = None) -> Path:
        """Make and return the folder for a frame's pictures, or for one algorithm's within it."""
        self._check_there()
        folder = self.path / "frames" / f"{frame:04d}"
        return make_folder(folder if label is None else folder / label)

    def _check_there(self) -> None:
        """Refuse to go on in a folder that somebody removed: a new one would look like a run and lack its first cells."""
        if not (self.path / "run.json").exists():
            raise RunFolderError(f"the run folder {self.path} has vanished: choose another --out, or run again")

    def sort(self, keys: Sequence[str]) -> None:
        """Put the cells into the order of their keys."""
        order = {key: i for i, key in enumerate(keys)}
        self.cells.sort(key=lambda cell: order[cell.key])

    def write_tables(self) -> None:
        """Write ``counts.csv`` and ``timings.csv`` from the cells so far."""
        counts, timings = tables(self.cells)
        self.write_text("counts.csv", counts)
        self.write_text("timings.csv", timings)


def append_line(file: Path, line: str) -> None:
    """Add a line to a file and flush it to the disk."""
    try:
        with file.open("a", encoding="utf-8") as stream:
            stream.write(line + "\n")
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise RunFolderError(f"cannot write {file}: {error.strerror}; the cells before this one are kept") from error


def make_folder(folder: Path) -> Path:
    """Make a folder for pictures, with its parents, and return it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFolderError(f"cannot make {folder}: {error.strerror}; what was finished is kept") from error
    return folder


def count_rows(cells: list[CellResult]) -> list[tuple[str, int, str, str, str, int]]:
    """List scene, frame, algorithm, label, counter and value of every count and class of samples, sorted."""
    rows = [(c.scene, c.frame, c.algorithm, c.label, name, value) for c in cells for name, value in c.counts.items()]
    for cell in cells:
        if cell.accuracy is not None and cell.algorithm not in PEERS:    # a peer's answers depend on the machine
            rows += [(cell.scene, cell.frame, cell.algorithm, cell.label, name, value)
                     for name, value in cell.accuracy.model_dump(exclude_none=True).items()]
    return sorted(rows)


def tables(cells: list[CellResult]) -> tuple[str, str]:
    """Make the texts of ``counts.csv`` (integers only, sorted) and ``timings.csv``."""
    timings = [(c.scene, c.frame, c.algorithm, c.label, stage, repeat, f"{seconds:.9f}") for c in cells
               for stage, values in [*c.stages.items(), ("total", c.total_seconds)]
               for repeat, seconds in enumerate(values)]
    return (_csv(("scene", "frame", "algorithm", "label", "counter", "value"), count_rows(cells)),
            _csv(("scene", "frame", "algorithm", "label", "stage", "repeat", "seconds"), timings))


def _csv(header: tuple[str, ...], rows: list[Any]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def read_run(path: Path) -> tuple[dict[str, Any], list[CellResult]]:
    """Read a run folder back.

    Returns
    -------
    ``run.json`` as a dictionary, and the cells in the order they finished: of cells that ran again, the last result. A
    last line cut short by a kill is left out.

    Raises
    ------
    InputError
        If the folder holds no run, or one of another schema, or a line that is no cell.
    """
    try:
        document = json.loads((path / "run.json").read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{path} holds no run: it has no run.json") from error
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {path / 'run.json'}: {error}") from error
    if document.get("schema") != SCHEMA:
        raise InputError(f"{path} was written with schema {document.get('schema')}; this version reads {SCHEMA}")
    return document, read_cells(path / "results.jsonl")


def read_cells(file: Path) -> list[CellResult]:
    """Read ``results.jsonl``; see `read_run`."""
    try:
        text = file.read_text(encoding="utf-8", errors="replace") if file.exists() else ""
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror}") from error
    cells: dict[tuple[str, int, str], CellResult] = {}
    for number, line in enumerate(text.split("\n")[:-1], 1):
        try:
            cell = CellResult.model_validate_json(line)
        except ValidationError as error:
            raise InputError(f"{file}:{number}: no result of a cell: remove this line, then --resume") from error
        cells.pop((cell.scene, cell.frame, cell.label), None)
        cells[cell.scene, cell.frame, cell.label] = cell
    return list(cells.values())


def drop_torn_line(file: Path) -> bool:
    """Cut off a last line that a kill or a full disk left unfinished; True if there was one."""
    if not file.is_file():
        return False
    with file.open("rb+") as stream:
        data = stream.read()
        whole = data.rfind(b"\n") + 1
        stream.truncate(whole)
    return whole < len(data)
