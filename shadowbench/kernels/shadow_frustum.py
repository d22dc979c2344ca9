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

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.culling_planes import (
    EDGES,
    UNUSED,
    Space,
    eye_plane,
    row_in_proj,
    tolerance_growth,
    wedge_plane,
)
from shadowbench.kernels.vectors import corner, cross, dot, minus, scaled, vector

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
    triangle : int64 (n_casters,), increasing: the mesh's triangle of each frustum.
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
    """Lexicographic order of two positions."""
    if a[0] != b[0]:
        return a[0] < b[0]
    if a[1] != b[1]:
        return a[1] < b[1]
    return a[2] < b[2]


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
def _side_normal(a, b, from_light_a, from_light_b, side):
    """Outward unit normal of the plane through the light and the edge from a to b, taken in canonical order."""
    if _before(a, b):
        m, sign = cross(from_light_a, minus(b, a)), side
    else:
        m, sign = cross(from_light_b, minus(a, b)), -side
    return scaled(m, sign / np.sqrt(dot(m, m)))


@kernel
def _value_at_eye(m, a, b, vertex_a, vertex_b):
    """Value at the eye of the plane with normal m through the canonically first of two vertices."""
    return -dot(m, vertex_a if _before(a, b) else vertex_b)


@kernel
def _store_direction(directions, i, v):
    """Store a vector as a unit vector; returns its length."""
    length = np.sqrt(dot(v, v))
    scale = 1.0 / length if length > 0.0 else 0.0
    directions[i, 0], directions[i, 1], directions[i, 2] = v[0] * scale, v[1] * scale, v[2] * scale
    return length


@kernel
def _store_row(rows, first, row):
    """Store a row as float32."""
    for j in range(4):
        rows[first + j] = row[j]


@kernel
def _make_frustum(k, triangle, side, space, eye_edges, wedge_planes, directions, rows, exact_rows):
    """Write all rows of one frustum."""
    p, q, s = triangle
    vertices = minus(p, space.eye), minus(q, space.eye), minus(s, space.eye)
    rays = _from_light(p, space.light), _from_light(q, space.light), _from_light(s, space.light)
    # Cap plane: towards the light is outside
    normal = cross(minus(q, p), minus(s, p))
    normal = scaled(normal, side / np.sqrt(dot(normal, normal)))
    height = -dot(normal, vertices[0])
    # Side planes
    m0, m1, m2 = (_side_normal(p, q, rays[0], rays[1], side), _side_normal(q, s, rays[1], rays[2], side),
                  _side_normal(s, p, rays[2], rays[0], side))
    c0, c1, c2 = (_value_at_eye(m0, p, q, vertices[0], vertices[1]), _value_at_eye(m1, q, s, vertices[1], vertices[2]),
                  _value_at_eye(m2, s, p, vertices[2], vertices[0]))
    own = (_plane(m0, c0, space), _plane(m1, c1, space), _plane(m2, c2, space),
           _plane(normal, height + space.bias, space))
    first = k * ROW_SIZE
    for row in range(WEDGE_ROW):
        _store_row(rows, first + 4 * row, own[row])
        for j in range(4):
            exact_rows[k, row, j] = own[row][j]
    # Culling planes
    for row in range(WEDGE_ROW, N_ROWS):
        _store_row(rows, first + 4 * row, UNUSED)
    if eye_edges == 0 and not wedge_planes:
        return
    largest_v = largest_e = 0.0
    for i in range(3):
        largest_v = max(largest_v, _store_direction(directions, i, vertices[i]))
        largest_e = max(largest_e, _store_direction(directions, 3 + i, rays[i]))
    for i, edge in enumerate((minus(q, p), minus(s, q), minus(p, s))):
        _store_direction(directions, 6 + i, edge)
    growth = tolerance_growth(largest_v, largest_e, abs(dot(normal, rays[0])), space)
    if wedge_planes:
        sides = m2, m0, m1, m2
        for i in range(3):
            _store_row(rows, first + 4 * (WEDGE_ROW + i),
                       wedge_plane(sides[i], sides[i + 1], i, directions, vertices, largest_v, growth, space))
    outside = c0 > 0.0, c1 > 0.0, c2 > 0.0, height > 0.0, False
    row = EYE_ROW
    for edge in range(eye_edges):
        if outside[EDGES[edge, 2]] != outside[EDGES[edge, 3]] and row < N_ROWS:
            _store_row(rows, first + 4 * row, eye_plane(directions, EDGES[edge, 0], EDGES[edge, 1], growth, space))
            row += 1


@kernel
def _frusta_part(corners, sides, view, eye_edges, wedge_planes, frusta, worker):
    n = len(frusta.triangle)
    light, reach = view.light, view.reach
    space = Space(vector(view.eye), vector(view.right), vector(view.up), vector(view.forward),
                   (light[0], light[1], light[2], light[3]), view.bias, vector(reach))
    # Unit vectors: the vertices seen from the eye, the light's rays there, the edges
    directions = np.empty((9, 3))
    for k in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        t = frusta.triangle[k]
        triangle = corner(corners, t, 0), corner(corners, t, 1), corner(corners, t, 2)
        _make_frustum(k, triangle, sides[t], space, eye_edges, wedge_planes, directions, frusta.rows,
                      frusta.exact_rows)


@parallel_kernel
def _fill_frusta(corners, sides, view, eye_edges, wedge_planes, frusta):
    for worker in prange(N_WORKERS):
        _frusta_part(corners, sides, view, eye_edges, wedge_planes, frusta, worker)


def make_frusta(corners, sides, casters, view, eye_edges, wedge_planes):
    """Set up the shadow frusta of all triangles that cast.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world, finite.
    sides : int8 (n_triangles,), from `find_facing`; triangles with 0 cast nothing.
    casters : bool (n_triangles,), the triangles that may cast, or None for all.
    view : camera, light, bias and the reach of the samples.
    eye_edges : how many of `EDGES` may give planes through the eye: 0, SILHOUETTE_EDGES or OUTLINE_EDGES.
    wedge_planes : True to make the wedge planes.
    """
    casting = sides != 0 if casters is None else (sides != 0) & casters
    triangle = np.flatnonzero(casting)
    frusta = Frusta(triangle, np.empty(len(triangle) * ROW_SIZE, np.float32), np.empty((len(triangle), 4, 4)))
    _fill_frusta(corners, sides, view, eye_edges, wedge_planes, frusta)
    return frusta
