"""The planes of every triangle's shadow frustum, in the space where the tests run.

**Space.** Relative to the eye a point is ``depth (forward + x right + y up)``. In (x, y, r = 1 / depth), the space
``_proj``, a world plane ``m . (p - v)`` is still a plane: divided by the depth it reads ``a x + b y + c r + d`` with
``a = m . right``, ``b = m . up``, ``d = m . forward`` and ``c = -m . (v - eye)``, its value at the eye. There is no
near plane, and since all differences are taken from world coordinates first, a scene far from the origin loses
nothing.

**Rows.** Positive is outside. Rows 0 to 2 are the side planes through the light and an edge, 3 is the cap plane moved
back by the bias, 4 to 6 are wedge planes, 7 to 12 are planes through the eye (see `culling_planes`); unused rows are -1
everywhere.
Two triangles that share an edge get exactly opposite side planes, since the edge's vertices are taken in
lexicographic order and only the sign differs (Sintorn et al. 2011, sec. 3).
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.culling_planes import (
    EDGES,
    OUTLINE_EDGES,
    UNUSED,
    Space,
    row_in_proj,
    tolerance_growth,
    wedge_plane,
)
from shadowbench.kernels.eye_planes import store_eye_planes
from shadowbench.kernels.vectors import corner, cross, dot, minus, scaled, store_row, vector

CAP_ROW, WEDGE_ROW, EYE_ROW, N_ROWS = 3, 4, 7, 13
"""First row of each kind of plane, and the number of rows."""

ROW_SIZE = 4 * N_ROWS
"""float32 values per triangle."""

FACING_ERROR = (7.0 + 56.0 * 2.0**-53) * 2.0**-53
"""Relative error of a rounded 3 x 3 determinant (Shewchuk 1997, o3derrboundA), with w = 0 or 1."""

N_WORKERS = 64
"""Parts that the triangles are cut into."""


class Frusta(NamedTuple):
    """Plane rows of the casting triangles.

    Attributes
    ----------
    triangle : int64 (n_casters,): the mesh's triangle of each frustum.
    rows : float32 (n_casters * ROW_SIZE,), rows (a, b, c, d) in proj space, scaled as `lanes` asks.
    exact_rows : float64 (n_casters, 4, 4), side and cap rows before rounding to float32.
    """

    triangle: np.ndarray
    rows: np.ndarray
    exact_rows: np.ndarray


class View(NamedTuple):
    """What the planes depend on besides the triangle.

    Attributes
    ----------
    eye, right, up, forward : float64 (3,), world: the camera.
    light : float64 (4,), homogeneous, world.
    bias : world distance that the cap plane is moved away from the light.
    reach : float64 (3,), largest |x|, |y| and r of a sample in proj space.
    """

    eye: np.ndarray
    right: np.ndarray
    up: np.ndarray
    forward: np.ndarray
    light: np.ndarray
    bias: float
    reach: np.ndarray


@kernel
def _from_light(v, light):
    """Direction in which the light travels at v: from a point light to v, or along a directional light's rays."""
    w = light[3]
    return w * v[0] - light[0], w * v[1] - light[1], w * v[2] - light[2]


@kernel
def _before(a, b):
    """Lexicographic order of two positions, without branches: which comes first can't be predicted."""
    return (a[0] < b[0]) | ((a[0] == b[0]) & ((a[1] < b[1]) | ((a[1] == b[1]) & (a[2] < b[2]))))


@kernel
def _choose(condition, a, b):
    """One vector or the other, without a branch."""
    return a[0] if condition else b[0], a[1] if condition else b[1], a[2] if condition else b[2]


@kernel
def facing(a, b, c, light):
    """Side of triangle (a, b, c) that a light sees.

    Returns
    -------
    1 for the side from which the vertices run counter-clockwise, -1 for the other, 0 if the triangle has no area or
    the light lies in its plane, as far as float64 can tell (what it shadows is then thinner than rounding).
    """
    u, v, ray = minus(b, a), minus(c, a), _from_light(a, light)
    value = -dot(cross(u, v), ray)
    bound = ((abs(u[1] * v[2]) + abs(u[2] * v[1])) * abs(ray[0]) + (abs(u[2] * v[0]) + abs(u[0] * v[2])) * abs(ray[1])
             + (abs(u[0] * v[1]) + abs(u[1] * v[0])) * abs(ray[2])) * FACING_ERROR
    return 1 if value > bound else (-1 if value < -bound else 0)


