"""The outcome of a check as text for a terminal, or as Markdown for a CI summary."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from shadowbench.check.compare import Change, Verdict
from shadowbench.results import CellResult

LISTED = 200
"""Changes of one kind that a CI summary lists; the rest is counted."""


@dataclass(frozen=True)
class Outcome:
    """What a check found.

    Attributes
    ----------
    suite : the suite's name.
    cells : everything that was measured.
    n_counts : number of counts in it.
    changes : differences from the baseline.
    wrong : cells of exact methods with wrong samples, and how many.
    commands : command that runs a cell again, by scene, frame and label.
    """

    suite: str
    cells: Sequence[CellResult]
    n_counts: int
    changes: Sequence[Change]
    wrong: Sequence[tuple[CellResult, int]]
    commands: dict[tuple[str, int, str], str] = field(default_factory=dict)

    @property
    def failed(self) -> list[CellResult]:
        """Cells that could not be measured."""
        return [cell for cell in self.cells if cell.status == "failed"]

    @property
    def regressed(self) -> bool:
        """True if a count is worse than the baseline, or a sample of an exact method is wrong."""
        return bool(self.wrong) or any(change.verdict.fails for change in self.changes)


def change_text(change: Change) -> str:
    """Write how a count changed: ``1,000 -> 1,100  +100 (+10 %)``."""
    if change.before is None or change.after is None:
        return f"{change.after if change.before is None else change.before:,}"
    difference = change.after - change.before
    share = f" ({100 * difference / change.before:+.3g} %)" if change.before else ""
    return f"{change.before:,} -> {change.after:,}  {difference:+,}{share}"


def _rows(changes: Iterable[Change]) -> list[tuple[str, str, str]]:
    return [(f"{c.place.scene} frame {c.place.frame} {c.place.label}", c.place.counter, change_text(c)) for c in changes]


def sections(outcome: Outcome) -> list[tuple[str, list[tuple[str, str, str]]]]:
    """Titles and rows of all that is not as expected, the worst first."""
    found = [("wrong samples of exact methods",
              [(f"{c.scene} frame {c.frame} {c.label}", "wrong samples", f"{n:,}") for c, n in outcome.wrong]),
             ("failed", [(f"{c.scene} frame {c.frame} {c.label}", "", str(c.reason)) for c in outcome.failed])]
    found += [(verdict.value, _rows(c for c in outcome.changes if c.verdict is verdict)) for verdict in Verdict]
    return [(title, rows) for title, rows in found if rows]


def headline(outcome: Outcome) -> str:
    """One sentence that says how it went."""
    done = sum(cell.status == "done" for cell in outcome.cells)
    what = f"{outcome.suite}: {done} cells, {outcome.n_counts:,} counts"
    found = [f"{len(rows):,} {title}" for title, rows in sections(outcome)]
    return f"{what}: {', '.join(found) if found else 'all as in the baseline'}"


def advice(outcome: Outcome) -> list[str]:
    """What to do next."""
    lines = []
    blamed = [(c.scene, c.frame, c.label) for c, _ in outcome.wrong]
    blamed += [(c.scene, c.frame, c.label) for c in outcome.failed]
    blamed += [c.place.cell for c in outcome.changes if c.verdict.fails]
    command = next((outcome.commands[cell] for cell in blamed if cell in outcome.commands), None)
    if command:
        lines.append(f"To look at the first: {command}")
    if outcome.changes and not outcome.wrong and not outcome.failed:
        lines.append("If this is meant, make the baseline anew and commit it: shadowbench check --update")
    return lines


def text_report(outcome: Outcome, advise: bool = True) -> str:
    """Write the outcome for a terminal, with what to do next if that is wanted."""
    lines = []
    for title, rows in sections(outcome):
        widths = [max(len(row[i]) for row in rows) for i in (0, 1)]
        lines.append(f"{title} ({len(rows):,})")
        lines += [f"  {cell:<{widths[0]}}  {counter:<{widths[1]}}  {change}".rstrip() for cell, counter, change in rows]
        lines.append("")
    return "\n".join([*lines, headline(outcome), *(advice(outcome) if advise else [])])


def markdown_report(outcome: Outcome) -> str:
    """Write the outcome as Markdown."""
    mark = "failed" if outcome.regressed or outcome.failed else "passed"
    lines = [f"### Operation counts: {mark}", "", headline(outcome), ""]
    for title, rows in sections(outcome):
        lines += [f"**{title}** ({len(rows):,})", "", "| where | counter | change |", "| --- | --- | --- |"]
        lines += [f"| {cell} | `{counter}` | {_escape(change)} |" if counter else f"| {cell} | | {_escape(change)} |"
                  for cell, counter, change in rows[:LISTED]]
        lines += ["", f"and {len(rows) - LISTED:,} more"] if len(rows) > LISTED else []
        lines.append("")
    return "\n".join([*lines, *advice(outcome)]).rstrip() + "\n"


def _escape(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
