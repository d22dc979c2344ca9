"""Numba options and the compile cache: the only module that decides how kernels are compiled.

Three rules keep every count the same on every machine, for every thread count:

* No ``fastmath``, hence no reordered sums and no fused multiply-add: plain IEEE operations, in source order.
* A parallel kernel is nothing but a ``prange`` over workers whose body *only calls serial kernels*. Each worker
  owns a disjoint part of the output. Python threads share out the workers: Numba's own parallel loops take several
  times longer to compile, and mis-compile ``is not None`` tests inside them.
* The counting build and the timing build come from one source: a kernel takes a record of count arrays or the
  literal ``None``, and guards each count with ``if counts is not None``. Numba compiles the two types apart and
  removes the guarded code from the ``None`` build, so timed code carries no counting.

**Reference counts.** Numba counts a reference, with an atomic instruction, whenever a function takes an array or a record
of arrays as its argument, reads an array out of a record, or slices one. All threads count on the same few words, which
then travel between the processors' caches: two threads could be slower than one. Only a kernel that allocates arrays
needs the counts, so the two decorators keep those apart: `kernel` compiles without, and arrays that reach an
`allocating_kernel` through it belong, as far as Numba can tell, to nobody, which leaves nothing to count. The caller
holds them until the kernel returns. A `kernel` that allocates fails to compile ("Only accept returning of array passed").

A kernel's cache lives in a folder named by a digest of all sources that its module depends on and of the versions of
Numba, llvmlite and NumPy, because Numba itself notices only a change in the file of the kernel, not in the helpers
that it calls.
"""

import ast
import atexit
import copy
import functools
import hashlib
import inspect
import os
import shutil
import tempfile
import textwrap
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

from shadowbench import threads
from shadowbench.source_digest import source_digest

__all__ = ["CompileWatch", "allocating_kernel", "cache_folder", "kernel", "n_threads", "parallel_kernel", "prange",
           "set_threads"]


@functools.cache
def cache_folder() -> Path:
    """Create and return the folder for compiled kernels: a temporary one where the usual place is not writable.

    ``NUMBA_CACHE_DIR``, where it is set, is the parent; otherwise it is the user's cache folder.
    """
    parent = os.environ.get("NUMBA_CACHE_DIR") or user_cache_path("shadowbench", appauthor=False)
    versions = f"{numba.__version__} {llvmlite.__version__} {numpy.__version__}"
    folder = Path(parent) / f"kernels-{hashlib.sha256(versions.encode()).hexdigest()[:8]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        temporary = Path(tempfile.mkdtemp(prefix="shadowbench-kernels-"))
        atexit.register(shutil.rmtree, temporary, ignore_errors=True)
        return temporary


_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False, "nogil": True}


def kernel(function: Callable[..., Any]) -> Any:
    """Decorator of a serial kernel that allocates no arrays, and calls nothing that returns one it has allocated."""
    return _compiled(function, counts_references=False)


def allocating_kernel(function: Callable[..., Any]) -> Any:
    """Decorator of a serial kernel that allocates arrays."""
    return _compiled(function, counts_references=True)


def _compiled(function: Callable[..., Any], counts_references: bool) -> Any:
    folder = cache_folder() / source_digest(Path(function.__code__.co_filename))
    setattr(numba.config, "CACHE_DIR", str(folder))     # noqa: B010  numba.config has no type stubs
    options = {**_OPTIONS, "_nrt": counts_references}
    return numba.njit(**options)(function)


_PRELUDE = ast.parse("""\
_store_now(_announced, _GENERATION, _generation)
_piece = _fetch_add(_numbers, _NEXT, 1)
while _piece < _n_pieces:
    _run_piece()
    _fetch_add(_numbers, _DONE, 1)
    _piece = _fetch_add(_numbers, _NEXT, 1)
""").body
_PIECE = ast.parse("range(_piece * _n_workers // _n_pieces, (_piece + 1) * _n_workers // _n_pieces)", mode="eval").body
_SHARED = "_numbers", "_announced", "_generation", "_n_workers", "_n_pieces"
_NAMES = {"_store_now": threads.store_now, "_fetch_add": threads.fetch_add, "_GENERATION": threads.GENERATION,
          "_NEXT": threads.NEXT, "_DONE": threads.DONE}


