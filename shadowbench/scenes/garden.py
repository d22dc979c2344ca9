"""Broad-leaved trees and the leaves of trees and hedges, for the scenes with a garden; lengths are in metres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from shadowbench.geometry import FloatArray
from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.procedural import MeshBuilder
from shadowbench.scenes.props import Limbs, branches, crown, leaves, trunk, tubes
from shadowbench.scenes.shapes import Shape, join


class Tufts(NamedTuple):
    """Balls of leaves: float64 (k, 3) centres and (k,) radii."""

    centre: FloatArray
    radius: FloatArray


def _merge(*limbs: Limbs) -> Limbs:
    """Put limbs together."""
    return Limbs(*(np.concatenate(column) for column in zip(*limbs, strict=True)))


def trees(builder: MeshBuilder, rng: np.random.Generator, places: Sequence[tuple[float, ...]], detail: float) -> Tufts:
    """Trunks and branches; returns where the leaves go: at the ends of the branches and in the crown's middle.

    Parameters
    ----------
    places : x, z, height of the trunk, radius of the crown of each tree.
    """
    centres, radii = [], []
    for x, z, height, radius in places:
        stem = trunk((x, -0.4, z), height + 0.6 * radius, 0.085 * radius + 0.05)
        boughs = branches(rng, stem, 9, 0.62 * radius)
        twigs = branches(rng, boughs, 2, 0.35 * radius)
        builder.add(tubes(stem, rounds(detail, 12, 6)), "bark")
        builder.add(tubes(_merge(boughs, twigs), rounds(detail, 4, 4)), "bark")
        middle = np.array([[x, height + 0.5 * radius, z]])
        offset = boughs.end - middle
        reach = np.sqrt((offset * offset).sum(axis=1, keepdims=True))
        ends = middle + offset * np.minimum(1.0, 0.75 * radius / reach)
        centres += [ends, middle]
        radii += [radius * rng.uniform(0.34, 0.48, len(ends)), np.array([0.6 * radius])]
    return Tufts(np.concatenate(centres), np.concatenate(radii))


def foliage(rng: np.random.Generator, tufts: Tufts, n: int, size: float) -> Shape:
    """Leaves of two triangles spread evenly over the tufts, at most n triangles."""
    per_tuft = n // (2 * len(tufts.radius))
    points = [crown(rng, per_tuft, centre, (radius, 0.8 * radius, radius))
              for centre, radius in zip(tufts.centre, tufts.radius, strict=True)]
    return leaves(rng, np.concatenate(points), size)


def hedge_leaves(rng: np.random.Generator, hedges: Sequence[tuple[float, ...]], n: int) -> Shape:
    """Leaves on the sides and tops of hedges, at most n triangles.

    Parameters
    ----------
    hedges : x, z, turn in degrees, length, height of each; they are 0.8 m thick.
    """
    area = np.array([length * (2.0 * height + 0.8) for _, _, _, length, height in hedges])
    share = (area / area.sum() * (n // 2)).astype(np.int64)
    pieces = []
    for (x, z, turn, length, height), k in zip(hedges, share, strict=True):
        u, v = rng.uniform(-0.5, 0.5, k) * length, rng.uniform(0.0, 2.0 * height + 0.8, k)
        y = np.minimum(np.minimum(v, height), 2.0 * height + 0.8 - v)
        points = np.stack([u, y, np.clip(v - height, 0.0, 0.8) - 0.4], axis=1)
        spot = Shape(points, np.zeros((0, 3), np.int64)).turned_degrees(turn).moved(x, 0.0, z)
        pieces.append(leaves(rng, spot.vertices, 0.16))
    return join(pieces)
