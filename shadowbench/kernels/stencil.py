"""Drawing shadow volumes into a stencil buffer: which samples a face covers, and whether it is behind them.

Coverage is the winding number of the face's border around the sample, found row by row: the border's edges that cross
the row each cut it at one column, found with the exact sign of orient2d, and a sample on an edge lies to its right.
Faces that close a volume share their edges bit for bit, so the winding numbers of a volume add up to the same
constant everywhere, whatever their shapes. A face that covers a sample is behind it if the sample and the eye lie
on the same side of the face's plane, and before it otherwise: no depth of the face is ever computed. In the row of a
sample, the plane's function is linear in the ray's column times the sample's depth, so a span is one short loop.

A face that is seen edge-on can cover samples by rounding alone, and its plane can't tell before from behind. There the
ray is cut with the face's borders, within its plane.

Stencil values are unsigned integers of 32 bits that wrap around. A narrower
buffer, wrapping too, would hold their lowest bits: increments and decrements are sums modulo a power of two.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.mask_runs import cut_spans, find_runs
from shadowbench.kernels.orientation import orient2d
from shadowbench.kernels.shadow_volumes import N_WORKERS
from shadowbench.kernels.volume_bins import BAND_STRIDE, N_BANDS, band_rows, face_rows
from shadowbench.kernels.volume_faces import AT_INFINITY, BEFORE_PLANE, BEHIND_PLANE, EDGE_ON_PLANE
from shadowbench.kernels.volume_polygons import MAX_CORNERS

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
    stencil : uint32 (rows, columns).
    """

    depth: NDArray[np.float64]
    stencil: NDArray[np.uint32]


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


_UPPER_X, _UPPER_DOWN, _LOWER_X, _LOWER_DOWN, _SLOPE, _ERROR, _TURN = range(7)
"""Columns of an edge of the face at work: its two ends, dx / dy, the error bound of its crossings, and +1 if the border
runs downwards there, -1 if upwards."""


@kernel
def _set_up_border(faces, face, edges):
    """Prepare the edges of a face; level ones cross no row. Return their number."""
    n = 0
    n_corners = faces.n_corners[face]
    for i in range(n_corners):
        j = i + 1 if i + 1 < n_corners else 0
        down_i, down_j = faces.polygon[face, i, 1], faces.polygon[face, j, 1]
        if down_i != down_j:
            upper, lower = (i, j) if down_i < down_j else (j, i)
            edges[n, _UPPER_X], edges[n, _LOWER_X] = faces.polygon[face, upper, 0], faces.polygon[face, lower, 0]
            edges[n, _UPPER_DOWN], edges[n, _LOWER_DOWN] = min(down_i, down_j), max(down_i, down_j)
            edges[n, _SLOPE] = ((edges[n, _LOWER_X] - edges[n, _UPPER_X])
                                / (edges[n, _LOWER_DOWN] - edges[n, _UPPER_DOWN]))
            edges[n, _ERROR] = CROSSING_ERROR * (abs(edges[n, _UPPER_X]) + abs(edges[n, _LOWER_X]))
            edges[n, _TURN] = 1.0 if down_i < down_j else -1.0
            n += 1
    return n


@kernel
def _exact_column(edges, i, columns, down, column):
    """Walk from a guess to the first column at or right of the point where an edge crosses a row."""
    ax, ay = edges[i, _UPPER_X], edges[i, _UPPER_DOWN]
    bx, by = edges[i, _LOWER_X], edges[i, _LOWER_DOWN]
    while column > 0 and orient2d(ax, ay, bx, by, columns[column - 1], down) <= 0:
        column -= 1
    while column < len(columns) and orient2d(ax, ay, bx, by, columns[column], down) > 0:
        column += 1
    return column