class parallel_kernel:
    """Decorator of a parallel kernel: one ``prange`` over workers whose body only calls serial kernels.

    The function is compiled once, as a serial kernel that holds no lock and takes pieces, runs of workers, until none is
    left (see `shadowbench.threads`). Python threads run it side by side. So it takes no longer to compile than a serial
    kernel, and any number of threads will do.

    Raises
    ------
    TypeError
        If the function is anything else than that one loop.
    """

    def __init__(self, function: Callable[..., None]) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
        ast.increment_lineno(tree, function.__code__.co_firstlineno - 1)
        definition = tree.body[0]
        assert isinstance(definition, ast.FunctionDef)
        loop = definition.body[-1]
        if not (isinstance(loop, ast.For) and isinstance(loop.iter, ast.Call) and ast.unparse(loop.iter.func) == "prange"
                and all(isinstance(line, ast.Expr) and isinstance(line.value, ast.Call) for line in loop.body)
                and len(definition.body) - 1 <= _has_docstring(definition)):
            raise TypeError(f"{function.__name__}: a parallel kernel is one prange whose body calls serial kernels")
        # The number of workers, as a function of the arguments.
        count = ast.Expression(ast.Lambda(definition.args, loop.iter.args[0]))
        # The serial kernel: the loop over workers becomes one over the workers of a piece, within a loop over pieces.
        shared = [ast.arg(name) for name in _SHARED]
        definition.args = ast.arguments([], [*shared, *definition.args.args], None, [], [], None, [])
        definition.decorator_list = []
        loop.iter = _PIECE
        definition.body[-1:] = copy.deepcopy(_PRELUDE)
        pieces = definition.body[-1]
        assert isinstance(pieces, ast.While)
        pieces.body[0] = loop
        file, names = function.__code__.co_filename, function.__globals__
        names.update(_NAMES)
        made: dict[str, Any] = {}
        exec(compile(ast.fix_missing_locations(tree), file, "exec"), names, made)
        self._n_workers = eval(compile(ast.fix_missing_locations(count), file, "eval"), names)
        serial = made[function.__name__]
        serial.__qualname__, serial.__module__ = function.__qualname__, function.__module__
        self.serial = kernel(serial)

    def __call__(self, *arguments: Any) -> None:
        """Run all workers."""
        n_workers, n_threads = self._n_workers(*arguments), _threads[0]
        if n_threads == 1:
            threads.run_alone(self.serial, n_workers, arguments)
        else:
            _team(n_threads).run(self.serial, n_workers, min(n_workers, PIECES_PER_THREAD * n_threads), arguments)


def _has_docstring(definition: ast.FunctionDef) -> bool:
    return ast.get_docstring(definition) is not None


PIECES_PER_THREAD = 8
"""Runs of workers that each thread takes, about: enough to even out the load, few enough to cost no time."""

THREADING_LAYER = "Python threads over kernels that hold no lock"

_threads = [len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1]
_spin = kernel(threads.spin)


@functools.cache
def _team(n_threads: int) -> threads.Team:
    return threads.Team(n_threads, _spin)


os.register_at_fork(after_in_child=_team.cache_clear)       # a forked process has none of the threads


def n_threads() -> int:
    """Number of threads that parallel kernels use."""
    return _threads[0]


def set_threads(n_threads: int) -> None:
    """Let parallel kernels use `n_threads` threads. Results and counts do not depend on it.

    Raises
    ------
    ValueError
        If `n_threads` is below 1.
    """
    if n_threads < 1:
        raise ValueError(f"the number of threads must be 1 or more, not {n_threads}")
    _threads[0] = n_threads


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
