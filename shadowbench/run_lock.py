"""One process per run folder: a lock file that names its owner.

The operating system ties the lock to the process, so the lock of a process that was killed is stale at once: the file
is still there, but nobody holds it.
"""

from __future__ import annotations

import fcntl
import os
import socket
from pathlib import Path
from types import TracebackType
from typing import Self

from shadowbench.errors import InputError

NAME = ".lock"


class RunLock:
    """Holds a run folder's lock; use as a context.

    Parameters
    ----------
    folder : the run folder; made here, with its parents.

    Attributes
    ----------
    stale : process id that an earlier run left in the lock file when it was killed, or None.

    Raises
    ------
    InputError
        On entering, if another process holds the lock, or the folder can't be made.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self.stale: str | None = None

    def __enter__(self) -> Self:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            while not self._take():
                os.close(self._file)
        except OSError as error:
            raise InputError(f"cannot make {self.path.parent}: {error.strerror}; choose another --out") from error
        return self

    def _take(self) -> bool:
        """Take the lock; False if the file was removed in the meantime, so that another one counts."""
        self._file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            owner = _owner(self._file)
            os.close(self._file)
            raise InputError(f"{self.path.parent} is in use by process {owner}: wait until it ends, or choose another --out"
                             ) from error
        try:
            current = os.stat(self.path).st_ino
        except FileNotFoundError:
            return False
        if current != os.fstat(self._file).st_ino:
            return False
        self.stale = _owner(self._file) or None
        os.ftruncate(self._file, 0)
        os.pwrite(self._file, f"{os.getpid()} on {socket.gethostname()}\n".encode(), 0)
        return True

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
                 ) -> None:
        self.path.unlink(missing_ok=True)
        os.close(self._file)


def _owner(file: int) -> str:
    """Who wrote a lock file."""
    return os.pread(file, 200, 0).decode(errors="replace").strip()
