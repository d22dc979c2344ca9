"""The citadel's ground: a hill with a flat top and a road up to the gate, in rolling land; lengths are in metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import FloatArray
from shadowbench.scenes.procedural import SmoothNoise, smooth_step, whole_degrees
from shadowbench.scenes.shapes import Point, Shape, grid, unit_circle

YARD = 12.0
"""Height of the hill's flat top."""

_HALF = 105.0       # half the side of the terrain


class Hill:
    """Height of the ground, and places on it."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 3])
        self._noise = SmoothNoise(rng, 34.0)
        self._fine = SmoothNoise(rng, 7.0)

    def __call__(self, x: FloatArray | float, z: FloatArray | float) -> FloatArray:
        """Height at (x, z)."""
        x, z = np.asarray(x, np.float64), np.asarray(z, np.float64)
        outside = smooth_step((np.sqrt(x * x + z * z) - 60.0) / 38.0)
        fine = self._fine(x, z)
        rolling = 3.2 * self._noise(x, z) + 0.35 * fine
        hill = YARD * (1.0 - outside) + rolling * outside + 0.06 * fine * (1.0 - outside)
        # The road runs along z from the gate down to the plain; the hill takes over beside it and within the walls.
        road = YARD * (1.0 - smooth_step((z - 56.0) / 46.0)) + 0.6 * outside
        beside = np.minimum(smooth_step((np.abs(x) - 4.0) / 9.0) + smooth_step((44.0 - z) / 4.0), 1.0)
        return np.asarray(hill * beside + road * (1.0 - beside))

    def around(self, rng: np.random.Generator, n: int, inner: float, outer: float, clear: float = 6.0) -> FloatArray:
        """float64 (n, 3): places between two distances from the middle, at least `clear` away from the road's axis."""
        circle = unit_circle(360)[whole_degrees(rng, n)]
        distance = inner + (outer - inner) * np.sqrt(rng.uniform(0.0, 1.0, n))
        x, z = distance * circle[:, 0], distance * circle[:, 1]
        x = np.where((z > 0.0) & (np.abs(x) < clear), np.where(x < 0.0, x - clear, x + clear), x)
        return np.stack([x, self(x, z) - 0.05, z], axis=1)


def _within(x: FloatArray, z: FloatArray, corners: Sequence[Point]) -> NDArray[np.bool_]:
    """True for points inside a polygon: an odd number of its edges cross the ray towards +x."""
    inside = np.zeros(x.shape, bool)
    for (x1, z1), (x2, z2) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if z1 != z2:
            inside ^= ((z1 > z) != (z2 > z)) & (x < x1 + (z - z1) * (x2 - x1) / (z2 - z1))
    return inside


def terrain(ground: Hill, detail: float, walls: Sequence[Point]) -> list[tuple[Shape, str]]:
    """One-sided height field: the road and the yard within the walls in earth, the rest in grass."""
    n = max(20, round(72 * detail))
    ticks = np.linspace(-_HALF, _HALF, n + 1)
    x, z = (a.ravel() for a in np.meshgrid(ticks, ticks))
    vertices = np.stack([x, ground(x, z), z], axis=1)
    triangles = grid(n, n)
    middle_x, middle_z = (0.5 * (vertices[triangles[:, 0], k] + vertices[triangles[:, 2], k]) for k in (0, 2))
    earth = _within(middle_x, middle_z, walls) | ((np.abs(middle_x) < 4.5) & (middle_z > 50.0))
    return [(Shape(vertices, triangles[earth]), "earth"), (Shape(vertices, triangles[~earth]), "grass")]
