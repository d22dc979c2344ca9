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

from shadowbench.jit import kernel
from shadowbench.kernels.kdtree_clip import GRID, MAX_CORNERS, clipped_bounds
from shadowbench.kernels.kdtree_sweep import (
    EMPTY_BONUS,
    END,
    INTERSECTION_COST,
    PIECE_BITS,
    PIECE_MASK,
    PLANAR,
    START,
    TRAVERSAL_COST,
    event,
    find_split,
)

__all__ = ["EMPTY_BONUS", "INTERSECTION_COST", "LEAF", "MAX_DEPTH", "TRAVERSAL_COST", "KdTree", "build_kdtree"]

MAX_DEPTH = 60
"""Levels below the root: traversal keeps a bit per level in an int64."""

LEAF = 3
"""Value of the two axis bits that marks a leaf."""

_LEFT, _RIGHT, _BOTH = 0, 1, 2


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
    nodes, references = _build(grid_corners, top, events[0], events[1], events[2])
    return KdTree(base, scale, top.astype(np.float64), nodes, nodes.view(np.float32), references)


def _sorted_events(low, high):
    """All events of one axis, int64, sorted."""
    piece, packed = np.arange(len(low)), event.py_func
    flat = low == high
    return np.sort(np.concatenate([packed(low[flat], PLANAR, piece[flat]), packed(low[~flat], START, piece[~flat]),
                                   packed(high[~flat], END, piece[~flat])]))


@kernel
def _room(array, n_used, n_more):
    """Return the array, or a copy with room for more values."""
    if n_used + n_more <= len(array):
        return array
    larger = np.empty(2 * (n_used + n_more), array.dtype)
    larger[:n_used] = array[:n_used]
    return larger


@kernel
def _find_sides(events, first, end, position, planar_left, side, straddling):
    """Mark the side of every piece of a node; list those on both. Returns how many are left, right and both."""
    n_left = n_right = n_both = 0
    for i in range(first, end):
        key = events[i]
        piece, kind, here = key & PIECE_MASK, (key >> PIECE_BITS) & 3, key >> 32
        if kind == START:
            # A piece that ends at or before the plane is found at its end
            side[piece] = _RIGHT if here >= position else _BOTH
            n_right += here >= position
        elif kind == END:
            if here <= position:
                side[piece] = _LEFT
                n_left += 1
            elif side[piece] == _BOTH:
                straddling[n_both] = piece
                n_both += 1
        elif here < position or (here == position and planar_left):
            side[piece] = _LEFT
            n_left += 1
        else:
            side[piece] = _RIGHT
            n_right += 1
    return n_left, n_right, n_both


@kernel
def _add_events(new, n_new, bounds, piece):
    """Append the events of a clipped piece on each axis; `new` is int64 (3, room), `n_new` int64 (3,)."""
    for axis in range(3):
        low, high, n = bounds[axis], bounds[3 + axis], n_new[axis]
        if low == high:
            new[axis, n] = event(low, PLANAR, piece)
            n_new[axis] = n + 1
        else:
            new[axis, n] = event(low, START, piece)
            new[axis, n + 1] = event(high, END, piece)
            n_new[axis] = n + 2


@kernel
def _sift(events, first, end, wanted, side, new, n_new, out):
    """Merge a node's events of one side with sorted new ones; returns how many there are."""
    n_out = k = 0
    for i in range(first, end):
        key = events[i]
        if side[key & PIECE_MASK] == wanted:
            while k < n_new and new[k] < key:
                out[n_out] = new[k]
                n_out += 1
                k += 1
            out[n_out] = key
            n_out += 1
    while k < n_new:
        out[n_out] = new[k]
        n_out += 1
        k += 1
    return n_out


@kernel
def _split_axis(events, first, end, side, new_left, n_new_left, new_right, n_new_right, scratch):
    """Replace a node's events at the top of one axis' stack by those of its right child, then those of its left one.

    Returns
    -------
    The stack, which may have grown, and the first event and the one after the last of the left child.
    """
    events = _room(events, end, n_new_left + n_new_right)
    new_left[:n_new_left].sort()
    new_right[:n_new_right].sort()
    n_left = _sift(events, first, end, _LEFT, side, new_left, n_new_left, scratch[0])
    n_right = _sift(events, first, end, _RIGHT, side, new_right, n_new_right, scratch[1])
    events[first:first + n_right] = scratch[1, :n_right]
    events[first + n_right:first + n_right + n_left] = scratch[0, :n_left]
    return events, first + n_right, first + n_right + n_left


