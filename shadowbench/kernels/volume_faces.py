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
from shadowbench.kernels.edges import EdgeAdjacency
from shadowbench.kernels.shadow_volumes import EDGE_ON, N_WORKERS, Casters, cap_plane, chunk, dot, side_plane
from shadowbench.kernels.volume_polygons import MAX_CORNERS, clip_and_project

BEHIND_PLANE, BEFORE_PLANE, EDGE_ON_PLANE, AT_INFINITY = 0, 1, 2, 3
"""Where the eye is: on the side f <= 0 of a face, on the other, in its plane; and the mark of dark caps."""

_NO_EDGE = -1
_BIASED_CAP, _DARK_CAP, _FACES_PER_TRIANGLE = 3, 4, 5


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
    borders : float64 (capacity, 4, 4), for faces seen edge-on: value at the eye and slopes of planes through its
        borders, positive on its inner side.
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


class _Scene(NamedTuple):
    """What faces are made of; see `make_faces`."""

    adjacency: EdgeAdjacency
    light: NDArray[np.float64]
    casters: Casters
    multiplicity: NDArray[np.int32]
    bias: float


class _Face(NamedTuple):
    """A face to be made.

    Attributes
    ----------
    edge : the edge of a side quad, or _NO_EDGE for a cap.
    triangle : the triangle it belongs to.
    sign : -1 where f decreases along the edge's plane normal, else 1.
    near_shift, far_shift : how far its borders are moved away from the light; may be infinite; equal for a cap.
    times : its multiplicity.
    """

    edge: int
    triangle: int
    sign: int
    near_shift: float
    far_shift: float
    times: int


class _Scratch(NamedTuple):
    """Room for the face at work.

    Attributes
    ----------
    corners : float64 (4, 4), homogeneous view space.
    room : float64 (2, 9, 4), for clipping.
    """

    corners: NDArray[np.float64]
    room: NDArray[np.float64]


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
def _project_face(view, scratch, n_corners, faces, slot):
    """Clip and project the face at work, and tell whether a sample's row and a sample's column cross its bounds."""
    for i in range(n_corners):
        for c in range(4):
            scratch.room[0, i, c] = scratch.corners[i, c]
    n = clip_and_project(view, scratch.room, n_corners, faces.polygon, slot)
    left = top = np.inf
    right = bottom = -np.inf
    for i in range(n):
        x, down = faces.polygon[slot, i, 0], faces.polygon[slot, i, 1]
        left, right, top, bottom = min(left, x), max(right, x), min(top, down), max(bottom, down)
    if not (left <= view.x[-1] and right >= view.x[0] and top <= view.down[-1] and bottom >= view.down[0]):
        return False
    column = first_at_or_after(view.x, view.columns_per_unit, left)
    row = first_at_or_after(view.down, view.rows_per_unit, top)
    if view.x[column] > right or view.down[row] > bottom:
        return False
    # A level border at the bottom covers nothing, so its row may be left out or kept
    faces.rows[slot, 0] = row
    faces.rows[slot, 1] = first_at_or_after(view.down, view.rows_per_unit, bottom) - 1
    faces.n_corners[slot] = n
    return True


@kernel
def _set_borders(scratch, n_corners, faces, slot):
    """Set up planes through the borders of a face, at right angles to it, positive on its inner side."""
    nx, ny, nz = faces.plane[slot, 1], faces.plane[slot, 2], faces.plane[slot, 3]
    for i in range(4):
        j = i + 1 if i + 1 < n_corners else 0
        a, b = (i, j) if scratch.corners[i, 3] == 1.0 else (j, i)
        mx = my = mz = at_eye = 0.0
        if i < n_corners and scratch.corners[a, 3] == 1.0:
            x, y, z = scratch.corners[b, 0], scratch.corners[b, 1], scratch.corners[b, 2]
            px, py, pz = scratch.corners[a, 0], scratch.corners[a, 1], scratch.corners[a, 2]
            if scratch.corners[b, 3] == 1.0:
                x, y, z = x - px, y - py, z - pz
            sign = 1.0 if a == i else -1.0
            # Right, up and forward are a left-handed system: the product of (normal, direction) changes sign
            mx, my, mz = sign * (y * nz - z * ny), sign * (z * nx - x * nz), sign * (x * ny - y * nx)
            at_eye = -(mx * px + my * py + mz * pz)
        faces.borders[slot, i, 0] = at_eye
        faces.borders[slot, i, 1], faces.borders[slot, i, 2], faces.borders[slot, i, 3] = mx, my, mz


@kernel
def _set_plane(view, scratch, n_corners, normal, value, terms, sign, faces, slot):
    """Store the plane of a projected face, its normal times `sign`."""
    faces.plane[slot, 0] = sign * value
    faces.plane[slot, 1] = sign * dot(normal, view.right)
    faces.plane[slot, 2] = sign * dot(normal, view.up)
    faces.plane[slot, 3] = sign * dot(normal, view.forward)
    if abs(value) <= EDGE_ON * terms:
        faces.eye_side[slot] = EDGE_ON_PLANE
        _set_borders(scratch, n_corners, faces, slot)
    else:
        faces.eye_side[slot] = BEHIND_PLANE if sign * value < 0.0 else BEFORE_PLANE


@kernel
def _silhouette_face(scene, edge):
    """Describe the side quad of an edge, from the edge itself to infinity."""
    times = np.int64(scene.multiplicity[edge])
    triangle = np.int64(scene.adjacency.uses[scene.adjacency.first_use[edge]]) // 3
    return _Face(edge, triangle, -1 if times < 0 else 1, 0.0, np.inf, abs(times))


