"""The exact stage: what float64 leaves open is settled in integers.

All coordinates of a batch are multiplied by one power of two that makes them integers, so every predicate
becomes a comparison of integers. NumPy arrays of Python integers keep the formulas readable and the loop in
C.
"""

import numpy as np

from shadowbench.reference.predicates import (
    BIAS_DOUBLED,
    BIAS_FLOOR,
    PLANES_IN,
    PLANES_OUT,
    SHADOWED,
)

PAIRS_PER_BATCH = 1 << 15
"""Sample-triangle pairs settled at a time: bounds the memory that the integers take (about 10 kB a pair)."""

_MANTISSA_BITS = 53


def to_integers(*arrays):
    """Return the arrays times one common power of two, as object arrays of Python integers.

    Parameters
    ----------
    *arrays : float64 arrays of any shape, finite.
    """
    split = [np.frexp(np.asarray(array, np.float64)) for array in arrays]
    lowest = min((int(exponent[mantissa != 0].min()) for mantissa, exponent in split if np.any(mantissa)),
                 default=0)
    integers = []
    for mantissa, exponent in split:
        # Zeros have exponent 0, which may lie below the lowest one: shift them by nothing.
        shift = np.where(mantissa != 0, exponent - lowest, 0)
        scaled = (mantissa * 2.0**_MANTISSA_BITS).astype(np.int64)
        integers.append(np.left_shift(scaled.astype(object), shift.astype(object)))
    return integers


def _cross(x, y):
    """Cross product over the last axis."""
    return np.stack([x[..., 1] * y[..., 2] - x[..., 2] * y[..., 1],
                     x[..., 2] * y[..., 0] - x[..., 0] * y[..., 2],
                     x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]], axis=-1)


def _dot(x, y):
    """Scalar product over the last axis."""
    return x[..., 0] * y[..., 0] + x[..., 1] * y[..., 1] + x[..., 2] * y[..., 2]


def exact_facing(corners, light):
    """Sign of n . (L - w a) per triangle.

    Parameters
    ----------
    corners : float64 (n, 3, 3), world.
    light : float64 (4,), homogeneous, world.

    Returns
    -------
    int8 (n,) : +1 or -1 by the side that faces the light, 0 where the triangle casts nothing.
    """
    signs = np.zeros(len(corners), np.int8)
    for start in range(0, len(corners), PAIRS_PER_BATCH):
        batch = slice(start, start + PAIRS_PER_BATCH)
        if light[3] != 0.0:
            points, position = to_integers(corners[batch], light[:3])
            to_light = position - points[:, 0]
        else:
            (points,), (to_light,) = to_integers(corners[batch]), to_integers(light[:3])
        value = _dot(_cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), to_light)
        signs[batch] = (value > 0).astype(np.int8) - (value < 0).astype(np.int8)
    return signs


def exact_flags(corners, facing, light, positions, tie, biases):
    """Settle the five flags of sample-triangle pairs.

    Parameters
    ----------
    corners : float64 (n, 3, 3), the triangle of each pair, world.
    facing : int8 (n,), +1 or -1, its `exact_facing`.
    light : float64 (4,), homogeneous, world.
    positions : float64 (n, 3), the sample of each pair, world.
    tie : float64 (n,), tie distances, world units.
    biases : float64 (3,), rounding floor, bias, twice the bias; world units.

    Returns
    -------
    uint8 (n,) : flags of `shadowbench.reference.predicates`.
    """
    flags = np.zeros(len(corners), np.uint8)
    for start in range(0, len(corners), PAIRS_PER_BATCH):
        batch = slice(start, start + PAIRS_PER_BATCH)
        flags[batch] = _batch_flags(corners[batch], facing[batch].astype(object), light, positions[batch],
                                    tie[batch], biases)
    return flags


def _batch_flags(corners, facing, light, positions, tie, biases):
    """Settle one batch; see `exact_flags`."""
    if light[3] != 0.0:
        points, samples, distance, bias, origin = to_integers(corners, positions, tie, biases, light[:3])
        from_light = points - origin
    else:
        points, samples, distance, bias = to_integers(corners, positions, tie, biases)
        from_light = np.broadcast_to(-to_integers(light[:3])[0], points.shape)

    # Cap plane: t > b |n| for b >= 0 is t > 0 and t^2 > b^2 n.n.
    normal = _cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    behind = -facing * _dot(normal, samples - points[:, 0])
    square, squared_normal = behind * behind, _dot(normal, normal)
    floor, beyond, doubled = ((behind > 0).astype(bool) & (square > b * b * squared_normal).astype(bool)
                              for b in bias)

    # Side planes: f >= -d |m| is f >= 0 or f^2 <= d^2 m.m, and f >= d |m| is f >= 0 and f^2 >= d^2 m.m.
    here, out, inside = (np.ones(len(corners), bool) for _ in range(3))
    for edge in range(3):
        plane = _cross(from_light[:, edge], points[:, (edge + 1) % 3] - points[:, edge])
        inner = -facing * _dot(plane, samples - points[:, edge])
        square, moved = inner * inner, distance * distance * _dot(plane, plane)
        positive = (inner >= 0).astype(bool)
        here &= positive
        out &= positive | (square <= moved).astype(bool)
        inside &= positive & (square >= moved).astype(bool)

    return ((here & beyond) * SHADOWED + (out & beyond) * PLANES_OUT + (inside & beyond) * PLANES_IN
            + (here & floor) * BIAS_FLOOR + (here & doubled) * BIAS_DOUBLED).astype(np.uint8)
