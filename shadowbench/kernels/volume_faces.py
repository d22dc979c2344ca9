"""The faces of stencil shadow volumes, exact for any triangle soup.

Each triangle that casts, turned to face the light, shadows one frustum: inside its three side planes and behind its
*biased cap*, the triangle moved away from the light until its plane has shifted by the bias. All three vertices have
the same height over the light, so the biased cap is the triangle scaled about a point light (or moved along a
directional light) by one number: ``v + shift * (v - light)``. The count of a sample is the number of frusta that
contain it, and each frustum is closed by the faces that are made here:

* silhouette extrusion: one side quad per edge of non-zero multiplicity, from the edge itself to infinity, drawn
  |multiplicity| times; that gives the unbiased frusta. What they hold in front of the biased caps is taken away again:
  three thin quads per triangle, from its edge to the edge of its biased cap, and the biased cap. (The unbiased cap
  appears twice with opposite signs, so it is never drawn.)
* triangle extrusion: three side quads per triangle, from its biased cap to infinity, and the cap.
* z-fail, point light: a dark cap at infinity per triangle. A directional light's dark caps are points.

Every chain of faces closes over bit-identical vertices (of an edge, of a biased cap, at infinity) and no vertex
lies within another face's border, so on the image no sample between faces is missed or drawn twice.

A face knows the function f of its plane: the shadow's side of it is ``f <= 0``. On an edge's plane, zero goes to the
side on which its volume lies, as the definition of shadow wants. A face seen edge-on keeps its borders instead.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.shadow_volumes import EDGE_ON, N_WORKERS, cap_plane, chunk, side_plane
from shadowbench.kernels.volume_polygons import MAX_CORNERS, clip_and_project

BEHIND_PLANE, BEFORE_PLANE, EDGE_ON_PLANE, AT_INFINITY = 0, 1, 2, 3
"""Where the eye is: on the side f <= 0 of a face, on the other, in its plane; and the mark of dark caps."""


class Faces(NamedTuple):
    """Faces that cover at least one sample's row and column.

    Attributes
    ----------
    first : int64 (N_WORKERS + 1,), where each worker's faces start; the last is the capacity.
    end : int64 (N_WORKERS,), one past the last face of each worker.
    polygon : float64 (capacity, 9, 2), corners on the image plane, counter-clockwise seen from the side f > 0.
    n_corners : int32 (capacity,).
    plane : float64 (capacity, 4), f at the eye and its slope along right, up and forward.
    eye_side : int8 (capacity,), BEHIND_PLANE, BEFORE_PLANE, EDGE_ON_PLANE or AT_INFINITY.
    multiplicity : int32 (capacity,), times drawn; positive if the volume lies where f <= 0.
    rows : int32 (capacity, 2), first and last row of the samples within its bounds.
    borders : float64 (capacity, 4, 4), for faces seen edge-on: value at the eye and slopes of planes through its borders,
        positive on its inner side.
    triangle : int32 (capacity,), the triangle it belongs to; the first one for an edge.
    """

    first: NDArray[np.int64]
    end: NDArray[np.int64]
    polygon: NDArray[np.float64]
    n_corners: NDArray[np.int32]
    plane: NDArray[np.float64]
    eye_side: NDArray[np.int8]
    multiplicity: NDArray[np.int32]
    rows: NDArray[np.int32]
    borders: NDArray[np.float64]
    triangle: NDArray[np.int32]


class VolumeKind(NamedTuple):
    """Which faces are made.

    Attributes
    ----------
    per_triangle : True to extrude triangles, False to extrude silhouettes.
    dark_caps : True to close the volumes at infinity.
    """

    per_triangle: bool
    dark_caps: bool


class _Scratch(NamedTuple):
    """Room for the face at work.

    Attributes
    ----------
    corners : float64 (4, 4), homogeneous view space.
    polygon, spare : float64 (9, 4), for clipping.
    """

    corners: NDArray[np.float64]
    polygon: NDArray[np.float64]
    spare: NDArray[np.float64]


@kernel
def first_at_or_after(positions, per_unit, value):
    """Index of the first sample whose position is at least `value`; the number of samples if there is none."""
    n = len(positions)
    if not value > positions[0]:
        return 0
    if value > positions[n - 1]:
        return n
    # Regular positions make the guess right to within one sample; others are walked to
    i = min(int((value - positions[0]) * per_unit), n - 1)
    while i > 0 and positions[i - 1] >= value:
        i -= 1
    while positions[i] < value:
        i += 1
    return i


@kernel
def _put_point(scratch, i, casters, position, shift):
    """Set a corner to a position, moved away from the light."""
    for c in range(3):
        scratch.corners[i, c] = casters.positions_view[position, c] + shift * casters.away_view[position, c]
    scratch.corners[i, 3] = 1.0


@kernel
def _put_infinity(scratch, i, casters, position):
    """Set a corner to the end at infinity of a position's light ray."""
    for c in range(3):
        scratch.corners[i, c] = casters.away_view[position, c]
    scratch.corners[i, 3] = 0.0


