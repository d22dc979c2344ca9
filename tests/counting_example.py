"""A kernel with an optional count, and a parallel kernel, for the tests of how they are compiled."""

from shadowbench.jit import kernel, parallel_kernel, prange


@kernel
def count_evens(n, counts):
    evens = 0
    for i in range(n):
        if counts is not None:
            counts[0] += 1
        if i % 2 == 0:
            evens += 1
    return evens


@kernel
def _visit(visits, worker):
    visits[worker] += 1


@parallel_kernel
def visit_all(visits):
    """Count a visit of each worker."""
    for worker in prange(len(visits)):
        _visit(visits, worker)
