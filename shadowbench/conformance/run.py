"""The `verify` command: the conformance suite on methods, built in or not, and what is wrong in words."""

from __future__ import annotations

import difflib
import json
import os
import shlex
import subprocess
import sys
from typing import Any

import click

from shadowbench.algorithm_specs import parameter_model, parse_algorithm_spec, validate_params
from shadowbench.algorithms import ALGORITHMS
from shadowbench.algorithms.base import Algorithm
from shadowbench.cli import EXIT_INTERRUPTED, EXIT_OK, EXIT_REGRESSION
from shadowbench.conformance.cases import CLEAR_CASES, HARD_CASES, LARGE_CASES
from shadowbench.conformance.fingerprint import fingerprints
from shadowbench.conformance.suite import Cases, Finding, Outcome, examine
from shadowbench.errors import InputError
from shadowbench.plugins import plugin_files, unavailable
from shadowbench.progress import Progress

LISTED = 5
"""Findings of the same kind that are listed; the others are counted."""

PROCESS_SECONDS = 600
"""Time for the second process to answer on all methods."""


def verify(specs: tuple[str, ...], case: str | None, quick: bool) -> int:
    """Verify methods; returns 0 if nothing is wrong, 3 if something is.

    Parameters
    ----------
    specs : names of methods, with parameters in brackets; all that there are if empty.
    case : the only case to run, or None for all.
    quick : True to leave out the large cases.
    """
    chosen = [parse_algorithm_spec(spec) for spec in specs] or [(name, {}) for name in ALGORITHMS]
    names = _case_names(case, quick)
    wrong = [] if specs else [_unavailable(p.name, p.reason) for p in unavailable()]
    loaded: list[tuple[str, dict[str, Any], Algorithm]] = []
    for name, params in chosen:
        try:
            if parameter_model(name) is None:
                click.echo(f"{name}: skipped: the optional packages that it needs are not installed")
                continue
            loaded.append((name, params, ALGORITHMS[name].load()(validate_params(name, params))))
        except InputError as error:
            wrong.append(_unavailable(name, str(error)))
    cases = Cases(names)
    try:
        with Progress(len(loaded)) as progress:
            elsewhere = _in_another_process(loaded, progress) if case is None else None
            for i, (name, params, algorithm) in enumerate(loaded):
                progress.step(name)
                outcome = examine(algorithm, cases)
                if elsewhere is not None and not outcome.findings:
                    outcome.findings += _compare_processes(name, params, elsewhere[i])
                click.echo(_text(_spec(name, params), outcome))
                progress.finished(name)
                if outcome.findings:
                    wrong.append(name)
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    click.echo(f"\nsomething is wrong with {', '.join(wrong)}" if wrong else f"\nnothing wrong with {len(loaded)} methods")
    return EXIT_REGRESSION if wrong else EXIT_OK


def _unavailable(name: str, reason: str) -> str:
    """Tell of a method that can't be examined at all; returns its name."""
    click.echo(f"{name}: WRONG\n  {reason}")
    return name


def _case_names(case: str | None, quick: bool) -> list[str]:
    """Choose the cases."""
    small = [*HARD_CASES, *CLEAR_CASES]
    known = [*small, *LARGE_CASES]
    if case is None:
        return small if quick else known
    if case not in known:
        near = difflib.get_close_matches(case, known, n=1)
        raise InputError(f"--case {case}: " + (f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"))
    return [case]


def _in_another_process(loaded: list[tuple[str, dict[str, Any], Algorithm]], progress: Progress) -> list[str | None] | None:
    """Digests of what the methods answer in a process of its own; None if that process did not answer."""
    request = {"methods": [(name, params) for name, params, _ in loaded], "plugins": [str(file) for file in plugin_files()]}
    environment = {**os.environ, "PYTHONHASHSEED": "12345"}
    try:
        done = subprocess.run([sys.executable, "-m", "shadowbench.conformance.fingerprint", json.dumps(request)],
                              env=environment, capture_output=True, text=True, timeout=PROCESS_SECONDS, check=True)
        digests: list[str | None] = json.loads(done.stdout.splitlines()[-1])
    except (subprocess.SubprocessError, OSError, ValueError, IndexError) as error:
        progress.note(f"warning: a second process gave no answer, so processes are not compared: {error}")
        return None
    return digests


def _compare_processes(name: str, params: dict[str, Any], elsewhere: str | None) -> list[Finding]:
    """Compare what a method answers here and there."""
    if fingerprints([(name, params)])[0] == elsewhere:
        return []
    return [Finding(None, "its shadows or counts differ between two processes: does it use hash(), the time or addresses?")]


def _spec(name: str, params: dict[str, Any]) -> str:
    """Write a method as the command line takes it."""
    inside = ",".join(f"{key}={json.dumps(value) if not isinstance(value, str) else value}" for key, value in params.items())
    return f"{name}[{inside}]" if inside else name


def _text(spec: str, outcome: Outcome) -> str:
    """Say how a method did."""
    state = "WRONG" if outcome.findings else "ok"
    lines = [f"{spec}: {state}, {outcome.passed} cases passed"]
    lines += [f"  unsupported: {case}: {reason}" for case, reason in outcome.unsupported.items()]
    shown = outcome.findings[:LISTED]
    for finding in shown:
        where = f"{finding.case}: " if finding.case else ""
        lines.append(f"  {where}{finding.message}")
        if finding.case:
            words = ["shadowbench", "verify", spec, "--case", finding.case]
            words += [word for file in plugin_files() for word in ("--plugin", str(file))]
            lines.append(f"    again: {shlex.join(words)}")
    if len(outcome.findings) > len(shown):
        lines.append(f"  and {len(outcome.findings) - len(shown)} more")
    return "\n".join(lines)
