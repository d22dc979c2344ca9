"""Silhouette maps: one point of a silhouette edge in each cell of a depth map that such an edge crosses.

The cells lie between the depths: each has four of them at its corners. An edge leaves a point in every cell that it
crosses, so the points of one edge are 4-connected. Which point is the case analysis of Sen et al. (2003), Fig. 4: an
end of the edge if the cell holds one, else the crossing with a diagonal of the cell, or the middle of both crossings.
The cell is enlarged by `ENLARGEMENT` for that, so that an edge through a corner leaves points in all four cells there,
and the point is moved back into the cell. A point farther from the light than all four corners is hidden: it is not
kept.

Points are stored relative to the cell's centre, so an untouched map, all zero, has the default point everywhere. Edges
are drawn in the order given and the last one to write a cell wins. A worker owns some rows of cells.

Edges are cut where they leave the `GUARD` around the map: its ends then lie outside the map, so no cell takes such an end
for a vertex, and coordinates stay small enough for the arithmetic in a cell.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.projection import N_WORKERS, FloatArray, View, chunk

ENLARGEMENT = 2.0**-10
"""Cells by which a cell is enlarged on each side: far above the rounding error of a coordinate (some 2^-38 cells on the
largest maps), far below what can be seen."""

GUARD = 2.0
"""Edges are cut at so many times the map's half side."""

_X0, _Y0, _DEPTH0, _X1, _Y1, _DEPTH1 = range(6)


class Segments(NamedTuple):
    """Silhouette edges on one map.

    Attributes
    ----------
    ends : float64 (n_edges, 6): column, row and depth key of both ends, in cells; not a number for edges that are not on
        the map. The depth key is linear along the edge on the map: 1 / depth if `perspective`, else the depth.
    perspective : True if keys are 1 / depth.
    """

    ends: FloatArray
    perspective: bool


class PointCounts(NamedTuple):
    """Operation counts of drawing, int64 (n_workers,) each.

    Attributes
    ----------
    fragments : cells crossed by an edge.
    written : points that were kept.
    """

    fragments: NDArray[np.int64]
    written: NDArray[np.int64]


@kernel
def _cut(f0, f1, t_range):
    """Cut a range of an edge's parameter to where a function, linear along the edge, is not negative."""
    first, last = t_range
    if f0 < 0.0 and f1 < 0.0:
        return 1.0, 0.0
    if f0 < 0.0:
        first = max(first, f0 / (f0 - f1))
    elif f1 < 0.0:
        last = min(last, f0 / (f0 - f1))
    return first, last


@kernel
def _visible_part(view, a, b):
    """Range of an edge's parameter, between two points of view space, within the guard and beyond the near plane."""
    t_range = (0.0, 1.0)
    if view.perspective:
        t_range = _cut(a[2] - view.near, b[2] - view.near, t_range)
    reach_a, reach_b = (a[2], b[2]) if view.perspective else (1.0, 1.0)
    for axis in range(2):
        half = GUARD * abs(view.x_half if axis == 0 else view.y_half)
        t_range = _cut(half * reach_a - a[axis], half * reach_b - b[axis], t_range)
        t_range = _cut(half * reach_a + a[axis], half * reach_b + b[axis], t_range)
    return t_range


@kernel
def _to_view(view, point):
    """Transform a world-space point to view space: along right, along up, depth."""
    x, y, z = point[0] - view.eye[0], point[1] - view.eye[1], point[2] - view.eye[2]
    return (x * view.right[0] + y * view.right[1] + z * view.right[2],
            x * view.up[0] + y * view.up[1] + z * view.up[2],
            x * view.forward[0] + y * view.forward[1] + z * view.forward[2])


@kernel
def _project_chunk(worker, view, edge_ends, segments):
    """Project one worker's share of the edges."""
    first, end = chunk(worker, len(edge_ends))
    for i in range(first, end):
        a, b = _to_view(view, edge_ends[i, 0]), _to_view(view, edge_ends[i, 1])
        t_range = _visible_part(view, a, b)
        if not t_range[0] <= t_range[1]:
            segments.ends[i, :] = np.nan
            continue
        for k in range(2):
            t = t_range[k]
            x, y, depth = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
            if t == 1.0:
                x, y, depth = b
            scale = depth if view.perspective else 1.0
            if not scale > 0.0:
                segments.ends[i, :] = np.nan
                break
            # The first cell starts at the centre of the first texel
            segments.ends[i, 3 * k] = (1.0 + x / (scale * view.x_half)) * (0.5 * view.x_extent) - 0.5
            segments.ends[i, 3 * k + 1] = (1.0 + y / (scale * view.y_half)) * (0.5 * view.y_extent) - 0.5
            segments.ends[i, 3 * k + 2] = 1.0 / depth if view.perspective else depth


@parallel_kernel
def _project_all(view, edge_ends, segments):
    for worker in prange(N_WORKERS):
        _project_chunk(worker, view, edge_ends, segments)


def project_edges(view: View, edge_ends: FloatArray) -> Segments:
    """Project silhouette edges, float64 (n_edges, 2, 3) world, to the cells of a map."""
    segments = Segments(np.empty((len(edge_ends), 6)), view.perspective)
    _project_all(view, edge_ends, segments)
    return segments


@kernel
def _inside(x, y):
    """Tell whether a point lies in the enlarged cell."""
    return -ENLARGEMENT <= x <= 1.0 + ENLARGEMENT and -ENLARGEMENT <= y <= 1.0 + ENLARGEMENT


