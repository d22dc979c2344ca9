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
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.edges import EdgeAdjacency
from shadowbench.kernels.shadow_volumes import N_WORKERS, Casters, cap_plane, chunk, side_plane
from shadowbench.kernels.volume_faces import AT_INFINITY, Faces, Scratch, project_face, set_plane
from shadowbench.kernels.volume_polygons import MAX_CORNERS

_NO_EDGE = -1
_BIASED_CAP, _DARK_CAP, _FACES_PER_TRIANGLE = 3, 4, 5


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
    if not project_face(view, scratch, n_corners, faces, slot):
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
    set_plane(view, scratch, n_corners, normal, value, terms, face.sign, faces, slot)
    return slot + 1


@allocating_kernel
def _make_chunk(worker, view, adjacency, light, casters, multiplicity, bias, kind, faces):
    """Make one worker's share of the faces."""
    # Parallel loops take no records of records, so the scene is put together here
    scene = _Scene(adjacency, light, casters, multiplicity, bias)
    scratch = Scratch(np.empty((4, 4)), np.empty((2, MAX_CORNERS, 4)))
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
