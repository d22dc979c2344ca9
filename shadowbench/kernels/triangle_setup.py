"""Triangle set-up: what the inner loops of rasterisation need to know of a triangle, computed once per band.

The near plane leaves a triangle or a quadrilateral of each triangle; a quadrilateral is drawn as two pieces that
share a diagonal. Kernels read each array of a record once, into a local name: Numba counts references with an
atomic operation at every access, which costs more than the arithmetic here.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import allocating_kernel, kernel
from shadowbench.kernels.binning import first_at_or_after, last_at_or_before
from shadowbench.kernels.orientation import orient2d
from shadowbench.kernels.projection import FloatArray, clip_near

BATCH = 256
"""Pieces set up before they are drawn: few enough to stay in the nearest cache."""

MAX_COORDINATE = 2.0**480
"""Largest screen position, in units, for which signs are exact: triangles that reach farther are not drawn."""


class Pieces(NamedTuple):
    """A batch of pieces to draw.

    Attributes
    ----------
    triangle : int64 (BATCH,), the triangle that the piece is part of.
    box : int64 (BATCH, 4), first and last row, first and last column to look at.
    edges : float64 (BATCH, 3, 5), per edge its ends ax, ay, bx, by on the screen and its slope dx / dy (infinite for
        an edge along a row). The inside of the piece is where orient2d(a, b, sample) is positive.
    plane : float64 (BATCH, 8), depth over the image plane as (c + cx x + cy y) / (d + dx x + dy y): c, cx, cy, d,
        dx, dy, then the smallest and largest depth of the corners.
    """

    triangle: NDArray[np.int64]
    box: NDArray[np.int64]
    edges: FloatArray
    plane: FloatArray


@allocating_kernel
def empty_pieces():
    """Make room for a batch."""
    return Pieces(np.empty(BATCH, np.int64), np.empty((BATCH, 4), np.int64), np.empty((BATCH, 3, 5)),
                  np.empty((BATCH, 8)))


@kernel
def _tuple(vector):
    """Copy a vector out of its array."""
    return vector[0], vector[1], vector[2]


@kernel
def _depth_plane(a, b, c, axes, perspective):
    """Depth of a triangle's plane over the image plane, and True if the triangle has no area in space.

    Parameters
    ----------
    a, b, c : world positions of its corners, as tuples.
    axes : the view's eye, right, up and forward, as tuples.
    """
    eye, right, up, forward = axes
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    along_right = nx * right[0] + ny * right[1] + nz * right[2]
    along_up = nx * up[0] + ny * up[1] + nz * up[2]
    along_forward = nx * forward[0] + ny * forward[1] + nz * forward[2]
    distance = nx * (a[0] - eye[0]) + ny * (a[1] - eye[1]) + nz * (a[2] - eye[2])
    flat = nx == 0.0 and ny == 0.0 and nz == 0.0
    # Rays share their origin in a perspective view and their direction in a parallel one
    if perspective:
        coefficients = (distance, 0.0, 0.0, along_forward, along_right, along_up)
    else:
        coefficients = (distance, -along_right, -along_up, along_forward, 0.0, 0.0)
    return coefficients, flat


@kernel
def _write_edges(edges, n_pieces, x0, y0, x1, y1, x2, y2):
    """Write the three edges of a piece, in the order given."""
    corners = ((x0, y0), (x1, y1), (x2, y2), (x0, y0))
    for k in range(3):
        ax, ay = corners[k]
        bx, by = corners[k + 1]
        edges[n_pieces, k, 0], edges[n_pieces, k, 1], edges[n_pieces, k, 2], edges[n_pieces, k, 3] = ax, ay, bx, by
        edges[n_pieces, k, 4] = (bx - ax) / (by - ay) if by != ay else np.inf


@kernel
def set_up_pieces(entry, end, first_row, last_row, view, mesh, bins, polygon, pieces):
    """Set up the pieces of a band's triangles until the batch is full.

    Parameters
    ----------
    entry, end : the band's triangles still to do, as positions in ``bins.triangle``.
    first_row, last_row : rows of the band.
    polygon : float64 (4, 3), scratch.
    pieces : filled in.

    Returns
    -------
    The next triangle to do, and the number of pieces.
    """
    binned, touched, triangles, vertices = bins.triangle, bins.rows, mesh.triangles, mesh.vertices
    screen, near, position, per_unit = mesh.screen, view.near, view.x_position, view.x_per_unit
    box, edges, planes, owner = pieces.box, pieces.edges, pieces.plane, pieces.triangle
    axes = _tuple(view.eye), _tuple(view.right), _tuple(view.up), _tuple(view.forward)
    n_pieces = 0
    while entry < end and n_pieces < BATCH - 1:
        t = np.int64(binned[entry])
        entry += 1
        v = (np.int64(triangles[t, 0]), np.int64(triangles[t, 1]), np.int64(triangles[t, 2]))
        n_corners = 3
        for c in range(3):
            polygon[c, 0], polygon[c, 1], polygon[c, 2] = screen[v[c], 0], screen[v[c], 1], screen[v[c], 2]
        if not (polygon[0, 2] >= near and polygon[1, 2] >= near and polygon[2, 2] >= near):
            n_corners = clip_near(view, mesh, t, polygon)
        x0, y0 = polygon[0, 0], polygon[0, 1]
        for c in range(2, n_corners):
            x1, y1, x2, y2 = polygon[c - 1, 0], polygon[c - 1, 1], polygon[c, 0], polygon[c, 1]
            # Drop pieces whose bounds contain no sample, or that have no area
            left = first_at_or_after(position, per_unit, min(x0, x1, x2))
            right = last_at_or_before(position, per_unit, max(x0, x1, x2))
            reach = max(abs(x0), abs(x1), abs(x2), abs(y0), abs(y1), abs(y2))
            side = orient2d(x0, y0, x1, y1, x2, y2) if left <= right and reach <= MAX_COORDINATE else 0
            if side != 0:
                coefficients, flat = _depth_plane(
                    (vertices[v[0], 0], vertices[v[0], 1], vertices[v[0], 2]),
                    (vertices[v[1], 0], vertices[v[1], 1], vertices[v[1], 2]),
                    (vertices[v[2], 0], vertices[v[2], 1], vertices[v[2], 2]), axes, view.perspective)
                # Run around the piece so that its inside is on the positive side of every edge
                if side > 0:
                    _write_edges(edges, n_pieces, x0, y0, x1, y1, x2, y2)
                else:
                    _write_edges(edges, n_pieces, x0, y0, x2, y2, x1, y1)
                for k in range(6):
                    planes[n_pieces, k] = coefficients[k]
                nearest = farthest = polygon[0, 2]
                for k in range(1, n_corners):
                    nearest, farthest = min(nearest, polygon[k, 2]), max(farthest, polygon[k, 2])
                planes[n_pieces, 6], planes[n_pieces, 7] = nearest, farthest
                owner[n_pieces] = t
                box[n_pieces, 0], box[n_pieces, 1] = max(first_row, touched[t, 0]), min(last_row, touched[t, 1])
                box[n_pieces, 2], box[n_pieces, 3] = left, right
                n_pieces += 0 if flat else 1
    return entry, n_pieces
