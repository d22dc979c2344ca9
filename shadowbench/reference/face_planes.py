"""One frustum in the light-space coordinates of one face, as plain numbers, and the tests against it.

Kernels keep these numbers in registers: passing arrays around in the inner loops would count references,
which threads then fight over.

**Triangle box.** Lines alone separate badly where a frustum is a sliver, so a box around the frustum's
cross-section rejects nodes too. Where all three vertices lie in front of the face, the cross-section is the
triangle of their light-space positions; moved outwards by a margin e it is a triangle whose corner between
the lines i and j shifts by ``(B_i - B_j, A_j - A_i) e / (A_i B_j - A_j B_i)`` at most, in the sense of
``|B_i| + |B_j|``. The coefficients are off by less than ``w - 1`` each, w being the tie factor. Where the
determinant exceeds ``8 (w_i - 1 + w_j - 1)`` the computed quotient is within a factor of three; four of it is
a bound. The quotient is at least 1, because |A|, |B| <= 1, so it also carries the error of a sample's
coordinate, which is less than the error bound of the lines. Where a vertex lies behind the face, or a
determinant is too small, the box is infinite.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel
from shadowbench.reference.predicates import UNIT_ROUNDOFF

REJECT, REFINE, ACCEPT = 0, 1, 2
"""Answers of a test: no sample gets any flag; undecided; every sample gets all flags."""

VERTEX_ERROR = 16 * UNIT_ROUNDOFF
"""Error of a vertex in light space per unit of its magnitude: 3 units for a point light, 12 for a directional
one."""
SLOPE_MARGIN = 4.0
"""Makes the computed shift of a corner a bound."""
DETERMINANT_MARGIN = 8.0
"""How far a determinant must exceed the error of its coefficients."""


class FaceFrame(NamedTuple):
    """One face of light space, and what the planes need to know besides: numbers alone.

    Attributes
    ----------
    is_point : True for a point light.
    axis, next_axis, last_axis : the face's axis and the two that follow in cyclic order.
    sign : -1 where the axis points backwards, else 1.
    origin, origin_next, origin_last : origin of light space along the three, world.
    shear_next, shear_last : shear of a directional light.
    floor, doubled : rounding floor and twice the bias, world units.
    """

    is_point: bool
    axis: int
    next_axis: int
    last_axis: int
    sign: float
    origin: float
    origin_next: float
    origin_last: float
    shear_next: float
    shear_last: float
    floor: float
    doubled: float


class FacePlanes(NamedTuple):
    """Planes of one frustum on one face: x X + y Y + k (+ r R) is positive inside.

    Attributes
    ----------
    x0, y0, k0, error0, tie0 : side plane of the first edge, its error bound and tie factor; 1 and 2 likewise.
    cap_x, cap_y : cap plane.
    k_floor, r_floor, k_doubled, r_doubled : the rest of it, moved by the rounding floor and by twice the
        bias.
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
def face_frame(space, face, biases):
    """Describe a face of a `LightSpace`; biases as in `predicates.classify`."""
    i0 = face // 2
    i1, i2 = (i0 + 1) % 3, (i0 + 2) % 3
    origin, shear = space.origin, space.shear
    sign = -1.0 if face % 2 == 1 else 1.0
    return FaceFrame(space.light[3] != 0.0, i0, i1, i2, sign, origin[i0], origin[i1], origin[i2], shear[0],
                     shear[1], biases[0], biases[2])


@kernel
def _line(planes, t, k, frame):
    """Side plane k of triangle t on a face: x, y, constant, error bound, tie factor."""
    constant = planes[t, k, 3]
    if frame.is_point:
        constant = frame.sign * planes[t, k, frame.axis]
    x, y = planes[t, k, frame.next_axis], planes[t, k, frame.last_axis]
    return x, y, constant, planes[t, k, 4], planes[t, k, 5]


@kernel
def face_planes(planes, t, frame):
    """Express triangle t's frustum (`Frusta.planes`) in the coordinates of a face."""
    x0, y0, k0, error0, tie0 = _line(planes, t, 0, frame)
    x1, y1, k1, error1, tie1 = _line(planes, t, 1, frame)
    x2, y2, k2, error2, tie2 = _line(planes, t, 2, frame)
    x, y = planes[t, 3, frame.next_axis], planes[t, 3, frame.last_axis]
    z, offset = frame.sign * planes[t, 3, frame.axis], planes[t, 3, 3]
    if frame.is_point:
        k_floor, r_floor, k_doubled, r_doubled = z, offset - frame.floor, z, offset - frame.doubled
    else:
        r = z + x * frame.shear_next + y * frame.shear_last
        k_floor, r_floor, k_doubled, r_doubled = offset - frame.floor, r, offset - frame.doubled, r
    return FacePlanes(x0, y0, k0, error0, tie0, x1, y1, k1, error1, tie1, x2, y2, k2, error2, tie2,
                      x, y, k_floor, r_floor, k_doubled, r_doubled, planes[t, 3, 4], planes[t, 3, 5])


