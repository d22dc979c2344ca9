"""What conservative rasterisation needs to know of a triangle: edges, box, projected corners and plane of depth.

A face of a light's maps (see `light_maps`) has coordinates u and v on its plane, at depth 1 or, seen in parallel, in world
units. An edge is a function ``a u + b v + c``, the triple product of a ray (u, v, 1) with two vertices, at least zero
inside: for a point light that holds for triangles that pass behind the light too, so nothing is clipped.

**Margins.** A texel must be marked if the exact test of `shadow_rays` can succeed for any sample in it. With u, W and h as
explained there, a sample that passes may have an edge value as low as -40 u |r| |e| W / h (|r| times its share of W, at
the depth h or more where the light sees the triangle), and its ray may meet the triangle's plane up to one grid unit
outside the triangle. `EDGE_SLACK` and two units around the box and before the nearest corner leave room for rounding.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel
from shadowbench.kernels.elements import get
from shadowbench.kernels.vectors import corner, cross, dot, minus

EDGE_SLACK = 64.0 * 2.0**-53
"""40 u of the module's text, and the rounding of the edge's own value (20 u |r| |e|)."""

PLANE_ROUNDING = 32.0 * 2.0**-53
"""Rounding of the plane's normal (8 u |e| |f|), of its value at a texel and of its distance from the light."""

BEHIND, UNBOUNDED, BOUNDED = 0, 1, 2
"""A triangle may lie behind the light, pass its plane (so its projection has no box) or lie before it."""

BOX, POINTS, PLANE, N_VALUES = 12, 16, 22, 29
"""Places in the scratch of `set_up`: three edges (a, b, c, slack) come first; then smallest and largest u, smallest and
largest v; u and v of the corners; the plane: normal (3), its rounding, two numbers that `nearest_depth` uses, and
the depth of the nearest corner."""


class Face(NamedTuple):
    """One face of a light's maps, as the rasteriser sees it.

    Attributes
    ----------
    right, up, forward : float64 (3,), world.
    eye : float64 (3,), centre of a parallel view, relative to the triangles' origin; zero for a point light.
    perspective : False for a directional light.
    texel : side of a texel in u and v.
    middle : the map's centre, in texels from its edge.
    side : texels along the map.
    pad : rounding of a sample's place on the map, in u and v.
    unit : grid unit of the kd-tree, world units.
    depth_pad : world distance by which depths are brought nearer.
    reach : as in `shadow_rays.ShadowRays`.
    """

    right: np.ndarray
    up: np.ndarray
    forward: np.ndarray
    eye: np.ndarray
    perspective: bool
    texel: float
    middle: float
    side: int
    pad: float
    unit: float
    depth_pad: float
    reach: float


class Values(NamedTuple):
    """The scratch of `set_up` as a record, for access without reference counts: float64 (N_VALUES,)."""

    data: np.ndarray


@kernel
def _turned(right, up, forward, v):
    """A vector along the axes of a face."""
    return (v[0] * right[0] + v[1] * right[1] + v[2] * right[2], v[0] * up[0] + v[1] * up[1] + v[2] * up[2],
            v[0] * forward[0] + v[1] * forward[1] + v[2] * forward[2])


@kernel
def set_up(corners, t, origin, face, values):
    """Fill in what a face needs to know of a triangle.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.
    t : the triangle.
    origin : float64 (3,), world: the light or the scene's centre.
    face : `Face`.
    values : float64 (N_VALUES,), written.

    Returns
    -------
    BEHIND, UNBOUNDED or BOUNDED.
    """
    right, up, forward, shift = face.right, face.up, face.forward, face.eye
    a, b, c = corner(corners, t, 0), corner(corners, t, 1), corner(corners, t, 2)
    # Vertices and edges along the face's axes; edges from the vertices' own coordinates, which loses less
    p = (_turned(right, up, forward, minus(minus(a, origin), shift)),
         _turned(right, up, forward, minus(minus(b, origin), shift)),
         _turned(right, up, forward, minus(minus(c, origin), shift)))
    e = (_turned(right, up, forward, minus(b, a)), _turned(right, up, forward, minus(c, b)),
         _turned(right, up, forward, minus(a, c)))
    nearest, farthest = min(p[0][2], p[1][2], p[2][2]), max(p[0][2], p[1][2], p[2][2])
    normal = cross(e[0], e[1])
    rounding = PLANE_ROUNDING * np.sqrt(dot(e[0], e[0]) * dot(e[1], e[1]))
    values[PLANE + 3], values[PLANE + 6] = rounding, nearest
    if face.perspective:
        if farthest < -2.0 * face.unit:
            return BEHIND
        _set_up_perspective(p, e, normal, rounding, face, values)
        if nearest <= 2.0 * face.unit:
            return UNBOUNDED
    else:
        _set_up_parallel(p, e, normal, rounding, face, values)
    # Corners on the map, and their box
    pad = 2.0 * face.unit
    if face.perspective:
        pad *= (1.0 + face.texel * face.side) / nearest
    for i in range(3):
        depth = p[i][2] if face.perspective else 1.0
        values[POINTS + 2 * i], values[POINTS + 2 * i + 1] = p[i][0] / depth, p[i][1] / depth
    for k in range(2):
        first, second, third = values[POINTS + k], values[POINTS + 2 + k], values[POINTS + 4 + k]
        values[BOX + 2 * k] = min(first, second, third) - pad
        values[BOX + 2 * k + 1] = max(first, second, third) + pad
    return BOUNDED


