"""Watertight software rasterisation in float64, for any view and any grid of samples.

Which samples a triangle covers is decided by the exact sign of orient2d on the float64 screen positions of its
corners, and a sample that lies exactly on an edge is treated as if it lay a vanishing distance to its right and
below (the top-left rule). Triangles that share the screen positions of an edge therefore cover each sample along
it exactly once: no sample between them is missed or drawn twice, whatever the size or the shape of the mesh.

* Vertices are projected once each, triangles are clipped against the near plane and nothing else. Edges that
  cross it are cut at bit-identical points in all triangles that share them.
* Screen positions may lie up to 2^480 units away, the range in which `shadowbench.kernels.orientation` is exact;
  triangles that reach farther are not drawn.
* Both sides of a triangle are visible. Triangles without area, on the screen or in space, cover nothing.
* The depth of a sample is where its ray meets the triangle's plane in world space, kept within the depth range of
  the triangle's own corners, so triangles seen almost edge-on give no stray depths. The nearest depth wins;
  between equal depths, the smaller triangle index.

Rows are dealt to a constant number of bands. A band owns its rows and draws its triangles in the order of their
indices, so results are the same for every number of threads.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.binning import N_BANDS, fill_bins, rows_per_band
from shadowbench.kernels.orientation import orient2d
from shadowbench.kernels.projection import N_WORKERS, FloatArray, View, project
from shadowbench.kernels.triangle_setup import empty_pieces, set_up_pieces

_BAND_STRIDE = 27
"""Coprime to N_BANDS: neighbouring workers get bands far apart, so each thread sees all parts of the screen."""

Counts2D = NDArray[np.int32]


class Target(NamedTuple):
    """What rasterisation fills: depth and triangle of the nearest surface.

    Attributes
    ----------
    depth : float64 (rows, columns), along the view's forward axis; inf where there is nothing.
    triangle : int32 (rows, columns), -1 where there is nothing.
    """

    depth: FloatArray
    triangle: NDArray[np.int32]


class RasterCounts(NamedTuple):
    """Operation counts of rasterisation, per sample.

    Attributes
    ----------
    fragments : int32 (rows, columns), triangles that cover the sample.
    written : int32 (rows, columns), times that the sample took a nearer surface.
    """

    fragments: Counts2D
    written: Counts2D


def empty_target(view: View) -> Target:
    """Make a target without any surface."""
    return Target(np.full(view.shape, np.inf), np.full(view.shape, -1, np.int32))


def empty_counts(view: View) -> RasterCounts:
    """Make count arrays that are all zero."""
    return RasterCounts(np.zeros(view.shape, np.int32), np.zeros(view.shape, np.int32))


def rasterize(view: View, vertices: FloatArray, triangles: NDArray[np.int32], target: Target,
              counts: RasterCounts | None = None, behind: Target | None = None) -> None:
    """Draw triangles into `target`, on top of what it holds.

    Parameters
    ----------
    view : the projection and its samples.
    vertices : float64 (n_vertices, 3), world.
    triangles : int32 (n_triangles, 3).
    target : updated in place.
    counts : increased in place, or None for the build without counting.
    behind : draw only what lies behind these surfaces, or at the same depth with a greater triangle index; None for all.
    """
    if len(triangles) == 0:
        return
    mesh = project(view, vertices, triangles)
    _draw_bands(view, mesh, fill_bins(view, mesh), target, counts, behind)


@parallel_kernel
def _draw_bands(view, mesh, bins, target, counts, behind):
    for worker in prange(N_BANDS):
        _draw_band((worker * _BAND_STRIDE) % N_BANDS, view, mesh, bins, target, counts, behind)


@allocating_kernel
def _draw_band(band, view, mesh, bins, target, counts, behind):
    """Draw all triangles of one band, in the order of their indices."""
    n_rows = rows_per_band(view)
    first_row = band * n_rows
    last_row = min(first_row + n_rows, len(view.y_position)) - 1
    polygon = np.empty((4, 3))
    pieces = empty_pieces()
    entry, end = bins.offset[band, 0], bins.offset[band, N_WORKERS]
    while entry < end:
        entry, n_pieces = set_up_pieces(entry, end, first_row, last_row, view, mesh, bins, polygon, pieces)
        _draw_pieces(n_pieces, pieces, view, target, counts, behind)


@kernel
def _draw_pieces(n_pieces, pieces, view, target, counts, behind):
    """Draw a batch of pieces, row by row."""
    x_position, x_plane, per_unit, far = view.x_position, view.x_plane, view.x_per_unit, view.far
    y_position, y_plane, depths, triangles = view.y_position, view.y_plane, target.depth, target.triangle
    box, edges, plane, owner = pieces.box, pieces.edges, pieces.plane, pieces.triangle
    for piece in range(n_pieces):
        for row in range(box[piece, 0], box[piece, 1] + 1):
            # Narrow the columns down to those inside each edge: one run, as orient2d is linear in x
            first, last, y = box[piece, 2], box[piece, 3], y_position[row]
            for k in range(3):
                ax, ay, bx, by = edges[piece, k, 0], edges[piece, k, 1], edges[piece, k, 2], edges[piece, k, 3]
                # The top-left rule: edges with the inside to their right, or below them, own the samples on them
                rising = by < ay
                owns = rising or (by == ay and bx > ax)
                # Find the first column in low..high that is inside (rising) or outside; high if there is none.
                # Floats guess it and exact signs check it; if the guess is wrong, bisection goes on from there
                low, high, n_tries = first, max(first, last + 1), 0
                probe = _guess_column((ax + (y - ay) * edges[piece, k, 4]) * per_unit, low, high) - 1
                while low < high:
                    probe = max(low, min(probe, high - 1))
                    side = orient2d(ax, ay, bx, by, x_position[probe], y)
                    if (side > 0 or (side == 0 and owns)) == rising:
                        high = probe
                    else:
                        low = probe + 1
                    n_tries += 1
                    probe = low if n_tries == 1 else (low + high) // 2
                if rising:
                    first = low
                else:
                    last = low - 1
            # Draw the run
            c, cx = plane[piece, 0] + plane[piece, 2] * y_plane[row], plane[piece, 1]
            d, dx = plane[piece, 3] + plane[piece, 5] * y_plane[row], plane[piece, 4]
            nearest, farthest = plane[piece, 6], plane[piece, 7]
            for column in range(first, last + 1):
                # Keep the depth within the triangle's own range; not a number fails the first comparison
                depth = (c + cx * x_plane[column]) / (d + dx * x_plane[column])
                if not depth >= nearest:
                    depth = nearest
                if depth > farthest:
                    depth = farthest
                if counts is not None:
                    counts.fragments[row, column] += 1
                if behind is not None:
                    # Depth peeling: surfaces in order of depth, then of index
                    limit = behind.depth[row, column]
                    if depth < limit or (depth == limit and owner[piece] <= behind.triangle[row, column]):
                        continue
                if depth <= far and depth < depths[row, column]:
                    depths[row, column] = depth
                    triangles[row, column] = owner[piece]
                    if counts is not None:
                        counts.written[row, column] += 1


@kernel
def _guess_column(crossing, low, high):
    """Guess the first column at or after a coordinate, within low..high. The guess need not be right."""
    crossing += 0.5
    if not crossing > low:
        return low
    return high if crossing >= high else int(crossing)