@kernel
def _project_face(view, scratch, n_corners, faces, slot):
    """Clip and project the face at work, and tell whether a sample's row and a sample's column cross its bounds."""
    scratch.polygon[:n_corners] = scratch.corners[:n_corners]
    polygon = faces.polygon[slot]
    n = clip_and_project(view, scratch.polygon, n_corners, scratch.spare, polygon)
    if n == 0:
        return False
    left = right = polygon[0, 0]
    top = bottom = polygon[0, 1]
    for i in range(1, n):
        left, right = min(left, polygon[i, 0]), max(right, polygon[i, 0])
        top, bottom = min(top, polygon[i, 1]), max(bottom, polygon[i, 1])
    n_columns, n_rows = len(view.x), len(view.down)
    column = first_at_or_after(view.x, view.columns_per_unit, left)
    row = first_at_or_after(view.down, view.rows_per_unit, top)
    if column == n_columns or view.x[column] > right or row == n_rows or view.down[row] > bottom:
        return False
    last = first_at_or_after(view.down, view.rows_per_unit, bottom)
    faces.rows[slot, 0] = row
    faces.rows[slot, 1] = last if last < n_rows and view.down[last] == bottom else last - 1
    faces.n_corners[slot] = n
    return True


@kernel
def _set_borders(scratch, n_corners, plane, borders):
    """Set up planes through the borders of a face, at right angles to it, positive on its inner side."""
    nx, ny, nz = plane[1], plane[2], plane[3]
    for i in range(4):
        borders[i] = 0.0
        if i < n_corners:
            a, b = scratch.corners[i], scratch.corners[(i + 1) % n_corners]
            if a[3] == 1.0 or b[3] == 1.0:
                sign = 1.0 if a[3] == 1.0 else -1.0
                point, end = (a, b) if a[3] == 1.0 else (b, a)
                x, y, z = sign * end[0], sign * end[1], sign * end[2]
                if end[3] == 1.0:
                    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
                # Right, up and forward are a left-handed system: the product of (n, direction) changes sign
                mx, my, mz = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
                borders[i, 0] = -(mx * point[0] + my * point[1] + mz * point[2])
                borders[i, 1], borders[i, 2], borders[i, 3] = mx, my, mz


@kernel
def _finish_face(view, scratch, n_corners, normal, value, terms, sign, faces, slot):
    """Store the plane of a projected face, its normal times `sign`."""
    plane = faces.plane[slot]
    plane[0] = sign * value
    plane[1] = sign * (normal[0] * view.right[0] + normal[1] * view.right[1] + normal[2] * view.right[2])
    plane[2] = sign * (normal[0] * view.up[0] + normal[1] * view.up[1] + normal[2] * view.up[2])
    plane[3] = sign * (normal[0] * view.forward[0] + normal[1] * view.forward[1] + normal[2] * view.forward[2])
    if abs(value) <= EDGE_ON * terms:
        faces.eye_side[slot] = EDGE_ON_PLANE
        _set_borders(scratch, n_corners, plane, faces.borders[slot])
    else:
        faces.eye_side[slot] = BEHIND_PLANE if plane[0] < 0.0 else BEFORE_PLANE


@kernel
def _add_side_quad(view, scratch, adjacency, light, casters, edge, sign, shifts, multiplicity, triangle, faces, slot):
    """Add the side quad of an edge between two shifts; the second may be infinite. Return the next free slot.

    `sign` is -1 where f decreases along the plane's normal: corners then run the other way.
    """
    first = 0 if sign > 0 else 1
    a, b = adjacency.ends[edge, first], adjacency.ends[edge, 1 - first]
    _put_point(scratch, 0, casters, a, shifts[0])
    _put_point(scratch, 3, casters, b, shifts[0])
    if shifts[1] == np.inf:
        _put_infinity(scratch, 1, casters, a)
        _put_infinity(scratch, 2, casters, b)
    else:
        _put_point(scratch, 1, casters, a, shifts[1])
        _put_point(scratch, 2, casters, b, shifts[1])
    if not _project_face(view, scratch, 4, faces, slot):
        return slot
    normal, value, terms = side_plane(adjacency, light, edge, view.eye)
    _finish_face(view, scratch, 4, normal, value, terms, sign, faces, slot)
    faces.multiplicity[slot], faces.triangle[slot] = multiplicity, triangle
    return slot + 1


