"""Commands that run one cell of a report again, or explain a pixel of it."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Any

from shadowbench.explain.methods import refusal
from shadowbench.report.gather import Run
from shadowbench.results import CellResult

_DROPPED = {"-a": 1, "--algorithm": 1, "--frames": 1, "--out": 1, "--repeats": 1, "--resume": 0, "--quick": 0,
            "--dry-run": 0, "--keep-going": 0, "--fail-fast": 0, "--only": 1, "--timeout": 1}
"""Options that a command for one cell leaves out, with the number of values that each takes."""


def spec(cell: CellResult, default: dict[str, Any] | None = None) -> str:
    """Write a cell's algorithm as the command line takes it, such as ``ptsv[branching=16]``.

    Parameters
    ----------
    default : values that need not be said; those of the label's own text otherwise.
    """
    named = cell.label.split("+")[1:]
    names = {part.partition("=")[0] for part in named}
    if default is not None:
        names = {name for name, value in cell.params.items() if default.get(name) != value}
    changed = [f"{name}={_text(value)}" for name, value in sorted(cell.params.items()) if name in names]
    return f"{cell.algorithm}[{','.join(changed)}]" if changed else cell.algorithm


def _text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def again(run: Run, cell: CellResult) -> str:
    """Return the command that runs one cell again; where the run was no `run` command, one on its own scene file."""
    words = scene_words(run)
    words += ["-a", spec(cell), "--frames", str(cell.frame)]
    return shlex.join(["shadowbench", "run", *words])


def scene_words(run: Run) -> list[str]:
    """Return the arguments that name the run's scene, its size and its overrides."""
    argv = list(run.document.get("argv", []))
    if argv[1:2] != ["run"]:
        return [str(run.path / "config.resolved.yaml")]
    kept = list(_kept(argv[2:]))
    if "--quick" in argv:
        kept += ["--size", f"{run.document['image']['width']}x{run.document['image']['height']}"]
    return kept


def _kept(words: Sequence[str]) -> Iterator[str]:
    """Leave out the options of `_DROPPED`, also when written ``--option=value`` or ``-aVALUE``."""
    skip = 0
    for word in words:
        if skip:
            skip -= 1
        elif word in _DROPPED:
            skip = _DROPPED[word]
        elif word.partition("=")[0] not in _DROPPED and not (word.startswith("-a") and not word.startswith("--")):
            yield word


def unexplained(cell: CellResult, by_triangle: bool = False) -> str | None:
    """Say why `explain` refuses a cell's method; None if it can list its tests."""
    return refusal(cell.algorithm, cell.params.get("group", 1), by_triangle)


def explain(run: Run) -> str:
    """Return the start of the command that explains a pixel: all but the algorithm, the frame and the pixel."""
    return shlex.join(["shadowbench", "explain", *scene_words(run)])