@kernel
def _facing_part(corners, light, sides, worker):
    n = len(corners)
    for t in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        sides[t] = facing(corner(corners, t, 0), corner(corners, t, 1), corner(corners, t, 2), light)


@parallel_kernel
def find_facing(corners, light, sides):
    """Write the `facing` of every triangle.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.
    light : float64 (4,), homogeneous, world.
    sides : int8 (n_triangles,), written.
    """
    for worker in prange(N_WORKERS):
        _facing_part(corners, light, sides, worker)


@kernel
def _plane(m, c, space):
    """Scaled row of a side or cap plane: normal m pointing outwards, value c at the eye."""
    row, weight = row_in_proj(m, c, space)
    scale = 1.0 / weight
    return row[0] * scale, row[1] * scale, row[2] * scale, row[3] * scale


@kernel
def _side_plane(a, b, ray_a, ray_b, vertex_a, vertex_b, side):
    """Outward unit normal of the plane through the light and the edge from a to b, and the plane's value at the eye.

    The edge is taken in canonical order: only the sign differs between two triangles that share it.
    """
    before = _before(a, b)
    start = _choose(before, a, b)
    m = cross(_choose(before, ray_a, ray_b), minus(_choose(before, b, a), start))
    m = scaled(m, (side if before else -side) / np.sqrt(dot(m, m)))
    return m, -dot(m, _choose(before, vertex_a, vertex_b))


@kernel
def _unit(v):
    """A vector made a unit vector (zero stays zero), and its length."""
    length = np.sqrt(dot(v, v))
    return scaled(v, 1.0 / length if length > 0.0 else 0.0), length


@allocating_kernel
def _frusta_part(corners, sides, view, eye_edges, wedge_planes, frusta, worker):
    """Write the rows of a share of the frusta.

    Arrays are read and written here alone, through intrinsics: a function takes a reference count for each of its own.
    """
    n, light, triangles, rows, exact_rows = len(frusta.triangle), view.light, frusta.triangle, frusta.rows, frusta.exact_rows
    space = Space(vector(view.eye), vector(view.right), vector(view.up), vector(view.forward),
                  (light[0], light[1], light[2], light[3]), view.bias, vector(view.reach))
    directions = np.zeros((9, 3))
    starts, alongs = np.zeros(OUTLINE_EDGES + 1, np.int64), np.zeros(OUTLINE_EDGES + 1, np.int64)
    for k in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        t, first = triangles[k], k * N_ROWS
        side, p, q, s = sides[t], corner(corners, t, 0), corner(corners, t, 1), corner(corners, t, 2)
        vertices = minus(p, space.eye), minus(q, space.eye), minus(s, space.eye)
        rays = _from_light(p, space.light), _from_light(q, space.light), _from_light(s, space.light)
        # Side planes and cap plane: towards the light is outside
        m0, c0 = _side_plane(p, q, rays[0], rays[1], vertices[0], vertices[1], side)
        m1, c1 = _side_plane(q, s, rays[1], rays[2], vertices[1], vertices[2], side)
        m2, c2 = _side_plane(s, p, rays[2], rays[0], vertices[2], vertices[0], side)
        normal = cross(minus(q, p), minus(s, p))
        normal = scaled(normal, side / np.sqrt(dot(normal, normal)))
        height = -dot(normal, vertices[0])
        own = (_plane(m0, c0, space), _plane(m1, c1, space), _plane(m2, c2, space),
               _plane(normal, height + space.bias, space))
        for row in range(WEDGE_ROW):
            store_row(rows, first + row, own[row])
            store_row(exact_rows, 4 * k + row, own[row])
        # Culling planes
        for row in range(WEDGE_ROW, N_ROWS):
            store_row(rows, first + row, UNUSED)
        if eye_edges == 0 and not wedge_planes:
            continue
        (v0, length0), (v1, length1), (v2, length2) = _unit(vertices[0]), _unit(vertices[1]), _unit(vertices[2])
        (e0, reach0), (e1, reach1), (e2, reach2) = _unit(rays[0]), _unit(rays[1]), _unit(rays[2])
        largest_v, largest_e = max(length0, length1, length2), max(reach0, reach1, reach2)
        growth = tolerance_growth(largest_v, largest_e, abs(dot(normal, rays[0])), space)
        if wedge_planes:
            for i in range(3):
                store_row(rows, first + WEDGE_ROW + i, wedge_plane((m2, m0, m1)[i], (m0, m1, m2)[i], i, (e0, e1, e2),
                                                                   vertices, largest_v, growth, space))
        if eye_edges == 0:
            continue
        for i, direction in enumerate((v0, v1, v2, e0, e1, e2)):
            store_row(directions, i, direction)
        for i, edge in enumerate((minus(q, p), minus(s, q), minus(p, s))):
            store_row(directions, 6 + i, _unit(edge)[0])
        # Edges between a face that the eye is outside of and one that it is inside of
        faces = np.int64(c0 > 0.0) | np.int64(c1 > 0.0) << 1 | np.int64(c2 > 0.0) << 2 | np.int64(height > 0.0) << 3
        n_chosen = 0
        for edge in range(eye_edges):
            starts[n_chosen], alongs[n_chosen] = EDGES[edge, 0], EDGES[edge, 1]
            n_chosen += (faces >> EDGES[edge, 2] ^ faces >> EDGES[edge, 3]) & 1
        store_eye_planes(rows, first + EYE_ROW, directions, starts, alongs, n_chosen, 6, growth,
                         (space.right, space.up, space.forward), space.reach)


