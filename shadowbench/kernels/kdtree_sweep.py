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
def _sweep(events, n_pieces, low, high, across, around):
    """Find the cheapest plane of one axis.

    Returns
    -------
    cost, position, planar_left : the latter True if pieces that lie flat in the plane go left; cost is inf if no
    plane cuts anything off.
    """
    best, best_position, best_planar_left = math.inf, 0, False
    n_left, n_right, i, n_events = 0, n_pieces, 0, len(events)
    while i < n_events:
        position = events[i] >> 32
        # Count the events at this position by their kind
        n_ends = n_planar = n_starts = 0
        while i < n_events and events[i] >> 32 == position:
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
def find_split(n_pieces, box, events_x, events_y, events_z):
    """Find the cheapest splitting plane of a node.

    Parameters
    ----------
    n_pieces : pieces in the node.
    box : int64 (6,), smallest x, y, z, then largest, in grid units.
    events_x, events_y, events_z : int64 (n_events,), sorted.

    Returns
    -------
    axis, position, planar_left : axis is -1 if no split is cheaper than a leaf.
    """
    x, y, z = float(box[3] - box[0]), float(box[4] - box[1]), float(box[5] - box[2])
    area = x * y + y * z + z * x
    axis, position, planar_left = -1, 0, False
    best = (n_pieces * INTERSECTION_COST - TRAVERSAL_COST) / INTERSECTION_COST * area
    if n_pieces == 0 or area == 0.0:
        return axis, position, planar_left
    if x > 0.0:
        cost, here, planar = _sweep(events_x, n_pieces, box[0], box[3], y * z, y + z)
        if cost < best:
            best, axis, position, planar_left = cost, 0, here, planar
    if y > 0.0:
        cost, here, planar = _sweep(events_y, n_pieces, box[1], box[4], x * z, x + z)
        if cost < best:
            best, axis, position, planar_left = cost, 1, here, planar
    if z > 0.0:
        cost, here, planar = _sweep(events_z, n_pieces, box[2], box[5], x * y, x + y)
        if cost < best:
            axis, position, planar_left = 2, here, planar
    return axis, position, planar_left
