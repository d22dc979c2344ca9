"""Affine transforms in plain IEEE operations: BLAS products differ in the last bit between machines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shadowbench.geometry import FloatArray, Vector
from shadowbench.trigonometry import cos_degrees, sin_degrees

Matrix = tuple[tuple[float, ...], ...]
"""Row-major affine matrix of 3 rows of 4: linear part and translation."""

IDENTITY: Matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """Compose two transforms: first `b`, then `a`."""
    return tuple(
        tuple(row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j] + (row[3] if j == 3 else 0.0) for j in range(4))
        for row in a)


def determinant(m: Matrix) -> float:
    """Determinant of the linear part: negative for a transform that mirrors."""
    (a, b, c, _), (d, e, f, _), (g, h, i, _) = m
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def scaling(factors: Vector) -> Matrix:
    """Scale along the axes."""
    x, y, z = factors
    return (x, 0.0, 0.0, 0.0), (0.0, y, 0.0, 0.0), (0.0, 0.0, z, 0.0)


def translation(offset: Vector) -> Matrix:
    """Move by an offset."""
    return (1.0, 0.0, 0.0, offset[0]), (0.0, 1.0, 0.0, offset[1]), (0.0, 0.0, 1.0, offset[2])


def rotation(degrees: Vector) -> Matrix:
    """Turn about the x axis, then y, then z, counter-clockwise seen from the axis's tip."""
    (cx, cy, cz), (sx, sy, sz) = ([turn(a) for a in degrees] for turn in (cos_degrees, sin_degrees))
    about_x: Matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, cx, -sx, 0.0), (0.0, sx, cx, 0.0))
    about_y: Matrix = ((cy, 0.0, sy, 0.0), (0.0, 1.0, 0.0, 0.0), (-sy, 0.0, cy, 0.0))
    about_z: Matrix = ((cz, -sz, 0.0, 0.0), (sz, cz, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
    return multiply(about_z, multiply(about_y, about_x))


def from_quaternion(x: float, y: float, z: float, w: float) -> Matrix:
    """Turn by a quaternion, which need not be of unit length: the identity for zero."""
    squared = x * x + y * y + z * z + w * w
    s = 2.0 / squared if squared > 0.0 else 0.0
    return ((1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w), 0.0),
            (s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w), 0.0),
            (s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y), 0.0))


def from_columns(values: Sequence[float]) -> Matrix:
    """Read a glTF matrix: 16 numbers, column by column."""
    return tuple(tuple(float(values[4 * column + row]) for column in range(4)) for row in range(3))


def transform_points(m: Matrix, points: FloatArray) -> FloatArray:
    """Transform points, float64 (n, 3). Overflow gives infinities, which the caller must refuse."""
    if m == IDENTITY:
        return points
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([row[0] * x + row[1] * y + row[2] * z + row[3] for row in m], axis=1)
