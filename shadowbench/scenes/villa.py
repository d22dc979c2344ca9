"""A villa and its pool garden in the evening: the stand-in for the scene that stresses shadow volumes in Sintorn et al.
2014 (figs. 5, 6, 8).

About 90 m across, and nearly everything in it is thin: balusters, railings, the columns, rafters and laths of two
pergolas, trellises, leaves. The sun is a point low on the left, so that every one of them throws a long shadow over lawn,
pool and house. The path leads through a pergola, along the pool, up to the house, over its terrace and back.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import FloatArray, Light
from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.country_house import (
    ball,
    balustrade,
    bars,
    column,
    fence,
    hedge,
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
)
from shadowbench.scenes.props import blades, fill, leaves
from shadowbench.scenes.shapes import Shape, box, copies, grid, lathe

MINIMUM = 44_000
"""Fewest triangles: everything in its coarsest form."""

_START = 0.8        # detail per square root of (triangles / 88,000) at which about a third is left for leaves and grass
_HALF = 46.0        # half the side of the ground
_HOUSE_Z = -17.0    # middle of the house
_TERRACE = 1.2      # height of the terrace that the house stands on
_WALK = 9.5         # distance of the pergolas' middles from the axis
_PERGOLA = (5.0, 29.0)      # where the pergolas start and end along z
_POOL = (3.6, 9.0, 23.0)    # half the pool's width, and where it starts and ends along z

_COLORS = {
    "grass": (0.22, 0.33, 0.1), "gravel": (0.64, 0.56, 0.43), "stone": (0.55, 0.5, 0.42),
    "stone_light": (0.74, 0.69, 0.59), "plaster": (0.82, 0.6, 0.4), "brick": (0.48, 0.22, 0.14),
    "tile": (0.52, 0.21, 0.11), "wood": (0.34, 0.23, 0.14), "shutter": (0.14, 0.27, 0.3), "dark": (0.035, 0.04, 0.05),
    "iron": (0.06, 0.065, 0.07), "clay": (0.6, 0.3, 0.17), "water": (0.1, 0.3, 0.4), "bark": (0.27, 0.2, 0.14),
    "hedge": (0.09, 0.19, 0.06), "hedge_leaf": (0.15, 0.29, 0.08), "leaf": (0.27, 0.38, 0.12), "vine": (0.3, 0.42, 0.1),
    "blossom": (0.62, 0.12, 0.3), "cypress": (0.06, 0.15, 0.07),
}

# Broad-leaved trees between the sun and the garden, and around it: x, z, height of the trunk, radius of the crown.
_TREES = ((-17.5, 6.5, 3.4, 2.4), (-18.5, 14.0, 3.8, 2.6), (-17.0, 22.0, 3.3, 2.3), (-20.0, 29.5, 4.2, 2.9),
          (-24.5, 2.0, 4.4, 3.0), (-26.0, 19.0, 4.8, 3.1), (23.5, 10.0, 3.6, 2.5), (18.0, 25.0, 3.8, 2.6),
          (-27.0, -12.0, 5.0, 3.2), (25.0, -8.0, 4.8, 3.0), (-14.0, -33.0, 6.0, 3.6), (13.0, -34.0, 6.4, 3.8))
# Clipped hedges: x, z, turn in degrees, length, height.
_HEDGES = ((-5.6, 16.0, 90, 12.0, 0.5), (5.6, 16.0, 90, 12.0, 0.5), (-14.5, 35.5, 0, 21.0, 1.3), (14.5, 35.5, 0, 21.0, 1.3),
           (-30.0, 8.0, 90, 52.0, 1.7), (30.0, 8.0, 90, 52.0, 1.7))
_CYPRESSES = tuple((end * x, z) for end in (-1.0, 1.0) for x, z in
                   ((22.5, -5.0), (22.5, -14.0), (22.5, -23.0), (23.0, 32.0), (13.2, 32.5)))
_POTS = tuple((end * 5.6, z) for end in (-1.0, 1.0) for z in (7.4, 24.6, 28.0))

_EYES = ((-9.3, 1.75, 33.5), (-9.6, 1.75, 24.0), (-9.4, 1.8, 14.0), (-5.4, 1.8, 4.4), (0.6, 1.9, 4.0), (0.4, 2.9, -0.4),
         (5.4, 3.1, -5.0), (13.0, 3.4, -5.2), (20.0, 4.6, 1.0), (15.5, 5.0, 17.0), (6.0, 3.6, 30.5), (-2.0, 2.2, 33.2))
_TARGETS = ((-8.6, 1.9, 20.0), (-6.5, 1.7, 10.0), (-4.0, 1.7, 0.0), (3.0, 1.4, 14.0), (1.0, 2.6, -10.0),
            (1.5, 3.6, -12.0), (-6.0, 2.2, 6.0), (-2.0, 1.5, 8.0), (0.0, 1.0, 10.0), (-6.0, 1.5, 8.0), (-3.0, 2.0, 4.0),
            (-1.0, 2.8, -6.0))


def _height(noise: SmoothNoise, x: FloatArray | float, z: FloatArray | float) -> FloatArray:
    """Height of the ground: level garden, rising land around it."""
    x, z = np.asarray(x, np.float64), np.asarray(z, np.float64)
    outside = smooth_step((np.maximum(np.abs(x), np.abs(z)) - 33.0) / 13.0)
    lawn = smooth_step((np.abs(x) - 12.0) / 3.0)
    return np.asarray((2.2 + 1.4 * noise(x, z)) * outside + 0.05 * noise(5.0 * x, 5.0 * z) * lawn)


def _terrain(builder: MeshBuilder, noise: SmoothNoise, detail: float) -> None:
    """One-sided height field: gravel walks and grass, two parts that share a border."""
    ticks = np.linspace(-_HALF, _HALF, 2 * round(_HALF / (1.6 / max(detail, 0.35))) + 1)
    x, z = (a.ravel() for a in np.meshgrid(ticks, ticks))
    vertices = np.stack([x, _height(noise, x, z), z], axis=1)
    triangles = grid(len(ticks) - 1, len(ticks) - 1)
    middle = 0.5 * (vertices[triangles[:, 0]] + vertices[triangles[:, 2]])
    cx, cz = np.abs(middle[:, 0]), middle[:, 2]
    walks = (np.abs(cx - _WALK) < 1.9) | (cz < 4.0) | (cz > 30.0)
    gravel = (cx < 21.0) & (cz > -30.0) & (cz < 34.0) & walks
    builder.add(Shape(vertices, triangles[gravel]), "gravel")
    builder.add(Shape(vertices, triangles[~gravel]), "grass")


def _row(n: int, start: float, end: float, x: float, y: float) -> FloatArray:
    """float64 (n, 3): evenly spaced places along z."""
    return np.stack([np.full(n, x), np.full(n, y), np.linspace(start, end, n)], axis=1)


def _pergola(site: Site, length: float, detail: float, lattice: float) -> None:
    """Walk along z, from 0 on: two rows of columns, beams, rafters, laths, a trellis on the side `lattice` (-1, 1)."""
    n = round(length / 3.0) + 1
    for z in np.linspace(0.0, length, n):
        for x in (-1.5, 1.5):
            column(site.inner(x, 0.0, float(z)), 2.7, 0.17, 0.5 * detail)
    for x in (-1.5, 1.5):
        site.add(box((x - 0.09, 2.7, -0.6), (x + 0.09, 2.92, length + 0.6)), "wood")
    rafters = round(length / 0.45)
    site.add(copies(box((-2.1, 0.0, -0.04), (2.1, 0.16, 0.04)), _row(rafters, -0.4, length + 0.4, 0.0, 2.92)), "wood")
    lath = box((-0.025, 0.0, -0.5), (0.025, 0.05, length + 0.5))
    site.add(copies(lath, np.stack([np.linspace(-1.8, 1.8, 9), np.full(9, 3.08), np.zeros(9)], axis=1)), "wood")
    slats = round(length / 0.32)
    side = 1.52 * lattice
    site.add(copies(box((-0.015, 0.0, -0.02), (0.015, 2.2, 0.02)), _row(slats, 0.2, length - 0.2, side, 0.35)), "wood")
    rail = box((-0.02, 0.0, 0.0), (0.02, 0.04, length))
    site.add(copies(rail, np.stack([np.full(7, side), np.linspace(0.4, 2.5, 7), np.zeros(7)], axis=1)), "wood")


def _pool(builder: MeshBuilder, detail: float) -> None:
    """Long basin with a stone rim and water below it, an iron railing around it, and urns at its corners."""
    half, low, high = _POOL
    for a, b in (((-half - 0.5, low - 0.5), (half + 0.5, low)), ((-half - 0.5, high), (half + 0.5, high + 0.5)),
                 ((-half - 0.5, low), (-half, high)), ((half, low), (half + 0.5, high))):
        builder.add(box((a[0], -0.4, a[1]), (b[0], 0.32, b[1])), "stone_light")
    builder.add(box((-half, -0.2, low), (half, 0.16, high), ("-y", "-x", "+x", "-z", "+z")), "water")
    for end in (-1.0, 1.0):
        length = high - low
        rail = Site.at(builder, end * (half + 0.25), 0.3, low, 90)
        n = round(length / 0.22)
        x = (np.arange(n, dtype=np.float64) + 0.5) * (length / n)
        rail.add(bars(x, 0.0, np.full(n, 0.75), 0.012, 4), "iron")
        rail.add(box((0.0, 0.55, -0.02), (length, 0.6, 0.02)), "iron")
        for z in (low - 0.25, high + 0.25):
            pier(Site.at(builder, end * (half + 0.25), 0.0, z), 0.3, 0.8, detail, "urn")


def _garden(builder: MeshBuilder, rng: np.random.Generator, detail: float) -> None:
    """Pergolas, pool, balustrades, fence, hedges, cypresses, and trees in pots."""
    start, end = _PERGOLA
    for side in (-1.0, 1.0):
        _pergola(Site.at(builder, side * _WALK, 0.0, start), end - start, detail, side)
        balustrade(Site.at(builder, side * 13.4, 0.0, 17.0, 90), 24.0, detail)
        balustrade(Site.at(builder, side * 4.6, 0.0, 30.2), 4.8, detail)
        fence(Site.at(builder, side * 3.0, 0.0, 37.0, 0.0 if side > 0 else 180.0), 22.0, detail)
        pier(Site.at(builder, side * 2.6, 0.0, 37.0), 0.4, 2.6, detail, "ball")
    _pool(builder, detail)
    for x, z, turn, length, height in _HEDGES:
        hedge(Site.at(builder, x, 0.0, z, turn), rng, length, height, detail)
    sides = rounds(detail, 12)
    spindle = lathe([(0.0, 0.1), (0.7, 0.8), (1.0, 2.6), (0.8, 5.2), (0.35, 7.4), (0.0, 8.4)], sides)
    for x, z in _CYPRESSES:
        builder.add(spindle.moved(x, 0.0, z), "cypress")
        builder.add(box((x - 0.12, -0.5, z - 0.12), (x + 0.12, 0.9, z + 0.12)), "bark")
    pot = lathe([(0.3, -0.1), (0.42, 0.55), (0.46, 0.56), (0.46, 0.66), (0.36, 0.66), (0.34, 0.56), (0.0, 0.56)], sides)
    for x, z in _POTS:
        builder.add(pot.moved(x, 0.0, z), "clay")
        builder.add(box((x - 0.05, 0.5, z - 0.05), (x + 0.05, 1.4, z + 0.05)), "bark")
        builder.add(ball(0.32, sides).moved(x, 1.75, z), "hedge")


def _build(detail: float, seed: int) -> tuple[MeshBuilder, SmoothNoise, Tufts]:
    """Build everything but leaves and grass; also the ground's noise and the tufts of the trees."""
    rng = np.random.default_rng(seed)
    builder, noise = MeshBuilder(_COLORS), SmoothNoise(rng, 24.0)
    tufts = trees(builder, rng, _TREES, detail)
    _terrain(builder, noise, detail)
    _garden(builder, rng, detail)
    terrace(Site.at(builder, 0.0, _TERRACE, _HOUSE_Z + 7.0), 16.5, 7.0, _TERRACE, detail)
    builder.add(box((-16.5, -0.5, _HOUSE_Z - 8.5), (16.5, _TERRACE, _HOUSE_Z + 7.0), ("-y",)), "stone")
    villa(Site.at(builder, 0.0, _TERRACE, _HOUSE_Z), detail)
    return builder, noise, tufts


