"""The planes of every triangle's shadow frustum, in the space where the tests run.

**Space.** Relative to the eye a point is ``depth (forward + x right + y up)``. In (x, y, r = 1 / depth), the space
``_proj``, a world plane ``m . (p - v)`` is still a plane: divided by the depth it reads ``a x + b y + c r + d`` with
``a = m . right``, ``b = m . up``, ``d = m . forward`` and ``c = -m . (v - eye)``, its value at the eye. There is no
near plane, and since all differences are taken from world coordinates first, a scene far from the origin loses
nothing.

**Rows.** Positive is outside. Rows 0 to 2 are the side planes through the light and an edge, 3 is the cap plane moved
back by the bias, 4 to 6 are wedge planes, 7 to 12 are planes through the eye; unused rows are -1 everywhere.
Two triangles that share an edge get exactly opposite side planes, since the edge's vertices are taken in
lexicographic order and only the sign differs (Sintorn et al. 2011, sec. 3).

**Planes through the eye.** A shadow frustum is a convex body with nine edges: three of the triangle, three rays from
its vertices away from the light, and three at infinity. Seen from the eye its outline consists of the edges between a
face that the eye is outside of and one that it is inside of, and the plane through the eye and such an edge bounds
the body. All of them are the *outline* planes; the two (at most) through rays are the *silhouette* planes of
Sintorn et al. 2011, sec. 3.5. The *wedge* planes of Sintorn et al. 2014 contain the light and a vertex.

**Why a culling plane never rejects a sample of the frustum.** A sample p of the frustum is ``v' + t e'``, v' on the
triangle (a convex combination of its vertices v, seen from the eye), e' from the light to v' (of the e) and t >= 0. Let
V and E be the largest |v| and |e|, h <= |e'| the light's distance from the triangle's plane, and suppose that a normal
m has ``m . v <= tau |v|`` and ``m . e <= tau |e|`` for every vertex. As ``t |e'| = |p - v'| <= |p| + V``, the value
over the depth is at most ``tau (V R + (l + V R) E / h)``, with R the largest 1 / depth and l the longest ray at depth
1. `_limit` picks tau so that this stays below `SLACK`, by which the scaled row is moved outwards; a plane that misses
it is left out. The same holds for a wedge plane through a vertex w with ``m . (v - w) <= tau V``.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.lanes import A_WEIGHT, B_WEIGHT, C_WEIGHT, D_WEIGHT

CAP_ROW, WEDGE_ROW, EYE_ROW, N_ROWS = 3, 4, 7, 13
"""First row of each kind of plane, and the number of rows."""

UNUSED = (0.0, 0.0, 0.0, -1.0)
"""A row that no point is outside of."""

ROW_SIZE = 4 * N_ROWS
"""float32 values per triangle."""

EDGES = np.array([[0, 3, 0, 2], [1, 4, 1, 0], [2, 5, 2, 1],
                  [0, 6, 0, 3], [1, 7, 1, 3], [2, 8, 2, 3],
                  [3, 6, 0, 4], [4, 7, 1, 4], [5, 8, 2, 4]])
"""Edges of a shadow frustum: two directions that span the plane through the eye, and the faces on either side.

Directions 0 to 2 are the vertices, 3 to 5 the light's rays there, 6 to 8 the triangle's edges: the vertices of a small
triangle are seen in directions too close for an accurate cross product. Faces 0 to 2 are the side planes (side i
joins vertices i and i + 1), 3 is the cap, 4 the face at infinity, which the eye is always inside of."""

SILHOUETTE_EDGES, OUTLINE_EDGES = 3, 9
"""How many of `EDGES` the silhouette planes and the outline planes go through."""

SLACK = 2.0**-27
"""How far culling rows are moved outwards: an eighth of the float32 error, far above float64's."""

ROUNDING = 16 * 2.0**-53
"""Bounds the float64 error of m . v for unit vectors: 3 products, 2 sums and the normalisations."""

SMALLEST_HALF = 1e-6
"""Two side planes whose outward unit normals add up to less (squared) enclose a needle: no wedge plane is made."""

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


class _Space(NamedTuple):
    """A `View` as tuples of float64."""

    eye: tuple
    right: tuple
    up: tuple
    forward: tuple
    light: tuple
    bias: float
    reach: tuple


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
def _vector(array):
    return array[0], array[1], array[2]


@kernel
def _item(array, i):
    return array[i, 0], array[i, 1], array[i, 2]


@kernel
def _corner(corners, t, i):
    return corners[t, i, 0], corners[t, i, 1], corners[t, i, 2]


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
    u, v, ray = _minus(b, a), _minus(c, a), _from_light(a, light)
    value = -_dot(_cross(u, v), ray)
    bound = ((abs(u[1] * v[2]) + abs(u[2] * v[1])) * abs(ray[0]) + (abs(u[2] * v[0]) + abs(u[0] * v[2])) * abs(ray[1])
             + (abs(u[0] * v[1]) + abs(u[1] * v[0])) * abs(ray[2])) * FACING_ERROR
    return 1 if value > bound else (-1 if value < -bound else 0)


@kernel
def _facing_part(corners, light, sides, worker):
    n = len(corners)
    for t in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        sides[t] = facing(_corner(corners, t, 0), _corner(corners, t, 1), _corner(corners, t, 2), light)


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
def _weight(a, b, c, d, reach):
    """Weighted sum of a row's magnitudes, which `lanes` asks to be 1 after scaling."""
    return (A_WEIGHT * abs(a) * reach[0] + B_WEIGHT * abs(b) * reach[1] + C_WEIGHT * abs(c) * reach[2]
            + D_WEIGHT * abs(d))