@kernel
def _find_spans(edges, n_edges, columns, per_unit, rows, row_range, column_range, crossings, spans):
    """List the runs of samples around which a border winds, row by row: exact. Return their number.

    Parameters
    ----------
    edges, n_edges : from `_set_up_border`.
    columns, per_unit, rows : the sample grid; see `VolumeView`.
    row_range, column_range : first and last row, first column and one past the last, to look at.
    crossings : int64 (9, 2), room for the crossings of a row: first column at or right of each, and its turn.
    spans : int64 (n, 4), receives row, first column, one past the last, winding number.
    """
    n_spans = 0
    n_columns = len(columns)
    for row in range(row_range[0], row_range[1] + 1):
        down = rows[row]
        n = 0
        for i in range(n_edges):
            if not edges[i, _UPPER_DOWN] <= down < edges[i, _LOWER_DOWN]:
                continue
            x = edges[i, _UPPER_X] + (down - edges[i, _UPPER_DOWN]) * edges[i, _SLOPE]
            column = int(min(max((x - columns[0]) * per_unit + 1.0, 0.0), float(n_columns)))
            # Far from both neighbouring samples the float64 crossing decides; otherwise the guess is walked from
            error = edges[i, _ERROR]
            if ((column < n_columns and not columns[column] > x + error)
                    or (column > 0 and not columns[column - 1] < x - error)):
                column = _exact_column(edges, i, columns, down, column)
            # Keep the crossings sorted by column
            place = n
            while place > 0 and crossings[place - 1, 0] > column:
                crossings[place, 0], crossings[place, 1] = crossings[place - 1, 0], crossings[place - 1, 1]
                place -= 1
            crossings[place, 0], crossings[place, 1] = column, int(edges[i, _TURN])
            n += 1
        winding = 0
        for i in range(n - 1):
            winding += crossings[i, 1]
            first, end = max(column_range[0], crossings[i, 0]), min(column_range[1], crossings[i + 1, 0])
            if winding != 0 and first < end:
                spans[n_spans, 0], spans[n_spans, 1], spans[n_spans, 2], spans[n_spans, 3] = row, first, end, winding
                n_spans += 1
    return n_spans


@kernel
def _meets_before(faces, face, x, down, depth):
    """True if the ray of a sample meets a face that contains the ray, within its plane, no farther than the sample."""
    enter, leave = -np.inf, np.inf
    for i in range(4):
        at_eye = faces.borders[face, i, 0]
        mx, my, mz = faces.borders[face, i, 1], faces.borders[face, i, 2], faces.borders[face, i, 3]
        change = depth * (mz + x * mx - down * my)
        noise = BORDER_ERROR * (abs(mx) + abs(my) + abs(mz)) * depth * (1.0 + abs(x) + abs(down))
        if change == 0.0 or (abs(at_eye) <= noise and abs(change) <= noise):
            continue
        if change > 0.0:
            enter = max(enter, -at_eye / change)
        else:
            leave = min(leave, -at_eye / change)
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
        return not _meets_before(faces, face, x, down, depth)
    slope = (faces.plane[face, 3] - down * faces.plane[face, 2]) + x * faces.plane[face, 1]
    f = faces.plane[face, 0] + depth * slope
    return f <= 0.0 if side == BEHIND_PLANE else f > 0.0


@kernel
def _draw_checked(face, spans, n_spans, sign, view, faces, z_fail, target, mask, depths, counts, entry):
    """Draw the spans of a face sample by sample, with whatever the fast loop leaves out."""
    for i in range(n_spans):
        row, amount = spans[i, 0], sign * spans[i, 3]
        for column in range(spans[i, 1], spans[i, 2]):
            depth = target.depth[row, column]
            if counts is not None:
                counts.fragments[row, column] += abs(amount)
            if not depths[0] <= depth <= depths[1] or (len(mask) > 0 and not mask[row, column]):
                continue
            if counts is not None:
                counts.depth_tests[row, column] += abs(amount)
            if _is_behind(faces, face, view.x[column], view.down[row], depth) == z_fail:
                target.stencil[row, column] += np.uint32(amount)
                if counts is not None:
                    counts.updates[row, column] += abs(amount)
                    counts.per_entry[entry] += abs(amount)


@kernel
def _count_span(row, first, end, size, where, line, columns, depth, fragments, depth_tests, updates):
    """Count what `_draw_fast` does in a span: `size` for each sample; returns the number of updates.

    `line` holds f at the eye, and the two numbers that give its slope along a row.
    """
    n_updates, value, along, across = 0, line[0], line[1], line[2]
    for column in range(first, end):
        f = value + depth[row, column] * (along + columns[column] * across)
        hit = f <= 0.0 if where == BEHIND_PLANE else f > 0.0
        changed = size if hit else 0
        fragments[row, column] += size
        depth_tests[row, column] += size
        updates[row, column] += changed
        n_updates += changed
    return n_updates


