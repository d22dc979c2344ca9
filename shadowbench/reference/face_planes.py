"""One frustum in the light-space coordinates of one face, as plain numbers, and the tests against it.

Kernels keep these numbers in registers: passing arrays around in the inner loops would count references, which
threads then fight over.

**Triangle box.** Lines alone separate badly where a frustum is a sliver, so a box around the frustum's cross-section
rejects nodes too. Where all three vertices lie in front of the face, the cross-section is the triangle of their
light-space positions; moved outwards by a margin e it is a triangle whose corner between the lines i and j shifts by
``(B_i - B_j, A_j - A_i) e / (A_i B_j - A_j B_i)`` at most, in the sense of ``|B_i| + |B_j|``. The coefficients are off by
less than ``w - 1`` each, w being the tie factor. Where the determinant exceeds ``8 (w_i - 1 + w_j - 1)`` the computed quotient
is within a factor of three; four of it is a bound. The quotient is at least 1, because |A|, |B| <= 1, so it also carries
the error of a sample's coordinate, which is less than the error bound of the lines. Where a vertex lies behind the
face, or a determinant is too small, the box is infinite.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel
from shadowbench.reference.predicates import UNIT_ROUNDOFF

REJECT, REFINE, ACCEPT = 0, 1, 2
"""Answers of a test: no sample gets any flag; undecided; every sample gets all flags."""

VERTEX_ERROR = 16 * UNIT_ROUNDOFF
"""Error of a vertex in light space per unit of its magnitude: 3 units for a point light, 12 for a directional one."""
SLOPE_MARGIN = 4.0
"""Makes the computed shift of a corner a bound."""
DETERMINANT_MARGIN = 8.0
"""How far a determinant must exceed the error of its coefficients."""


class FacePlanes(NamedTuple):
    """Planes of one frustum on one face: x X + y Y + k (+ r R) is positive inside.

    Attributes
    ----------
    x0, y0, k0, error0, tie0 : side plane of the first edge, its error bound and tie factor; 1 and 2 likewise.
    cap_x, cap_y : cap plane.
    k_floor, r_floor, k_doubled, r_doubled : the rest of it, moved by the rounding floor and by twice the bias.
    cap_error, cap_error_r : its error bound, constant and factor of r.
    """

    x0: float
    y0: float
    k0: float
    error0: float
    tie0: float
    x1: float
    y1: float
    k1: float
    error1: float
    tie1: float
    x2: float
    y2: float
    k2: float
    error2: float
    tie2: float
    cap_x: float
    cap_y: float
    k_floor: float
    r_floor: float
    k_doubled: float
    r_doubled: float
    cap_error: float
    cap_error_r: float


class TriangleBox(NamedTuple):
    """Bounds of a frustum's cross-section, to be widened by slope times margin.

    Attributes
    ----------
    low_x, high_x, low_y, high_y : light-space coordinates.
    slope_x, slope_y : growth of the box per unit of margin.
    error, tie : largest error bound and tie factor of the three lines: margin = error + tie * e.
    """

    low_x: float
    high_x: float
    low_y: float
    high_y: float
    slope_x: float
    slope_y: float
    error: float
    tie: float


@kernel
def _line(frusta, t, k, face, is_point):
    """Side plane k of triangle t on a face."""
    i0 = face // 2
    z = -frusta.side[t, k, i0] if face % 2 == 1 else frusta.side[t, k, i0]
    constant = z if is_point else frusta.side_offset[t, k]
    return (frusta.side[t, k, (i0 + 1) % 3], frusta.side[t, k, (i0 + 2) % 3], constant, frusta.side_error[t, k],
            frusta.tie_factor[t, k])


@kernel
def face_planes(frusta, t, space, face, biases):
    """Express triangle t's frustum in the coordinates of one face.

    Parameters
    ----------
    frusta, space : records.
    t, face : triangle, and face as in `light_tree`.
    biases : float64 (3,), rounding floor, bias, twice the bias; world units.
    """
    is_point = space.light[3] != 0.0
    x0, y0, k0, error0, tie0 = _line(frusta, t, 0, face, is_point)
    x1, y1, k1, error1, tie1 = _line(frusta, t, 1, face, is_point)
    x2, y2, k2, error2, tie2 = _line(frusta, t, 2, face, is_point)
    i0 = face // 2
    x, y = frusta.cap[t, (i0 + 1) % 3], frusta.cap[t, (i0 + 2) % 3]
    z = -frusta.cap[t, i0] if face % 2 == 1 else frusta.cap[t, i0]
    offset = frusta.cap_offset[t]
    if is_point:
        k_floor, r_floor, k_doubled, r_doubled = z, offset - biases[0], z, offset - biases[2]
    else:
        r = z + x * space.shear[0] + y * space.shear[1]
        k_floor, r_floor, k_doubled, r_doubled = offset - biases[0], r, offset - biases[2], r
    return FacePlanes(x0, y0, k0, error0, tie0, x1, y1, k1, error1, tie1, x2, y2, k2, error2, tie2, x, y, k_floor,
                      r_floor, k_doubled, r_doubled, frusta.cap_error[t, 0], frusta.cap_error[t, 1])


@kernel
def _vertex(corners, t, k, space, face):
    """Light-space x and y of a vertex, and their error bounds; NaN where the vertex is not in front of the face."""
    i0 = face // 2
    i1, i2 = (i0 + 1) % 3, (i0 + 2) % 3
    z, c1, c2 = (corners[t, k, i0] - space.origin[i0], corners[t, k, i1] - space.origin[i1],
                 corners[t, k, i2] - space.origin[i2])
    if face % 2 == 1:
        z = -z
    if space.light[3] != 0.0:
        if not z > 0.0:
            return np.nan, np.nan, np.nan, np.nan
        x, y = c1 / z, c2 / z
        return x, y, VERTEX_ERROR * abs(x), VERTEX_ERROR * abs(y)
    error = VERTEX_ERROR * (abs(c1) + abs(c2) + abs(z))
    return c1 - z * space.shear[0], c2 - z * space.shear[1], error, error


@kernel
def _slopes(xi, yi, tie_i, xj, yj, tie_j):
    """How far the corner of two lines shifts in x and y per unit of margin; NaN if that is not certain."""
    determinant = abs(xi * yj - xj * yi)
    if not determinant > DETERMINANT_MARGIN * (tie_i - 1.0 + (tie_j - 1.0)):
        return np.nan, np.nan
    return (SLOPE_MARGIN * (abs(yi) + abs(yj)) / determinant, SLOPE_MARGIN * (abs(xi) + abs(xj)) / determinant)


@kernel
def triangle_box(corners, t, space, face, planes):
    """Bound the cross-section of triangle t's frustum on a face; see the module's text."""
    xa, ya, error_xa, error_ya = _vertex(corners, t, 0, space, face)
    xb, yb, error_xb, error_yb = _vertex(corners, t, 1, space, face)
    xc, yc, error_xc, error_yc = _vertex(corners, t, 2, space, face)
    slope_xa, slope_ya = _slopes(planes.x2, planes.y2, planes.tie2, planes.x0, planes.y0, planes.tie0)
    slope_xb, slope_yb = _slopes(planes.x0, planes.y0, planes.tie0, planes.x1, planes.y1, planes.tie1)
    slope_xc, slope_yc = _slopes(planes.x1, planes.y1, planes.tie1, planes.x2, planes.y2, planes.tie2)
    low_x = min(xa - error_xa, xb - error_xb, xc - error_xc)
    high_x = max(xa + error_xa, xb + error_xb, xc + error_xc)
    low_y = min(ya - error_ya, yb - error_yb, yc - error_yc)
    high_y = max(ya + error_ya, yb + error_yb, yc + error_yc)
    slope_x, slope_y = max(slope_xa, slope_xb, slope_xc), max(slope_ya, slope_yb, slope_yc)
    # The sum is NaN or infinite if any vertex or slope is.
    total = (xa + xb + xc + ya + yb + yc + error_xa + error_xb + error_xc + error_ya + error_yb + error_yc
             + slope_xa + slope_xb + slope_xc + slope_ya + slope_yb + slope_yc)
    if not abs(total) < np.inf:
        low_x, high_x, low_y, high_y, slope_x, slope_y = -np.inf, np.inf, -np.inf, np.inf, 0.0, 0.0
    return TriangleBox(low_x, high_x, low_y, high_y, slope_x, slope_y, max(planes.error0, planes.error1, planes.error2),
                       max(planes.tie0, planes.tie1, planes.tie2))


@kernel
def outside_box(bound, low_x, high_x, low_y, high_y, tie):
    """Tell whether a node is certainly outside the box around the frustum's cross-section."""
    margin = bound.error + bound.tie * tie
    grow_x, grow_y = bound.slope_x * margin, bound.slope_y * margin
    return (high_x < bound.low_x - grow_x or low_x > bound.high_x + grow_x
            or high_y < bound.low_y - grow_y or low_y > bound.high_y + grow_y)