@kernel
def _triangle_face(scene, kind, triangle, k):
    """Describe a face of a triangle: the side of edge k = 0, 1, 2, its biased cap (3) or its dark cap (4)."""
    facing, shift = np.int64(scene.casters.facing[triangle]), scene.casters.shift[triangle]
    if k == _BIASED_CAP:
        return _Face(_NO_EDGE, triangle, 1, shift, shift, -abs(facing))
    if k == _DARK_CAP:
        return _Face(_NO_EDGE, triangle, 1, np.inf, np.inf, abs(facing) if kind.dark_caps else 0)
    edge = np.int64(scene.adjacency.triangle_edges[triangle, k])
    outward = facing * np.int64(scene.adjacency.along[triangle, k])
    if kind.per_triangle:
        return _Face(edge, triangle, outward, shift, np.inf, abs(facing))
    # What the silhouette's volume holds in front of the biased cap is taken away
    sign = -1 if scene.multiplicity[edge] < 0 else 1
    return _Face(edge, triangle, sign, 0.0, shift, -outward * sign if shift > 0.0 else 0)


@kernel
def _put_corners(scene, scratch, face):
    """Set the corners of a face, counter-clockwise seen from the side f > 0. Return their number."""
    casters, adjacency = scene.casters, scene.adjacency
    n_corners = 3 if face.edge == _NO_EDGE else 4
    for i in range(n_corners):
        if face.edge == _NO_EDGE:
            # Seen from behind the triangle: against the winding that faces the light
            k = (3 - i) % 3 if casters.facing[face.triangle] > 0 else i
            position, shift = adjacency.corners[face.triangle, k], face.near_shift
        else:
            position = adjacency.ends[face.edge, 0 if (i < 2) == (face.sign > 0) else 1]
            shift = face.near_shift if i == 0 or i == 3 else face.far_shift
        # At infinity there is only the direction
        for c in range(3):
            away = casters.away_view[position, c]
            scratch.corners[i, c] = casters.positions_view[position, c] + shift * away if shift < np.inf else away
        scratch.corners[i, 3] = 1.0 if shift < np.inf else 0.0
    return n_corners


@kernel
def _add_face(view, scratch, scene, face, faces, slot):
    """Add a face if it may cover a sample. Return the next free slot."""
    n_corners = _put_corners(scene, scratch, face)
    if not _project_face(view, scratch, n_corners, faces, slot):
        return slot
    faces.multiplicity[slot], faces.triangle[slot] = face.times, face.triangle
    if face.near_shift == np.inf:
        faces.eye_side[slot] = AT_INFINITY
        return slot + 1
    if face.edge == _NO_EDGE:
        normal, behind, terms = cap_plane(scene.adjacency, scene.casters, face.triangle, view.eye)
        value = behind - scene.bias
    else:
        normal, value, terms = side_plane(scene.adjacency, scene.light, face.edge, view.eye)
    _set_plane(view, scratch, n_corners, normal, value, terms, face.sign, faces, slot)
    return slot + 1


@kernel
def _make_chunk(worker, view, adjacency, light, casters, multiplicity, bias, kind, faces):
    """Make one worker's share of the faces."""
    # Parallel loops take no records of records, so the scene is put together here
    scene = _Scene(adjacency, light, casters, multiplicity, bias)
    scratch = _Scratch(np.empty((4, 4)), np.empty((2, MAX_CORNERS, 4)))
    first_edge, end_edge = chunk(worker, 0 if kind.per_triangle else len(multiplicity))
    first_triangle, end_triangle = chunk(worker, len(casters.facing))
    n_edges, n_triangles = end_edge - first_edge, end_triangle - first_triangle
    slot = faces.first[worker]
    for item in range(n_edges + n_triangles):
        for k in range(1 if item < n_edges else _FACES_PER_TRIANGLE):
            if item < n_edges:
                face = _silhouette_face(scene, first_edge + item)
            else:
                face = _triangle_face(scene, kind, first_triangle + item - n_edges, k)
            if face.times != 0:
                slot = _add_face(view, scratch, scene, face, faces, slot)
    faces.end[worker] = slot


@parallel_kernel
def _make_all_faces(view, adjacency, light, casters, multiplicity, bias, kind, faces):
    for worker in prange(N_WORKERS):
        _make_chunk(np.int64(worker), view, adjacency, light, casters, multiplicity, bias, kind, faces)


def _empty_faces(multiplicity, facing, kind: VolumeKind) -> Faces:
    """Allocate room for every face that could be made."""
    per_triangle = 4 + int(kind.dark_caps)
    shares = np.zeros(N_WORKERS + 1, np.int64)
    for worker in range(N_WORKERS):
        edges, triangles = (slice(worker * len(a) // N_WORKERS, (worker + 1) * len(a) // N_WORKERS)
                            for a in (multiplicity, facing))
        shares[worker + 1] = per_triangle * np.count_nonzero(facing[triangles])
        if not kind.per_triangle:
            shares[worker + 1] += np.count_nonzero(multiplicity[edges])
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
    multiplicity : int32 (n_edges,), see `edges.edge_multiplicities`; not used `per_triangle`.
    bias : shadow bias, world units.
    kind : which faces are made.
    """
    faces = _empty_faces(multiplicity, casters.facing, kind)
    _make_all_faces(view, adjacency, light, casters, multiplicity, float(bias), kind, faces)
    return faces
