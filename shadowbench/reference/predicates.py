"""Float64 predicates with a proven forward error bound: each answers yes, no, or "ask exact arithmetic".

Notation: ``u = 2**-53`` is the unit roundoff, ``gamma_k = k u / (1 - k u)`` (Higham 2002, lemma 3.1), a hat
marks a computed value, and all inputs (vertices, light, sample, distances) are exact float64 numbers.

**Plane values.** Every sign here is that of ``f = m . c`` with ``m = x × y``, where each component of the
vectors x, y and c is an input or the difference of two inputs. A computed difference is ``(exact)(1 + d)``,
``|d| <= u``: subtraction never underflows. Let ``M_i = |x_j y_k| + |x_k y_j|``. Each of the two products in
m_i carries three rounding factors (two differences, one product) and the subtraction a fourth, so ``|m^_i -
m_i| <= gamma_4 M_i``. The factor c_i, its product and two additions bring that to eight: ``|f^ - f| <=
gamma_8 sum M_i |c_i|``. The bound is a sum of non-negative terms with at most the same eight factors each, so
its computed value falls short of it by a factor of ``1 - gamma_8`` at most, and ``9 u`` times the computed
sum is a valid bound. `FILTER_ERROR` is 12 u; the rest covers comparing f^ with a distance (below).

**Underflow.** A product that underflows is off by at most ``2**-1075``: ``2**-1074`` per m_i, so in total
less than ``2**-1073 (1 + sum |c_i|)``. The same amount may be missing from the computed bound, times 12 u.
`UNDERFLOW` is far above both.

**Distances.** A plane moved by the distance e has the value ``f - e |m|``. For ``l^ = sqrt(m^ . m^)``,
``|l^ - |m|| <= |m^ - m| + gamma_4 |m^| + 2**-536 <= gamma_4 sum M_i + gamma_4 l^ + 2**-536``: the last term
bounds the square root of what underflow takes from the squares. The product with e and the final sum add two
roundings, so ``12 u (sum M_i + l^) e + 2**-535 e + UNDERFLOW`` is a valid bound, with slack.

**Overflow** makes the bound infinite or NaN whenever a value that is compared is (the bound contains the
magnitude of each intermediate result), and no comparison with such a bound is decided: "yes" needs ``value >
bound`` and "no" needs ``value < -bound``.

The edge plane uses ``(u - L) × (v - u)`` instead of ``(u - L) × (v - L)``: the same plane, but without
cancellation where the light is far away. For a directional light the first factor is minus the direction
towards the light.
"""

import numpy as np

from shadowbench.jit import kernel

UNIT_ROUNDOFF = 2.0**-53
FILTER_ERROR = 12 * UNIT_ROUNDOFF
"""Relative error bound of a plane value; the proof above needs 9 units and 2 more for distances."""
UNDERFLOW = 2.0**-1022
"""Absolute error allowance for underflow, per 1 + sum |c_i|: the smallest normal number."""
ROOT_UNDERFLOW = 2.0**-535
"""Absolute error allowance of a length whose squares underflow."""

NO, MAYBE, YES = 0, 1, 2
"""Answers of a predicate, ordered so that the smaller one is the answer of "both"."""

SHADOWED = 1
"""The sample is shadowed by the definition."""
PLANES_OUT = 2
"""It is with all side planes moved outwards by the tie distance."""
PLANES_IN = 4
"""It is with all side planes moved inwards by the tie distance."""
BIAS_FLOOR = 8
"""It is with the rounding floor as bias."""
BIAS_DOUBLED = 16
"""It is with twice the bias."""
ALL_FLAGS = 31
FINISHED = PLANES_IN | BIAS_DOUBLED
"""Both imply all other flags, so no further triangle can change the sample."""


@kernel
def compare(value, bound):
    """Tell whether a computed value with an error bound is certainly above (YES) or below (NO) zero."""
    if value > bound:
        return YES
    if value < -bound:
        return NO
    return MAYBE


@kernel
def cross_with_bound(x0, x1, x2, y0, y1, y2):
    """Return m = x × y and the magnitudes M of the module's proof."""
    a0, b0 = x1 * y2, x2 * y1
    a1, b1 = x2 * y0, x0 * y2
    a2, b2 = x0 * y1, x1 * y0
    return a0 - b0, a1 - b1, a2 - b2, abs(a0) + abs(b0), abs(a1) + abs(b1), abs(a2) + abs(b2)


@kernel
def plane_value(m0, m1, m2, b0, b1, b2, c0, c1, c2):
    """Return f = m . c and its error bound."""
    value = m0 * c0 + m1 * c1 + m2 * c2
    magnitude = b0 * abs(c0) + b1 * abs(c1) + b2 * abs(c2)
    return value, FILTER_ERROR * magnitude + UNDERFLOW * (1.0 + abs(c0) + abs(c1) + abs(c2))


@kernel
def length_with_bound(m0, m1, m2, b0, b1, b2):
    """Return |m| and its error bound, to be multiplied by a distance."""
    length = np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    return length, FILTER_ERROR * (b0 + b1 + b2 + length) + ROOT_UNDERFLOW


