"""The planes of every triangle's shadow frustum, in the space where the tests run.

**Space.** Relative to the eye a point is ``depth (forward + x right + y up)``. In (x, y, r = 1 / depth), the space
``_proj``, a world plane ``m . (p - v)`` is still a plane: divided by the depth it reads ``a x + b y + c r + d`` with
``a = m . right``, ``b = m . up``, ``d = m . forward`` and ``c = -m . (v - eye)``, its value at the eye. No near plane is
involved, and since all differences are taken from world coordinates first, a scene far from the origin loses nothing.

**Rows.** Positive is outside. Rows 0 to 2 are the side planes through the light and an edge, 3 is the cap plane moved
back by the bias, 4 to 6 are wedge planes, 7 to 12 are planes through the eye; unused rows are -1 everywhere.
Two triangles that share an edge get exactly opposite side planes, since the edge's vertices are taken in
lexicographic order and only the sign differs (Sintorn et al. 2011, sec. 3).

**Planes through the eye.** A shadow frustum is a convex body with nine edges: three of the triangle, three rays from its
vertices away from the light, and three at infinity. Seen from the eye its outline consists of the edges between a
face that the eye is outside of and one that it is inside of, and the plane through the eye and such an edge bounds
the body. All of them are the *outline* planes; the two (at most) through rays are the *silhouette* planes of
Sintorn et al. 2011, sec. 3.5. The *wedge* planes of Sintorn et al. 2014 contain the light and a vertex.

**Why a culling plane never rejects a sample of the frustum.** A sample p of the frustum is ``v' + t e'``, v' on the triangle
(a convex combination of its vertices v, seen from the eye), e' from the light to v' (of the e) and t >= 0. Let V and
E be the largest |v| and |e|, h <= |e'| the light's distance from the triangle's plane, and suppose that a unit normal m
has ``m . v <= tau V`` and ``m . e <= tau |e|`` for every vertex. As ``t |e'| = |p - v'| <= |p| + V``, the value over the depth is at
most ``tau (V R + (l + V R) E / h)``, with R the largest 1 / depth and l the longest ray at depth 1. `_tolerance` picks
tau so that this stays below `SLACK`, by which the row is moved outwards; a plane that misses it is left out. The
same holds for a wedge plane through a vertex w with ``m . (v - w) <= tau V``.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.lanes import A_WEIGHT, B_WEIGHT, C_WEIGHT, D_WEIGHT

CAP_ROW, WEDGE_ROW, EYE_ROW, N_ROWS = 3, 4, 7, 13
"""First row of each kind of plane, and the number of rows."""

ROW_SIZE = 4 * N_ROWS
"""float32 values per triangle."""

NO_EYE_PLANES, SILHOUETTE_PLANES, OUTLINE_PLANES = 0, 1, 2
"""Which planes through the eye are made."""

SLACK = 2.0**-27
"""How far culling rows are moved outwards: an eighth of the float32 error, far above float64's."""

ROUNDING = 16 * 2.0**-53
"""Bounds the float64 error of m . v / |v| for unit vectors: 3 products, 2 sums and the normalisations."""

LARGEST_TOLERANCE = 1e-9
"""Upper limit of tau: enough for degenerate views; larger ones would turn planes visibly."""

SMALLEST_SINE = 1e-9
"""Two edges' directions closer than this define no plane: the cross product has lost half its digits."""

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
def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def _scaled(a, s):
    return a[0] * s, a[1] * s, a[2] * s