@kernel
def _set_up_perspective(p, e, normal, rounding, face, values):
    """Edges and plane for a point light: the plane's 1 / depth at (u, v) is its normal times (u, v, 1) over a number."""
    value = dot(normal, p[0])
    farthest = np.sqrt(max(dot(p[0], p[0]), dot(p[1], p[1]), dot(p[2], p[2])))
    distance = abs(value) - rounding * farthest
    sign = 1.0 if value > 0.0 else -1.0
    for k in range(3):
        values[PLANE + k] = sign * normal[k]
    values[PLANE + 4] = max(distance, 0.0)
    # EDGE_SLACK |r| |e| W / h, with 1 / h as the area over the distance
    growth = 0.0
    if distance > 0.0:
        growth = (EDGE_SLACK * (1.0 + face.texel * face.side) * farthest * face.reach * np.sqrt(dot(normal, normal))
                  / distance)
    for i in range(3):
        m, slack = cross(p[i], e[i]), growth * np.sqrt(dot(e[i], e[i]))
        values[4 * i], values[4 * i + 1], values[4 * i + 2], values[4 * i + 3] = sign * m[0], sign * m[1], sign * m[2], slack
        if not distance > 0.0:
            values[4 * i], values[4 * i + 1], values[4 * i + 2], values[4 * i + 3] = 0.0, 0.0, 0.0, 1.0


@kernel
def _set_up_parallel(p, e, normal, rounding, face, values):
    """Edges and plane for a directional light: the plane's depth is linear in u and v."""
    sign = 1.0 if normal[2] > 0.0 else -1.0
    for k in range(3):
        values[PLANE + k] = sign * normal[k]
    values[PLANE + 4], values[PLANE + 5] = max(abs(normal[2]) - rounding, 0.0), p[0][2]
    for i in range(3):
        a, b = -sign * e[i][1], sign * e[i][0]
        values[4 * i], values[4 * i + 1] = a, b
        values[4 * i + 2] = -(a * p[i][0] + b * p[i][1])
        values[4 * i + 3] = EDGE_SLACK * np.sqrt(dot(e[i], e[i])) * face.reach
        if not abs(normal[2]) > rounding:
            values[4 * i], values[4 * i + 1], values[4 * i + 2], values[4 * i + 3] = 0.0, 0.0, 0.0, 1.0


@kernel
def nearest_depth(perspective, values, u_low, u_high, v_low, v_high):
    """A lower bound of a triangle's depth over a rectangle of the map (values: `Values`)."""
    a, b, c = get(values, "data", PLANE), get(values, "data", PLANE + 1), get(values, "data", PLANE + 2)
    rounding = get(values, "data", PLANE + 3)
    number, nearest = get(values, "data", PLANE + 4), get(values, "data", PLANE + 6)
    if perspective:
        # Depth is smallest where 1 / depth is largest
        largest = max(a * u_low, a * u_high) + max(b * v_low, b * v_high) + c
        largest += rounding * (1.0 + max(abs(u_low), abs(u_high)) + max(abs(v_low), abs(v_high)))
        return max(number / largest, nearest) if largest > 0.0 else nearest
    if not number > 0.0:
        return nearest
    u0, v0 = get(values, "data", POINTS), get(values, "data", POINTS + 1)
    rise = (max(a * (u_low - u0), a * (u_high - u0)) + max(b * (v_low - v0), b * (v_high - v0))
            + rounding * (max(abs(u_low - u0), abs(u_high - u0)) + max(abs(v_low - v0), abs(v_high - v0))))
    # The rounding of the divisor makes a fall smaller, so a negative rise is left out
    return max(get(values, "data", PLANE + 5) - max(rise, 0.0) / number, nearest)
