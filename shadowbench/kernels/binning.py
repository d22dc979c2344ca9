"""Sorting triangles into horizontal bands of the screen, so that workers can draw them apart.

Workers own the bands, not the triangles. Each band lists its triangles in the order of their indices. The numbers
of bands and of workers are constants, so nothing here depends on the number of threads.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.projection import N_WORKERS, ProjectedMesh, View, chunk, clip_near

N_BANDS = 64


class Bins(NamedTuple):
    """Triangles per band.

    Attributes
    ----------
    rows : int32 (n_triangles, 2), first and last row that the triangle's bounds touch; empty if last < first.
    offset : int64 (N_BANDS, N_WORKERS + 1), where each worker's triangles of each band start.
    triangle : int32 (n_entries,), band by band, in increasing order within each.
    """

    rows: NDArray[np.int32]
    offset: NDArray[np.int64]
    triangle: NDArray[np.int32]


def fill_bins(view: View, mesh: ProjectedMesh) -> Bins:
    """Sort triangles into bands by counting: count per worker and band, add up, scatter."""
    rows = np.empty((len(mesh.triangles), 2), np.int32)
    counted = np.zeros((N_BANDS, N_WORKERS), np.int64)
    _count_all(view, mesh, rows, counted)
    ends = np.cumsum(counted.ravel()).reshape(N_BANDS, N_WORKERS)
    offset = np.zeros((N_BANDS, N_WORKERS + 1), np.int64)
    offset[:, 1:] = ends
    offset[1:, 0] = ends[:-1, -1]
    bins = Bins(rows, offset, np.empty(int(ends[-1, -1]), np.int32))
    _scatter_all(view, bins)
    return bins


@kernel
def first_at_or_after(position, per_unit, value):
    """Index of the first sample whose position is at least `value`; the number of samples if there is none."""
    n = len(position)
    if not value > position[0]:
        return 0
    if value > position[n - 1]:
        return n
    # Regular positions make the guess right to within one sample; others are walked to
    i = min(int(value * per_unit), n - 1)
    while i > 0 and position[i - 1] >= value:
        i -= 1
    while position[i] < value:
        i += 1
    return i


@kernel
def last_at_or_before(position, per_unit, value):
    """Index of the last sample whose position is at most `value`; -1 if there is none."""
    i = first_at_or_after(position, per_unit, value)
    return i if i < len(position) and position[i] == value else i - 1


@kernel
def rows_per_band(view):
    """Rows in each band."""
    return (len(view.y_position) + N_BANDS - 1) // N_BANDS


@kernel
def _clipped_bounds(view, mesh, t, polygon):
    """Smallest and largest y on the screen of what the near plane leaves of a triangle; the wrong way round if
    nothing is left."""
    n_corners = clip_near(view, mesh, t, polygon)
    low, high = np.inf, -np.inf
    for c in range(n_corners):
        low, high = min(low, polygon[c, 1]), max(high, polygon[c, 1])
    return low, high


@allocating_kernel
def _count_chunk(worker, view, mesh, rows, counted):
    """Find the rows that the bounds of one worker's share of the triangles touch; count triangles per band."""
    first, end = chunk(worker, len(mesh.triangles))
    band_rows = rows_per_band(view)
    polygon = np.empty((4, 3))
    triangles, screen, position, per_unit = mesh.triangles, mesh.screen, view.y_position, view.y_per_unit
    for t in range(first, end):
        y0, y1, y2 = screen[triangles[t, 0], 1], screen[triangles[t, 1], 1], screen[triangles[t, 2], 1]
        low, high = min(y0, y1, y2), max(y0, y1, y2)
        if np.isnan(y0 + y1 + y2):
            low, high = _clipped_bounds(view, mesh, t, polygon)
        first_row = first_at_or_after(position, per_unit, low)
        last_row = last_at_or_before(position, per_unit, high)
        rows[t, 0], rows[t, 1] = first_row, last_row
        if first_row <= last_row:
            for band in range(first_row // band_rows, last_row // band_rows + 1):
                counted[band, worker] += 1


@allocating_kernel
def _scatter_chunk(worker, view, bins):
    """Write one worker's share of the triangles into the bands."""
    first, end = chunk(worker, len(bins.rows))
    band_rows = rows_per_band(view)
    rows, binned = bins.rows, bins.triangle
    place = bins.offset[:, worker].copy()
    for t in range(first, end):
        if rows[t, 0] <= rows[t, 1]:
            for band in range(rows[t, 0] // band_rows, rows[t, 1] // band_rows + 1):
                binned[place[band]] = t
                place[band] += 1


@parallel_kernel
def _count_all(view, mesh, rows, counted):
    for worker in prange(N_WORKERS):
        _count_chunk(worker, view, mesh, rows, counted)


@parallel_kernel
def _scatter_all(view, bins):
    for worker in prange(N_WORKERS):
        _scatter_chunk(worker, view, bins)
