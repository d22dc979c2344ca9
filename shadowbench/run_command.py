"""The `run` command: turns options into cells, sorts out those that are kept, and runs the others."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from shadowbench import plan
from shadowbench.algorithm_specs import parse_algorithm_spec, validate_params
from shadowbench.algorithms import ALGORITHMS, ALL_ALGORITHMS
from shadowbench.algorithms.base import AlgorithmParams
from shadowbench.cli import EXIT_INTERRUPTED, EXIT_OK, EXIT_SOME_FAILED
from shadowbench.config import resolved_yaml
from shadowbench.errors import InputError
from shadowbench.plugins import plugin_files, plugin_names
from shadowbench.progress import Progress
from shadowbench.report.html import write_report
from shadowbench.report.table import format_table, summary
from shadowbench.results import (
    RunFolder,
    RunFolderError,
    check_writable,
    default_folder,
    drop_torn_line,
    make_folder,
)
from shadowbench.resume import Decision, decide, earlier_folders, estimate
from shadowbench.run_lock import RunLock
from shadowbench.runner import Runner, RunSummary
from shadowbench.scene_sweep import scene_variants
from shadowbench.scenes.loader import Scene, load_scene

QUICK_HEIGHT = 256
"""Largest image height of ``run --quick``."""


@dataclass(frozen=True)
class Request:
    """What the command line asks for, beside the scenes.

    Attributes
    ----------
    selections : algorithms named by ``-a``; none for those of the scene file.
    frames : frame numbers to take.
    options : all else that holds for every scene; its frames are filled in per scene.
    quick, resume, dry_run : the flags of these names.
    argv : the command line, for run.json.
    """

    selections: tuple[tuple[str, dict[str, Any]], ...]
    frames: slice
    options: plan.RunOptions
    quick: bool
    resume: bool
    dry_run: bool
    argv: tuple[str, ...]


def run(argv: list[str], *, scenes: tuple[str, ...], specs: tuple[str, ...], overrides: tuple[str, ...],
        frames: slice | None, size: tuple[int, int] | None, repeats: int | None, threads: int | None, timeout: float | None,
        out: Path | None, only: frozenset[str] | None, quick: bool, resume: bool, dry_run: bool, keep_going: bool) -> int:
    """Run every scene, each into its own folder; return the worst exit code."""
    if resume and out is None:
        raise InputError("--resume needs --out DIR: the run folder to go on with")
    changes = list(overrides)
    if size is not None:
        changes += [f"image.width={size[0]}", f"image.height={size[1]}"]
    chosen = tuple(parse_algorithm_spec(spec) for spec in specs)
    for name, params in chosen:
        validate_params(name, params)
    options = plan.RunOptions((), repeats or (1 if quick else 3), threads or len(os.sched_getaffinity(0)),
                              only or plan.EVERYTHING, keep_going, timeout=timeout)
    request = Request(chosen, frames or slice(None), options, quick, resume, dry_run, ("shadowbench", *argv))
    loaded = [pair for name in scenes for pair in _load(name, changes, quick)]
    folders = _folders(out, [scene.name for scene, _ in loaded], resume)
    codes = []
    for (scene, seconds), folder in zip(loaded, folders, strict=True):
        codes.append(_run_scene(scene, seconds, folder, request))
        if codes[-1] == EXIT_INTERRUPTED:
            break
    return max(codes)


def _load(name: str, changes: Sequence[str], quick: bool) -> list[tuple[Scene, float]]:
    """Load a scene with the seconds it took, or its variants if its matrix has axes of the scene."""
    height = QUICK_HEIGHT if quick else None
    start = time.perf_counter()
    scene = load_scene(name, changes, quick_height=height)
    seconds = time.perf_counter() - start
    variants = scene_variants(scene.config)
    if not variants:
        return [(scene, seconds)]
    return [(load_scene(name, [*changes, *more], quick_height=height), seconds) for more in variants]


def _folders(out: Path | None, names: list[str], resume: bool) -> list[Path]:
    """Choose one run folder per scene and make sure that each can be written to."""
    if out is None:
        folders = [default_folder(name) for name in names]
    else:
        folders = [out] if len(names) == 1 else [out / name for name in names]
    for i, folder in enumerate(folders):
        if folder in folders[:i]:
            raise InputError(f"two scenes are called {names[i]}: run them apart, or rename one")
        check_writable(folder, resume)
    return folders


def selections(scene: Scene, chosen: Sequence[tuple[str, dict[str, Any]]]) -> list[tuple[str, AlgorithmParams]]:
    """Decide which algorithms run: those asked for, or all, each swept over its axes of the scene's matrix."""
    wanted = chosen or scene.config.selections() or [(name, {}) for name in _everything()]
    return [(name, validate_params(name, params)) for name, params in plan.sweep(wanted, scene.config.matrix)]


