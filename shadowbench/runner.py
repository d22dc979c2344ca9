"""Runs cells: prepare, warm up, repeat, count, verify against the reference, and write.

A cell is one scene x frame x algorithm x parameters. Timings come from the build without counting, counts from the
build with it; compilation happens in a warm-up call and is never inside a timing. The reference judges every cell
over the same set of casters. A cell that fails loses no other.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench import accuracy, jit
from shadowbench.algorithms import PEERS
from shadowbench.algorithms.base import Algorithm, ShadowBuffer, Transparency
from shadowbench.algorithms.reference import lets_light_through
from shadowbench.allocator import keep_freed_memory
from shadowbench.geometry import Frame
from shadowbench.judge import LIGHT_TOLERANCE, Judge, Truth, antialiasing_difference, classify
from shadowbench.plan import Cell, RunOptions
from shadowbench.probe import Probe
from shadowbench.progress import Progress
from shadowbench.report import pictures
from shadowbench.report.remarks import remarks
from shadowbench.results import AccuracyRecord, CellFolder, CellResult, RunFolder, RunFolderError, RunStatus
from shadowbench.scenes.loader import Scene
from shadowbench.triangle_work import triangle_work
from shadowbench.view_samples import render_frame


@dataclass
class RunSummary:
    """What a run came to.

    Attributes
    ----------
    folder : where the results are.
    cells : results in order.
    warnings : sentences worth a reader's attention.
    interrupted : True if the run was stopped by the user.
    """

    folder: Path
    cells: list[CellResult]
    warnings: list[str] = field(default_factory=list)
    interrupted: bool = False

    @property
    def exit_code(self) -> int:
        """0 all well, 4 some cells failed, 5 nothing measured, 130 interrupted."""
        if self.interrupted:
            return 130
        if any(cell.status == "failed" for cell in self.cells):
            return 4
        return 0 if any(cell.status == "done" for cell in self.cells) else 5


class StopRun(Exception):
    """Raised to end a run early because a cell failed and `RunOptions.keep_going` is False."""


class Measurer:
    """Carries out the cells of one scene.

    Parameters
    ----------
    scene, cells, options : what to run and how.
    load_seconds : how long it took to load or generate the scene.
    folder : where results go.
    progress : where the user reads how far it is.
    """

    def __init__(self, scene: Scene, load_seconds: float, cells: list[Cell], options: RunOptions, folder: CellFolder,
                 progress: Progress) -> None:
        self.scene, self.cells, self.options = scene, cells, options
        self.folder, self.progress = folder, progress
        self.summary = RunSummary(folder.path, folder.cells)
        self.seconds: dict[str, float] = {"scene": load_seconds, "compilation": 0.0, "prepare": 0.0, "view_samples": 0.0,
                                          "reference": 0.0, "cells": 0.0, "images": 0.0}
        self._prepared: dict[str, tuple[Any, Any]] = {}
        self._announced: set[str] = set()

    def measure(self) -> None:
        """Measure every cell and hand it to the folder; on Ctrl-C keep what is finished."""
        keep_freed_memory()
        jit.set_threads(self.options.threads)
        try:
            for frame, cells in itertools.groupby(self.cells, key=lambda cell: cell.frame):
                self._run_frame(frame, list(cells))
        except KeyboardInterrupt:
            self.summary.interrupted = True
        except StopRun:
            pass

    @contextmanager
    def _clock(self, name: str, what: str = "") -> Iterator[None]:
        """Add the time spent inside to `seconds`, and time spent compiling to "compilation" instead."""
        def announce() -> None:
            if (what or name) not in self._announced:
                self._announced.add(what or name)
                self.progress.note(f"compiling kernels for {what or name} (once; they are kept for later runs)")

        start = time.perf_counter()
        with jit.CompileWatch(announce) as watch:
            try:
                yield
            finally:
                self.seconds[name] += time.perf_counter() - start - watch.seconds
                self.seconds["compilation"] += watch.seconds

    def _run_frame(self, index: int, cells: list[Cell]) -> None:
        """Render the view samples, find the truth, run the cells."""
        self.progress.step(f"frame {index}: view samples")
        with self._clock("view_samples"):
            mesh, camera, light = self.scene.mesh(index), self.scene.camera(index), self.scene.light(index)
            frame = render_frame(mesh, camera, light, self.scene.image, self.scene.bias, "images" in self.options.only)
        n_candidates = int(np.count_nonzero(frame.samples.candidate))
        if n_candidates == 0:
            self._warn(f"frame {index}: no sample faces the light, so no method has anything to do; "
                       "check the light's position or direction, and what the camera sees")
        if "images" in self.options.only:
            with self._clock("images"):
                pictures.write_gbuffer(self.folder.image_folder(index), frame)
        judge = Judge(frame)
        for cell in cells:
            self.progress.step(f"frame {index}: {cell.label}")
            result = self._run_cell(cell, frame, judge)
            self.folder.append(result)
            self.progress.finished(f"frame {index} {cell.label}: {outcome(result)}")
            if result.status == "failed" and not self.options.keep_going:
                raise StopRun

    def _run_cell(self, cell: Cell, frame: Frame, judge: Judge) -> CellResult:
        """Run one cell; whatever goes wrong inside it becomes its reason."""
        start = time.perf_counter()
        result = empty_result(cell, self.scene)
        try:
            reason = cell.algorithm.unsupported(self.scene)
            if reason is not None:
                return result.model_copy(update={"status": "unsupported", "reason": reason})
            self._measure(cell, frame, judge, result)
        except RunFolderError:
            raise
        except Exception as error:
            return failed_result(cell, self.scene, f"{type(error).__name__}: {error}")
        result.wall_seconds = round(time.perf_counter() - start - result.jit_seconds, 6)
        return result

    def _measure(self, cell: Cell, frame: Frame, judge: Judge, result: CellResult) -> None:
        """Fill in counts, accuracy, timings and pictures."""
        algorithm = cell.algorithm
        compiled_before = self.seconds["compilation"]
        with self._clock("prepare", cell.label):
            frame = self._prepare(cell, frame)
        with self._clock("cells", cell.label):
            probe = Probe(counting=True)
            buffers = [algorithm.shadows(layer, probe) for layer in frame.layers]
        for buffer, layer in zip(buffers, frame.layers, strict=True):
            _check_buffer(buffer, layer)
        result.counts, result.levels, result.largest = probe.all_counts(), probe.levels, probe.largest
        errors = self._verify(cell, frame, buffers, judge, result) if self.options.verify else None
        if "counts" in self.options.only:
            result.triangles = {name: triangle_work(values) for name, values in probe.triangle_counts.items()}
        else:
            result.counts, result.levels, result.largest = {}, {}, {}
        if "timings" in self.options.only:
            with self._clock("cells", cell.label):
                self._repeat(algorithm, frame, buffers, result)
        result.memory_bytes = probe.memory_bytes
        result.jit_seconds = round(self.seconds["compilation"] - compiled_before, 6)
        if errors is not None and "images" in self.options.only:
            with self._clock("images"):
                folder = self.folder.image_folder(cell.frame, cell.label)
                files = pictures.write_shadow_pictures(folder, frame, buffers, errors, probe.heat, cell.label)
                result.files = {name: path.relative_to(self.folder.path).as_posix() for name, path in files.items()}

    def _verify(self, cell: Cell, frame: Frame, buffers: list[ShadowBuffer], judge: Judge, result: CellResult
                ) -> NDArray[np.uint32]:
        """Compare with the reference over the same casters; fills in the accuracy of all layers.

        Returns the `ErrorClass` of each sample of the first layer.
        """
        casters, mode = cell.algorithm.casters(frame), cell.algorithm.judged_as(frame)
        truths = self._truths(judge, casters, mode)
        layers = list(zip(buffers, truths, frame.layers, strict=True))
        errors = [classify(cell.algorithm, *layer) for layer in layers]
        measured = [accuracy.measure(buffer.shadow, found, truth.ambiguous, layer.samples.candidate)
                    for found, (buffer, truth, layer) in zip(errors, layers, strict=True)]
        names = asdict(measured[0])
        result.accuracy = AccuracyRecord(**{name: sum(getattr(one, name) for one in measured) for name in names})
        if casters is not None:
            result.accuracy.caster_difference = _differing(truths, self._truths(judge, None, mode))
        if mode == "off" and lets_light_through(frame, "alpha"):
            result.accuracy.transparency_difference = _differing(truths, self._truths(judge, casters, "alpha"))
        if frame.supersampled is not None:
            difference = antialiasing_difference(frame, truths[0], judge.supersampled(casters, mode))
            result.accuracy.antialiasing_difference = int(np.count_nonzero(difference))
            buffers[0].images["antialiasing"] = pictures.antialiasing_map(frame, difference)
        buffer, truth = buffers[0], truths[0]
        if cell.name in PEERS:
            path = self.folder.image_folder(cell.frame, cell.label) / "differences.csv"
            path.write_text(accuracy.list_differences(frame, buffer.shadow, truth.shadow, truth.ambiguous))
        explained = remarks(result)
        for sentence in explained:
            self._warn(f"frame {cell.frame}: {cell.label}: {sentence}")
        n_wrong = sum(one.wrong for one in measured)
        if cell.algorithm.exact and n_wrong and not explained:
            self._warn(f"frame {cell.frame}: {cell.label} is meant to be exact but has {n_wrong} wrong samples")
        return errors[0]

    def _prepare(self, cell: Cell, frame: Frame) -> Frame:
        """Attach what the algorithm prepares from the mesh, made once per mesh."""
        known_mesh, prepared = self._prepared.get(cell.label, (None, None))
        if known_mesh is not frame.mesh:
            prepared = cell.algorithm.prepare(frame.mesh)
            self._prepared[cell.label] = (frame.mesh, prepared)
        return replace(frame, prepared=prepared, deeper=tuple(replace(layer, prepared=prepared) for layer in frame.deeper))

    def _repeat(self, algorithm: Algorithm, frame: Frame, expected: list[ShadowBuffer], result: CellResult) -> None:
        """Time the build without counting, once it is compiled and, if wanted, has run before."""
        if self.options.warm_up:
            for layer in frame.layers:
                algorithm.shadows(layer, Probe())
        while len(result.total_seconds) < self.options.repeats:
            probe = Probe()
            start = time.perf_counter()
            with jit.CompileWatch(lambda: None) as watch:
                buffers = [algorithm.shadows(layer, probe) for layer in frame.layers]
            if watch.seconds > 0:
                continue
            result.total_seconds.append(time.perf_counter() - start)
            for stage, seconds in probe.stages.items():
                result.stages.setdefault(stage, []).append(seconds)
            if not all(np.array_equal(a.shadow, b.shadow) for a, b in zip(buffers, expected, strict=True)):
                raise RuntimeError("two executions on the same input gave different shadows")

    def _truths(self, judge: Judge, casters: NDArray[np.bool_] | None, mode: Transparency) -> list[Truth]:
        """Return the reference's answer for each layer, computed once per frame."""
        if judge.knows(casters, mode):
            return judge.truths(casters, mode)
        with self._clock("reference"):
            truths = judge.truths(casters, mode)
        n_ambiguous = sum(int(np.count_nonzero(truth.ambiguous)) for truth in truths)
        n_candidates = sum(int(np.count_nonzero(layer.samples.candidate)) for layer in judge.frame.layers)
        if n_ambiguous > accuracy.AMBIGUOUS_WARNING_SHARE * n_candidates:
            self._warn(f"{n_ambiguous} of {n_candidates} lit candidates are ambiguous: their answer hangs on the "
                       "last digits, so mismatches there count as edge ties")
        return truths

    def _warn(self, text: str) -> None:
        """Keep a warning for run.json and print it, once."""
        if text not in self.summary.warnings:
            self.summary.warnings.append(text)
            self.progress.note(f"warning: {text}")


