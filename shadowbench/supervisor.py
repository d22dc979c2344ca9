"""Cells with a time limit: a worker process measures, and this one ends it when a cell takes too long.

A compiled kernel can't be interrupted from inside its process, so `run --timeout` measures in a second process. When a
cell exceeds its time, or takes the process down with it, that cell is recorded as failed and a new process goes on with
the next one. Time spent compiling does not count.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from numba.core.event import Event, Listener, register

from shadowbench.geometry import Frame
from shadowbench.judge import Judge
from shadowbench.plan import Cell, RunOptions
from shadowbench.plugins import load_files
from shadowbench.progress import Progress
from shadowbench.results import CellResult, RunFolderError, make_folder
from shadowbench.runner import Measurer, failed_result, outcome
from shadowbench.scenes.loader import Scene

Send = Callable[..., None]


def measure_within(measurer: Measurer, timeout: float, plugin_files: tuple[Path, ...]) -> None:
    """Carry out the cells of a measurer, each within `timeout` seconds, in worker processes."""
    remaining = measurer.cells
    try:
        while remaining:
            n_done = _Worker(measurer, remaining, timeout, plugin_files).run()
            failed = n_done and measurer.folder.cells[-1].status == "failed"
            if failed and not measurer.options.keep_going:
                return
            remaining = remaining[n_done:]
    except KeyboardInterrupt:
        measurer.summary.interrupted = True


class _Worker:
    """One worker process, seen from this side.

    Parameters
    ----------
    measurer : whose cells and folder these are.
    cells : what the process is to measure, in order.
    timeout : seconds for each of them.
    plugin_files : plug-ins to load there first.
    """

    def __init__(self, measurer: Measurer, cells: list[Cell], timeout: float, plugin_files: tuple[Path, ...]) -> None:
        self.measurer, self.cells, self.timeout = measurer, cells, timeout
        context = get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, plugin_files), daemon=True)
        self.process.start()
        theirs.close()
        self.n_done = 0
        self.clock = _Clock()

    def run(self) -> int:
        """Wait for results until the process is through, or has to be ended; returns the number of cells dealt with."""
        m = self.measurer
        try:
            self.pipe.send((m.scene, self.cells, m.options, m.folder.path))
            while True:
                left = None if self.clock.running_since is None else self.timeout - self.clock.seconds()
                if left is not None and left <= 0:
                    self._give_up(f"timeout: not finished after {self.timeout:g} s")
                    return self.n_done
                if wait([self.pipe], left) and not self._receive():
                    return self.n_done
        except (EOFError, OSError):
            self.process.join()
            if self.n_done < len(self.cells):
                self._give_up(f"the worker process ended with {_how(self.process.exitcode)}")
            return self.n_done
        finally:
            self.process.kill()
            self.process.join()
            self.pipe.close()

    def _receive(self) -> bool:
        """Take one message; False if it was the last."""
        kind, content = self.pipe.recv()
        m = self.measurer
        if kind == "start":
            m.progress.step(content)
            self.clock = _Clock(running_since=time.monotonic())
        elif kind == "compiling":
            self.clock.pause() if content else self.clock.go_on()
        elif kind == "cell":
            self.clock = _Clock()
            self._take(CellResult.model_validate_json(content))
        elif kind == "note":
            m.progress.note(content)
        elif kind == "error":
            raise RunFolderError(content)
        elif kind == "end":
            seconds, warnings = content
            for name, value in seconds.items():
                m.seconds[name] += value
            m.summary.warnings += [text for text in warnings if text not in m.summary.warnings]
            return False
        return True

    def _take(self, result: CellResult) -> None:
        """Keep a result."""
        self.n_done += 1
        self.measurer.folder.append(result)
        self.measurer.progress.finished(f"frame {result.frame} {result.label}: {outcome(result)}")

    def _give_up(self, reason: str) -> None:
        """Record the cell that is being measured as failed."""
        self._take(failed_result(self.cells[self.n_done], self.measurer.scene, reason))


@dataclass
class _Clock:
    """Time that a cell has taken, without pauses; `running_since` is None while it stands."""

    before: float = 0.0
    running_since: float | None = None

    def seconds(self) -> float:
        """Time until now."""
        return self.before + (0.0 if self.running_since is None else time.monotonic() - self.running_since)

    def pause(self) -> None:
        """Stop, keeping the time."""
        self.before, self.running_since = self.seconds(), None

    def go_on(self) -> None:
        """Run again."""
        self.running_since = time.monotonic()


def _how(code: int | None) -> str:
    """Name the way a process ended."""
    return f"signal {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit code {code}"


def _work(pipe: Connection, plugin_files: tuple[Path, ...]) -> None:
    """Measure what the pipe asks for: the worker process's whole life."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)        # Ctrl-C is for the process that waits
    threading.Thread(target=_end_with_parent, daemon=True).start()
    load_files(plugin_files)                            # so that what comes through the pipe finds its classes
    scene, cells, options, path = pipe.recv()
    lock = threading.Lock()

    def send(kind: str, content: Any = None) -> None:
        with lock:
            pipe.send((kind, content))

    register("numba:compile", _CompileListener(send))
    try:
        measurer = _PipedMeasurer(scene, cells, options, path, send)
        measurer.measure()
        send("end", (measurer.seconds, measurer.summary.warnings))
    except RunFolderError as error:
        send("error", str(error))


def _end_with_parent() -> None:
    """End this process when the one that started it is gone, even in the middle of a kernel."""
    parent = parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


class _CompileListener(Listener):
    """Tells when compiling starts and ends."""

    def __init__(self, send: Send) -> None:
        self._send, self._depth = send, 0

    def on_start(self, event: Event) -> None:
        """Tell of an outermost compilation."""
        if self._depth == 0:
            self._send("compiling", True)
        self._depth += 1

    def on_end(self, event: Event) -> None:
        """Tell of its end."""
        self._depth -= 1
        if self._depth == 0:
            self._send("compiling", False)


class _PipedProgress(Progress):
    """Sends notes to the process that waits, which counts the cells itself."""

    def __init__(self, send: Send) -> None:
        super().__init__(0, quiet=True)
        self._send = send

    def note(self, text: str) -> None:
        """Send a line."""
        self._send("note", text)


@dataclass
class _PipedFolder:
    """Sends cells to the process that waits; pictures are written here."""

    path: Path
    send: Send
    cells: list[CellResult] = field(default_factory=list)

    def append(self, cell: CellResult) -> None:
        """Send a finished cell."""
        self.send("cell", cell.model_dump_json(by_alias=True))

    def image_folder(self, frame: int, label: str | None = None) -> Path:
        """Make and return the folder for a frame's pictures, or for one algorithm's within it."""
        if not (self.path / "run.json").exists():
            raise RunFolderError(f"the run folder {self.path} has vanished: choose another --out, or run again")
        folder = self.path / "frames" / f"{frame:04d}"
        return make_folder(folder if label is None else folder / label)


class _PipedMeasurer(Measurer):
    """A measurer that tells when each cell starts."""

    def __init__(self, scene: Scene, cells: list[Cell], options: RunOptions, path: Path, send: Send) -> None:
        super().__init__(scene, 0.0, cells, options, _PipedFolder(path, send), _PipedProgress(send))
        self._send = send

    def _run_cell(self, cell: Cell, frame: Frame, judge: Judge) -> CellResult:
        self._send("start", f"frame {cell.frame}: {cell.label}")
        return super()._run_cell(cell, frame, judge)
