"""A country house behind an iron gate: the stand-in for the view of Sintorn et al. 2014 (fig. 1).

About 100 m across. Bars close to the camera, balusters and leaves at every distance, and the house behind: steep
steps of depth everywhere. The sun is a point low on the left, so that the shadows of the trees run across lawn and
path. The camera starts in front of the gate, enters by its open leaf, and goes around the house.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import FloatArray, Light
from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.country_house import (
    ball,
    balustrade,
    fence,
    fountain,
    gate_leaf,
    hedge,
    overthrow,
    pier,
    terrace,
    villa,
)
from shadowbench.scenes.garden import Tufts, foliage, hedge_leaves, trees
from shadowbench.scenes.procedural import (
    MeshBuilder,
    ProceduralScene,
    Site,
    SmoothNoise,
    fit_detail,
    require_triangles,
    smooth_step,
    whole_degrees,
)
from shadowbench.scenes.props import blades, conifer, fill
from shadowbench.scenes.shapes import Shape, box, copies, grid, lathe

MINIMUM = 32_000
"""Fewest triangles: everything in its coarsest form."""

_START = 0.9        # detail per square root of (triangles / 88,000) at which about half is left for leaves and grass
_HALF = 56.0        # half the side of the ground
_GATE_Z = 33.5      # the gate stands across the path here
_HOUSE_Z = -17.0    # middle of the house
_TERRACE = 1.2      # height of the terrace that the house stands on

_COLORS = {
    "grass": (0.2, 0.34, 0.09), "gravel": (0.62, 0.54, 0.41), "stone": (0.55, 0.5, 0.42),
    "stone_light": (0.72, 0.67, 0.57), "plaster": (0.8, 0.63, 0.42), "brick": (0.48, 0.22, 0.14),
    "tile": (0.5, 0.2, 0.11), "wood": (0.3, 0.2, 0.12), "shutter": (0.12, 0.24, 0.2), "dark": (0.035, 0.04, 0.05),
    "iron": (0.05, 0.055, 0.06), "clay": (0.58, 0.3, 0.17), "water": (0.2, 0.33, 0.38), "bark": (0.27, 0.2, 0.14),
    "hedge": (0.08, 0.18, 0.05), "hedge_leaf": (0.14, 0.28, 0.07), "leaf": (0.24, 0.4, 0.08),
    "leaf_dark": (0.13, 0.27, 0.08), "cypress": (0.06, 0.15, 0.07), "fir": (0.08, 0.17, 0.1),
}

# Broad-leaved trees: x, z, height of the trunk, radius of the crown.
_TREES = ((-5.9, 27.6, 3.7, 2.6), (-11.5, 19.5, 4.2, 3.0), (-12.5, 10.5, 4.0, 2.8), (-7.8, 3.6, 3.4, 2.3),
          (9.5, 26.0, 3.6, 2.5), (15.0, 17.0, 4.4, 3.0), (8.4, 4.4, 3.4, 2.2), (-19.0, 25.0, 4.8, 3.2),
          (-21.0, 12.0, 5.0, 3.3), (27.0, 14.0, 4.8, 3.2), (-15.0, 42.0, 4.6, 3.2), (-24.0, 44.5, 4.8, 3.0))
# The wood behind the house and at its sides.
_WOOD = ((-35.0, -14.0, 8.0, 5.0), (-28.0, -43.0, 13.0, 5.6), (-13.0, -46.0, 16.5, 6.2), (1.0, -47.0, 15.0, 6.0),
         (13.0, -45.0, 17.0, 6.0), (26.0, -43.0, 12.0, 5.6), (37.0, -22.0, 9.0, 5.0))
# Clipped hedges: x, z, turn in degrees, length, height.
_HEDGES = ((-4.2, 27.0, 90, 9.0, 0.7), (4.2, 27.0, 90, 9.0, 0.7), (-4.2, 3.8, 90, 6.0, 0.7), (4.2, 3.8, 90, 6.0, 0.7),
           (-8.6, 22.2, 0, 8.0, 0.7), (8.6, 22.2, 0, 8.0, 0.7), (-8.4, 6.6, 0, 7.6, 0.7), (8.4, 6.6, 0, 7.6, 0.7),
           (-27.0, 0.0, 90, 44.0, 1.5), (33.0, 4.0, 90, 44.0, 1.5), (0.0, -40.5, 0, 50.0, 1.6))
_CONES = ((-5.6, 21.0), (5.6, 21.0), (-5.6, 7.8), (5.6, 7.8))
_CYPRESSES = ((-18.4, -9.0), (18.4, -9.0), (-19.5, -27.0), (19.5, -28.0))

_EYES = ((-0.7, 1.7, 39.6), (0.75, 1.75, 33.4), (1.6, 2.0, 24.5), (4.9, 2.2, 14.5), (2.0, 2.7, 4.6), (9.5, 3.3, -0.6),
         (23.0, 4.4, -5.0), (24.5, 6.5, -22.0), (10.0, 6.0, -33.0), (-10.0, 4.5, -33.5), (-25.0, 4.0, -22.0),
         (-23.0, 3.5, -2.5))
_TARGETS = ((0.0, 2.9, 0.0), (0.0, 3.0, 0.0), (-0.5, 3.0, 0.0), (-1.0, 3.0, -2.0), (0.5, 4.2, -12.0),
            (0.0, 4.0, -12.0), (4.0, 3.0, -12.0), (4.0, 3.0, -32.0), (-14.0, 3.0, -30.0), (-24.0, 3.0, -18.0),
            (-10.0, 4.0, -4.0), (0.0, 3.0, 4.0))


class _Ground:
    """Height of the terrain: level garden, rolling land around it."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._noise = SmoothNoise(rng, 26.0)
        self._fine = SmoothNoise(rng, 6.0)

    def __call__(self, x: FloatArray | float, z: FloatArray | float) -> FloatArray:
        x, z = np.asarray(x, np.float64), np.asarray(z, np.float64)
        outside = smooth_step((np.maximum(np.abs(x), np.abs(z)) - 41.0) / 15.0)
        lawn = smooth_step((np.abs(x) - 2.6) / 3.0)
        return np.asarray((2.0 + 1.6 * self._noise(x, z)) * outside * lawn + 0.05 * self._fine(x, z) * lawn)


