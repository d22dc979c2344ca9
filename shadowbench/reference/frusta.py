"""Shadow frusta as plane coefficients for the fast stage, with error bounds that hold for every sample.

Coordinates are relative to an origin o: the light itself, or the middle of the samples where the light is at
infinity. A plane is ``f(C) = m . C + k`` with ``C = p - o``, scaled by a positive number (the rounded ``1 /
|m|``, written 1/l) and turned so that the inside of the frustum is positive. Since l is just some positive
number, its own rounding cannot change a sign. In the notation of `predicates`, ``P_i = M_i / l`` and P1 is
their sum:

* a coefficient m_i / l is off by ``gamma_5 P_i``;
* ``| |m| / l - 1 | <= 9 u P1``, so a distance e becomes ``e (1 ± 9 u P1)`` in scaled values (P1 >= 1 up to
  rounding).

`light_space` defines the light-space coordinates (x, y, r) and their errors.

**Point light.** ``f / z`` = m_x x + m_y y + m_z with |x|, |y| <= 1 + 2u and each computed with three
roundings. Per term 5 + 3 + 1, and three additions in the cap: ``|error| <= gamma_12 P1``. The cap adds ``k
r`` with ``k = n . (o - a)`` of nine roundings, one more for the bias, two of r, the product and the sum:
``gamma_14 sum P_i |a_i - o_i| r``. The bias b enters as ``b r``, which is off by ``(5 + 9 P1) u b r``.

**Directional light.** m . d = 0 makes ``f = m_x x + m_y y + k`` with x, y off by ``12 u S``, S being the
largest component of a C, and |x|, |y| <= 2 S: ``30 u S P1 + gamma_14 sum P_i |u_i - o_i|``. The cap's
coefficient of r takes nine roundings, with the product and the sum ``11 u S P1`` more, and the bias ``(3 + 9
P1) u b``.

The constants below are these, rounded up to leave room for the rounding of the bounds themselves. With l
above `SMALLEST_LENGTH` and P1 below `LARGEST_SUM_P`, all that underflow takes is less than `UNDERFLOW_SLACK`:
``2**-1074 / l`` from an offset, ``P1 2**-1074`` from a coordinate. Elsewhere the bounds are infinite or NaN,
so nothing is decided here.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.reference.predicates import (
    NO,
    UNIT_ROUNDOFF,
    cross_with_bound,
    triangle_facing,
)

POINT_ERROR = 16 * UNIT_ROUNDOFF
"""Error of a point light's plane value per P1; the proof needs 14 units."""
DIRECTIONAL_ERROR = 48 * UNIT_ROUNDOFF
"""Error of a directional light's plane value per unit of S P1; the proof needs 41 units."""
TIE_ERROR = 16 * UNIT_ROUNDOFF
"""Relative error of a tie distance per P1; the proof needs 9, the tie distance 3 and the margin 2 units."""
SMALLEST_LENGTH = 2.0**-460
"""Smallest |m| whose squares are far from underflow."""
LARGEST_LENGTH = 2.0**500
"""Largest |m| whose squares are far from overflow."""
LARGEST_SUM_P = 2.0**400
"""Largest P1 for which the bound of underflow holds."""
UNDERFLOW_SLACK = 2.0**-560
"""Absolute error allowance for underflow."""
N_WORKERS = 64
"""Blocks of triangles that `make_frusta` deals out."""


class Frusta(NamedTuple):
    """Planes of a batch of triangles; inside is positive, values are distances up to rounding.

    Attributes
    ----------
    facing : int8 (n,), +1 or -1: the side that faces the light; 0: casts nothing; 2: not decided yet.
    planes : float64 (n, 4, 6), the side plane of each edge, then the cap plane without bias. Columns:
        coefficients of x, y, z; constant (zero for side planes of a point light); error bound of the
        light-space value; and for a side plane the factor that widens a tie distance by its own error, for
        the cap the error bound per r.
    """

    facing: np.ndarray
    planes: np.ndarray


@kernel
def _scaled_length(m0, m1, m2):
    """Return |m|, or NaN where its squares may leave the range of float64."""
    length = np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    if SMALLEST_LENGTH < length < LARGEST_LENGTH:
        return length
    return np.nan


@kernel
def _error_bound(magnitude, sum_p):
    """Complete an error bound; infinite, so that it decides nothing, where the proof does not reach."""
    return magnitude + UNDERFLOW_SLACK if sum_p < LARGEST_SUM_P else np.inf


