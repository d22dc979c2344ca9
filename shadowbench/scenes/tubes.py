"""Closed tubes along polylines: limbs of figures and trees, rails, handles. Many at once, all with as many points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shadowbench.geometry import FloatArray, cross, dot
from shadowbench.scenes.shapes import Shape, grid, unit_circle


def tube_triangles(points: int, sides: int) -> int:
    """Triangles of one tube through so many points."""
    return 2 * sides * (points - 1) + 2 * (sides - 2)


def tubes(points: FloatArray, radius: FloatArray, sides: int) -> Shape:
    """Closed tubes with flat ends.

    Parameters
    ----------
    points : float64 (n_tubes, n_points, 3); a tube must not turn by more than about a right angle in all.
    radius : float64 (n_tubes, n_points), positive.
    sides : of the cross-section.
    """
    n_tubes, n_points = points.shape[:2]
    along = np.empty_like(points)
    along[:, 1:-1] = points[:, 2:] - points[:, :-2]
    along[:, 0], along[:, -1] = points[:, 1] - points[:, 0], points[:, -1] - points[:, -2]
    along = _unit(along)
    # One direction across for a whole tube keeps its sides from twisting
    axis = _unit(points[:, -1] - points[:, 0])
    across = np.where(np.abs(axis[:, 1:2]) < 0.75, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    u = _unit(cross(along, np.broadcast_to(across[:, None], along.shape)))
    v = cross(u, along)
    circle = unit_circle(sides)
    rings = [points + radius[..., None] * (c * u + s * v) for c, s in circle]
    vertices = np.stack(rings, axis=2)
    triangles = np.concatenate([grid(sides, n_points - 1, closed=True), _end(sides, 0)[:, ::-1],
                                _end(sides, (n_points - 1) * sides)])
    first = n_points * sides * np.arange(n_tubes)
    return Shape(vertices.reshape(-1, 3), (triangles[None] + first[:, None, None]).reshape(-1, 3))


def tube(points: Sequence[Sequence[float]] | FloatArray, radius: Sequence[float], sides: int) -> Shape:
    """One closed tube; see `tubes`."""
    return tubes(np.array([points], np.float64), np.array([radius], np.float64), sides)


def ring(radius: float, thickness: float, steps: int, sides: int) -> Shape:
    """Closed ring about the y axis: a torus."""
    circle = unit_circle(sides) * thickness
    turns = unit_circle(steps)
    points = [[(radius + a) * c, b, (radius + a) * s] for c, s in turns for a, b in circle]
    last = (steps - 1) * sides
    i = np.arange(sides)
    j = (i + 1) % sides
    closing = np.concatenate([np.stack([last + i, i, j], axis=1), np.stack([last + i, j, last + j], axis=1)])
    return Shape(np.array(points), np.concatenate([grid(sides, steps - 1, closed=True), closing])).flipped()


def _end(sides: int, first: int) -> np.ndarray:
    """Fan of the vertices of a ring, int64 (sides - 2, 3)."""
    i = np.arange(1, sides - 1)
    return np.stack([np.full_like(i, first), first + i + 1, first + i], axis=1)


def _unit(vectors: FloatArray) -> FloatArray:
    """Scale vectors (..., 3) to length 1."""
    length = np.sqrt(dot(vectors, vectors))
    return np.asarray(vectors / length[..., None])