def _ticks(borders: tuple[float, ...], size: float) -> FloatArray:
    """Positions that hit every border and are at most `size` apart."""
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / size)) + 1)[:-1]
              for a, b in pairwise(borders)]
    return np.concatenate([*pieces, [borders[-1]]])


def _terrain(builder: MeshBuilder, ground: _Ground, detail: float) -> None:
    """One-sided height field: gravel paths and grass, two parts that share a border."""
    size = 1.9 / max(detail, 0.35)
    xs = _ticks((-_HALF, -21.0, -18.6, -6.0, -2.6, 2.6, 6.0, 18.6, 21.0, _HALF), size)
    zs = _ticks((-_HALF, -30.0, -26.6, 1.0, 9.0, 19.0, 30.5, _GATE_Z, 41.0, _HALF), size)
    x, z = (a.ravel() for a in np.meshgrid(xs, zs))
    vertices = np.stack([x, ground(x, z), z], axis=1)
    triangles = grid(len(xs) - 1, len(zs) - 1)
    a, c = vertices[triangles[:, 0]], vertices[triangles[:, 2]]
    cx, cz = np.abs(0.5 * (a[:, 0] + c[:, 0])), 0.5 * (a[:, 2] + c[:, 2])
    gravel = (cx < 2.6) & (cz > 0.0) | (cx < 6.0) & (cz > 9.0) & (cz < 19.0) | (cx < 21.0) & (cz > -30.0) & (cz < 1.0)
    builder.add(Shape(vertices, triangles[gravel]), "gravel")
    builder.add(Shape(vertices, triangles[~gravel]), "grass")


def _entrance(builder: MeshBuilder, detail: float) -> None:
    """The gate: posts, one leaf closed and one open, the bow above, and the railings on either side."""
    gate = Site.at(builder, 0.0, 0.0, _GATE_Z)
    for end in (-1.0, 1.0):
        pier(gate.inner(2.35 * end, 0.0, 0.0), 0.36, 3.0, 1.4 * detail, "ball")
    gate_leaf(gate.inner(-1.97, 0.0, 0.0), 1.95, 2.2, 0.35, detail)
    gate_leaf(gate.inner(1.97, 0.0, 0.0, 180 + 70), 1.95, 2.2, 0.35, detail)
    overthrow(gate, 3.95, 2.95, detail)
    fence(gate.inner(2.7, 0.0, 0.0), 20.3, detail)
    fence(gate.inner(-2.7, 0.0, 0.0, 180), 20.3, detail)