@kernel
def _make_side(planes, facing, corners, t, edge, light, origin, extent):
    """Fill one side plane of triangle t, turned by its facing."""
    k = edge + 1 if edge < 2 else 0
    u0, u1, u2 = corners[t, edge, 0], corners[t, edge, 1], corners[t, edge, 2]
    is_point = light[3] != 0.0
    a0, a1, a2 = -light[0], -light[1], -light[2]
    if is_point:
        a0, a1, a2 = u0 + a0, u1 + a1, u2 + a2
    m0, m1, m2, b0, b1, b2 = cross_with_bound(
        a0, a1, a2, corners[t, k, 0] - u0, corners[t, k, 1] - u1, corners[t, k, 2] - u2)
    length = _scaled_length(m0, m1, m2)
    scale = -facing / length
    planes[t, edge, 0], planes[t, edge, 1], planes[t, edge, 2] = m0 * scale, m1 * scale, m2 * scale
    sum_p = (b0 + b1 + b2) / length
    planes[t, edge, 5] = 1.0 + TIE_ERROR * sum_p
    if is_point:
        planes[t, edge, 3], planes[t, edge, 4] = 0.0, _error_bound(POINT_ERROR * sum_p, sum_p)
    else:
        c0, c1, c2 = u0 - origin[0], u1 - origin[1], u2 - origin[2]
        at_vertex = (b0 * abs(c0) + b1 * abs(c1) + b2 * abs(c2)) / length
        planes[t, edge, 3] = -(m0 * c0 + m1 * c1 + m2 * c2) * scale
        planes[t, edge, 4] = _error_bound(DIRECTIONAL_ERROR * (extent * sum_p + at_vertex), sum_p)


@kernel
def _make_cap(planes, facing, corners, t, light, origin, extent, largest_bias):
    """Fill the cap plane of triangle t, turned by its facing."""
    a0, a1, a2 = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
    m0, m1, m2, b0, b1, b2 = cross_with_bound(
        corners[t, 1, 0] - a0, corners[t, 1, 1] - a1, corners[t, 1, 2] - a2,
        corners[t, 2, 0] - a0, corners[t, 2, 1] - a1, corners[t, 2, 2] - a2)
    length = _scaled_length(m0, m1, m2)
    scale = -facing / length
    c0, c1, c2 = a0 - origin[0], a1 - origin[1], a2 - origin[2]
    planes[t, 3, 0], planes[t, 3, 1], planes[t, 3, 2] = m0 * scale, m1 * scale, m2 * scale
    planes[t, 3, 3] = -(m0 * c0 + m1 * c1 + m2 * c2) * scale
    sum_p = (b0 + b1 + b2) / length
    at_vertex = (b0 * abs(c0) + b1 * abs(c1) + b2 * abs(c2)) / length
    if light[3] != 0.0:
        planes[t, 3, 4] = _error_bound(POINT_ERROR * sum_p, sum_p)
        planes[t, 3, 5] = _error_bound(POINT_ERROR * (at_vertex + largest_bias * sum_p), sum_p)
    else:
        magnitude = extent * sum_p + at_vertex + largest_bias * sum_p
        planes[t, 3, 4], planes[t, 3, 5] = _error_bound(DIRECTIONAL_ERROR * magnitude, sum_p), 0.0


@kernel
def _find_facing(facing, corners, casters, light, block, n_blocks):
    """Decide the facing of one block of triangles; triangles that do not cast get 0."""
    n = len(facing)
    for t in range(block * n // n_blocks, (block + 1) * n // n_blocks):
        facing[t] = triangle_facing(corners, t, light) if casters[t] else NO


@parallel_kernel
def find_facing(facing, corners, casters, light):
    """Decide the facing of a batch of triangles in float64 (2 where that fails)."""
    for block in prange(N_WORKERS):
        _find_facing(facing, corners, casters, light, block, N_WORKERS)


@kernel
def _make_frusta(frusta, corners, light, origin, extent, largest_bias, block, n_blocks):
    """Fill the planes of one block of triangles."""
    planes, facing = frusta.planes, frusta.facing
    n = len(corners)
    for t in range(block * n // n_blocks, (block + 1) * n // n_blocks):
        if facing[t] != 0:
            for edge in range(3):
                _make_side(planes, facing[t], corners, t, edge, light, origin, extent)
            _make_cap(planes, facing[t], corners, t, light, origin, extent, largest_bias)


@parallel_kernel
def make_frusta(frusta, corners, light, origin, extent, largest_bias):
    """Fill the planes of a batch of triangles whose facing is settled.

    Parameters
    ----------
    frusta : `planes` is written.
    corners : float64 (n, 3, 3), world.
    light : float64 (4,), homogeneous, world.
    origin : float64 (3,), what coordinates are relative to, world.
    extent : largest |component| of a sample relative to the origin (used for directional lights).
    largest_bias : the largest bias that is tested, world units.
    """
    for block in prange(N_WORKERS):
        _make_frusta(frusta, corners, light, origin, extent, largest_bias, block, N_WORKERS)
