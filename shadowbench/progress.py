"""Progress on stderr: a live bar on a terminal, plain lines with n/total and an estimate elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress


class Progress:
    """Tell how far a run is.

    Parameters
    ----------
    total : number of steps.
    quiet : True to print nothing but notes.
    """

    def __init__(self, total: int, quiet: bool = False) -> None:
        self._total, self._done, self._quiet = total, 0, quiet
        self._start = time.perf_counter()
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)
        self._bar = None
        if sys.stderr.isatty() and not quiet:
            self._bar = RichProgress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                                     TimeRemainingColumn(), console=self._console, transient=True)
            self._task = self._bar.add_task("", total=total)

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
                 ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def step(self, what: str) -> None:
        """Announce a step that begins."""
        if self._bar is not None:
            self._bar.update(self._task, description=what)

    def finished(self, what: str) -> None:
        """Count a step as done; on a plain stream, print it with the time that is left."""
        self._done += 1
        if self._bar is not None:
            self._bar.advance(self._task)
        elif not self._quiet:
            elapsed = time.perf_counter() - self._start
            left = elapsed / self._done * (self._total - self._done)
            eta = f", about {left:.0f} s left" if self._done < self._total else f", {elapsed:.1f} s in all"
            self.note(f"[{self._done}/{self._total}] {what}{eta}")

    def note(self, text: str) -> None:
        """Print a line above the bar."""
        self._console.print(text, markup=False)