@parallel_kernel
def _fill_frusta(corners, sides, view, eye_edges, wedge_planes, frusta):
    for worker in prange(N_WORKERS):
        _frusta_part(corners, sides, view, eye_edges, wedge_planes, frusta, worker)


def casting_triangles(sides, casters):
    """Triangles that cast: int64 (n_casters,), increasing.

    Parameters
    ----------
    sides : int8 (n_triangles,), from `find_facing`; triangles with 0 cast nothing.
    casters : bool (n_triangles,), the triangles that may cast, or None for all.
    """
    return np.flatnonzero(sides != 0 if casters is None else (sides != 0) & casters)


def make_frusta(corners, sides, triangles, view, eye_edges, wedge_planes):
    """Set up the shadow frusta of the triangles that cast.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world, finite.
    sides : int8 (n_triangles,), from `find_facing`.
    triangles : int64 (n_casters,), those that cast, in the order that the frusta shall have.
    view : camera, light, bias and the reach of the samples.
    eye_edges : how many of `EDGES` may give planes through the eye: 0, SILHOUETTE_EDGES or OUTLINE_EDGES.
    wedge_planes : True to make the wedge planes.
    """
    frusta = Frusta(triangles, np.empty(len(triangles) * ROW_SIZE, np.float32), np.empty((len(triangles), 4, 4)))
    _fill_frusta(corners, sides, view, eye_edges, wedge_planes, frusta)
    return frusta


@kernel
def inside_in_float64(rows, k, x, y, r):
    """Tell whether a sample is in a frustum: on or inside the side planes, strictly inside the cap plane.

    Parameters
    ----------
    rows : float64 (n_frusta, 4, 4), `Frusta.exact_rows`; k : which frustum.
    x, y, r : float64, the sample in proj space.
    """
    for row in range(CAP_ROW):
        if rows[k, row, 0] * x + (rows[k, row, 1] * y + rows[k, row, 3]) + rows[k, row, 2] * r > 0.0:
            return False
    return (rows[k, CAP_ROW, 0] * x + (rows[k, CAP_ROW, 1] * y + rows[k, CAP_ROW, 3])
            + rows[k, CAP_ROW, 2] * r) < 0.0