@kernel
def pick_point(x0, y0, x1, y1):
    """Pick the point of a segment that its cell stores: Sen et al. (2003), Fig. 4.

    Parameters
    ----------
    x0, y0, x1, y1 : the segment's ends, in cells, from the cell's upper left corner.

    Returns
    -------
    t, x, y : parameter along the segment and the point, which may lie `ENLARGEMENT` outside; t is negative if the
        segment misses the cell.
    """
    # (A) an end of the segment
    if _inside(x0, y0):
        return 0.0, x0, y0
    if _inside(x1, y1):
        return 1.0, x1, y1
    # Where the segment meets y = x and y = 1 - x: (B) one hit, (C) two, (D) none
    n_hits, t_sum = 0, 0.0
    for falling in range(2):
        f0, f1 = (y0 - x0, y1 - x1) if falling == 0 else (x0 + y0 - 1.0, x1 + y1 - 1.0)
        if (f0 <= 0.0 <= f1 or f1 <= 0.0 <= f0) and f0 != f1:
            t = f0 / (f0 - f1)
            if _inside(x0 + t * (x1 - x0), y0 + t * (y1 - y0)):
                n_hits += 1
                t_sum += t
    if n_hits == 0:
        return -1.0, 0.0, 0.0
    t = t_sum / n_hits
    return t, x0 + t * (x1 - x0), y0 + t * (y1 - y0)


@kernel
def _is_hidden(depth, row, column, limit):
    """Tell whether a depth lies behind all four corners of a cell."""
    return (depth[row, column] < limit and depth[row, column + 1] < limit and depth[row + 1, column] < limit
            and depth[row + 1, column + 1] < limit)


@kernel
def _draw_row(row, segment, perspective, depth, points, worker, counts):
    """Leave the points of one segment in the cells of one row."""
    x0, y0, key0, x1, y1, key1 = segment
    # The columns that the segment passes in the enlarged row
    low, high = min(x0, x1), max(x0, x1)
    if y0 != y1:
        t_above = min(max((row - 2.0 * ENLARGEMENT - y0) / (y1 - y0), 0.0), 1.0)
        t_below = min(max((row + 1.0 + 2.0 * ENLARGEMENT - y0) / (y1 - y0), 0.0), 1.0)
        x_above, x_below = x0 + t_above * (x1 - x0), x0 + t_below * (x1 - x0)
        low, high = max(low, min(x_above, x_below)), min(high, max(x_above, x_below))
    first = int(np.floor(max(low - 2.0 * ENLARGEMENT, 0.0)))
    last = int(np.floor(min(high + 2.0 * ENLARGEMENT, points.shape[1] - 1.0)))
    for column in range(first, last + 1):
        t, x, y = pick_point(x0 - column, y0 - row, x1 - column, y1 - row)
        if t < 0.0:
            continue
        if counts is not None:
            counts.fragments[worker] += 1
        key = key0 + t * (key1 - key0)
        if not _is_hidden(depth, row, column, 1.0 / key if perspective else key):
            points[row, column, 0] = np.float32(min(max(x, 0.0), 1.0) - 0.5)
            points[row, column, 1] = np.float32(min(max(y, 0.0), 1.0) - 0.5)
            if counts is not None:
                counts.written[worker] += 1


@kernel
def _draw_rows(worker, segments, depth, points, counts):
    """Draw all segments into one worker's rows, in order."""
    ends = segments.ends
    first_row, end_row = chunk(worker, len(points))
    for i in range(len(ends)):
        low, high = min(ends[i, _Y0], ends[i, _Y1]), max(ends[i, _Y0], ends[i, _Y1])
        if not (high >= first_row - ENLARGEMENT and low <= end_row + ENLARGEMENT):
            continue
        segment = (ends[i, _X0], ends[i, _Y0], ends[i, _DEPTH0], ends[i, _X1], ends[i, _Y1], ends[i, _DEPTH1])
        first = int(np.floor(max(low - 2.0 * ENLARGEMENT, float(first_row))))
        last = int(np.floor(min(high + 2.0 * ENLARGEMENT, end_row - 1.0)))
        for row in range(first, last + 1):
            _draw_row(row, segment, segments.perspective, depth, points, worker, counts)


@parallel_kernel
def _draw_all(segments, depth, points, counts):
    for worker in prange(N_WORKERS):
        _draw_rows(worker, segments, depth, points, counts)


def draw_silhouettes(view: View, edge_ends: FloatArray, depth: FloatArray,
                     points: NDArray[np.float32], counting: bool = False) -> tuple[int, int]:
    """Draw silhouette edges into the silhouette map of one view.

    Parameters
    ----------
    view : the map's view.
    edge_ends : float64 (n_edges, 2, 3), world, in the order of drawing.
    depth : float64 (side, side), depths of the texel centres.
    points : float32 (side - 1, side - 1, 2), updated in place: x to the right and y downwards from each cell's centre.
    counting : True to count.

    Returns
    -------
    n_fragments, n_written : cells crossed by an edge, and points kept; 0 unless `counting`.
    """
    segments = project_edges(view, edge_ends)
    if not counting:
        _draw_all(segments, depth, points, None)
        return 0, 0
    counts = PointCounts(np.zeros(N_WORKERS, np.int64), np.zeros(N_WORKERS, np.int64))
    _draw_all(segments, depth, points, counts)
    return int(counts.fragments.sum()), int(counts.written.sum())
