"""Trees, leaves, grass, stones, barrels and crates for procedural scenes; lengths are in metres."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from shadowbench.geometry import FloatArray, cross, dot
from shadowbench.scenes.procedural import MeshBuilder, whole_degrees
from shadowbench.scenes.shapes import Shape, box, copies, grid, join, lathe, rock, unit_circle

_LEAF = np.array([[0.0, -0.5], [0.36, 0.05], [0.0, 0.5], [-0.36, 0.05]])
_LEAF_FOLD = np.array([0.0, 0.12, 0.0, 0.12])


def directions(rng: np.random.Generator, n: int) -> FloatArray:
    """float64 (n, 3): random unit vectors (a cube's points scaled to length 1: near enough to even)."""
    v = rng.uniform(-1.0, 1.0, (n, 3)) + np.array([1e-3, 2e-3, 3e-3])
    return v / np.sqrt(dot(v, v))[:, None]


def leaves(rng: np.random.Generator, centres: FloatArray, size: float) -> Shape:
    """Folded leaves of two triangles at random angles, open; float64 (k, 3) centres."""
    n = len(centres)
    along, other = directions(rng, n), directions(rng, n)
    across = cross(along, other)
    across = across / np.sqrt(np.maximum(dot(across, across), 1e-6))[:, None]
    face = cross(along, across)
    length = size * rng.uniform(0.7, 1.3, (n, 1, 1))
    points = (_LEAF[None, :, :1] * across[:, None] + _LEAF[None, :, 1:] * along[:, None]
              + _LEAF_FOLD[None, :, None] * face[:, None]) * length + centres[:, None]
    triangles = np.array([[0, 1, 2], [0, 2, 3]])[None] + 4 * np.arange(n)[:, None, None]
    return Shape(points.reshape(-1, 3), triangles.reshape(-1, 3))


def crown(rng: np.random.Generator, n: int, centre: Sequence[float], radii: Sequence[float]) -> FloatArray:
    """float64 (n, 3): points in an ellipsoid, denser towards its surface."""
    distance = 0.35 + 0.65 * np.sqrt(rng.uniform(0.0, 1.0, (n, 1)))
    return directions(rng, n) * distance * np.array(radii) + np.array(centre)


def blades(rng: np.random.Generator, roots: FloatArray, height: float) -> Shape:
    """Blades of grass: single open triangles that stand on float64 (k, 3) roots."""
    n = len(roots)
    turn = unit_circle(360)[whole_degrees(rng, n)]
    side = np.stack([turn[:, 0], np.zeros(n), turn[:, 1]], axis=1) * (0.09 * height + 0.015)
    lean = rng.uniform(-0.45, 0.45, (n, 2))
    tall = height * rng.uniform(0.6, 1.4, n)
    tip = np.stack([lean[:, 0] * tall, tall, lean[:, 1] * tall], axis=1)
    points = np.stack([roots - side, roots + side, roots + tip], axis=1)
    return Shape(points.reshape(-1, 3), np.arange(3 * n).reshape(n, 3))


class Limbs(NamedTuple):
    """Straight tapering branches: float64 (k, 3) starts and ends, (k,) radii at both."""

    start: FloatArray
    end: FloatArray
    start_radius: FloatArray
    end_radius: FloatArray


def tubes(limbs: Limbs, sides: int) -> Shape:
    """Branches as cones without ends."""
    axis = limbs.end - limbs.start
    axis = axis / np.sqrt(dot(axis, axis))[:, None]
    helper = np.where(np.abs(axis[:, 1:2]) < 0.9, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    u = cross(axis, helper)
    u = u / np.sqrt(dot(u, u))[:, None]
    v = cross(u, axis)
    circle = unit_circle(sides)
    around = circle[None, :, :1] * u[:, None] + circle[None, :, 1:] * v[:, None]
    low = limbs.start[:, None] + around * limbs.start_radius[:, None, None]
    high = limbs.end[:, None] + around * limbs.end_radius[:, None, None]
    points = np.stack([low, high], axis=1)
    n = 2 * sides
    triangles = grid(sides, 1, closed=True)[None] + n * np.arange(len(axis))[:, None, None]
    return Shape(points.reshape(-1, 3), triangles.reshape(-1, 3))


def branches(rng: np.random.Generator, parents: Limbs, per_parent: int, length: float) -> Limbs:
    """Grow branches from the outer parts of others: each bends upwards and is about `length` long."""
    n = len(parents.start) * per_parent
    index = np.repeat(np.arange(len(parents.start)), per_parent)
    t = rng.uniform(0.45, 1.0, (n, 1))
    start = parents.start[index] * (1.0 - t) + parents.end[index] * t
    axis = parents.end[index] - parents.start[index]
    axis = axis / np.sqrt(dot(axis, axis))[:, None]
    way = axis * 0.75 + directions(rng, n) + np.array([0.0, 0.35, 0.0])
    way = way / np.sqrt(np.maximum(dot(way, way), 0.01))[:, None]
    end = start + way * (length * rng.uniform(0.7, 1.25, (n, 1)))
    radius = 0.6 * (parents.start_radius[index] * (1.0 - t[:, 0]) + parents.end_radius[index] * t[:, 0])
    return Limbs(start, end, radius, 0.45 * radius)


def trunk(foot: Sequence[float], height: float, radius: float) -> Limbs:
    """Make the one limb that a tree grows from."""
    start = np.array([foot], np.float64)
    return Limbs(start, start + np.array([0.0, height, 0.0]), np.array([radius]), np.array([0.6 * radius]))


@cache
def conifer(tiers: int, sides: int) -> Shape:
    """Cones one above the other, open below, one unit high; widest radius 0.26."""
    cones = []
    for i in range(tiers):
        low, top = 0.12 + 0.7 * i / tiers, 0.12 + 0.7 * (i + 1) / tiers + 0.18
        cones.append(lathe([(0.26 * (1.0 - 0.8 * i / tiers), low), (0.0, top)], sides))
    return join(cones)


def barrel(sides: int) -> Shape:
    """Closed barrel a metre high, standing on the origin."""
    profile = [(0.3, 0.0), (0.36, 0.25), (0.38, 0.5), (0.36, 0.75), (0.3, 1.0), (0.26, 1.0), (0.26, 0.95)]
    return lathe(profile, sides, bottom=True, top=True)


CRATE = box((-0.45, 0.0, -0.45), (0.45, 0.9, 0.45))
"""Closed crate standing on the origin."""


def scatter_rocks(rng: np.random.Generator, feet: FloatArray, size: float) -> Shape:
    """Closed stones lying on float64 (k, 3) feet."""
    n = len(feet)
    scales = size * rng.uniform(0.4, 1.4, (n, 1)) * rng.uniform(0.7, 1.3, (n, 3))
    return copies(rock(), feet, whole_degrees(rng, n), scales)


def fill(builder: MeshBuilder, triangles: int, shares: Sequence[tuple[float, str, Callable[[int], Shape]]],
         blade: Callable[[int], Shape], material: str) -> None:
    """Bring the builder's count to `triangles` exactly.

    Parameters
    ----------
    shares : per kind of small thing the share of the missing triangles, its material, and a function that makes it
        with at most a given number of triangles.
    blade : makes exactly the given number of loose triangles: what is still missing.
    """
    missing = triangles - builder.n_triangles
    for share, name, make in shares:
        builder.add(make(int(share * missing)), name)
    builder.add(blade(triangles - builder.n_triangles), material)
