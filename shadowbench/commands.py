"""What the commands do: turns options into a run, and things into text."""

from __future__ import annotations

import difflib
import inspect
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from shadowbench.algorithm_specs import parse_algorithm_spec, validate_params
from shadowbench.algorithms import ALGORITHMS, ALL_ALGORITHMS
from shadowbench.algorithms.base import AlgorithmParams
from shadowbench.cli import EXIT_INTERRUPTED, EXIT_SOME_FAILED
from shadowbench.config import load_config, resolved_yaml
from shadowbench.errors import InputError
from shadowbench.progress import Progress
from shadowbench.report.table import format_table, summary
from shadowbench.results import RunFolder, RunFolderError, check_writable, default_folder, read_run
from shadowbench.scenes import ALL_SCENES, SCENES
from shadowbench.templates import template

if TYPE_CHECKING:
    from shadowbench.plan import Cell, RunOptions
    from shadowbench.scenes.loader import Scene

QUICK_HEIGHT = 256
"""Largest image height of ``run --quick``."""


def run(argv: list[str], *, scenes: tuple[str, ...], specs: tuple[str, ...], overrides: tuple[str, ...],
        frames: slice | None, size: tuple[int, int] | None, repeats: int | None, threads: int | None,
        out: Path | None, only: frozenset[str] | None, quick: bool, dry_run: bool, keep_going: bool) -> int:
    """Run every scene, each into its own folder; return the worst exit code."""
    from shadowbench import plan
    from shadowbench.scenes.loader import load_scene

    changes = list(overrides)
    if size is not None:
        changes += [f"image.width={size[0]}", f"image.height={size[1]}"]
    chosen = [parse_algorithm_spec(spec) for spec in specs]
    for name, params in chosen:
        validate_params(name, params)
    loaded, seconds = [], []
    for name in scenes:
        start = time.perf_counter()
        loaded.append(load_scene(name, changes, quick_height=QUICK_HEIGHT if quick else None))
        seconds.append(time.perf_counter() - start)
    folders = _folders(out, [scene.name for scene in loaded])
    codes = []
    for scene, load_seconds, folder in zip(loaded, seconds, folders, strict=True):
        numbers = range(scene.n_frames)[frames or slice(None)]
        options = plan.RunOptions(tuple(numbers[:1] if quick else numbers), repeats or (1 if quick else 3),
                                    threads or len(os.sched_getaffinity(0)), only or plan.EVERYTHING, keep_going)
        if not options.frames:
            raise InputError(f"{scene.name} has {scene.n_frames} frame(s): --frames selects none of them")
        cells = plan.plan_cells(scene, _selections(scene, chosen), options.frames)
        if dry_run:
            click.echo(_list_cells(scene, cells))
            codes.append(0)
        else:
            codes.append(_run_scene(scene, load_seconds, cells, options, folder, argv))
            if codes[-1] == EXIT_INTERRUPTED:
                break
    return max(codes)


def _folders(out: Path | None, names: list[str]) -> list[Path]:
    """Choose one run folder per scene and make sure that each can be written to."""
    if out is None:
        folders = [default_folder(name) for name in names]
    else:
        folders = [out] if len(names) == 1 else [out / name for name in names]
    for i, folder in enumerate(folders):
        if folder in folders[:i]:
            raise InputError(f"two scenes are called {names[i]}: run them apart, or rename one")
        check_writable(folder)
    return folders


def _selections(scene: Scene, chosen: list[tuple[str, dict[str, Any]]]) -> list[tuple[str, AlgorithmParams]]:
    """Decide which algorithms run: those asked for, or all, each swept over its axes of the scene's matrix."""
    from shadowbench.plan import sweep

    wanted = chosen or scene.config.selections() or [(entry.name, {}) for entry in ALL_ALGORITHMS]
    return [(name, validate_params(name, params)) for name, params in sweep(wanted, scene.config.matrix)]


def _list_cells(scene: Scene, cells: list[Cell]) -> str:
    """Text of ``--dry-run``."""
    rows = [(str(cell.frame), cell.label, cell.algorithm.unsupported(scene) or "will run") for cell in cells]
    return f"{scene.name}: {len(cells)} cells\n" + format_table(("frame", "method", ""), rows)


def _run_scene(scene: Scene, load_seconds: float, cells: list[Cell], options: RunOptions, path: Path, argv: list[str]
               ) -> int:
    """Run one scene and print its table and where everything is."""
    from shadowbench.plan import describe
    from shadowbench.runner import Runner

    folder = RunFolder(path, describe(scene, options, ["shadowbench", *argv]), len(cells))
    try:
        folder.write_text("config.input.yaml", scene.text)
        folder.write_text("config.resolved.yaml", resolved_yaml(scene.config))
        with Progress(len(cells)) as progress:
            progress.note(f"{scene.name}: {len(cells)} cells, {options.threads} thread(s)")
            result = Runner(scene, load_seconds, cells, options, folder, progress).run()
    except RunFolderError as error:
        click.echo(f"error: {error}", err=True)
        return EXIT_SOME_FAILED
    click.echo(summary(result.cells))
    click.echo(f"\n{'interrupted; kept' if result.interrupted else 'results'}: {path}")
    return result.exit_code


def describe_algorithm(name: str) -> str:
    """Manual page of an algorithm: its module's text, parameters, stages and counters."""
    entry = ALGORITHMS[name]
    algorithm = entry.load()
    rows = []
    for key, info in algorithm.Params.model_fields.items():
        extra = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
        limits = ", ".join(str(limit) for limit in info.metadata)
        rows.append((key, str(getattr(info.annotation, "__name__", info.annotation)).replace("typing.", ""), limits,
                     str(info.default), str(extra.get("paper", info.default)), info.description or ""))
    module = inspect.getmodule(algorithm)
    parts = [f"{entry.title} ({entry.paper}), {'exact' if entry.exact else 'approximate'}",
             inspect.getdoc(module) or "",
             "Parameters\n" + format_table(("name", "type", "limits", "default", "paper", "meaning"), rows)
             if rows else "No parameters.",
             "Stages: " + ", ".join(algorithm.stages), "Counters: " + ", ".join(algorithm.counters)]
    return "\n\n".join(parts)


def describe_scene(name: str) -> str:
    """A built-in scene's summary, or a scene file with every default filled in."""
    if name in SCENES:
        entry = SCENES[name]
        return f"{entry.name}: {entry.summary}\n{entry.triangles} triangles unless said otherwise\n\n" + template(name)
    return resolved_yaml(load_config(Path(name)))


def describe_run(path: Path) -> str:
    """The table of a finished run, with its status and warnings."""
    document, cells = read_run(path)
    lines = [f"{document['scene']}: {document['status']}, {document['created']}",
             *[f"warning: {text}" for text in document.get("warnings", [])], summary(cells)]
    return "\n".join(lines)


def not_found(what: str) -> str:
    """Say that a name is unknown, with the nearest ones."""
    names = [entry.name for entry in ALL_ALGORITHMS] + [scene.name for scene in ALL_SCENES]
    near = difflib.get_close_matches(what, names, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    return f"{what} is no algorithm, built-in scene, scene file or run folder{hint}"


def write_template(name: str) -> Path:
    """Write ``NAME.yaml`` in the current folder, refusing to overwrite."""
    file = Path(f"{name.removesuffix('.yaml')}.yaml")
    try:
        with file.open("x", encoding="utf-8") as stream:
            stream.write(template(file.stem))
    except FileExistsError as error:
        raise InputError(f"{file} exists already: choose another name, or remove it") from error
    except OSError as error:
        raise InputError(f"cannot write {file}: {error.strerror}") from error
    return file
