"""Shadow frusta of the triangles that cast: facing, biased caps, and the planes through the light.

A triangle, turned to face the light, shadows a frustum: the points on the inner side of its three side planes and
behind its *biased cap*, the triangle moved away from the light until its plane has shifted by the bias. All three
vertices have the same height over the light, so the biased cap is the triangle scaled about a point light (or moved
along a directional light) by one number: ``v + shift * away(v)``, with ``away(v) = v - light``.

Planes are set up from an edge's two positions in lexicographic order, so triangles that share the edge share the plane.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel, parallel_kernel, prange

N_WORKERS = 64
"""Parts that lists of edges and triangles are cut into: a constant, so nothing depends on the number of threads."""

FACING_ERROR = (7.0 + 56.0 * 2.0**-53) * 2.0**-53
"""Relative error bound of a rounded 3 x 3 determinant (Shewchuk 1997, o3derrboundA). A light closer to a triangle's
plane than that is in the plane: the triangle's frustum has no inside that float64 could tell from its border."""

LARGEST_SHIFT = 2.0**100
"""A biased cap that lies so many times farther from the light than its triangle shadows nothing."""

EDGE_ON = 256.0 * 2.0**-53
"""The eye is in a face's plane if it is closer than this, relative to the terms of its plane function: ten times the
rounding errors of the function and of the face's projected corners (together below 24 units)."""


class Casters(NamedTuple):
    """The triangles as one light sees them.

    Attributes
    ----------
    facing : int8 (n_triangles,), +1 if the winding normal faces the light, -1 if it faces away, 0 if it casts nothing.
    shift : float64 (n_triangles,), places the biased cap.
    positions_view : float64 (n_positions, 3), each position of the mesh in view space.
    away_view : float64 (n_positions, 3), from the light through each position, view space, not normalised.
    """

    facing: NDArray[np.int8]
    shift: NDArray[np.float64]
    positions_view: NDArray[np.float64]
    away_view: NDArray[np.float64]


@kernel
def chunk(worker, n_items):
    """Return first and one past the last item of a worker's share of a list."""
    return worker * n_items // N_WORKERS, (worker + 1) * n_items // N_WORKERS


@kernel
def cross(a, b):
    """Cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def dot(a, b):
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def difference(a, b):
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def permanent(a, b, c):
    """Sum of the magnitudes of the six products in the determinant (a x b) . c."""
    return ((abs(a[1] * b[2]) + abs(a[2] * b[1])) * abs(c[0]) + (abs(a[2] * b[0]) + abs(a[0] * b[2])) * abs(c[1])
            + (abs(a[0] * b[1]) + abs(a[1] * b[0])) * abs(c[2]))


@kernel
def away_from_light(light, point):
    """Direction of the light's ray at a point, not normalised."""
    w = light[3]
    return w * point[0] - light[0], w * point[1] - light[1], w * point[2] - light[2]


@kernel
def _length(a):
    """Length of a vector."""
    return np.sqrt(dot(a, a))


@kernel
def side_plane(adjacency, light, edge, point):
    """Evaluate the plane through the light and an edge.

    Returns
    -------
    normal : positive on the right of the edge, seen from the light, when it runs upwards.
    value : the plane's function at `point`.
    terms : what the rounding error of the value is relative to.
    """
    low, high = adjacency.positions[adjacency.ends[edge, 0]], adjacency.positions[adjacency.ends[edge, 1]]
    away, along, offset = away_from_light(light, low), difference(high, low), difference(point, low)
    normal = cross(away, along)
    reach = 2.0 * _length(offset) + _length(along)
    return normal, dot(normal, offset), permanent(away, along, offset) + _length(normal) * reach


@kernel
def cap_plane(adjacency, casters, triangle, point):
    """Evaluate the plane of a triangle, turned to face the light.

    Returns
    -------
    normal : unit length, away from the light.
    value : distance of `point` behind the triangle (negative in front).
    terms : what the rounding error of the value is relative to.
    """
    a = adjacency.positions[adjacency.corners[triangle, 0]]
    b = adjacency.positions[adjacency.corners[triangle, 1]]
    c = adjacency.positions[adjacency.corners[triangle, 2]]
    u, v, offset = difference(b, a), difference(c, a), difference(point, a)
    normal = cross(u, v)
    scale = -casters.facing[triangle] / _length(normal)
    terms = permanent(u, v, offset) * abs(scale) + _length(offset) + _length(u) + _length(v)
    return (normal[0] * scale, normal[1] * scale, normal[2] * scale), dot(normal, offset) * scale, terms


@kernel
def _facing_chunk(worker, adjacency, light, casting, bias, casters):
    """Decide one worker's share of the triangles."""
    first, end = chunk(worker, len(casters.facing))
    for t in range(first, end):
        casters.facing[t], casters.shift[t] = 0, 0.0
        a = adjacency.positions[adjacency.corners[t, 0]]
        u = difference(adjacency.positions[adjacency.corners[t, 1]], a)
        v = difference(adjacency.positions[adjacency.corners[t, 2]], a)
        away = away_from_light(light, a)
        normal = cross(u, v)
        height = -dot(normal, away)
        if casting[t] and abs(height) > FACING_ERROR * permanent(u, v, away):
            shift = bias * _length(normal) / abs(height)
            if shift < LARGEST_SHIFT:
                casters.facing[t] = 1 if height > 0.0 else -1
                casters.shift[t] = shift


@kernel
def _view_chunk(worker, adjacency, light, view, casters):
    """Transform one worker's share of the positions to view space."""
    first, end = chunk(worker, len(adjacency.positions))
    for i in range(first, end):
        offset = difference(adjacency.positions[i], view.eye)
        away = away_from_light(light, adjacency.positions[i])
        casters.positions_view[i, 0], casters.away_view[i, 0] = dot(offset, view.right), dot(away, view.right)
        casters.positions_view[i, 1], casters.away_view[i, 1] = dot(offset, view.up), dot(away, view.up)
        casters.positions_view[i, 2], casters.away_view[i, 2] = dot(offset, view.forward), dot(away, view.forward)


@parallel_kernel
def _find_all_casters(adjacency, light, casting, bias, view, casters):
    for worker in prange(N_WORKERS):
        _facing_chunk(np.int64(worker), adjacency, light, casting, bias, casters)
        _view_chunk(np.int64(worker), adjacency, light, view, casters)


def find_casters(adjacency, light: NDArray[np.float64], casting: NDArray[np.bool_] | None, bias: float,
                 view) -> Casters:
    """Decide which triangles cast and how they face the light.

    Parameters
    ----------
    adjacency : EdgeAdjacency of the mesh.
    light : float64 (4,), homogeneous, world.
    casting : bool (n_triangles,), False for triangles that are left out; None if all may cast.
    bias : shadow bias, world units.
    view : VolumeView.
    """
    n_triangles, n_positions = len(adjacency.corners), len(adjacency.positions)
    casters = Casters(np.empty(n_triangles, np.int8), np.empty(n_triangles), np.empty((n_positions, 3)),
                      np.empty((n_positions, 3)))
    if casting is None:
        casting = np.ones(n_triangles, np.bool_)
    _find_all_casters(adjacency, light, casting, float(bias), view, casters)
    return casters