@kernel
def _build(corners, top, events_x, events_y, events_z):
    """Build all nodes, depth first; returns nodes and references."""
    n_triangles = len(corners)
    work = _Work(np.empty((MAX_CORNERS + 1, 3)), np.empty((MAX_CORNERS + 1, 3)), np.empty(6, np.int64),
                 np.empty(6, np.int64), np.empty(6, np.int64))
    nodes, references = np.empty(8 * n_triangles + 2, np.int32), np.empty(4 * n_triangles + 1, np.int32)
    planes = nodes.view(np.float32)
    n_nodes = n_references = 0
    # Pieces: their triangle, and their side at the present split
    triangle, n_pieces = np.arange(4 * n_triangles + 1).astype(np.int32), n_triangles
    side = np.empty(len(triangle), np.int8)
    # Nodes to build: first and end of their events on each axis, box, depth, parent whose second child they are
    stack = np.empty((MAX_DEPTH + 2, 14), np.int64)
    box = np.empty(6, np.int64)
    for axis in range(3):
        stack[0, 6 + axis], stack[0, 9 + axis] = 0, top[axis]
        stack[0, 2 * axis] = 0
    stack[0, 1], stack[0, 3], stack[0, 5] = len(events_x), len(events_y), len(events_z)
    stack[0, 12], stack[0, 13] = 0, -1
    n_stack = 1
    while n_stack > 0:
        n_stack -= 1
        x0, x1, y0, y1, z0, z1 = stack[n_stack, :6]
        box[:] = stack[n_stack, 6:12]
        depth, parent = stack[n_stack, 12], stack[n_stack, 13]
        nodes = _room(nodes, 2 * n_nodes, 2)
        planes = nodes.view(np.float32)
        if parent >= 0:
            nodes[2 * parent + 1] |= n_nodes << 2
        node, n_nodes = n_nodes, n_nodes + 1
        n_here = 0
        for i in range(x0, x1):
            n_here += (events_x[i] >> PIECE_BITS) & 3 != END
        axis, position, planar_left = -1, 0, False
        if depth < MAX_DEPTH:
            axis, position, planar_left = find_split(n_here, box, events_x[x0:x1], events_y[y0:y1], events_z[z0:z1])
        if axis < 0:
            nodes[2 * node], nodes[2 * node + 1] = n_references, LEAF + 4 * n_here
            references = _room(references, n_references, n_here)
            for i in range(x0, x1):
                if (events_x[i] >> PIECE_BITS) & 3 != END:
                    references[n_references] = triangle[events_x[i] & PIECE_MASK]
                    n_references += 1
            continue
        planes[2 * node], nodes[2 * node + 1] = position, axis
        # Sort out the pieces and clip those on both sides
        straddling = np.empty(n_here, np.int64)
        if axis == 0:
            _, _, n_both = _find_sides(events_x, x0, x1, position, planar_left, side, straddling)
        elif axis == 1:
            _, _, n_both = _find_sides(events_y, y0, y1, position, planar_left, side, straddling)
        else:
            _, _, n_both = _find_sides(events_z, z0, z1, position, planar_left, side, straddling)
        work.left_box[:], work.right_box[:] = box, box
        work.left_box[3 + axis], work.right_box[axis] = position, position
        new_left, new_right = np.empty((3, 2 * n_both), np.int64), np.empty((3, 2 * n_both), np.int64)
        n_new_left, n_new_right = np.zeros(3, np.int64), np.zeros(3, np.int64)
        triangle, side = _room(triangle, n_pieces, n_both), _room(side, n_pieces, n_both)
        for i in range(n_both):
            piece = straddling[i]
            t = triangle[piece]
            if clipped_bounds(corners, t, work.left_box, work.polygon, work.clipped, work.bounds):
                _add_events(new_left, n_new_left, work.bounds, piece)
            if clipped_bounds(corners, t, work.right_box, work.polygon, work.clipped, work.bounds):
                triangle[n_pieces] = t
                _add_events(new_right, n_new_right, work.bounds, n_pieces)
                n_pieces += 1
        scratch = np.empty((2, max(x1 - x0, y1 - y0, z1 - z0) + 2 * n_both), np.int64)
        events_x, x_middle, x_end = _split_axis(events_x, x0, x1, side, new_left[0], n_new_left[0], new_right[0],
                                                n_new_right[0], scratch)
        events_y, y_middle, y_end = _split_axis(events_y, y0, y1, side, new_left[1], n_new_left[1], new_right[1],
                                                n_new_right[1], scratch)
        events_z, z_middle, z_end = _split_axis(events_z, z0, z1, side, new_left[2], n_new_left[2], new_right[2],
                                                n_new_right[2], scratch)
        # The right child waits below the left one
        stack[n_stack, :6] = x0, x_middle, y0, y_middle, z0, z_middle
        stack[n_stack, 6:12] = work.right_box
        stack[n_stack, 12], stack[n_stack, 13] = depth + 1, node
        stack[n_stack + 1, :6] = x_middle, x_end, y_middle, y_end, z_middle, z_end
        stack[n_stack + 1, 6:12] = work.left_box
        stack[n_stack + 1, 12], stack[n_stack + 1, 13] = depth + 1, -1
        n_stack += 2
    return nodes[:2 * n_nodes].copy(), references[:n_references].copy()