@kernel
def _sum(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def _unit(a):
    """Scale to length 1; a zero vector stays zero."""
    length = np.sqrt(_dot(a, a))
    return _scaled(a, 1.0 / length) if length > 0.0 else a


@kernel
def _vector(array):
    return array[0], array[1], array[2]


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
    u, v, l = _minus(b, a), _minus(c, a), _from_light(a, light)
    value = -_dot(_cross(u, v), l)
    bound = ((abs(u[1] * v[2]) + abs(u[2] * v[1])) * abs(l[0]) + (abs(u[2] * v[0]) + abs(u[0] * v[2])) * abs(l[1])
             + (abs(u[0] * v[1]) + abs(u[1] * v[0])) * abs(l[2])) * FACING_ERROR
    return 1 if value > bound else (-1 if value < -bound else 0)


@kernel
def _facing_part(corners, light, sides, worker):
    n = len(corners)
    for t in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        sides[t] = facing(_vector(corners[t, 0]), _vector(corners[t, 1]), _vector(corners[t, 2]), light)


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
def _scale(a, b, c, d, reach):
    """Factor that makes the weighted sum of a row's magnitudes 1 (see `lanes`)."""
    weighted = (A_WEIGHT * abs(a) * reach[0] + B_WEIGHT * abs(b) * reach[1] + C_WEIGHT * abs(c) * reach[2]
                + D_WEIGHT * abs(d))
    return 1.0 / weighted if weighted > 0.0 else 0.0


@kernel
def _set_row(rows, first, a, b, c, d):
    rows[first], rows[first + 1], rows[first + 2], rows[first + 3] = a, b, c, d


@kernel
def _set_plane(frusta, k, row, m, c, view):
    """Write a side or cap row: normal m pointing outwards, value c at the eye."""
    a, b, d = _dot(m, view.right), _dot(m, view.up), _dot(m, view.forward)
    scale = _scale(a, b, c, d, view.reach)
    exact = frusta.exact_rows
    exact[k, row, 0], exact[k, row, 1], exact[k, row, 2], exact[k, row, 3] = a * scale, b * scale, c * scale, d * scale
    _set_row(frusta.rows, k * ROW_SIZE + 4 * row, a * scale, b * scale, c * scale, d * scale)


@kernel
def _set_culling_plane(frusta, k, row, m, c, view):
    """Write a culling row, moved outwards by `SLACK`."""
    a, b, d = _dot(m, view.right), _dot(m, view.up), _dot(m, view.forward)
    scale = _scale(a, b, c, d, view.reach)
    _set_row(frusta.rows, k * ROW_SIZE + 4 * row, a * scale, b * scale, c * scale, d * scale - SLACK)


@kernel
def _side_plane(a, b, rays, i, j, side):
    """Unit normal of the plane through the light and the edge from vertex i at a to vertex j at b, and its anchor.

    The edge is taken in canonical order; the sign makes outside positive. Returns (normal, True if i comes first).
    """
    if _before(a, b):
        m, sign = _cross(rays[i], _minus(b, a)), side
    else:
        m, sign = _cross(rays[j], _minus(a, b)), -side
    return _scaled(m, sign / np.sqrt(_dot(m, m)))


@kernel
def _tolerance(vertices, rays, normal, view):
    """Return V and tau of the module's text; tau includes the row's scale, and is negative if no plane qualifies."""
    reach = view.reach
    largest_v = np.sqrt(max(_dot(vertices[0], vertices[0]), _dot(vertices[1], vertices[1]),
                            _dot(vertices[2], vertices[2])))
    largest_e = np.sqrt(max(_dot(rays[0], rays[0]), _dot(rays[1], rays[1]), _dot(rays[2], rays[2])))
    height = abs(_dot(normal, rays[0])) if view.light[3] != 0.0 else largest_e
    longest_ray = np.sqrt(1.0 + reach[0] * reach[0] + reach[1] * reach[1])
    near = largest_v * reach[2]
    growth = near + (longest_ray + near) * largest_e / height
    return largest_v, SLACK / growth


@kernel
def _widest(m, units, offsets):
    """Smallest and largest m . v over two triples of vectors."""
    p, q, r = _dot(m, units[0]), _dot(m, units[1]), _dot(m, units[2])
    s, t, u = _dot(m, offsets[0]), _dot(m, offsets[1]), _dot(m, offsets[2])
    return min(p, q, r, s, t, u), max(p, q, r, s, t, u)


@kernel
def _add_eye_plane(frusta, k, n_planes, g, h, unit_v, unit_e, tau, view):
    """Add the plane through the eye and the directions g and h if the frustum lies on one side; return the number."""
    m = _cross(g, h)
    length = np.sqrt(_dot(m, m))
    if length < SMALLEST_SINE or n_planes == N_ROWS - EYE_ROW:
        return n_planes
    m = _scaled(m, 1.0 / length)
    low, high = _widest(m, unit_v, unit_e)
    # The row will be scaled, and the tolerance with it
    limit = min(tau / _scale(_dot(m, view.right), _dot(m, view.up), 0.0, _dot(m, view.forward), view.reach),
                LARGEST_TOLERANCE) - ROUNDING
    if high > limit:
        if low < -limit:
            return n_planes
        m = _scaled(m, -1.0)
    _set_culling_plane(frusta, k, EYE_ROW + n_planes, m, 0.0, view)
    return n_planes + 1


@kernel
def _eye_planes(frusta, k, kind, vertices, rays, outside, tau, view):
    """Write the outline planes, or only the silhouette planes.

    `outside` tells for the side plane of each edge (i, i + 1) and for the cap plane whether the eye is outside.
    """
    unit_v = _unit(vertices[0]), _unit(vertices[1]), _unit(vertices[2])
    unit_e = _unit(rays[0]), _unit(rays[1]), _unit(rays[2])
    n_planes = 0
    for i in range(3):
        j, previous = (i + 1) % 3, (i + 2) % 3
        if outside[i] != outside[previous]:
            n_planes = _add_eye_plane(frusta, k, n_planes, unit_v[i], unit_e[i], unit_v, unit_e, tau, view)
        if kind == OUTLINE_PLANES:
            if outside[i] != outside[3]:
                n_planes = _add_eye_plane(frusta, k, n_planes, unit_v[i], unit_v[j], unit_v, unit_e, tau, view)
            if outside[i]:
                n_planes = _add_eye_plane(frusta, k, n_planes, unit_e[i], unit_e[j], unit_v, unit_e, tau, view)


@kernel
def _wedge_planes(frusta, k, sides, vertices, rays, largest_v, tau, view):
    """Write the wedge plane of every vertex where it bounds the frustum (Sintorn et al. 2014, sec. 3)."""
    unit_e = _unit(rays[0]), _unit(rays[1]), _unit(rays[2])
    for i in range(3):
        half = _unit(_sum(sides[i], sides[(i + 2) % 3]))
        # Remove what rounding left along the ray, so that the plane contains the light
        m = _minus(half, _scaled(unit_e[i], _dot(half, unit_e[i])))
        length = np.sqrt(_dot(m, m))
        if not length > 0.5:
            continue
        m = _scaled(m, 1.0 / length)
        at = vertices[i]
        s = 1.0 / largest_v
        offsets = (_scaled(_minus(vertices[0], at), s), _scaled(_minus(vertices[1], at), s),
                   _scaled(_minus(vertices[2], at), s))
        c = -_dot(m, at)
        limit = tau / _scale(_dot(m, view.right), _dot(m, view.up), c, _dot(m, view.forward), view.reach)
        if _widest(m, unit_e, offsets)[1] <= min(limit, LARGEST_TOLERANCE) - ROUNDING:
            _set_culling_plane(frusta, k, WEDGE_ROW + i, m, c, view)


@kernel
def _make_frustum(k, corners, side, view, eye_planes, wedge_planes, frusta):
    """Write all rows of one frustum."""
    t = frusta.triangle[k]
    p = _vector(corners[t, 0]), _vector(corners[t, 1]), _vector(corners[t, 2])
    vertices = _minus(p[0], view.eye), _minus(p[1], view.eye), _minus(p[2], view.eye)
    rays = _from_light(p[0], view.light), _from_light(p[1], view.light), _from_light(p[2], view.light)
    # Cap plane: towards the light is outside
    normal = _cross(_minus(p[1], p[0]), _minus(p[2], p[0]))
    normal = _scaled(normal, side / np.sqrt(_dot(normal, normal)))
    height = -_dot(normal, vertices[0])
    _set_plane(frusta, k, CAP_ROW, normal, height + view.bias, view)
    # Side planes, anchored at the edge's first vertex in canonical order
    s0 = _side_plane(p[0], p[1], rays, 0, 1, side)
    s1 = _side_plane(p[1], p[2], rays, 1, 2, side)
    s2 = _side_plane(p[2], p[0], rays, 2, 0, side)
    c0 = -_dot(s0, vertices[0] if _before(p[0], p[1]) else vertices[1])
    c1 = -_dot(s1, vertices[1] if _before(p[1], p[2]) else vertices[2])
    c2 = -_dot(s2, vertices[2] if _before(p[2], p[0]) else vertices[0])
    _set_plane(frusta, k, 0, s0, c0, view)
    _set_plane(frusta, k, 1, s1, c1, view)
    _set_plane(frusta, k, 2, s2, c2, view)
    # Culling planes
    for row in range(WEDGE_ROW, N_ROWS):
        _set_row(frusta.rows, k * ROW_SIZE + 4 * row, 0.0, 0.0, 0.0, -1.0)
    largest_v, tau = _tolerance(vertices, rays, normal, view)
    if wedge_planes:
        _wedge_planes(frusta, k, (s0, s1, s2), vertices, rays, largest_v, tau, view)
    if eye_planes != NO_EYE_PLANES:
        outside = c0 > 0.0, c1 > 0.0, c2 > 0.0, height > 0.0
        _eye_planes(frusta, k, eye_planes, vertices, rays, outside, tau, view)


@kernel
def _frusta_part(corners, sides, view, eye_planes, wedge_planes, frusta, worker):
    n = len(frusta.triangle)
    for k in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        _make_frustum(k, corners, sides[frusta.triangle[k]], view, eye_planes, wedge_planes, frusta)


@parallel_kernel
def _fill_frusta(corners, sides, view, eye_planes, wedge_planes, frusta):
    for worker in prange(N_WORKERS):
        _frusta_part(corners, sides, view, eye_planes, wedge_planes, frusta, worker)


def make_frusta(corners, sides, casters, view, eye_planes, wedge_planes):
    """Set up the shadow frusta of all triangles that cast.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world, finite.
    sides : int8 (n_triangles,), from `find_facing`; triangles with 0 cast nothing.
    casters : bool (n_triangles,), the triangles that may cast, or None for all.
    view : camera, light, bias and the reach of the samples.
    eye_planes : NO_EYE_PLANES, SILHOUETTE_PLANES or OUTLINE_PLANES.
    wedge_planes : True to make the wedge planes.
    """
    casting = sides != 0 if casters is None else (sides != 0) & casters
    triangle = np.flatnonzero(casting)
    frusta = Frusta(triangle, np.empty(len(triangle) * ROW_SIZE, np.float32), np.empty((len(triangle), 4, 4)))
    _fill_frusta(corners, sides, view, eye_planes, wedge_planes, frusta)
    return frusta