@kernel
def _draw_fast(spans, n_spans, sign, plane, where, columns, rows, depth, stencil, counts, entry):
    """Draw the spans of a face whose plane the eye is not in, where f <= 0 (BEHIND_PLANE) or f > 0."""
    nothing = np.uint32(0)
    across, upwards = plane[1], plane[2]
    for i in range(n_spans):
        row, amount = np.uint64(spans[i, 0]), np.uint32(sign * spans[i, 3])
        along = plane[3] - rows[row] * upwards
        # Unsigned indices need no test for negative ones, which lets the loops become vector code
        first, end = np.uint64(spans[i, 1]), np.uint64(spans[i, 2])
        if counts is not None:
            counts.per_entry[entry] += _count_span(row, first, end, abs(spans[i, 3] * sign), where,
                                                   (plane[0], along, across), columns, depth, counts.fragments,
                                                   counts.depth_tests, counts.updates)
        if where == BEHIND_PLANE:
            for column in range(first, end):
                f = plane[0] + depth[row, column] * (along + columns[column] * across)
                stencil[row, column] += amount if f <= 0.0 else nothing
        else:
            for column in range(first, end):
                f = plane[0] + depth[row, column] * (along + columns[column] * across)
                stencil[row, column] += amount if f > 0.0 else nothing


@kernel
def _draw_face(face, first_row, last_row, view, faces, z_fail, target, limits, mask, room, counts, entry):
    """Draw the rows of a face that one band owns."""
    edges, crossings, spans, masked = room
    part = limits.part[faces.triangle[face]]
    column_range = np.int64(limits.columns[part, 0]), np.int64(limits.columns[part, 1]) + 1
    n_spans = _find_spans(edges, _set_up_border(faces, face, edges), view.x, view.columns_per_unit, view.down,
                          (first_row, last_row), column_range, crossings, spans)
    if n_spans == 0:
        return
    if len(mask) > 0 and counts is None:
        # Cut the spans to the mask, and the mask is done with
        n_spans = cut_spans(spans, n_spans, masked)
        spans, mask = masked.pieces, mask[:0]
    side, sign = faces.eye_side[face], np.int64(-faces.multiplicity[face] if z_fail else faces.multiplicity[face])
    depths = (limits.depths[part, 0], limits.depths[part, 1])
    unbounded = depths[0] == -np.inf and depths[1] == np.inf
    if side in (BEHIND_PLANE, BEFORE_PLANE) and unbounded and len(mask) == 0:
        plane = (faces.plane[face, 0], faces.plane[face, 1], faces.plane[face, 2], faces.plane[face, 3])
        where = side if z_fail else BEHIND_PLANE + BEFORE_PLANE - side
        _draw_fast(spans, n_spans, sign, plane, where, view.x, view.down, target.depth, target.stencil,
                   counts, entry)
    else:
        _draw_checked(face, spans, n_spans, sign, view, faces, z_fail, target, mask, depths, counts, entry)


@allocating_kernel
def _draw_band(band, view, faces, bins, z_fail, target, limits, mask, counts):
    """Draw all faces of one band."""
    n_rows = band_rows(len(view.down))
    first_row = band * n_rows
    last_row = min(first_row + n_rows, len(view.down)) - 1
    room = (np.empty((MAX_CORNERS, 7)), np.empty((MAX_CORNERS, 2), np.int64),
            np.empty((n_rows * MAX_CORNERS, 4), np.int64), find_runs(mask, first_row, last_row, MAX_CORNERS))
    for entry in range(bins.offset[band, 0], bins.offset[band, N_WORKERS]):
        face = bins.face[entry]
        first, last = face_rows(faces, face, limits)
        _draw_face(face, max(first, first_row), min(last, last_row), view, faces, z_fail, target, limits, mask, room,
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
    limits : VolumeLimits: scissor and depth bounds.
    mask : bool (rows, columns), the samples on which volumes are drawn (Chan and Durand 2004, sec. 3); bool (0, 0) for
        all of them.
    counts : StencilCounts or None.
    """
    for worker in prange(N_BANDS):
        _draw_band((worker * BAND_STRIDE) % N_BANDS, view, faces, bins, z_fail, target, limits, mask, counts)