def _vines(rng: np.random.Generator, n: int) -> Shape:
    """Leaves on the roofs of the pergolas, in patches, and down their trellises, at most n triangles."""
    k = n // 2
    start, end = _PERGOLA
    patch = rng.uniform(start, end, 14)
    z = patch[rng.integers(0, 14, k)] + rng.uniform(-1.6, 1.6, k)
    side, across = rng.choice([-1.0, 1.0], k), rng.uniform(-1.9, 2.6, k)
    on_roof = across < 1.7
    x = side * (_WALK + np.where(on_roof, across, 1.55 + rng.uniform(-0.1, 0.12, k)))
    y = np.where(on_roof, 3.1 + rng.uniform(-0.12, 0.25, k), rng.uniform(0.4, 3.1, k))
    return leaves(rng, np.stack([x, y, z], axis=1), 0.2)


def _potted(rng: np.random.Generator, n: int) -> Shape:
    """Leaves of the trees in pots, at most n triangles."""
    at = np.array(_POTS)
    return foliage(rng, Tufts(np.stack([at[:, 0], np.full(len(at), 1.75), at[:, 1]], axis=1), np.full(len(at), 0.5)),
                   n, 0.17)


def _lawn(rng: np.random.Generator, noise: SmoothNoise, n: int) -> FloatArray:
    """float64 (n, 3): roots of grass on both sides of the pool, and outside the pergolas."""
    inside = rng.uniform(0.0, 1.0, n) < 0.6
    x = np.where(inside, rng.uniform(4.3, 7.3, n), rng.uniform(11.6, 19.0, n)) * rng.choice([-1.0, 1.0], n)
    z = rng.uniform(4.3, 29.7, n)
    return np.stack([x, _height(noise, x, z) - 0.01, z], axis=1)


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the villa with exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("villa", triangles, MINIMUM)
    start = _START * (triangles / 88_000) ** 0.5
    builder = fit_detail(lambda detail: _build(detail, seed)[0], triangles, start)
    _, noise, tufts = _build(0.0, seed)
    rng = np.random.default_rng([seed, 1])
    fill(builder, triangles,
         [(0.42, "leaf", lambda n: foliage(rng, tufts, n, 0.4)),
          (0.26, "vine", lambda n: _vines(rng, n)),
          (0.04, "blossom", lambda n: _vines(rng, n)),
          (0.04, "leaf", lambda n: _potted(rng, n)),
          (0.12, "hedge_leaf", lambda n: hedge_leaves(rng, _HEDGES, n))],
         lambda n: blades(rng, _lawn(rng, noise, n), 0.12), "grass")
    return ProceduralScene(builder.mesh(), _EYES, _TARGETS, closed=True, fov_y=55.0, near=0.1, far=400.0,
                           light=Light.point(-160.0, 58.0, 62.0))
