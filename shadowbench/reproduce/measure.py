"""Measures what an item asks for, through the same code as `shadowbench run`, and keeps every cell as it finishes."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

from shadowbench import environment, plan
from shadowbench.algorithm_specs import parse_algorithm_spec, validate_params
from shadowbench.progress import Progress
from shadowbench.reproduce.items import Measured, Measurement, view_key
from shadowbench.reproduce.store import CellStore, Kept, Origin, StoreFolder
from shadowbench.runner import Measurer
from shadowbench.scenes.loader import Scene, load_scene


class Cells(NamedTuple):
    """Cells of an item, and where they were measured."""

    measured: list[Measured]
    origins: list[Origin]


class MeasurementError(Exception):
    """A cell that an item needs failed, or the method does not support the scene."""


def this_origin() -> Origin:
    """Commit, machine and threads of this process."""
    git = environment.git_state()
    commit = f"{git['commit']}{'-dirty' if git['dirty'] else ''}" if git["commit"] else "unknown"
    return Origin(commit, environment.processor()["model"], len(os.sched_getaffinity(0)))


@cache
def _scene(name: str, width: int, height: int, n_frames: int, triangles: int,
           light: tuple[float, float, float] | None = None, settings: tuple[str, ...] = ()
           ) -> tuple[Scene, float]:
    """Load a scene; returns it with the seconds that it took."""
    start = time.perf_counter()
    changed = [f"image.width={width}", f"image.height={height}", f"frames={n_frames}"]
    if triangles:
        changed.append(f"geometry.0.triangles={triangles}")
    if light is not None:
        changed.append(f"light.position=[{', '.join(map(repr, light))}]")
    scene = load_scene(name, [*changed, *settings])
    return scene, time.perf_counter() - start


def measure(measurements: Iterable[Measurement], store: CellStore) -> Cells:
    """Take the cells from the store, and measure those that it lacks.

    Raises
    ------
    MeasurementError
        If a cell failed or is unsupported; the others are kept.
    KeyboardInterrupt
        If the user stopped it; what was finished is kept.
    """
    found = [(measurement, kept) for measurement in measurements for kept in _cells(measurement, store)]
    return Cells([Measured(measurement, kept.cell) for measurement, kept in found],
                    list(dict.fromkeys(kept.origin for _, kept in found)))


def _cells(wanted: Measurement, store: CellStore) -> list[Kept]:
    """Cells of one measurement, in the order of frames and methods."""
    scene, seconds = _scene(wanted.scene, *wanted.shape, wanted.n_frames, wanted.triangles, wanted.light, wanted.settings)
    specs = [parse_algorithm_spec(method) for method in wanted.methods]
    cells = plan.plan_cells(scene, [(name, validate_params(name, params)) for name, params in specs], wanted.frames)
    missing = [cell for cell in cells if store.find(cell.key, wanted) is None]
    if missing:
        only = {"counts"} | ({"timings"} if wanted.repeats else set()) | ({"images"} if wanted.images else set())
        options = plan.RunOptions(wanted.frames, max(wanted.repeats, 1), store.origin.threads, frozenset(only),
                                  verify=wanted.verify, warm_up=wanted.warm_up)
        folder = StoreFolder(store, {(cell.frame, cell.label): cell.key for cell in missing}, wanted.warm_up)
        with Progress(len(missing)) as progress:
            progress.note(f"{wanted.scene} {wanted.size} x {wanted.shape[1]}: {len(missing)} cells to measure, "
                          f"{len(cells) - len(missing)} kept from before")
            measurer = Measurer(scene, seconds, missing, options, folder, progress)
            measurer.measure()
        if measurer.summary.interrupted:
            raise KeyboardInterrupt
        for cell in folder.cells:
            if cell.status != "done":
                raise MeasurementError(f"{cell.scene} frame {cell.frame} {cell.label}: {cell.status}: {cell.reason}")
    kept = [store.find(cell.key, wanted) for cell in cells]
    return [each for each in kept if each is not None]


def pictures_of(measured: Iterable[Measured], store: CellStore) -> dict[str, dict[str, Path]]:
    """Files of the cells that kept pictures, by view and kind: views by their `view_key`, and by label alone."""
    found: dict[str, dict[str, Path]] = {}
    for measurement, cell in measured:
        if measurement.images:
            files = {kind.removesuffix("_png"): store.path / file for kind, file in cell.files.items()}
            found[cell.label] = found[view_key(measurement.scene, cell.frame, cell.label)] = files
    return found