@kernel
def _vertex(corners, t, k, frame):
    """Light-space x and y of a vertex, and their error bounds; NaN where the vertex is not in front of the
    face."""
    z = frame.sign * (corners[t, k, frame.axis] - frame.origin)
    c1 = corners[t, k, frame.next_axis] - frame.origin_next
    c2 = corners[t, k, frame.last_axis] - frame.origin_last
    if frame.is_point:
        if not z > 0.0:
            return np.nan, np.nan, np.nan, np.nan
        x, y = c1 / z, c2 / z
        return x, y, VERTEX_ERROR * abs(x), VERTEX_ERROR * abs(y)
    error = VERTEX_ERROR * (abs(c1) + abs(c2) + abs(z))
    return c1 - z * frame.shear_next, c2 - z * frame.shear_last, error, error


@kernel
def _slopes(xi, yi, tie_i, xj, yj, tie_j):
    """How far the corner of two lines shifts in x and y per unit of margin; NaN if that is not certain."""
    determinant = abs(xi * yj - xj * yi)
    if not determinant > DETERMINANT_MARGIN * (tie_i - 1.0 + (tie_j - 1.0)):
        return np.nan, np.nan
    return SLOPE_MARGIN * (abs(yi) + abs(yj)) / determinant, SLOPE_MARGIN * (abs(xi) + abs(xj)) / determinant


@kernel
def triangle_box(corners, t, frame, planes):
    """Bound the cross-section of triangle t's frustum on a face; see the module's text."""
    xa, ya, error_xa, error_ya = _vertex(corners, t, 0, frame)
    xb, yb, error_xb, error_yb = _vertex(corners, t, 1, frame)
    xc, yc, error_xc, error_yc = _vertex(corners, t, 2, frame)
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
    return TriangleBox(low_x, high_x, low_y, high_y, slope_x, slope_y,
                       max(planes.error0, planes.error1, planes.error2),
                       max(planes.tie0, planes.tie1, planes.tie2))


@kernel
def outside_box(bound, low_x, high_x, low_y, high_y, tie):
    """Tell whether a node is certainly outside the box around the frustum's cross-section."""
    margin = bound.error + bound.tie * tie
    grow_x, grow_y = bound.slope_x * margin, bound.slope_y * margin
    # All four at once: one branch is cheaper than four that cannot be predicted.
    return ((high_x < bound.low_x - grow_x) | (low_x > bound.high_x + grow_x)
            | (high_y < bound.low_y - grow_y) | (low_y > bound.high_y + grow_y))


@kernel
def _largest(x, y, low_x, high_x, low_y, high_y):
    """Largest value of x X + y Y over a box: of the same operations as at a sample, so rounding keeps the
    order."""
    return max(x * low_x, x * high_x) + max(y * low_y, y * high_y)


@kernel
def _smallest(x, y, low_x, high_x, low_y, high_y):
    """Smallest value of x X + y Y over a box."""
    return min(x * low_x, x * high_x) + min(y * low_y, y * high_y)


@kernel
def planes_test(planes, low_x, high_x, low_y, high_y, low_r, high_r, tie):
    """Test a box (or, with low = high, a sample) against a frustum: REJECT, REFINE or ACCEPT.

    The operations and their order are the same for boxes and samples, which the argument about boxes in
    `light_tree` needs.
    """
    p = planes
    margin0, margin1, margin2 = p.error0 + p.tie0 * tie, p.error1 + p.tie1 * tie, p.error2 + p.tie2 * tie
    # The largest value of each side plane; all three at once, since branches cannot be predicted here.
    if ((_largest(p.x0, p.y0, low_x, high_x, low_y, high_y) + p.k0 < -margin0)
            | (_largest(p.x1, p.y1, low_x, high_x, low_y, high_y) + p.k1 < -margin1)
            | (_largest(p.x2, p.y2, low_x, high_x, low_y, high_y) + p.k2 < -margin2)):
        return REJECT
    # The largest distance behind the cap plane moved by the rounding floor.
    margin = p.cap_error + p.cap_error_r * high_r
    if (_largest(p.cap_x, p.cap_y, low_x, high_x, low_y, high_y) + p.k_floor
            + max(p.r_floor * low_r, p.r_floor * high_r) < -margin):
        return REJECT
    # The smallest values, behind the cap plane moved by twice the bias.
    if ((_smallest(p.x0, p.y0, low_x, high_x, low_y, high_y) + p.k0 > margin0)
            & (_smallest(p.x1, p.y1, low_x, high_x, low_y, high_y) + p.k1 > margin1)
            & (_smallest(p.x2, p.y2, low_x, high_x, low_y, high_y) + p.k2 > margin2)
            & (_smallest(p.cap_x, p.cap_y, low_x, high_x, low_y, high_y) + p.k_doubled
               + min(p.r_doubled * low_r, p.r_doubled * high_r) > margin)):
        return ACCEPT
    return REFINE
