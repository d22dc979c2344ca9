"""Construction of a kd-tree over triangles with the surface area heuristic, in O(n log n).

Method: Wald and Havran, "On building fast kd-Trees for Ray Tracing, and on doing that in O(N log N)" (2006), sec.
4.3. Each piece of a triangle has, on each axis, an event where it starts and one where it ends (or a single one if it
is flat there). Events are sorted once; a split sifts a node's sorted events into those of its children. Pieces that
straddle the splitting plane are clipped to both children ("perfect splits"), and only their events are sorted anew.

**Grid.** Positions are whole numbers of grid units (see `kdtree_clip`). So a split is exact in float32, an event is one
int64 that sorts by position, kind and piece, and the tree does not depend on rounding.

**Nodes** take 8 bytes: an inner node holds its splitting plane, axis and second child (the first one follows it
directly), a leaf the place and the number of its entries in the list of references.

**Invariant.** Every point of every triangle lies within `CLIP_MARGIN` of a leaf that refers to the triangle.
"""

import math
from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel
from shadowbench.kernels.kdtree_clip import GRID, MAX_CORNERS, clipped_bounds
from shadowbench.kernels.kdtree_events import add_events, find_sides, room, split_axis
from shadowbench.kernels.kdtree_sweep import (
    EMPTY_BONUS,
    END,
    INTERSECTION_COST,
    PIECE_BITS,
    PIECE_MASK,
    PLANAR,
    START,
    TASK_BOX,
    TASK_DEPTH,
    TASK_N_PIECES,
    TASK_PARENT,
    TRAVERSAL_COST,
    event,
    find_split,
)

__all__ = ["EMPTY_BONUS", "INTERSECTION_COST", "LEAF", "MAX_DEPTH", "TRAVERSAL_COST", "KdTree", "build_kdtree"]

MAX_DEPTH = 60
"""Levels below the root: traversal keeps a bit per level in an int64."""

LEAF = 3
"""Value of the two axis bits that marks a leaf."""



class KdTree(NamedTuple):
    """A kd-tree; see the module's description.

    Attributes
    ----------
    base : float64 (3,), world position of the grid's origin.
    scale : grid units per world unit, a power of two.
    high : float64 (3,), largest corner of the root's cell in grid units; the smallest is zero.
    nodes : int32 (2 n_nodes,), per node: the splitting plane (bits of a float32) and ``axis + 4 second_child``, or
        the first reference and ``LEAF + 4 n_references``.
    planes : float32 (2 n_nodes,), the same memory.
    references : int32 (n_references,), triangles, leaf by leaf.
    """

    base: np.ndarray
    scale: float
    high: np.ndarray
    nodes: np.ndarray
    planes: np.ndarray
    references: np.ndarray


class _Work(NamedTuple):
    """Scratch of the build that does not grow: two polygons, two boxes, bounds."""

    polygon: np.ndarray
    clipped: np.ndarray
    left_box: np.ndarray
    right_box: np.ndarray
    bounds: np.ndarray


def build_kdtree(corners):
    """Build the kd-tree of a mesh.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world, finite.
    """
    n = len(corners)
    points = corners.reshape(-1, 3)
    base = points.min(axis=0) if n else np.zeros(3)
    extent = float((points.max(axis=0) - base).max()) if n else 0.0
    # The power of two that brings the extent below the grid's size
    scale = math.ldexp(float(GRID), -math.frexp(extent)[1]) if extent > 0.0 else 1.0
    grid_corners = (corners - base) * scale
    low = np.floor(grid_corners.min(axis=1, initial=GRID)).astype(np.int64)
    high = np.ceil(grid_corners.max(axis=1, initial=0.0)).astype(np.int64)
    events = [_sorted_events(low[:, axis], high[:, axis]) for axis in range(3)]
    top = high.max(axis=0, initial=0)
    nodes, n_nodes, references, n_references = _build(grid_corners, top, (events[0], events[1], events[2]))
    nodes, references = nodes[:2 * n_nodes].copy(), references[:n_references].copy()
    return KdTree(base, scale, top.astype(np.float64), nodes, nodes.view(np.float32), references)


def _sorted_events(low, high):
    """All events of one axis, int64, sorted."""
    piece, packed = np.arange(len(low)), event.py_func
    flat = low == high
    return np.sort(np.concatenate([packed(low[flat], PLANAR, piece[flat]), packed(low[~flat], START, piece[~flat]),
                                   packed(high[~flat], END, piece[~flat])]))


@kernel
def _clip_straddling(corners, straddling, n_both, triangle, n_pieces, work, new_left, new_right, n_new):
    """Clip the pieces on both sides of a split to both children, and make their events.

    The part on the left keeps the piece's number, the part on the right becomes a new piece.

    Returns
    -------
    The number of pieces, and how many of them are new on the left and on the right.
    """
    n_left = n_right = 0
    for axis in range(3):
        n_new[0, axis] = n_new[1, axis] = 0
    for i in range(n_both):
        piece = straddling[i]
        t = triangle[piece]
        if clipped_bounds(corners, t, work.left_box, work.polygon, work.clipped, work.bounds):
            add_events(new_left, n_new[0], work.bounds, piece)
            n_left += 1
        if clipped_bounds(corners, t, work.right_box, work.polygon, work.clipped, work.bounds):
            triangle[n_pieces] = t
            add_events(new_right, n_new[1], work.bounds, n_pieces)
            n_pieces += 1
            n_right += 1
    return n_pieces, n_left, n_right