@kernel
def triangle_facing(corners, t, light):
    """Sign of n . (L - w a): +1, -1, 0 (certainly edge-on or without area) or 2 if float64 can't tell.

    Zero is certain only where every product has a factor that is exactly zero.
    """
    x0, x1, x2 = (corners[t, 1, 0] - corners[t, 0, 0], corners[t, 1, 1] - corners[t, 0, 1],
                  corners[t, 1, 2] - corners[t, 0, 2])
    y0, y1, y2 = (corners[t, 2, 0] - corners[t, 0, 0], corners[t, 2, 1] - corners[t, 0, 1],
                  corners[t, 2, 2] - corners[t, 0, 2])
    c0, c1, c2 = light[0], light[1], light[2]
    if light[3] != 0.0:
        c0, c1, c2 = c0 - corners[t, 0, 0], c1 - corners[t, 0, 1], c2 - corners[t, 0, 2]
    m0, m1, m2, b0, b1, b2 = cross_with_bound(x0, x1, x2, y0, y1, y2)
    value, bound = plane_value(m0, m1, m2, b0, b1, b2, c0, c1, c2)
    if value > bound:
        return 1
    if value < -bound:
        return -1
    zero0 = c0 == 0.0 or ((x1 == 0.0 or y2 == 0.0) and (x2 == 0.0 or y1 == 0.0))
    zero1 = c1 == 0.0 or ((x2 == 0.0 or y0 == 0.0) and (x0 == 0.0 or y2 == 0.0))
    zero2 = c2 == 0.0 or ((x0 == 0.0 or y1 == 0.0) and (x1 == 0.0 or y0 == 0.0))
    if zero0 and zero1 and zero2:
        return 0
    return 2


@kernel
def side_answers(corners, t, edge, sign, light, positions, i, tie):
    """Answer whether sample i is on the inner side of one side plane: in place, moved outwards, moved
    inwards.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.
    t, edge : triangle, and edge from corner `edge` to the next one.
    sign : +1 or -1, `triangle_facing`.
    light : float64 (4,), homogeneous, world.
    positions : float64 (n_samples, 3), world.
    tie : distance by which the plane moves, world units.
    """
    k = edge + 1 if edge < 2 else 0
    u0, u1, u2 = corners[t, edge, 0], corners[t, edge, 1], corners[t, edge, 2]
    a0, a1, a2 = -light[0], -light[1], -light[2]
    if light[3] != 0.0:
        a0, a1, a2 = u0 + a0, u1 + a1, u2 + a2
    m0, m1, m2, b0, b1, b2 = cross_with_bound(
        a0, a1, a2, corners[t, k, 0] - u0, corners[t, k, 1] - u1, corners[t, k, 2] - u2)
    value, bound = plane_value(
        m0, m1, m2, b0, b1, b2, positions[i, 0] - u0, positions[i, 1] - u1, positions[i, 2] - u2)
    length, length_bound = length_with_bound(m0, m1, m2, b0, b1, b2)
    inner = -sign * value
    moved = bound + tie * length_bound + UNDERFLOW
    return (compare(inner, bound), compare(inner + tie * length, moved), compare(inner - tie * length, moved))


@kernel
def cap_answers(corners, t, sign, positions, i, biases):
    """Answer whether sample i is behind the triangle's plane by more than each of the three `biases`."""
    a0, a1, a2 = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
    m0, m1, m2, b0, b1, b2 = cross_with_bound(
        corners[t, 1, 0] - a0, corners[t, 1, 1] - a1, corners[t, 1, 2] - a2,
        corners[t, 2, 0] - a0, corners[t, 2, 1] - a1, corners[t, 2, 2] - a2)
    value, bound = plane_value(
        m0, m1, m2, b0, b1, b2, positions[i, 0] - a0, positions[i, 1] - a1, positions[i, 2] - a2)
    length, length_bound = length_with_bound(m0, m1, m2, b0, b1, b2)
    behind = -sign * value
    return (compare(behind - biases[0] * length, bound + biases[0] * length_bound + UNDERFLOW),
            compare(behind - biases[1] * length, bound + biases[1] * length_bound + UNDERFLOW),
            compare(behind - biases[2] * length, bound + biases[2] * length_bound + UNDERFLOW))


@kernel
def classify(corners, t, sign, light, positions, i, tie, biases):
    """Decide the five flags of sample i and triangle t as far as float64 can.

    Parameters
    ----------
    biases : float64 (3,), ascending: rounding floor, bias, twice the bias; world units.
    (the others as in `side_answers`)

    Returns
    -------
    certain, open : bit sets of flags that are certainly set, and of those that need exact arithmetic.
    """
    floor, bias, doubled = cap_answers(corners, t, sign, positions, i, biases)
    if floor == NO:
        return 0, 0
    here, out, inside = YES, YES, YES
    for edge in range(3):
        answer, answer_out, answer_in = side_answers(corners, t, edge, sign, light, positions, i, tie)
        here, out, inside = min(here, answer), min(out, answer_out), min(inside, answer_in)
        if out == NO:
            return 0, 0
    certain, undecided = 0, 0
    for flag, answer in ((SHADOWED, min(here, bias)), (PLANES_OUT, min(out, bias)),
                         (PLANES_IN, min(inside, bias)), (BIAS_FLOOR, min(here, floor)),
                         (BIAS_DOUBLED, min(here, doubled))):
        if answer == YES:
            certain |= flag
        elif answer == MAYBE:
            undecided |= flag
    return certain, undecided
