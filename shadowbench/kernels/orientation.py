"""The exact sign of a 2D orientation test: on which side of a line a point lies.

A float64 evaluation with a proven forward error bound decides almost every call. The rest is evaluated without
any rounding error, as an expansion: a sum of float64 terms that do not overlap. Method and bound: Shewchuk,
"Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates" (1997), sec. 2 (error-free
sums and products), fig. 6 (growing an expansion) and sec. 4.2 (orient2d).

The sign is exact while every coordinate is 0 or has a magnitude between 2^-480 and 2^480, so that no product of
two of them, nor the rounding error of such a product, overflows or becomes subnormal.
"""

import numpy as np

from shadowbench.jit import allocating_kernel, kernel

_HALF_ULP = 2.0**-53
ORIENT_ERROR_BOUND = (3.0 + 16.0 * _HALF_ULP) * _HALF_ULP
"""Shewchuk's ccwerrboundA: bounds the error of the rounded determinant relative to its two products."""

_SPLITTER = 2.0**27 + 1.0      # Dekker and Veltkamp: cuts 53 bits into two halves of 26 bits
_MAX_TERMS = 12                # six products of two terms each


@kernel
def two_sum(a, b):
    """Return a + b rounded, and its rounding error, exactly."""
    total = a + b
    b_part = total - a
    return total, (a - (total - b_part)) + (b - b_part)


@kernel
def _split(a):
    """Cut a float64 into a high and a low half of at most 26 bits."""
    c = _SPLITTER * a
    high = c - (c - a)
    return high, a - high


@kernel
def two_product(a, b):
    """Return a * b rounded, and its rounding error, exactly."""
    product = a * b
    a_high, a_low = _split(a)
    b_high, b_low = _split(b)
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


@kernel
def _grow(terms, n_terms, value):
    """Add one float64 to an expansion of `n_terms` terms, smallest first; the result has one term more."""
    for i in range(n_terms):
        value, terms[i] = two_sum(value, terms[i])
    terms[n_terms] = value


@kernel
def _difference_error(a, b):
    """Return the rounding error of a - b."""
    return two_sum(a, -b)[1]


@allocating_kernel
def orient2d_exact(ax, ay, bx, by, cx, cy):
    """Sign of orient2d without rounding."""
    # Shortcut for points on a line at coordinates of few bits: exact differences with equal rounded products
    if (_difference_error(ax, cx) == 0.0 and _difference_error(by, cy) == 0.0
            and _difference_error(ay, cy) == 0.0 and _difference_error(bx, cx) == 0.0):
        left, left_error = two_product(ax - cx, by - cy)
        right, right_error = two_product(ay - cy, bx - cx)
        if left == right:
            return 1 if left_error > right_error else (-1 if left_error < right_error else 0)
    # In general, sum exactly the six products that remain when cx cy cancels
    terms = np.empty(_MAX_TERMS)
    factors = ((ax, by), (-ax, cy), (-cx, by), (-ay, bx), (ay, cx), (cy, bx))
    n_terms = 0
    for left, right in factors:
        product, error = two_product(left, right)
        _grow(terms, n_terms, error)
        _grow(terms, n_terms + 1, product)
        n_terms += 2
    # The largest term that is not zero outweighs all smaller ones together
    for i in range(_MAX_TERMS - 1, -1, -1):
        if terms[i] != 0.0:
            return 1 if terms[i] > 0.0 else -1
    return 0


@kernel
def orient2d(ax, ay, bx, by, cx, cy):
    """Exact sign of (a - c) x (b - c): 1, 0 or -1.

    With y up, 1 means that c lies to the left of the line from a to b; with y down, to its right.
    """
    left = (ax - cx) * (by - cy)
    right = (ay - cy) * (bx - cx)
    determinant = left - right
    bound = ORIENT_ERROR_BOUND * (abs(left) + abs(right))
    if determinant > bound:
        return 1
    if determinant < -bound:
        return -1
    # A difference of two floats is zero only if they are equal, so two zero products are exact
    if left == 0.0 and right == 0.0:
        return 0
    return orient2d_exact(ax, ay, bx, by, cx, cy)