@kernel
def _add_caps(view, scratch, adjacency, casters, bias, kind, triangle, faces, slot):
    """Add the caps of a triangle. Return the next free slot."""
    # Counter-clockwise seen from behind: against the winding that faces the light
    order = (0, 2, 1) if casters.facing[triangle] > 0 else (0, 1, 2)
    for i in range(3):
        _put_point(scratch, i, casters, adjacency.corners[triangle, order[i]], casters.shift[triangle])
    if _project_face(view, scratch, 3, faces, slot):
        normal, behind, terms = cap_plane(adjacency, casters, triangle, view.eye)
        _finish_face(view, scratch, 3, normal, behind - bias, terms, 1, faces, slot)
        faces.multiplicity[slot], faces.triangle[slot] = -1, triangle
        slot += 1
    if kind.dark_caps:
        for i in range(3):
            _put_infinity(scratch, i, casters, adjacency.corners[triangle, order[i]])
        if _project_face(view, scratch, 3, faces, slot):
            faces.eye_side[slot], faces.multiplicity[slot], faces.triangle[slot] = AT_INFINITY, 1, triangle
            slot += 1
    return slot


@kernel
def _faces_chunk(worker, view, scratch, adjacency, light, casters, multiplicity, bias, kind, faces):
    """Make the faces of one worker's share of the edges and of the triangles."""
    slot = faces.first[worker]
    first, end = chunk(worker, len(multiplicity))
    for edge in range(first, end):
        if multiplicity[edge] != 0:
            sign = 1 if multiplicity[edge] > 0 else -1
            slot = _add_side_quad(view, scratch, adjacency, light, casters, edge, sign, (0.0, np.inf),
                                  abs(multiplicity[edge]), adjacency.uses[adjacency.first_use[edge]] // 3, faces, slot)
    first, end = chunk(worker, len(casters.facing))
    for triangle in range(first, end):
        if casters.facing[triangle] == 0:
            continue
        shift = casters.shift[triangle]
        for k in range(3):
            edge = adjacency.triangle_edges[triangle, k]
            inside = casters.facing[triangle] * adjacency.along[triangle, k]
            if kind.per_triangle:
                slot = _add_side_quad(view, scratch, adjacency, light, casters, edge, inside, (shift, np.inf), 1,
                                      triangle, faces, slot)
            elif shift > 0.0:
                sign = -1 if multiplicity[edge] < 0 else 1
                slot = _add_side_quad(view, scratch, adjacency, light, casters, edge, sign, (0.0, shift),
                                      -inside * sign, triangle, faces, slot)
        slot = _add_caps(view, scratch, adjacency, casters, bias, kind, triangle, faces, slot)
    faces.end[worker] = slot


@kernel
def _scratch():
    """Make room for one face."""
    return _Scratch(np.empty((4, 4)), np.empty((MAX_CORNERS, 4)), np.empty((MAX_CORNERS, 4)))


@kernel
def _faces_worker(worker, view, adjacency, light, casters, multiplicity, bias, kind, faces):
    """Do one worker's share, with room of its own."""
    _faces_chunk(worker, view, _scratch(), adjacency, light, casters, multiplicity, bias, kind, faces)


@parallel_kernel
def _make_all_faces(view, adjacency, light, casters, multiplicity, bias, kind, faces):
    for worker in prange(N_WORKERS):
        _faces_worker(worker, view, adjacency, light, casters, multiplicity, bias, kind, faces)


def _empty_faces(multiplicity, facing, kind: VolumeKind) -> Faces:
    """Allocate room for every face that could be made."""
    per_triangle = 4 + int(kind.dark_caps)
    shares = np.zeros(N_WORKERS + 1, np.int64)
    for worker in range(N_WORKERS):
        edges, triangles = (slice(worker * len(a) // N_WORKERS, (worker + 1) * len(a) // N_WORKERS)
                            for a in (multiplicity, facing))
        shares[worker + 1] = (np.count_nonzero(multiplicity[edges])
                              + per_triangle * np.count_nonzero(facing[triangles]))
    first = np.cumsum(shares)
    n = int(first[-1])
    return Faces(first, first[1:].copy(), np.empty((n, MAX_CORNERS, 2)), np.empty(n, np.int32), np.empty((n, 4)),
                 np.empty(n, np.int8), np.empty(n, np.int32), np.empty((n, 2), np.int32), np.empty((n, 4, 4)),
                 np.empty(n, np.int32))


def make_faces(view, adjacency, light: NDArray[np.float64], casters, multiplicity: NDArray[np.int32], bias: float,
               kind: VolumeKind) -> Faces:
    """Make the faces of all volumes and project those that may cover a sample.

    Parameters
    ----------
    view : VolumeView.
    adjacency : EdgeAdjacency of the mesh.
    light : float64 (4,), homogeneous, world.
    casters : Casters.
    multiplicity : int32 (n_edges,), see `edges.edge_multiplicities`; all zero for `per_triangle`.
    bias : shadow bias, world units.
    kind : which faces are made.
    """
    faces = _empty_faces(multiplicity, casters.facing, kind)
    _make_all_faces(view, adjacency, light, casters, multiplicity, float(bias), kind, faces)
    return faces
