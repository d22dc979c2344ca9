"""Bare trees of closed tubes: trunk, boughs, branches and twigs, each grown from the outer part of its parent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shadowbench.geometry import FloatArray, dot
from shadowbench.scenes.props import directions
from shadowbench.scenes.shapes import Shape
from shadowbench.scenes.tubes import tube_triangles, tubes


@dataclass(frozen=True)
class Growth:
    """One generation of branches.

    Attributes
    ----------
    per_parent : branches that each parent gets.
    length : of a branch, world units; each is between 0.7 and 1.25 times as long.
    points, sides : of the tube.
    along : how far a branch keeps to its parent's direction, against a random one of weight 1.
    up : how far it bends upwards.
    """

    per_parent: float
    length: float
    points: int
    sides: int
    along: float = 0.9
    up: float = 0.45

    @property
    def triangles(self) -> int:
        """Triangles of one branch."""
        return tube_triangles(self.points, self.sides)


@dataclass(frozen=True, eq=False)
class Branches:
    """A generation that has grown: float64 (n, n_points, 3) middles and (n, n_points) radii."""

    points: FloatArray
    radius: FloatArray


def stem(foot: Sequence[float], height: float, radius: float, rng: np.random.Generator) -> Branches:
    """Trunk with a slight bend, 8 points from below the ground to the top."""
    steps = np.linspace(-0.06, 1.0, 8)
    sway = np.cumsum(rng.uniform(-0.018, 0.018, (8, 2)), axis=0) * height
    points = np.array(foot) + np.stack([sway[:, 0], steps * height, sway[:, 1]], axis=1)
    flare = np.array([1.7, 1.12, 0.98, 0.9, 0.8, 0.66, 0.5, 0.3])
    return Branches(points[None], radius * flare[None])


def grow(rng: np.random.Generator, parents: Branches, growth: Growth, n: int | None = None, low: float = 0.3) -> Branches:
    """Grow the next generation.

    Parameters
    ----------
    n : number of branches, if it is not `growth.per_parent` for each parent; they are dealt out to the parents in turn.
    low : branches start no lower than at this share of the parent's length.
    """
    n_parents, n_points = parents.points.shape[:2]
    count = round(growth.per_parent * n_parents) if n is None else n
    index = np.arange(count) % n_parents
    place = rng.uniform(low, 1.0, count) * (n_points - 1)
    first = np.minimum(place.astype(np.int64), n_points - 2)
    t = (place - first)[:, None]
    a, b = parents.points[index, first], parents.points[index, first + 1]
    start = a * (1.0 - t) + b * t
    thick = parents.radius[index, first] * (1.0 - t[:, 0]) + parents.radius[index, first + 1] * t[:, 0]
    way = _unit(_unit(b - a) * growth.along + directions(rng, count) + np.array([0.0, growth.up, 0.0]))
    step = growth.length * rng.uniform(0.7, 1.25, (count, 1)) / (growth.points - 1)
    points = [start]
    for _ in range(growth.points - 1):
        points.append(points[-1] + way * step)
        way = _unit(way + 0.28 * directions(rng, count) + np.array([0.0, 0.12 * growth.up, 0.0]))
    taper = np.linspace(1.0, 0.3, growth.points)
    return Branches(np.stack(points, axis=1), 0.66 * thick[:, None] * taper)


def bark(branches: Branches, sides: int) -> Shape:
    """Surface of a generation: closed tubes."""
    return tubes(branches.points, branches.radius, sides)


def _unit(vectors: FloatArray) -> FloatArray:
    """Scale vectors (n, 3) to length 1; hardly any direction for those that have next to none."""
    return np.asarray(vectors / np.sqrt(np.maximum(dot(vectors, vectors), 1e-4))[:, None])
