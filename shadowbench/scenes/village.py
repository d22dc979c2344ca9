"""A village round a church (a stand-in for "village" of Hertel et al. 2009): houses, gardens, trees, fields.

About 200 m across. Walls and roofs are open shells, as in models made for games; leaves and grass are loose triangles.
Lengths are metres.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import FloatArray, Light
from shadowbench.scenes.buildings import house, rounds, square_tower
from shadowbench.scenes.garden import Tufts, foliage, hedge_leaves, trees
from shadowbench.scenes.grounds import Height, ground
from shadowbench.scenes.procedural import (
    MeshBuilder,
    ProceduralScene,
    Site,
    SmoothNoise,
    fit_detail,
    require_triangles,
    smooth_step,
)
from shadowbench.scenes.props import CRATE, barrel, blades, fill
from shadowbench.scenes.shapes import Point, box, copies, join, lathe, prism, unit_circle

MINIMUM = 80_000
"""Fewest triangles: everything in its coarsest form."""

_DEFAULT = 247_432
_HALF = 105.0
_LAND = 9_000
"""Triangles of the land at the default count."""
_RINGS = ((30.0, 13, 0), (54.0, 21, 8), (78.0, 25, 3))      # distance from the church, houses, turn of the first in degrees

_COLORS = {"grass": (0.27, 0.38, 0.13), "stone": (0.58, 0.54, 0.47), "stone_dark": (0.42, 0.39, 0.35),
           "stone_light": (0.72, 0.68, 0.6), "plaster": (0.82, 0.75, 0.62), "wood": (0.3, 0.2, 0.12),
           "dark": (0.04, 0.045, 0.05), "roof": (0.5, 0.19, 0.12), "thatch": (0.5, 0.4, 0.22), "slate": (0.25, 0.27, 0.31),
           "iron": (0.08, 0.08, 0.09), "bark": (0.27, 0.2, 0.14), "leaf": (0.24, 0.38, 0.1), "hedge": (0.13, 0.26, 0.08)}
_ROOFS = ("roof", "thatch", "slate", "roof")


def _land(rng: np.random.Generator) -> Height:
    """Height of the land: level at the church, rolling outside."""
    noise = SmoothNoise(rng, 46.0)

    def height(x: FloatArray, z: FloatArray) -> FloatArray:
        away = smooth_step((np.sqrt(x * x + z * z) - 14.0) / 45.0)
        return np.asarray(away * (2.6 * noise(x, z)))
    return height


def _church(site: Site, rng: np.random.Generator, detail: float) -> None:
    """Nave with a steep roof and buttresses, choir, and a tower with a spire."""
    square_tower(site.inner(0.0, 0.0, -12.0), rng, 3.6, 19.0, None, detail)
    site.add(lathe([(5.0, 19.0), (0.0, 36.0)], 8, bottom=True).moved(0.0, 0.0, -12.0), "slate")
    outline: list[Point] = [(-5.5, -2.0), (5.5, -2.0), (5.5, 8.0), (0.0, 14.5), (-5.5, 8.0)]
    site.add(prism(outline, 20.0), "stone")
    for side in (-1.0, 1.0):
        slope: list[Point] = [(0.0, 14.6), (side * 6.2, 7.2), (side * 6.2, 7.5), (0.0, 15.0)]
        site.add(prism(slope if side > 0 else slope[::-1], 20.8), "slate")
        for z in (-7.5, -2.5, 2.5, 7.5):
            site.add(box((side * 6.1 - 0.6, -2.0, z - 0.5), (side * 6.1 + 0.6, 6.0, z + 0.5)), "stone_dark")
            site.add(box((side * 5.55 - 0.05, 2.2, z + 1.6), (side * 5.55 + 0.05, 6.4, z + 3.2)), "dark")
    site.add(lathe([(4.4, -2.0), (4.4, 7.0)], rounds(detail, 16), top=True).moved(0.0, 0.0, 10.0), "stone")
    site.add(lathe([(4.9, 6.9), (0.0, 11.0)], rounds(detail, 16), bottom=True).moved(0.0, 0.0, 10.0), "slate")
    graves = copies(box((-0.35, -0.4, -0.08), (0.35, 0.9, 0.08)), np.stack([
        rng.uniform(9.0, 16.0, 34) * rng.choice([-1.0, 1.0], 34), np.zeros(34), rng.uniform(-10.0, 12.0, 34)], axis=1),
        rng.integers(-12, 13, 34))
    site.add(graves, "stone_light")


def _plot(site: Site, rng: np.random.Generator, detail: float, number: int) -> None:
    """A house with a garden fence, a shed, a wood pile and what stands about."""
    width, length = rng.uniform(6.4, 8.2), rng.uniform(8.0, 11.5)
    house(site, (width, length, rng.uniform(3.4, 5.6), rng.uniform(3.0, 4.2)), _ROOFS[number % 4], detail)
    shed = site.inner(0.5 * width + 3.4, 0.0, -0.3 * length, int(rng.integers(0, 4)) * 90)
    shed.add(prism([(-1.5, -1.5), (1.5, -1.5), (1.5, 2.1), (-1.5, 2.7)], 3.2), "wood")
    shed.add(box((-1.8, 2.5, -1.8), (1.8, 2.64, 1.8)), "thatch")
    front = site.inner(0.0, 0.0, 0.5 * length + 5.0)
    x = np.linspace(-8.0, 8.0, 41)
    x = x[np.abs(x) > 1.2]
    front.add(copies(box((-0.06, -0.8, -0.025), (0.06, 1.0, 0.025)), np.stack([x, 0 * x, 0 * x], axis=1)), "stone_light")
    for low, high in ((-8.0, -1.2), (1.2, 8.0)):
        front.add(join([box((low, y, -0.05), (high, y + 0.08, -0.025)) for y in (0.2, 0.7)]), "wood")
    logs = lathe([(0.16, 0.0), (0.16, 0.9)], rounds(detail, 8, 4), bottom=True, top=True)
    upright = np.stack([-0.5 * width - 0.4 - 0.34 * (np.arange(12) % 4), np.zeros(12), 0.34 * (np.arange(12) // 4)], axis=1)
    site.add(copies(logs, upright), "wood")
    for k in range(int(rng.integers(1, 4))):
        spot = site.inner(-0.5 * width - 2.4, 0.0, 1.8 + 1.1 * k)
        spot.add(CRATE if k % 2 else barrel(rounds(detail, 12)), "wood")


def _places(rng: np.random.Generator) -> list[tuple[float, float, int]]:
    """x, z and turn of the plots: rings round the church, fronts inwards, with lanes between them."""
    found = []
    for distance, n, first in _RINGS:
        for k in range(n):
            degrees = (first + round(360 * k / n)) % 360
            c, s = unit_circle(360)[degrees]
            out = distance + rng.uniform(-2.5, 2.5)
            found.append((out * c, out * s, degrees + 90 + int(rng.integers(-9, 10))))
    return found


def _build(detail: float, seed: int) -> tuple[MeshBuilder, Tufts, Height, list[tuple[float, float, int]]]:
    """Build everything but land, leaves and grass; also where the trees' leaves go, the land and the plots."""
    rng = np.random.default_rng(seed)
    builder, height = MeshBuilder(_COLORS), _land(rng)

    def at(x: float, z: float) -> float:
        return float(height(np.array([x]), np.array([z]))[0])

    _church(Site.at(builder, 0.0, 0.0, 0.0, 20), rng, detail)
    plots = _places(rng)
    for number, (x, z, turn) in enumerate(plots):
        _plot(Site.at(builder, x, at(x, z), z, turn), np.random.default_rng([seed, number]), detail, number)
    spots = []
    for distance, n in ((20.0, 6), (42.0, 16), (66.0, 22), (92.0, 26)):
        for k in range(n):
            c, s = unit_circle(360)[(7 + round(360 * k / n) + int(rng.integers(-4, 5))) % 360]
            spots.append((distance * c, distance * s, rng.uniform(3.0, 4.6), rng.uniform(2.0, 3.2)))
    tufts = trees(builder, rng, spots, detail)
    return builder, tufts, height, plots


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the village with exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("village", triangles, MINIMUM)
    start = (triangles / _DEFAULT) ** 0.5
    land = int(_LAND * triangles / _DEFAULT)
    builder = fit_detail(lambda detail: _build(detail, seed)[0], triangles - land, start)
    _, tufts, height, plots = _build(0.0, seed)
    rng = np.random.default_rng([seed, 1])
    builder.add(ground((-_HALF, _HALF), (-_HALF, _HALF), land, height), "grass")
    hedges = [(x, z, turn, 7.0, 1.2) for x, z, turn in ((1.12 * x, 1.12 * z, turn) for x, z, turn in plots)]

    def tufts_of_grass(n: int) -> FloatArray:
        x, z = rng.uniform(-95.0, 95.0, n), rng.uniform(-95.0, 95.0, n)
        return np.stack([x, height(x, z) - 0.02, z], axis=1)

    fill(builder, triangles, [(0.72, "leaf", lambda n: foliage(rng, tufts, n, 0.5)),
                              (0.1, "hedge", lambda n: hedge_leaves(rng, hedges, n))],
         lambda n: blades(rng, tufts_of_grass(n), 0.3), "grass")
    eyes = [(56.0, 30.0, 74.0), (17.0, 7.0, 42.0), (-13.0, 3.6, 19.0), (-40.0, 9.0, -4.0), (-72.0, 34.0, -50.0),
            (0.0, 58.0, -88.0), (78.0, 40.0, -28.0)]
    targets = [(0.0, 5.0, 0.0), (0.0, 6.0, 0.0), (6.0, 6.0, -8.0), (0.0, 6.0, -6.0), (0.0, 4.0, 0.0), (0.0, 2.0, 0.0),
               (0.0, 4.0, 0.0)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=True, fov_y=50.0, near=0.2, far=500.0,
                           light=Light.point(-150.0, 120.0, 90.0))
