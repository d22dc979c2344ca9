"""The `check` command: measures a suite and compares its counts with the baseline."""

from __future__ import annotations

import os
import shlex
import time
from collections.abc import Iterable
from pathlib import Path

import click

from shadowbench.algorithm_specs import validate_params
from shadowbench.algorithms import ALGORITHMS
from shadowbench.check.baseline import Place, baseline_text, counts_of, read_baseline
from shadowbench.check.compare import ALL_NAMES, compare
from shadowbench.check.report import Outcome, markdown_report, text_report
from shadowbench.check.suite import Suite, SuiteEntry, load_suite
from shadowbench.cli import EXIT_INTERRUPTED, EXIT_NOTHING, EXIT_OK, EXIT_REGRESSION, EXIT_SOME_FAILED
from shadowbench.errors import InputError
from shadowbench.plan import Cell, RunOptions, plan_cells
from shadowbench.progress import Progress
from shadowbench.report.remarks import remarks
from shadowbench.results import CellResult, make_folder
from shadowbench.runner import Measurer
from shadowbench.validation import did_you_mean


class MemoryFolder:
    """Takes cells and keeps them in memory: a check writes no run folder."""

    def __init__(self) -> None:
        self.path = Path()
        self.cells: list[CellResult] = []

    def append(self, cell: CellResult) -> None:
        """Take a finished cell."""
        self.cells.append(cell)

    def image_folder(self, frame: int, label: str | None = None) -> Path:
        """Refuse: counts alone are measured."""
        raise RuntimeError("a check makes no pictures")


def check(suite_path: Path, baseline: Path, *, update: bool, tolerances: tuple[str, ...], style: str, threads: int | None
          ) -> int:
    """Measure a suite and compare; returns the exit code.

    Parameters
    ----------
    suite_path, baseline : the suite file and the file of expected counts.
    update : True to make the baseline anew.
    tolerances : texts ``COUNTER=PERCENT``.
    style : "text" or "md".
    threads : threads of the kernels, or None for all processors.
    """
    percent = parse_tolerances(tolerances)
    if update and os.environ.get("CI", "").lower() not in ("", "0", "false"):
        raise InputError("--update is refused where CI is set: make the baseline anew on your machine and commit it")
    suite = load_suite(suite_path)
    exists = baseline.is_file()
    expected = read_baseline(baseline, suite.name) if exists else {}
    if not exists and not update:
        click.echo(f"error: no baseline {baseline}: make it with `shadowbench check --update` and commit it", err=True)
        return EXIT_NOTHING
    folder, commands = MemoryFolder(), {}
    for entry in suite.entries:
        cells = plan_cells(entry.scene, [(name, validate_params(name, params)) for name, params in entry.selections],
                           entry.frames)
        commands.update(_commands(entry, cells))
        if _measure(entry, cells, folder, threads or len(os.sched_getaffinity(0))):
            return EXIT_INTERRUPTED
    outcome = _outcome(suite, folder.cells, expected, percent, commands)
    text, markdown = text_report(outcome, advise=not update), markdown_report(outcome)
    click.echo(markdown if style == "md" else text)
    summary = os.environ.get("GITHUB_STEP_SUMMARY")
    if summary:
        with open(summary, "a", encoding="utf-8") as file:
            file.write(markdown)
    return _finish(outcome, baseline, update)


def parse_tolerances(texts: Iterable[str]) -> dict[str, float]:
    """Read ``COUNTER=PERCENT``.

    Raises
    ------
    InputError
        If a counter is unknown or a percentage is no number from 0 up.
    """
    tolerances = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if name not in ALL_NAMES:
            near = did_you_mean(name, ALL_NAMES)
            hint = near if "mean" in near else "see `shadowbench list counters`"
            raise InputError(f"--tolerance {text}: unknown counter '{name}'; {hint}")
        try:
            tolerances[name] = float(value.removesuffix("%"))
        except ValueError:
            tolerances[name] = -1.0
        if not equals or not 0 <= tolerances[name] < float("inf"):
            raise InputError(f"--tolerance {text}: write it as COUNTER=PERCENT, such as node_tests=0.5")
    return tolerances


def _commands(entry: SuiteEntry, cells: list[Cell]) -> dict[tuple[str, int, str], str]:
    """The command that runs each cell again, with pictures."""
    commands = {}
    for cell in cells:
        changed = cell.algorithm.params.model_dump(mode="json", exclude_defaults=True)
        inside = ",".join(f"{key}={value}" for key, value in changed.items())
        spec = f"{cell.name}[{inside}]" if inside else cell.name
        words = ["shadowbench", "run", entry.source, *(word for text in entry.overrides for word in ("-D", text)),
                 "--frames", str(cell.frame), "-a", spec]
        commands[entry.scene.name, cell.frame, cell.label] = shlex.join(words)
    return commands


def _measure(entry: SuiteEntry, cells: list[Cell], folder: MemoryFolder, threads: int) -> bool:
    """Measure the cells of one scene; True if the user stopped it."""
    start = time.perf_counter()
    options = RunOptions(entry.frames, 1, threads, frozenset({"counts"}))
    with Progress(len(cells)) as progress:
        measurer = Measurer(entry.scene, 0.0, cells, options, folder, progress)
        measurer.measure()
        progress.note(f"{entry.scene.name}: {len(cells)} cells in {time.perf_counter() - start:.1f} s")
    return measurer.summary.interrupted


def _outcome(suite: Suite, cells: list[CellResult], expected: dict[Place, int], percent: dict[str, float],
             commands: dict[tuple[str, int, str], str]) -> Outcome:
    """Compare what was measured with what was expected."""
    wrong = [(cell, cell.accuracy.false_shadow + cell.accuracy.false_light) for cell in cells
             if cell.accuracy is not None and ALGORITHMS[cell.algorithm].load().exact and not remarks(cell)]
    counts = counts_of(cells)
    return Outcome(suite.name, cells, len(counts), compare(expected, counts, percent),
                   [(cell, n) for cell, n in wrong if n], commands)


def _finish(outcome: Outcome, baseline: Path, update: bool) -> int:
    """Write the baseline if that is wanted and allowed, and choose the exit code."""
    if not any(cell.status == "done" for cell in outcome.cells):
        click.echo("error: nothing was measured", err=True)
        return EXIT_NOTHING
    if update and (outcome.wrong or outcome.failed):
        click.echo("error: the baseline is left as it is: wrong samples and failed cells are no baseline", err=True)
    elif update:
        text = baseline_text(outcome.suite, counts_of(outcome.cells))
        make_folder(baseline.parent)
        try:
            baseline.write_text(text, encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot write {baseline}: {error.strerror}") from error
        click.echo(f"wrote {baseline}: {outcome.n_counts:,} counts, {len(outcome.changes):,} of them changed")
        return EXIT_OK
    if outcome.regressed:
        return EXIT_REGRESSION
    return EXIT_SOME_FAILED if outcome.failed else EXIT_OK
