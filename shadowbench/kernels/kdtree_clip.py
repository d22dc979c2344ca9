"""Bounds of the part of a triangle that lies in a cell of a kd-tree ("perfect splits").

Coordinates are in units of the tree's grid: a cell's faces lie on whole numbers from 0 to `GRID`, triangles anywhere
between. Bounds are rounded outwards to whole numbers.
"""

import numpy as np

from shadowbench.jit import kernel

GRID = 2**24
"""Cells along each axis: the largest range of whole numbers that float32 holds exactly."""

CLIP_MARGIN = 0.25
"""How far cells are widened before a triangle is clipped to them, in grid units: far above the rounding of the
clipping (2^-26 units), so that a face that lies within rounding of a splitting plane is not lost on both sides."""

MAX_CORNERS = 9
"""Corners of a triangle that six planes have clipped."""


@kernel
def _clip_axis(polygon, n_corners, clipped, axis, limit, sign):
    """Keep the part of a polygon with ``sign * x[axis] <= sign * limit``; returns the number of corners."""
    n_kept = 0
    previous = n_corners - 1
    before = sign * (polygon[previous, axis] - limit)
    for i in range(n_corners):
        here = sign * (polygon[i, axis] - limit)
        if (here < 0.0 and before > 0.0) or (here > 0.0 and before < 0.0):
            s = before / (before - here)
            for k in range(3):
                clipped[n_kept, k] = polygon[previous, k] + (polygon[i, k] - polygon[previous, k]) * s
            clipped[n_kept, axis] = limit
            n_kept += 1
        if here <= 0.0:
            for k in range(3):
                clipped[n_kept, k] = polygon[i, k]
            n_kept += 1
        previous, before = i, here
    return n_kept


@kernel
def clipped_bounds(corners, t, box, polygon, clipped, bounds):
    """Find the bounds of a triangle's part in a cell.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), grid units.
    t : the triangle.
    box : int64 (6,), smallest x, y, z, then largest.
    polygon, clipped : float64 (MAX_CORNERS + 1, 3), scratch.
    bounds : int64 (6,), written like `box`, and within it.

    Returns
    -------
    True if a part of the triangle lies in the cell.
    """
    n_corners = 3
    for i in range(3):
        for k in range(3):
            polygon[i, k] = corners[t, i, k]
    for axis in range(3):
        low, high = box[axis] - CLIP_MARGIN, box[3 + axis] + CLIP_MARGIN
        smallest, largest = polygon[0, axis], polygon[0, axis]
        for i in range(1, n_corners):
            smallest, largest = min(smallest, polygon[i, axis]), max(largest, polygon[i, axis])
        if smallest > high or largest < low:
            return False
        # Most triangles stick out on one or two sides alone
        if smallest < low:
            n_corners = _clip_axis(polygon, n_corners, clipped, axis, low, -1.0)
            polygon, clipped = clipped, polygon
        if largest > high:
            n_corners = _clip_axis(polygon, n_corners, clipped, axis, high, 1.0)
            polygon, clipped = clipped, polygon
        if n_corners == 0:
            return False
    for axis in range(3):
        smallest, largest = polygon[0, axis], polygon[0, axis]
        for i in range(1, n_corners):
            smallest, largest = min(smallest, polygon[i, axis]), max(largest, polygon[i, axis])
        bounds[axis] = min(max(np.int64(np.floor(smallest)), box[axis]), box[3 + axis])
        bounds[3 + axis] = max(min(np.int64(np.ceil(largest)), box[3 + axis]), box[axis])
    return True