def _everything() -> list[str]:
    """Names of all algorithms and of the plug-ins that can be loaded."""
    names = [entry.name for entry in ALL_ALGORITHMS]
    for name in plugin_names():
        try:
            ALGORITHMS[name].load()
            names.append(name)
        except InputError as error:
            click.echo(f"warning: {error}", err=True)
    return names


def _run_scene(scene: Scene, load_seconds: float, folder: Path, request: Request) -> int:
    """Run one scene, or say what would be run."""
    numbers = range(scene.n_frames)[request.frames]
    options = replace(request.options, frames=tuple(numbers[:1] if request.quick else numbers))
    if not options.frames:
        raise InputError(f"{scene.name} has {scene.n_frames} frame(s): --frames selects none of them")
    cells = plan.plan_cells(scene, selections(scene, request.selections), options.frames)
    if request.dry_run:
        click.echo(_list_cells(scene, decide(cells, folder, scene.name, options), folder))
        return EXIT_OK
    with RunLock(folder) as lock:
        torn = request.resume and drop_torn_line(folder / "results.jsonl")
        decisions = decide(cells, folder, scene.name, options)
        notes = []
        if lock.stale:
            notes.append(f"an earlier run (process {lock.stale}) was killed in this folder; what it finished is kept")
        if torn:
            notes.append("the last line of results.jsonl was cut short: it is dropped, and its cell runs again")
        if request.resume:
            notes += [f"frame {d.cell.frame} {d.cell.label}: {'kept' if d.kept else f'runs: {d.reason}'}" for d in decisions]
        return _run_cells(scene, load_seconds, decisions, options, folder, request, notes)


def _run_cells(scene: Scene, load_seconds: float, decisions: list[Decision], options: plan.RunOptions, path: Path,
               request: Request, notes: list[str]) -> int:
    """Run the cells that are not kept; print their table and where everything is."""
    n_cells = sum(not decision.kept for decision in decisions)
    try:
        with Progress(n_cells) as progress:
            for note in (*notes, f"{scene.name}: {n_cells} cells, {options.threads} thread(s)"):
                progress.note(note)
            result = measure_cells(scene, load_seconds, decisions, options, path, list(request.argv), progress)
    except RunFolderError as error:
        click.echo(f"error: {error}", err=True)
        return EXIT_SOME_FAILED
    click.echo(summary(result.cells))
    click.echo(f"\n{'interrupted; kept' if result.interrupted else 'results'}: {path}")
    return result.exit_code


def measure_cells(scene: Scene, load_seconds: float, decisions: list[Decision], options: plan.RunOptions, path: Path,
                  argv: list[str], progress: Progress) -> RunSummary:
    """Run the cells that are not kept, and write everything that belongs into the run folder.

    Raises
    ------
    RunFolderError
        If the folder can't be written to any more.
    """
    kept = [decision.kept for decision in decisions if decision.kept]
    cells = [decision.cell for decision in decisions if not decision.kept]
    make_folder(path)
    folder = RunFolder(path, plan.describe(scene, options, argv), len(decisions), kept)
    folder.write_text("config.input.yaml", scene.text)
    folder.write_text("config.resolved.yaml", resolved_yaml(scene.config))
    runner = Runner(scene, load_seconds, cells, options, folder, progress)
    result = runner.run([decision.cell.key for decision in decisions], plugin_files())
    write_report(folder)
    return result


def _list_cells(scene: Scene, decisions: list[Decision], folder: Path) -> str:
    """Text of ``--dry-run``: each cell, what becomes of it, and how long it takes as far as that is known."""
    seconds = estimate(decisions, scene.name, earlier_folders(folder))
    rows = []
    for decision, time_needed in zip(decisions, seconds, strict=True):
        cell = decision.cell
        unsupported = cell.algorithm.unsupported(scene)
        what = "kept from before" if decision.kept else unsupported or f"will run: {decision.reason}"
        guess = "" if decision.kept or unsupported or time_needed is None else f"{time_needed:.1f}"
        rows.append((str(cell.frame), cell.label, guess, what))
    known = [s for s in seconds if s is not None]
    n_run = sum(decision.kept is None for decision in decisions)
    total = f"about {sum(known):.0f} s" if known and n_run else "of unknown duration" if n_run else "nothing to do"
    unknown = len(seconds) - len(known)
    more = f", and {unknown} more of unknown duration" if known and unknown and n_run else ""
    return (f"{scene.name}: {len(decisions)} cells, {n_run} to run: {total}{more}\n"
            + format_table(("frame", "method", "seconds", ""), rows))