def _garden(builder: MeshBuilder, rng: np.random.Generator, detail: float) -> None:
    """Fountain, hedges, clipped cones and balls, urns, garden balustrades and cypresses."""
    fountain(Site.at(builder, 0.0, 0.0, 14.0), detail)
    for x, z, turn, length, height in _HEDGES:
        hedge(Site.at(builder, x, 0.0, z, turn), rng, length, height, detail)
    sides = rounds(detail, 12)
    cone = lathe([(0.0, 0.0), (0.55, 0.15), (0.5, 0.6), (0.3, 1.4), (0.0, 2.0)], sides)
    for x, z in _CONES:
        builder.add(cone.moved(x, 0.0, z), "hedge")
        builder.add(ball(0.5, sides).moved(1.9 * x, 0.45, z), "hedge")
    spindle = lathe([(0.0, 0.1), (0.8, 0.8), (1.15, 3.0), (0.9, 6.0), (0.4, 8.4), (0.0, 9.4)], sides)
    for x, z in _CYPRESSES:
        builder.add(spindle.moved(x, 0.0, z), "cypress")
        builder.add(box((x - 0.14, -0.5, z - 0.14), (x + 0.14, 1.0, z + 0.14)), "bark")
    for end in (-1.0, 1.0):
        balustrade(Site.at(builder, end * 9.6, 0.0, 20.0), 6.4, detail)
        pier(Site.at(builder, end * 6.2, 0.0, 20.0), 0.26, 1.15, detail, "urn")
        pier(Site.at(builder, end * 3.3, 0.0, 8.4), 0.3, 0.9, detail, "urn")
        for z in (11.0, 17.0):
            bench = Site.at(builder, end * 7.0, 0.0, z, 90)
            bench.add(box((-0.9, 0.42, -0.25), (0.9, 0.52, 0.25)), "stone_light")
            bench.add(copies(box((-0.1, -0.2, -0.2), (0.1, 0.42, 0.2), ("-y", "+y")),
                             np.array([[-0.65, 0.0, 0.0], [0.65, 0.0, 0.0]])), "stone")


def _build(detail: float, seed: int) -> tuple[MeshBuilder, _Ground, tuple[Tufts, Tufts]]:
    """Build everything but leaves and grass; also the ground, and the tufts of the garden's trees and the wood's."""
    rng = np.random.default_rng(seed)
    builder, ground = MeshBuilder(_COLORS), _Ground(rng)
    near, far = trees(builder, rng, _TREES, detail), trees(builder, rng, _WOOD, 0.5 * detail)
    angles = whole_degrees(rng, 40)
    height = rng.uniform(11.0, 19.0, (40, 1))
    along = (np.arange(40) - 19.5) * 2.6
    row = np.stack([along, np.zeros(40), -50.0 + rng.uniform(-2.5, 2.5, 40)], axis=1)
    row[::4, 0], row[::4, 2] = -49.0, along[::4]
    row[1::4, 0], row[1::4, 2] = 49.0, along[1::4]
    row[:, 1] = ground(row[:, 0], row[:, 2]) - 0.5
    builder.add(copies(conifer(4, rounds(detail, 8)), row, angles, height), "fir")
    _terrain(builder, ground, detail)
    _entrance(builder, detail)
    _garden(builder, rng, detail)
    terrace(Site.at(builder, 0.0, _TERRACE, _HOUSE_Z + 7.0), 16.5, 7.0, _TERRACE, detail)
    builder.add(box((-16.5, -0.5, _HOUSE_Z - 8.5), (16.5, _TERRACE, _HOUSE_Z + 7.0), ("-y",)), "stone")
    villa(Site.at(builder, 0.0, _TERRACE, _HOUSE_Z), detail)
    return builder, ground, (near, far)


def _lawn(rng: np.random.Generator, ground: _Ground, n: int) -> FloatArray:
    """float64 (n, 3): roots of grass beside the path, more of them near the gate."""
    t = rng.uniform(0.0, 1.0, n)
    z = _GATE_Z - 0.4 - 31.0 * t * t
    side: NDArray[np.float64] = rng.choice([-1.0, 1.0], n)
    inner = np.where((z > 8.8) & (z < 19.2), 6.05, 2.65)
    x = side * (inner + rng.uniform(0.0, 1.0, n) * (3.0 + 7.0 * rng.uniform(0.0, 1.0, n)))
    return np.stack([x, ground(x, z) - 0.01, z], axis=1)


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the gate scene with exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("gate", triangles, MINIMUM)
    start = _START * (triangles / 88_000) ** 0.5
    builder = fit_detail(lambda detail: _build(detail, seed)[0], triangles, start)
    _, ground, (near, far) = _build(0.0, seed)
    rng = np.random.default_rng([seed, 1])
    fill(builder, triangles,
         [(0.5, "leaf", lambda n: foliage(rng, near, n, 0.42)),
          (0.16, "leaf_dark", lambda n: foliage(rng, far, n, 0.95)),
          (0.16, "hedge_leaf", lambda n: hedge_leaves(rng, _HEDGES, n))],
         lambda n: blades(rng, _lawn(rng, ground, n), 0.13), "grass")
    return ProceduralScene(builder.mesh(), _EYES, _TARGETS, closed=False, fov_y=50.0, near=0.1, far=400.0,
                           light=Light.point(-188.0, 95.0, 60.0))