@kernel
def _line_test(x, y, k, error, tie_factor, low_x, high_x, low_y, high_y, tie):
    """Test a box (or, with low = high, a sample) against one side plane."""
    margin = error + tie_factor * tie
    near_x, far_x = (high_x, low_x) if x > 0.0 else (low_x, high_x)
    near_y, far_y = (high_y, low_y) if y > 0.0 else (low_y, high_y)
    if x * near_x + y * near_y + k < -margin:
        return REJECT
    if x * far_x + y * far_y + k > margin:
        return ACCEPT
    return REFINE


@kernel
def planes_test(planes, low_x, high_x, low_y, high_y, low_r, high_r, tie):
    """Test a box (or, with low = high, a sample) against a frustum: REJECT, REFINE or ACCEPT.

    The operations and their order are the same for boxes and samples, which the argument about boxes in
    `light_tree` needs.
    """
    answer0 = _line_test(planes.x0, planes.y0, planes.k0, planes.error0, planes.tie0, low_x, high_x, low_y, high_y, tie)
    if answer0 == REJECT:
        return REJECT
    answer1 = _line_test(planes.x1, planes.y1, planes.k1, planes.error1, planes.tie1, low_x, high_x, low_y, high_y, tie)
    if answer1 == REJECT:
        return REJECT
    answer2 = _line_test(planes.x2, planes.y2, planes.k2, planes.error2, planes.tie2, low_x, high_x, low_y, high_y, tie)
    if answer2 == REJECT:
        return REJECT
    near_x, far_x = (high_x, low_x) if planes.cap_x > 0.0 else (low_x, high_x)
    near_y, far_y = (high_y, low_y) if planes.cap_y > 0.0 else (low_y, high_y)
    near_r = high_r if planes.r_floor > 0.0 else low_r
    margin = planes.cap_error + planes.cap_error_r * high_r
    if planes.cap_x * near_x + planes.cap_y * near_y + planes.k_floor + planes.r_floor * near_r < -margin:
        return REJECT
    if answer0 == ACCEPT and answer1 == ACCEPT and answer2 == ACCEPT:
        far_r = low_r if planes.r_doubled > 0.0 else high_r
        if planes.cap_x * far_x + planes.cap_y * far_y + planes.k_doubled + planes.r_doubled * far_r > margin:
            return ACCEPT
    return REFINE