@kernel
def _push(stack, place, span, box, depth, parent, n_pieces):
    """Note a node that is to be built: its events, cell, level, parent (if it is a second child) and pieces."""
    for axis in range(3):
        stack[place, 2 * axis], stack[place, 2 * axis + 1] = span[axis]
        stack[place, TASK_BOX + axis], stack[place, TASK_BOX + 3 + axis] = box[axis], box[3 + axis]
    stack[place, TASK_DEPTH], stack[place, TASK_PARENT], stack[place, TASK_N_PIECES] = depth, parent, n_pieces


@allocating_kernel
def _build(corners, top, events):
    """Build all nodes, depth first, from the sorted events of each axis; returns nodes, references and their numbers."""
    n_pieces = len(corners)
    work = _Work(np.empty((MAX_CORNERS + 1, 3)), np.empty((MAX_CORNERS + 1, 3)), np.empty(6, np.int64),
                 np.empty(6, np.int64), np.empty(6, np.int64))
    nodes, references = np.empty(8 * n_pieces + 2, np.int32), np.empty(4 * n_pieces + 1, np.int32)
    n_nodes = n_references = 0
    # Pieces: their triangle, and their side at the present split
    triangle, side = np.arange(4 * n_pieces + 1).astype(np.int32), np.empty(4 * n_pieces + 1, np.int8)
    stack, n_new = np.empty((MAX_DEPTH + 2, TASK_N_PIECES + 1), np.int64), np.zeros((2, 3), np.int64)
    task, box = np.empty(TASK_N_PIECES + 1, np.int64), np.zeros(6, np.int64)
    left, right = np.empty(1, np.int64), np.empty(1, np.int64)
    for k in range(3):
        box[3 + k] = top[k]
    _push(stack, 0, ((0, len(events[0])), (0, len(events[1])), (0, len(events[2]))), box, 0, -1, n_pieces)
    n_stack = 1
    while n_stack > 0:
        n_stack -= 1
        for k in range(len(task)):
            task[k] = stack[n_stack, k]
        n_here = task[TASK_N_PIECES]
        if task[TASK_PARENT] >= 0:
            nodes[2 * task[TASK_PARENT] + 1] |= n_nodes << 2
        nodes, node, n_nodes = room(nodes, 2 * n_nodes, 2), n_nodes, n_nodes + 1
        axis, position, planar_left = -1, 0, False
        if task[TASK_DEPTH] < MAX_DEPTH:
            axis, position, planar_left = find_split(task, events)
        if axis < 0:
            nodes[2 * node], nodes[2 * node + 1] = n_references, LEAF + 4 * n_here
            references = room(references, n_references, n_here)
            for i in range(task[0], task[1]):
                if (events[0][i] >> PIECE_BITS) & 3 != END:
                    references[n_references] = triangle[events[0][i] & PIECE_MASK]
                    n_references += 1
            continue
        nodes.view(np.float32)[2 * node], nodes[2 * node + 1] = position, axis
        # Sort out the pieces and clip those on both sides
        straddling = np.empty(n_here, np.int64)
        n_left, n_right, n_both = find_sides(events[axis], task[2 * axis], task[2 * axis + 1], position, planar_left, side,
                                              straddling)
        for k in range(6):
            work.left_box[k] = work.right_box[k] = task[TASK_BOX + k]
        work.left_box[3 + axis], work.right_box[axis] = position, position
        new_left, new_right = np.empty((3, 2 * n_both), np.int64), np.empty((3, 2 * n_both), np.int64)
        triangle, side = room(triangle, n_pieces, n_both), room(side, n_pieces, n_both)
        n_pieces, more_left, more_right = _clip_straddling(corners, straddling, n_both, triangle, n_pieces, work, new_left,
                                                           new_right, n_new)
        n_most = max(task[1] - task[0], task[3] - task[2], task[5] - task[4]) + 2 * n_both
        left, right = room(left, 0, n_most), room(right, 0, n_most)
        x, x1, x2 = split_axis(events[0], task[0], task[1], side, new_left[0], new_right[0], n_new[:, 0], left, right)
        y, y1, y2 = split_axis(events[1], task[2], task[3], side, new_left[1], new_right[1], n_new[:, 1], left, right)
        z, z1, z2 = split_axis(events[2], task[4], task[5], side, new_left[2], new_right[2], n_new[:, 2], left, right)
        events = (x, y, z)
        # The second child waits below the first one
        _push(stack, n_stack, ((task[0], x1), (task[2], y1), (task[4], z1)), work.right_box, task[TASK_DEPTH] + 1, node,
              n_right + more_right)
        _push(stack, n_stack + 1, ((x1, x2), (y1, y2), (z1, z2)), work.left_box, task[TASK_DEPTH] + 1, -1,
              n_left + more_left)
        n_stack += 2
    return nodes, n_nodes, references, n_references