class Runner(Measurer):
    """Carries out a run: the cells of one scene into a run folder; parameters as in `Measurer`."""

    def __init__(self, scene: Scene, load_seconds: float, cells: list[Cell], options: RunOptions, folder: RunFolder,
                 progress: Progress) -> None:
        super().__init__(scene, load_seconds, cells, options, folder, progress)
        self.run_folder = folder

    def run(self, order: Sequence[str], plugin_files: tuple[Path, ...] = ()) -> RunSummary:
        """Run the cells, and write tables and status of all that is finished.

        Parameters
        ----------
        order : keys of all cells of the run folder, in the order of its tables.
        plugin_files : plug-ins that a worker process has to load, where cells have a time limit.
        """
        if self.options.timeout is None:
            self.measure()
        else:
            from shadowbench.supervisor import measure_within

            measure_within(self, self.options.timeout, plugin_files)
        self.run_folder.sort(order)
        status: RunStatus = "interrupted" if self.summary.interrupted else "done"
        if status == "done" and any(cell.status == "failed" for cell in self.run_folder.cells):
            status = "partial"
        self.run_folder.write_tables()
        self.run_folder.write_status(status, warnings=self.summary.warnings,
                                     seconds={name: round(value, 6) for name, value in self.seconds.items()})
        return self.summary


