"""Ground of exactly any number of triangles: what a scene's bodies leave over goes into it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from shadowbench.geometry import FloatArray
from shadowbench.scenes.shapes import Shape, grid

Height = Callable[[FloatArray, FloatArray], FloatArray]
"""Height over (x, z)."""


def ground(x: tuple[float, float], z: tuple[float, float], n: int, height: Height | None = None) -> Shape:
    """Height field of exactly `n` triangles, at least 2, in nearly square cells, facing up.

    The row at the smallest z takes the odd ones: its far border has as many points as it takes.

    Parameters
    ----------
    x, z : smallest and largest coordinate.
    height : None for level ground at y = 0.
    """
    columns = math.isqrt(int(n * (x[1] - x[0]) / (2.0 * (z[1] - z[0]))))
    columns = max(1, min(columns, n - 1))
    rows = max(1, n // (2 * columns))
    far = n - (rows - 1) * 2 * columns - columns
    across, along = np.linspace(*x, columns + 1), np.linspace(*z, rows + 1)
    grid_x, grid_z = (a.ravel() for a in np.meshgrid(across, along[1:]))
    far_x = np.linspace(*x, far + 1)
    points_x, points_z = np.concatenate([far_x, grid_x]), np.concatenate([np.full(far + 1, z[0]), grid_z])
    y = np.zeros_like(points_x) if height is None else height(points_x, points_z)
    vertices = np.stack([points_x, y, points_z], axis=1)
    triangles = np.concatenate([_ribbon(far, columns), grid(columns, rows - 1) + far + 1])
    return Shape(vertices, triangles)


def _ribbon(far: int, near: int) -> np.ndarray:
    """Triangles between a line of far + 1 points and, numbered on, one of near + 1 points: int64 (far + near, 3)."""
    triangles, i, j = [], 0, 0
    while i < far or j < near:
        # Advance on the side that lags behind, so that the ribbon stays even
        if j * far <= i * near and j < near:
            triangles.append((i, far + 1 + j, far + 2 + j))
            j += 1
        else:
            triangles.append((i, far + 1 + j, i + 1))
            i += 1
    return np.array(triangles, np.int64)
