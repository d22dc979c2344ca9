"""The baseline file: one count per line, sorted, so that a change of counts is a readable diff.

Neither versions nor digests of sources stand in it: an edit that changes no count changes no byte.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from shadowbench.errors import InputError
from shadowbench.results import CellResult, count_rows

SCHEMA = 1
"""Version of the format; grows when a field changes its meaning."""

_TITLE = "# Counts that `shadowbench check` expects. Do not edit: `shadowbench check --update` makes them anew."
_COLUMNS = "# scene frame method counter value"


@dataclass(frozen=True, order=True)
class Place:
    """Where a count belongs: scene, frame, label of the method, counter."""

    scene: str
    frame: int
    label: str
    counter: str

    @property
    def cell(self) -> tuple[str, int, str]:
        """The place without the counter."""
        return self.scene, self.frame, self.label


def counts_of(cells: Iterable[CellResult]) -> dict[Place, int]:
    """Counts and samples by class of the cells that are done."""
    done = [cell for cell in cells if cell.status == "done"]
    return {Place(scene, frame, label, counter): value
            for scene, frame, _, label, counter, value in count_rows(done)}


def baseline_text(suite: str, counts: Mapping[Place, int]) -> str:
    """Write a baseline: the same text for the same counts."""
    lines = [_TITLE, f"suite {suite}", f"schema {SCHEMA}", _COLUMNS]
    lines += [f"{place.scene} {place.frame} {place.label} {place.counter} {counts[place]}" for place in sorted(counts)]
    return "\n".join(lines) + "\n"


def read_baseline(path: Path, suite: str) -> dict[Place, int]:
    """Read a baseline.

    Raises
    ------
    InputError
        If it can't be read, belongs to another suite or schema, or has lines that are no counts.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: can't be read: {error}") from error
    head = dict(line.split(" ", 1) for line in lines[:4] if line.startswith(("suite ", "schema ")))
    if head.get("schema") != str(SCHEMA):
        raise InputError(f"{path}: schema {head.get('schema', 'unknown')}, but this version reads {SCHEMA}: make it anew "
                         "with `shadowbench check --update`")
    if head.get("suite") != suite:
        raise InputError(f"{path}: made for the suite {head.get('suite', 'unknown')}, not for {suite}: give --baseline")
    counts: dict[Place, int] = {}
    for number, line in enumerate(lines, 1):
        if line and not line.startswith(("#", "suite ", "schema ")):
            place, value = _count(path, number, line)
            if place in counts:
                raise InputError(f"{path}:{number}: this count stands there twice: make the file anew with "
                                 "`shadowbench check --update`")
            counts[place] = value
    return counts


def _count(path: Path, number: int, line: str) -> tuple[Place, int]:
    """Read one line."""
    words = line.split(" ")
    if len(words) != 5 or not words[1].isdecimal() or not words[4].isdecimal():
        raise InputError(f"{path}:{number}: '{line[:60]}' is no 'scene frame method counter value' (left by a merge?): "
                         "make the file anew with `shadowbench check --update`")
    return Place(words[0], int(words[1]), words[2], words[3]), int(words[4])