@kernel
def _in_proj(m, c, space):
    """Row (a, b, c, d) of the plane with normal m and value c at the eye, and its weight."""
    a, b, d = _dot(m, space.right), _dot(m, space.up), _dot(m, space.forward)
    return (a, b, c, d), _weight(a, b, c, d, space.reach)


@kernel
def _plane(m, c, space):
    """Scaled row of a side or cap plane: normal m pointing outwards, value c at the eye."""
    row, weight = _in_proj(m, c, space)
    scale = 1.0 / weight
    return row[0] * scale, row[1] * scale, row[2] * scale, row[3] * scale


@kernel
def _culling_plane(row, scale):
    """Scaled row of a culling plane, moved outwards by `SLACK`."""
    return row[0] * scale, row[1] * scale, row[2] * scale, row[3] * scale - SLACK


@kernel
def _side_normal(a, b, from_light_a, from_light_b, side):
    """Outward unit normal of the plane through the light and the edge from a to b, taken in canonical order."""
    if _before(a, b):
        m, sign = _cross(from_light_a, _minus(b, a)), side
    else:
        m, sign = _cross(from_light_b, _minus(a, b)), -side
    return _scaled(m, sign / np.sqrt(_dot(m, m)))


@kernel
def _value_at_eye(m, a, b, vertex_a, vertex_b):
    """Value at the eye of the plane with normal m through the canonically first of two vertices."""
    return -_dot(m, vertex_a if _before(a, b) else vertex_b)


@kernel
def _growth(largest_v, largest_e, height, space):
    """Factor of the module's text, V R + (l + V R) E / h; for a directional light all rays e are alike."""
    reach = space.reach
    longest_ray = np.sqrt(1.0 + reach[0] * reach[0] + reach[1] * reach[1])
    near = largest_v * reach[2]
    return near + (longest_ray + near) * (1.0 if space.light[3] == 0.0 else largest_e / height)


@kernel
def _limit(m, weight, growth):
    """Largest m . u that a culling plane may show for a unit vector u, less float64's rounding (m of any length)."""
    return SLACK * weight / growth - ROUNDING * (abs(m[0]) + abs(m[1]) + abs(m[2]))


@kernel
def _eye_plane(directions, g, h, growth, space):
    """Row of the plane through the eye and two directions; `UNUSED` if it does not bound the frustum."""
    m = _cross(_item(directions, g), _item(directions, h))
    low = high = 0.0
    for i in range(6):
        value = _dot(m, _item(directions, i))
        low, high = min(low, value), max(high, value)
    row, weight = _in_proj(m, 0.0, space)
    limit = _limit(m, weight, growth)
    if (high > limit and low < -limit) or not weight > 0.0:
        return UNUSED
    return _culling_plane(row, (1.0 if high <= limit else -1.0) / weight)


@kernel
def _wedge_plane(side_a, side_b, i, directions, vertices, largest_v, growth, space):
    """Row of the wedge plane of vertex i, between two side planes; `UNUSED` if it does not bound the frustum."""
    half = _sum(side_a, side_b)
    if _dot(half, half) < SMALLEST_HALF:
        return UNUSED
    # Remove what rounding left along the ray, so that the plane contains the light
    ray = _item(directions, 3 + i)
    m = _minus(half, _scaled(ray, _dot(half, ray)))
    c = -_dot(m, vertices[i])
    row, weight = _in_proj(m, c, space)
    limit = _limit(m, weight, growth)
    for j in range(3):
        if (_dot(m, _minus(vertices[j], vertices[i])) > limit * largest_v
                or _dot(m, _item(directions, 3 + j)) > limit):
            return UNUSED
    return _culling_plane(row, 1.0 / weight)


@kernel
def _store_direction(directions, i, v):
    """Store a vector as a unit vector; returns its length."""
    length = np.sqrt(_dot(v, v))
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
    vertices = _minus(p, space.eye), _minus(q, space.eye), _minus(s, space.eye)
    rays = _from_light(p, space.light), _from_light(q, space.light), _from_light(s, space.light)
    # Cap plane: towards the light is outside
    normal = _cross(_minus(q, p), _minus(s, p))
    normal = _scaled(normal, side / np.sqrt(_dot(normal, normal)))
    height = -_dot(normal, vertices[0])
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
    for i, edge in enumerate((_minus(q, p), _minus(s, q), _minus(p, s))):
        _store_direction(directions, 6 + i, edge)
    growth = _growth(largest_v, largest_e, abs(_dot(normal, rays[0])), space)
    if wedge_planes:
        sides = m2, m0, m1, m2
        for i in range(3):
            _store_row(rows, first + 4 * (WEDGE_ROW + i),
                       _wedge_plane(sides[i], sides[i + 1], i, directions, vertices, largest_v, growth, space))
    outside = c0 > 0.0, c1 > 0.0, c2 > 0.0, height > 0.0, False
    row = EYE_ROW
    for edge in range(eye_edges):
        if outside[EDGES[edge, 2]] != outside[EDGES[edge, 3]] and row < N_ROWS:
            _store_row(rows, first + 4 * row, _eye_plane(directions, EDGES[edge, 0], EDGES[edge, 1], growth, space))
            row += 1


@kernel
def _frusta_part(corners, sides, view, eye_edges, wedge_planes, frusta, worker):
    n = len(frusta.triangle)
    light, reach = view.light, view.reach
    space = _Space(_vector(view.eye), _vector(view.right), _vector(view.up), _vector(view.forward),
                   (light[0], light[1], light[2], light[3]), view.bias, _vector(reach))
    # Unit vectors: the vertices seen from the eye, the light's rays there, the edges
    directions = np.empty((9, 3))
    for k in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        t = frusta.triangle[k]
        triangle = _corner(corners, t, 0), _corner(corners, t, 1), _corner(corners, t, 2)
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
