"""Drawing shadow volumes into a stencil buffer: which samples a face covers, and whether it is behind them.

Coverage is the winding number of the face's border around the sample, found row by row: the border's edges that cross
the row each cut it at one column, found with the exact sign of orient2d, and a sample on an edge lies to its right.
Faces that close a volume share their edges bit for bit, so the winding numbers of a volume add up to the same
constant everywhere, whatever their shapes. A face that covers a sample is behind it if the sample and the eye lie
on the same side of the face's plane, and before it otherwise: no depth of the face is ever computed. In the row of a
sample, the plane's function is linear in the ray's column times the sample's depth, so a span is one short loop.

A face that is seen edge-on can cover samples by rounding alone, and its plane can't tell before from behind. There the
ray is cut with the face's borders, within its plane.

Rows are dealt to a constant number of bands. A band owns its rows and draws its faces in their order, so results are
the same for every number of threads. The stencil buffer holds unsigned integers that wrap around, as hardware does.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.orientation import orient2d
from shadowbench.kernels.shadow_volumes import N_WORKERS
from shadowbench.kernels.volume_faces import AT_INFINITY, BEHIND_PLANE, EDGE_ON_PLANE, Faces, first_at_or_after
from shadowbench.kernels.volume_polygons import MAX_CORNERS

N_BANDS = 64
_BAND_STRIDE = 27
"""Coprime to N_BANDS: neighbouring workers get bands far apart, so each thread sees all parts of the screen."""

CROSSING_ERROR = 32.0 * 2.0**-53
"""Bounds the rounding error of a crossing's position relative to its edge's ends: six roundings, with room to spare."""

BORDER_ERROR = 64.0 * 2.0**-53
"""A ray runs along a border of a face, within rounding, if eye and sample are both closer to it than this."""

Grid = NDArray[np.int64]


class StencilTarget(NamedTuple):
    """The samples and their stencil values.

    Attributes
    ----------
    depth : float64 (rows, columns), along the camera's forward axis; inf on background.
    stencil : uint8, uint16 or uint32 (rows, columns).
    """

    depth: NDArray[np.float64]
    stencil: NDArray[np.unsignedinteger]


class VolumeLimits(NamedTuple):
    """Where the volumes of each part of the scene can reach a sample; see `volume_limits`.

    Attributes
    ----------
    part : int32 (n_triangles,).
    rows, columns : int32 (n_parts, 2), first and last that are drawn: the scissor.
    depths : float64 (n_parts, 2), nearest and farthest sample that is drawn: the depth bounds.
    """

    part: NDArray[np.int32]
    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    depths: NDArray[np.float64]


class StencilCounts(NamedTuple):
    """Operation counts of stencil drawing, per sample and per triangle.

    Attributes
    ----------
    fragments : int64 (rows, columns), faces that cover the sample, each as often as it is drawn.
    depth_tests : int64 (rows, columns), fragments that the mask and the depth bounds let through.
    updates : int64 (rows, columns), depth tests that changed the stencil value.
    per_entry : int64 (n_entries,), stencil updates of each entry of the bands' lists.
    """

    fragments: Grid
    depth_tests: Grid
    updates: Grid
    per_entry: NDArray[np.int64]


class Bins(NamedTuple):
    """Faces per band.

    Attributes
    ----------
    offset : int64 (N_BANDS, N_WORKERS + 1), where the faces of each band and worker start.
    face : int64 (n_entries,), band by band, in increasing order within each.
    """

    offset: NDArray[np.int64]
    face: NDArray[np.int64]


class _Border(NamedTuple):
    """The edges of the face at work that cross rows, and where they cross the current one.

    Attributes
    ----------
    edge : float64 (9, 6), upper end x and down, lower end x and down, slope, error bound.
    turn : int64 (9,), +1 for an edge that runs downwards, -1 upwards.
    column : int64 (9,), first column at the right of each crossing, in increasing order.
    crossing_turn : int64 (9,), `turn` of each crossing.
    """

    edge: NDArray[np.float64]
    turn: NDArray[np.int64]
    column: NDArray[np.int64]
    crossing_turn: NDArray[np.int64]


@kernel
def _band_rows(n_rows):
    """Rows in each band."""
    return (n_rows + N_BANDS - 1) // N_BANDS


@kernel
def _face_rows(faces, face, limits):
    """First and last row of a face, within its scissor."""
    first, last = np.int64(faces.rows[face, 0]), np.int64(faces.rows[face, 1])
    if limits is not None:
        part = limits.part[faces.triangle[face]]
        first, last = max(first, np.int64(limits.rows[part, 0])), min(last, np.int64(limits.rows[part, 1]))
    return first, last


@kernel
def _count_chunk(worker, n_rows, faces, limits, counted):
    """Count one worker's faces per band."""
    band_rows = _band_rows(n_rows)
    for face in range(faces.first[worker], faces.end[worker]):
        first, last = _face_rows(faces, face, limits)
        if first <= last:
            for band in range(first // band_rows, last // band_rows + 1):
                counted[band, worker] += 1


@kernel
def _scatter_chunk(worker, n_rows, faces, limits, bins):
    """Write one worker's faces into the bands."""
    band_rows = _band_rows(n_rows)
    place = bins.offset[:, worker].copy()
    for face in range(faces.first[worker], faces.end[worker]):
        first, last = _face_rows(faces, face, limits)
        if first <= last:
            for band in range(first // band_rows, last // band_rows + 1):
                bins.face[place[band]] = face
                place[band] += 1


@parallel_kernel
def _count_all(n_rows, faces, limits, counted):
    for worker in prange(N_WORKERS):
        _count_chunk(np.int64(worker), n_rows, faces, limits, counted)


@parallel_kernel
def _scatter_all(n_rows, faces, limits, bins):
    for worker in prange(N_WORKERS):
        _scatter_chunk(np.int64(worker), n_rows, faces, limits, bins)


def bin_faces(n_rows: int, faces: Faces, limits: VolumeLimits | None) -> Bins:
    """Sort faces into bands by counting: count per worker and band, add up, scatter."""
    counted = np.zeros((N_BANDS, N_WORKERS), np.int64)
    _count_all(n_rows, faces, limits, counted)
    ends = np.cumsum(counted.ravel()).reshape(N_BANDS, N_WORKERS)
    offset = np.zeros((N_BANDS, N_WORKERS + 1), np.int64)
    offset[:, 1:] = ends
    offset[1:, 0] = ends[:-1, -1]
    bins = Bins(offset, np.empty(int(ends[-1, -1]), np.int64))
    _scatter_all(n_rows, faces, limits, bins)
    return bins


@kernel
def _set_up_border(faces, face, border):
    """Prepare the edges of a face; level ones cross no row. Return their number."""
    n = 0
    polygon, n_corners = faces.polygon[face], faces.n_corners[face]
    for i in range(n_corners):
        j = i + 1 if i + 1 < n_corners else 0
        if polygon[i, 1] != polygon[j, 1]:
            turn = 1 if polygon[i, 1] < polygon[j, 1] else -1
            upper, lower = (i, j) if turn > 0 else (j, i)
            edge = border.edge[n]
            edge[0], edge[1] = polygon[upper, 0], polygon[upper, 1]
            edge[2], edge[3] = polygon[lower, 0], polygon[lower, 1]
            edge[4] = (edge[2] - edge[0]) / (edge[3] - edge[1])
            edge[5] = CROSSING_ERROR * (abs(edge[0]) + abs(edge[2]))
            border.turn[n] = turn
            n += 1
    return n


@kernel
def _crossing_column(edge, view, down):
    """First column at or right of the point where an edge crosses a row: exact."""
    n = len(view.x)
    x = edge[0] + (down - edge[1]) * edge[4]
    column = first_at_or_after(view.x, view.columns_per_unit, x)
    # Far from both neighbouring samples the float64 crossing decides
    if ((column == n or view.x[column] > x + edge[5]) and (column == 0 or view.x[column - 1] < x - edge[5])):
        return column
    while column > 0 and orient2d(edge[0], edge[1], edge[2], edge[3], view.x[column - 1], down) <= 0:
        column -= 1
    while column < n and orient2d(edge[0], edge[1], edge[2], edge[3], view.x[column], down) > 0:
        column += 1
    return column


@kernel
def _cross_row(border, n_edges, view, down):
    """Find the columns where the edges cross a row, sorted. Return their number."""
    n = 0
    for i in range(n_edges):
        edge = border.edge[i]
        if edge[1] <= down < edge[3]:
            column = _crossing_column(edge, view, down)
            place = n
            while place > 0 and border.column[place - 1] > column:
                border.column[place] = border.column[place - 1]
                border.crossing_turn[place] = border.crossing_turn[place - 1]
                place -= 1
            border.column[place], border.crossing_turn[place] = column, border.turn[i]
            n += 1
    return n


@kernel
def _meets_before(borders, x, down, depth):
    """True if the ray of a sample meets a face that contains the ray, within its plane, no farther than the sample."""
    enter, leave = -np.inf, np.inf
    for i in range(4):
        at_eye = borders[i, 0]
        slope = borders[i, 3] + x * borders[i, 1] - down * borders[i, 2]
        change = depth * slope
        size = (abs(borders[i, 1]) + abs(borders[i, 2]) + abs(borders[i, 3])) * depth * (1.0 + abs(x) + abs(down))
        if change == 0.0 or (abs(at_eye) <= BORDER_ERROR * size and abs(change) <= BORDER_ERROR * size):
            continue
        t = -at_eye / change
        if change > 0.0:
            enter = max(enter, t)
        else:
            leave = min(leave, t)
    # Rounding may make the ray miss a corner that it passes through: take the point between its two borders
    if enter > leave:
        enter = 0.5 * (enter + leave)
    return enter <= 1.0


@kernel
def _is_behind(faces, face, x, down, depth):
    """True if a face that covers a sample lies behind it."""
    side = faces.eye_side[face]
    if side == AT_INFINITY:
        return depth < np.inf
    if side == EDGE_ON_PLANE:
        return not _meets_before(faces.borders[face], x, down, depth)
    plane = faces.plane[face]
    f = plane[0] + depth * ((plane[3] - down * plane[2]) + x * plane[1])
    return f <= 0.0 if side == BEHIND_PLANE else f > 0.0


@kernel
def _draw_checked(face, row, first, end, amount, view, faces, z_fail, target, mask, depths, counts, entry):
    """Draw a span sample by sample, with whatever the fast loop leaves out."""
    step = target.stencil.dtype.type(amount)
    for column in range(first, end):
        depth = target.depth[row, column]
        if counts is not None:
            counts.fragments[row, column] += abs(amount)
        if mask is not None and not mask[row, column]:
            continue
        if not depths[0] <= depth <= depths[1]:
            continue
        if counts is not None:
            counts.depth_tests[row, column] += abs(amount)
        if _is_behind(faces, face, view.x[column], view.down[row], depth) == z_fail:
            target.stencil[row, column] += step
            if counts is not None:
                counts.updates[row, column] += abs(amount)
                counts.per_entry[entry] += abs(amount)


@kernel
def _draw_fast(face, row, first, end, amount, view, faces, z_fail, target):
    """Draw a span of a face whose plane the eye is not in."""
    plane = faces.plane[face]
    value, across = plane[0], plane[1]
    along = plane[3] - view.down[row] * plane[2]
    step, nothing = target.stencil.dtype.type(amount), target.stencil.dtype.type(0)
    # Unsigned indices need no test for negative ones, which lets the loop become vector code
    if (faces.eye_side[face] == BEHIND_PLANE) == z_fail:
        for column in range(np.uint64(first), np.uint64(end)):
            f = value + target.depth[row, column] * (along + view.x[column] * across)
            target.stencil[row, column] += step if f <= 0.0 else nothing
    else:
        for column in range(np.uint64(first), np.uint64(end)):
            f = value + target.depth[row, column] * (along + view.x[column] * across)
            target.stencil[row, column] += step if f > 0.0 else nothing


@kernel
def _draw_face(face, first_row, last_row, view, faces, z_fail, target, limits, mask, border, counts, entry):
    """Draw the rows of a face that one band owns."""
    n_edges = _set_up_border(faces, face, border)
    left, right, depths = 0, len(view.x), (-np.inf, np.inf)
    if limits is not None:
        part = limits.part[faces.triangle[face]]
        left, right = np.int64(limits.columns[part, 0]), np.int64(limits.columns[part, 1]) + 1
        depths = (limits.depths[part, 0], limits.depths[part, 1])
    side = faces.eye_side[face]
    fast = side != EDGE_ON_PLANE and side != AT_INFINITY and limits is None and mask is None and counts is None
    sign = -faces.multiplicity[face] if z_fail else faces.multiplicity[face]
    for row in range(first_row, last_row + 1):
        n_crossings = _cross_row(border, n_edges, view, view.down[row])
        winding = 0
        for i in range(n_crossings - 1):
            winding += border.crossing_turn[i]
            first, end = max(left, border.column[i]), min(right, border.column[i + 1])
            if winding != 0 and first < end:
                if fast:
                    _draw_fast(face, row, first, end, sign * winding, view, faces, z_fail, target)
                else:
                    _draw_checked(face, row, first, end, sign * winding, view, faces, z_fail, target, mask, depths,
                                  counts, entry)


@kernel
def _draw_band(band, view, faces, bins, z_fail, target, limits, mask, counts):
    """Draw all faces of one band."""
    n_rows = _band_rows(len(view.down))
    first_row = band * n_rows
    last_row = min(first_row + n_rows, len(view.down)) - 1
    border = _Border(np.empty((MAX_CORNERS, 6)), np.empty(MAX_CORNERS, np.int64), np.empty(MAX_CORNERS, np.int64),
                     np.empty(MAX_CORNERS, np.int64))
    for entry in range(bins.offset[band, 0], bins.offset[band, N_WORKERS]):
        face = bins.face[entry]
        first, last = _face_rows(faces, face, limits)
        _draw_face(face, max(first, first_row), min(last, last_row), view, faces, z_fail, target, limits, mask, border,
                   counts, entry)


@parallel_kernel
def draw_faces(view, faces, bins, z_fail, target, limits, mask, counts):
    """Draw faces into a stencil buffer.

    Parameters
    ----------
    view : VolumeView.
    faces : Faces.
    bins : Bins of the faces.
    z_fail : True to count faces behind the samples, False to count those before them.
    target : StencilTarget, updated in place.
    limits : VolumeLimits or None: scissor and depth bounds.
    mask : bool (rows, columns) or None: the samples on which volumes are drawn (Chan and Durand 2004, sec. 3).
    counts : StencilCounts or None.
    """
    for worker in prange(N_BANDS):
        _draw_band((worker * _BAND_STRIDE) % N_BANDS, view, faces, bins, z_fail, target, limits, mask, counts)