def empty_result(cell: Cell, scene: Scene) -> CellResult:
    """Make the result of a cell, to be filled in."""
    return CellResult(key=cell.key, scene=scene.name, frame=cell.frame, algorithm=cell.name, label=cell.label,
                      params=cell.algorithm.params.model_dump(mode="json"), status="done")


def failed_result(cell: Cell, scene: Scene, reason: str) -> CellResult:
    """Make the result of a cell that failed."""
    return empty_result(cell, scene).model_copy(update={"status": "failed", "reason": reason})


def _differing(one: list[Truth], other: list[Truth]) -> int:
    """Number of samples whose answers differ."""
    return sum(int(np.count_nonzero(np.abs(a.shadow - b.shadow) > LIGHT_TOLERANCE))
               for a, b in zip(one, other, strict=True))


def _check_buffer(buffer: ShadowBuffer, frame: Frame) -> None:
    """Refuse a shadow buffer of the wrong size or type."""
    shape = frame.samples.candidate.shape
    if buffer.shadow.shape != shape or buffer.shadow.dtype != np.float32:
        raise TypeError(f"shadow must be float32 {shape}, not {buffer.shadow.dtype} {buffer.shadow.shape}")


def outcome(result: CellResult) -> str:
    """One short phrase for the progress log."""
    if result.status != "done":
        return f"{result.status}: {result.reason}"
    a = result.accuracy
    verified = "not compared with the reference" if a is None else f"{a.false_shadow + a.false_light} wrong"
    time_text = f", {1e3 * float(np.median(result.total_seconds)):.1f} ms" if result.total_seconds else ""
    return verified + time_text
