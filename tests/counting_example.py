"""A kernel with an optional count, for the test of the two builds."""

from shadowbench.jit import kernel


@kernel
def count_evens(n, counts):
    evens = 0
    for i in range(n):
        if counts is not None:
            counts[0] += 1
        if i % 2 == 0:
            evens += 1
    return evens
