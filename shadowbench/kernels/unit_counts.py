"""Attribution of what single frusta and groups of them counted to the triangles."""

import numpy as np


def add_to_triangles(per_triangle, triangles, first, tests):
    """Add the tests of units to their triangles: those of a group are dealt out evenly, the rest to the first members.

    Parameters
    ----------
    per_triangle : int64 (n_triangles,), added to.
    triangles : int64 (n_frusta,), of the frusta; first : int64 (n_units + 1,), the frusta of each unit.
    tests : int64 (n_units,).
    """
    lengths = np.diff(first)
    member = np.arange(len(triangles)) - np.repeat(first[:-1], lengths)
    each, rest = np.divmod(tests, np.maximum(lengths, 1))
    np.add.at(per_triangle, triangles, np.repeat(each, lengths) + (member < np.repeat(rest, lengths)))


def sum_by_unit(unit, values, n_units):
    """Sum values of jobs by unit: int64 (n_units,)."""
    sums = np.zeros(n_units, np.int64)
    np.add.at(sums, unit, values)
    return sums
