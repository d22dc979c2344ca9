"""Culling planes: planes beyond a shadow frustum's own that tiles are tested against, in proj space.

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

from shadowbench.jit import kernel
from shadowbench.kernels.lanes import A_WEIGHT, B_WEIGHT, C_WEIGHT, D_WEIGHT
from shadowbench.kernels.vectors import add, dot, minus, scaled

UNUSED = (0.0, 0.0, 0.0, -1.0)
"""A row that no point is outside of."""

EDGES = np.array([[0, 3, 0, 2], [1, 4, 1, 0], [2, 5, 2, 1],
                  [0, 6, 0, 3], [1, 7, 1, 3], [2, 8, 2, 3],
                  [3, 6, 0, 4], [4, 7, 1, 4], [5, 8, 2, 4]])
"""Edges of a shadow frustum: two directions that span the plane through the eye, and the faces on either side.

Directions 0 to 2 are the vertices, 3 to 5 the light's rays there, 6 to 8 the triangle's edges: the vertices of a small
triangle are seen in directions too close for an accurate cross product. Faces 0 to 2 are the side planes (side i
joins vertices i and i + 1), 3 is the cap, 4 the face at infinity, which the eye is always inside of."""

SILHOUETTE_EDGES, OUTLINE_EDGES = 3, 9
"""How many of `EDGES` the silhouette planes and the outline planes go through."""

EYE_EDGES = {"none": 0, "silhouette": SILHOUETTE_EDGES, "wedge": 0,
             "outline": OUTLINE_EDGES, "outline+wedge": OUTLINE_EDGES}
"""Edges of the frustum that may give a plane through the eye, for each choice of culling planes."""

SLACK = 2.0**-27
"""How far culling rows are moved outwards: an eighth of the float32 error, far above float64's."""

ROUNDING = 16 * 2.0**-53
"""Bounds the float64 error of m . v for unit vectors: 3 products, 2 sums and the normalisations."""

SMALLEST_HALF = 1e-6
"""Two side planes whose outward unit normals add up to less (squared) enclose a needle: no wedge plane is made."""


class Space(NamedTuple):
    """Camera, light, bias and reach of the samples, as in `shadow_frustum.View`, as tuples of float64."""

    eye: tuple
    right: tuple
    up: tuple
    forward: tuple
    light: tuple
    bias: float
    reach: tuple


@kernel
def weight_of(a, b, c, d, reach):
    """Weighted sum of a row's magnitudes, which `lanes` asks to be 1 after scaling."""
    return (A_WEIGHT * abs(a) * reach[0] + B_WEIGHT * abs(b) * reach[1] + C_WEIGHT * abs(c) * reach[2]
            + D_WEIGHT * abs(d))


@kernel
def row_in_proj(m, c, space):
    """Row (a, b, c, d) of the plane with normal m and value c at the eye, and its weight."""
    a, b, d = dot(m, space.right), dot(m, space.up), dot(m, space.forward)
    return (a, b, c, d), weight_of(a, b, c, d, space.reach)


@kernel
def _culling_plane(row, scale):
    """Scaled row of a culling plane, moved outwards by `SLACK`."""
    return row[0] * scale, row[1] * scale, row[2] * scale, row[3] * scale - SLACK


@kernel
def tolerance_growth(largest_v, largest_e, height, space):
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
def wedge_plane(side_a, side_b, i, rays, vertices, largest_v, growth, space):
    """Row of the wedge plane of vertex i, between two side planes; `UNUSED` if it does not bound the frustum.

    Parameters
    ----------
    rays : unit vectors of the light's rays at the vertices; vertices : relative to the eye, the longest `largest_v`.
    """
    half = add(side_a, side_b)
    if dot(half, half) < SMALLEST_HALF:
        return UNUSED
    # Remove what rounding left along the ray, so that the plane contains the light
    ray = rays[i]
    m = minus(half, scaled(ray, dot(half, ray)))
    c = -dot(m, vertices[i])
    row, weight = row_in_proj(m, c, space)
    limit = _limit(m, weight, growth)
    for j in range(3):
        if (dot(m, minus(vertices[j], vertices[i])) > limit * largest_v
                or dot(m, rays[j]) > limit):
            return UNUSED
    return _culling_plane(row, 1.0 / weight)
