"""The choice of a kd-tree node's splitting plane: a sweep over the sorted events of each axis.

Costs follow the surface area heuristic (MacDonald and Booth 1990): a child costs its number of pieces times the
chance that a ray through the node passes through it, the ratio of their surface areas.
"""

import math

from shadowbench.jit import kernel

TRAVERSAL_COST, INTERSECTION_COST = 1.5, 1.0
"""Relative cost of a step down the tree and of a ray-triangle test: the ratio that gives the shortest frame times."""

EMPTY_BONUS = 0.8
"""Factor on the cost of a split that cuts off empty space (Wald and Havran 2006, sec. 4.1)."""

END, PLANAR, START = 0, 1, 2
"""Kinds of events, in the order in which they are taken at the same position."""

PIECE_BITS = 30
PIECE_MASK = (1 << PIECE_BITS) - 1


TASK_BOX, TASK_DEPTH, TASK_PARENT, TASK_N_PIECES = 6, 12, 13, 14
"""Columns of the stack of nodes to build. The first six hold the first event of each axis and the one after the last;
the box is smallest x, y, z, then largest; the parent is that of a second child, else -1."""


@kernel
def event(position, kind, piece):
    """Pack an event into an int64 that sorts by position, kind and piece."""
    return (position << 32) | (kind << PIECE_BITS) | piece


@kernel
def _split_cost(below, above, across, around, n_left, n_right):
    """Cost of a split, less the traversal step, in pieces times area.

    Parameters
    ----------
    below, above : thickness of the children.
    across, around : area and half the perimeter of the cut.
    """
    cost = (across + around * below) * n_left + (across + around * above) * n_right
    empty = (n_left == 0 and below > 0.0) or (n_right == 0 and above > 0.0)
    return cost * EMPTY_BONUS if empty else cost


@kernel
def _sweep(events, first, end, n_pieces, low, high, across, around):
    """Find the cheapest plane of one axis.

    Returns
    -------
    cost, position, planar_left : the latter True if pieces that lie flat in the plane go left; cost is inf if no
    plane cuts anything off.
    """
    best, best_position, best_planar_left = math.inf, 0, False
    n_left, n_right, i = 0, n_pieces, first
    while i < end:
        position = events[i] >> 32
        # Count the events at this position by their kind
        n_ends = n_planar = n_starts = 0
        while i < end and events[i] >> 32 == position:
            kind = (events[i] >> PIECE_BITS) & 3
            n_ends += kind == END
            n_planar += kind == PLANAR
            n_starts += kind == START
            i += 1
        n_right -= n_planar + n_ends
        below, above = float(position - low), float(high - position)
        # A plane on the node's own face cuts off the flat pieces in it, or nothing
        if n_planar > 0 or (below > 0.0 and above > 0.0):
            left = _split_cost(below, above, across, around, n_left + n_planar, n_right)
            right = _split_cost(below, above, across, around, n_left, n_right + n_planar)
            cost, planar_left = min(left, right), left <= right
            if below == 0.0 or above == 0.0:
                cost, planar_left = (left, True) if below == 0.0 else (right, False)
            if cost < best:
                best, best_position, best_planar_left = cost, position, planar_left
        n_left += n_planar + n_starts
    return best, best_position, best_planar_left


@kernel
def find_split(task, events):
    """Find the cheapest splitting plane of a node.

    Parameters
    ----------
    task : int64, row of the stack of nodes to build (see `TASK_BOX`).
    events : three arrays, int64, sorted within the node.

    Returns
    -------
    axis, position, planar_left : axis is -1 if no split is cheaper than a leaf.
    """
    n_pieces, x0, y0, z0 = task[TASK_N_PIECES], task[TASK_BOX], task[TASK_BOX + 1], task[TASK_BOX + 2]
    size = (float(task[TASK_BOX + 3] - x0), float(task[TASK_BOX + 4] - y0), float(task[TASK_BOX + 5] - z0))
    x, y, z = size
    area = x * y + y * z + z * x
    axis, position, planar_left = -1, 0, False
    best = (n_pieces * INTERSECTION_COST - TRAVERSAL_COST) / INTERSECTION_COST * area
    if n_pieces == 0 or area == 0.0:
        return axis, position, planar_left
    for k in range(3):
        if size[k] > 0.0:
            one, other = size[(k + 1) % 3], size[(k + 2) % 3]
            cost, here, planar = _sweep(events[k], task[2 * k], task[2 * k + 1], n_pieces, task[TASK_BOX + k],
                                        task[TASK_BOX + 3 + k], one * other, one + other)
            if cost < best:
                best, axis, position, planar_left = cost, k, here, planar
    return axis, position, planar_left
