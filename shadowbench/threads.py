"""A team of threads that share out the workers of parallel kernels, and wait for the next kernel awake.

A frame is a dozen kernels of a few milliseconds. Waking a sleeping thread takes about 0.3 ms on a virtual machine, for
every kernel anew, so a thread that has nothing left to do watches for the next kernel for a while before it sleeps (as
OpenMP's threads do), and the caller never waits for a thread that sleeps: who comes late finds nothing left to take.

Threads take *pieces*, runs of workers, by counting up one number with an atomic instruction, inside the compiled
kernel: none needs Python's global lock between two pieces. The lock is free when the others see the kernel begin,
because it is the compiled code that announces it.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

GENERATION, NEXT, DONE = 0, 8, 16
"""Where the numbers of a job or a team stand, a cache line apart: the generation's, the next piece, pieces done."""

SIZE = 24

SPINS = 4_000_000
"""Looks at a number before a thread sleeps: about 4 ms, longer than what lies between the kernels of a frame."""

_INT64 = ir.IntType(64)


def _place(context: Any, builder: ir.IRBuilder, array_type: Any, array: Any, index: Any) -> Any:
    return builder.gep(context.make_array(array_type)(context, builder, array).data, [index])


@intrinsic
def fetch_add(typing_context: Any, numbers: Any, index: Any, value: Any) -> Any:
    """Add to an element of an int64 array in one step; returns what it was before."""
    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        place = _place(context, builder, signature.args[0], args[0], args[1])
        return builder.atomic_rmw("add", place, args[2], "seq_cst")

    return types.int64(numbers, types.int64, types.int64), codegen


@intrinsic
def load_now(typing_context: Any, numbers: Any, index: Any) -> Any:
    """Read an element of an int64 array that other threads may write."""
    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        return builder.load_atomic(_place(context, builder, signature.args[0], *args), "acquire", 8)

    return types.int64(numbers, types.int64), codegen


@intrinsic
def store_now(typing_context: Any, numbers: Any, index: Any, value: Any) -> Any:
    """Write an element of an int64 array that other threads may read."""
    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, args: Any) -> Any:
        builder.store_atomic(args[2], _place(context, builder, signature.args[0], args[0], args[1]), "release", 8)
        return context.get_dummy_value()

    return types.void(numbers, types.int64, types.int64), codegen


def spin(numbers: Any, index: int, low: int, n_spins: int) -> bool:
    """Watch a number until it is `low` or more, or for `n_spins` looks; True if it is. `shadowbench.jit` compiles it."""
    for _ in range(n_spins):        # noqa: SIM110  compiled code has no generators
        if load_now(numbers, index) >= low:     # type: ignore[call-arg]
            return True
    return False


class Job:
    """One call of a parallel kernel: `run` takes pieces until none is left.

    Attributes
    ----------
    numbers : int64 (SIZE,), its counters.
    error : the first exception of a thread other than the caller's, or None.
    """

    def __init__(self, kernel: Callable[..., None], n_workers: int, n_pieces: int, announced: NDArray[np.int64],
                 generation: int, arguments: tuple[Any, ...]) -> None:
        self.numbers = np.zeros(SIZE, np.int64)
        self.n_pieces, self.generation = n_pieces, generation
        self.error: BaseException | None = None
        self._announced, self._kernel = announced, kernel
        self._rest: tuple[Any, ...] | None = (generation, n_workers, n_pieces, *arguments)

    def run(self) -> None:
        """Announce the job and take pieces until none is left, in the caller's thread."""
        assert self._rest is not None
        self._kernel(self.numbers, self._announced, *self._rest)

    def run_beside(self) -> None:
        """Take pieces in another thread, unless the job is over; an error is kept, and counts as everything done."""
        rest = self._rest
        try:
            if rest is not None:
                self._kernel(self.numbers, self.numbers, *rest)
        except BaseException as error:
            self.error = error
            self.numbers[DONE] += self.n_pieces

    def close(self) -> None:
        """Let go of the arguments."""
        self._rest = None


class Team:
    """The caller's thread and `n_threads` - 1 others.

    Parameters
    ----------
    spin : the compiled `spin`.
    """

    def __init__(self, n_threads: int, spin: Callable[..., bool]) -> None:
        self._spin, self._announced = spin, np.zeros(SIZE, np.int64)
        self._called, self._job = threading.Condition(), Job(lambda *_: None, 0, 0, self._announced, 0, ())
        self._busy, self._n_asleep = threading.Lock(), 0
        spin(self._announced, GENERATION, 0, 1)          # compiled before any thread needs it
        for number in range(1, n_threads):
            threading.Thread(target=self._serve, name=f"shadowbench-{number}", daemon=True).start()

    def run(self, kernel: Callable[..., None], n_workers: int, n_pieces: int, arguments: tuple[Any, ...]) -> None:
        """Run all workers of a kernel, in pieces; one call at a time, or else the calling thread runs them alone."""
        if n_pieces < 2 or not self._busy.acquire(blocking=False):
            run_alone(kernel, n_workers, arguments)
            return
        try:
            job = Job(kernel, n_workers, n_pieces, self._announced, self._job.generation + 1, arguments)
            with self._called:
                self._job = job
                if self._n_asleep:
                    self._called.notify_all()
            try:
                job.run()
                # Another thread may still be at its last piece
                while not self._spin(job.numbers, DONE, n_pieces, SPINS):
                    time.sleep(0)
            finally:
                job.close()
            if job.error is not None:
                raise job.error
        finally:
            self._busy.release()

    def _serve(self) -> None:
        """Run one job after the other; between them, watch for the next one, then sleep."""
        done = 0
        while True:
            self._spin(self._announced, GENERATION, done + 1, SPINS)
            with self._called:
                self._n_asleep += 1
                while self._job.generation == done:
                    self._called.wait()
                self._n_asleep -= 1
                job = self._job
            done = job.generation
            job.run_beside()


def run_alone(kernel: Callable[..., None], n_workers: int, arguments: tuple[Any, ...]) -> None:
    """Run all workers of a kernel in the calling thread, as one piece."""
    numbers = np.zeros(SIZE, np.int64)
    kernel(numbers, numbers, 0, n_workers, 1, *arguments)
