"""Numba options and the compile cache: the only module that decides how kernels are compiled.

Three rules keep every count the same on every machine, for every thread count:

* No ``fastmath``, hence no reordered sums and no fused multiply-add: plain IEEE operations, in source order.
* A parallel kernel is nothing but a ``prange`` over workers whose body *calls one serial kernel*. Each worker
  owns a disjoint part of the output. (Numba mis-compiles ``is not None`` tests written inside a ``prange`` body,
  so this is a rule of correctness too.)
* The counting build and the timing build come from one source: a kernel takes a record of count arrays or the
  literal ``None``, and guards each count with ``if counts is not None``. Numba compiles the two types apart and
  removes the guarded code from the ``None`` build, so timed code carries no counting.

The cache lives in a folder named by a digest of all package sources and of the versions of Numba, llvmlite and
NumPy, because Numba itself notices only a change in the file of the kernel, not in the helpers that it calls.
"""

import atexit
import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import llvmlite
import numba
import numpy
from numba import prange
from numba.core.event import Event, Listener, register, unregister
from platformdirs import user_cache_path

__all__ = ["CompileWatch", "cache_folder", "inlined_kernel", "kernel", "parallel_kernel", "prange", "set_threads",
           "sources_digest", "threading_layer"]


def sources_digest() -> str:
    """Digest of every package source and of the compiler's versions, as 16 hexadecimal digits."""
    digest = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__} {numpy.__version__}".encode())
    package = Path(__file__).parent
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Create and return the folder for compiled kernels: a temporary one where the usual place is not writable.

    ``NUMBA_CACHE_DIR``, where it is set, is the parent; otherwise it is the user's cache folder.
    """
    parent = os.environ.get("NUMBA_CACHE_DIR") or user_cache_path("shadowbench", appauthor=False)
    folder = Path(parent) / f"kernels-{sources_digest()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        temporary = Path(tempfile.mkdtemp(prefix="shadowbench-kernels-"))
        atexit.register(shutil.rmtree, temporary, ignore_errors=True)
        return temporary


def set_threads(n_threads: int) -> None:
    """Let parallel kernels use `n_threads` threads, dealing their workers out one at a time.

    Raises
    ------
    ValueError
        If `n_threads` is not between 1 and the number of threads that Numba was started with.
    """
    numba.set_num_threads(n_threads)
    numba.set_parallel_chunksize(1)


def threading_layer() -> str | None:
    """Name of the threading layer that Numba chose, or None before the first parallel kernel ran."""
    try:
        return str(numba.threading_layer())
    except ValueError:
        return None


setattr(numba.config, "CACHE_DIR", str(cache_folder()))    # noqa: B010  numba.config has no type stubs

_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False}

kernel: Any = numba.njit(**_OPTIONS)
"""Decorator of a serial kernel."""

inlined_kernel: Any = numba.njit(inline="always", **_OPTIONS)
"""Decorator of a part of a serial kernel: its statements are copied into every caller. A call that passes a record
takes and drops a reference count per array of the record, which in an inner loop costs more than the work."""

parallel_kernel: Any = numba.njit(parallel=True, **_OPTIONS)
"""Decorator of a parallel kernel: one ``prange`` whose body calls one serial kernel."""


class CompileWatch(Listener):
    """Tells when Numba compiles (rather than loads from the cache), and how long that takes.

    Use as a context: ``with CompileWatch(lambda: print("compiling")) as watch``, then read ``watch.seconds``.

    Parameters
    ----------
    announce : called once, when the first compilation starts.
    """

    def __init__(self, announce: Callable[[], None]) -> None:
        self.seconds = 0.0
        self._announce = announce
        self._depth = 0

    def on_start(self, event: Event) -> None:
        """Note the start of a compilation; those nested in another are part of it."""
        if self._depth == 0:
            if self.seconds == 0.0:
                self._announce()
            self._start = time.perf_counter()
        self._depth += 1

    def on_end(self, event: Event) -> None:
        """Add up the time of an outermost compilation."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._start

    def __enter__(self) -> Self:
        register("numba:compile", self)
        return self

    def __exit__(self, *exception: object) -> None:
        unregister("numba:compile", self)
