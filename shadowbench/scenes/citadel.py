"""A walled town on a hill: the stand-in for the game level of Sintorn et al. 2011 (fig. 7) and 2014 (figs. 5, 6).

About 200 m across: one-sided terrain, curtain walls, towers, gate house, keep, arcade, chapel, houses and props, of
which most stand in the ground without a bottom face, and some are closed. The light is a point high in the west,
whose long shadows cross the yards; the path enters by the gate and returns around the walls.
"""

from __future__ import annotations

import math

import numpy as np

from shadowbench.geometry import FloatArray, Light
from shadowbench.scenes.buildings import (
    ORNAMENT_DETAIL,
    arched_window,
    crenellation,
    curtain_wall,
    gable_roof,
    house,
    round_tower,
    rounds,
    square_tower,
    stones,
)
from shadowbench.scenes.hill import YARD, Hill, terrain
from shadowbench.scenes.procedural import (
    MeshBuilder,
    ProceduralScene,
    Site,
    fit_detail,
    require_triangles,
    whole_degrees,
)
from shadowbench.scenes.props import (
    CRATE,
    barrel,
    blades,
    branches,
    conifer,
    crown,
    fill,
    leaves,
    scatter_rocks,
    trunk,
    tubes,
)
from shadowbench.scenes.shapes import Shape, arch, box, copies, join, lathe, sheet, stairs

MINIMUM = 9_200
"""Fewest triangles: every building without its ornaments."""

# Counts grow as _FIXED + _GROWING * detail^2 (measured); the buildings take _SHARE of all, small things the rest.
_FIXED, _GROWING, _SHARE = 26_000, 50_000, 0.86
_WALL = 9.0         # height of the curtain walls

_COLORS = {
    "grass": (0.25, 0.33, 0.13), "earth": (0.43, 0.34, 0.24), "stone": (0.52, 0.49, 0.44),
    "stone_light": (0.62, 0.59, 0.53), "stone_dark": (0.38, 0.36, 0.34), "plaster": (0.75, 0.68, 0.55),
    "wood": (0.25, 0.16, 0.09), "tile": (0.5, 0.17, 0.1), "slate": (0.2, 0.25, 0.33), "thatch": (0.55, 0.43, 0.22),
    "dark": (0.03, 0.03, 0.035), "iron": (0.12, 0.12, 0.13), "cloth": (0.6, 0.07, 0.06),
    "awning": (0.75, 0.6, 0.2), "leaf": (0.17, 0.3, 0.09), "fir": (0.09, 0.19, 0.1), "bark": (0.28, 0.2, 0.13),
}

# Corners of the curtain wall (x, z), from the gate's right flank around; roof of each tower, or None; round or not.
_CORNERS = ((6.2, 52.0), (38.0, 42.0), (55.0, 8.0), (46.0, -32.0), (14.0, -54.0), (-24.0, -50.0), (-52.0, -20.0),
            (-50.0, 20.0), (-34.0, 44.0), (-6.2, 52.0))
_TOWERS = (("slate", True, 13.0), (None, True, 15.0), ("tile", False, 16.0), ("slate", True, 18.0),
           (None, False, 15.0), ("slate", True, 20.0), (None, True, 15.0), ("tile", False, 17.0),
           ("slate", True, 15.0), ("slate", True, 13.0))

# Houses: x, z, turn in degrees, width, length, eaves, rise, roof.
_HOUSES = (
    (24.0, 35.0, 62, 7.0, 9.0, 4.0, 3.4, "tile"), (36.0, 27.0, 118, 6.5, 8.5, 4.6, 3.2, "thatch"),
    (43.5, 13.0, 112, 7.5, 10.0, 4.2, 3.8, "tile"), (-22.0, 38.5, 118, 7.0, 9.5, 4.4, 3.4, "slate"),
    (-35.0, 30.0, 70, 6.5, 8.0, 5.0, 3.2, "tile"), (-40.5, 14.0, 94, 7.0, 10.0, 4.0, 3.6, "thatch"),
    (-41.0, -3.0, 86, 6.5, 9.0, 4.8, 3.2, "tile"), (-37.0, -19.0, 60, 7.0, 8.5, 4.0, 3.4, "slate"),
    (12.0, -43.0, 15, 7.0, 8.0, 4.4, 3.4, "thatch"), (-13.0, -44.0, 170, 6.5, 8.5, 4.2, 3.3, "tile"),
    (29.0, 18.0, 40, 6.5, 8.5, 4.2, 3.3, "slate"), (-25.0, -31.0, 130, 6.0, 7.5, 4.2, 3.2, "thatch"),
    (22.0, 75.0, 100, 6.5, 8.0, 3.8, 3.2, "thatch"), (-20.0, 83.0, 75, 7.0, 9.0, 4.0, 3.6, "thatch"),
)

_YARD_TREES = ((-4.0, YARD, 31.0), (20.0, YARD, 9.0), (-26.0, YARD, 4.0))

_EYES = ((-64.0, 27.0, 104.0), (-14.0, 20.0, 90.0), (0.0, 15.2, 67.0), (0.0, 14.6, 52.0), (0.0, 14.8, 38.0),
         (4.0, 15.5, 22.0), (15.5, 18.0, 4.0), (19.0, 30.0, -14.0), (8.0, 43.0, -44.0), (-34.0, 45.0, -72.0),
         (-86.0, 38.0, -40.0), (-96.0, 30.0, 36.0))
_TARGETS = ((0.0, 16.0, 20.0), (0.0, 15.0, 50.0), (0.0, 15.4, 30.0), (0.0, 16.5, 10.0), (-4.0, 20.0, -10.0),
            (-7.0, 22.0, -20.0), (28.0, 16.0, -22.0), (6.0, 20.0, -52.0), (-24.0, 22.0, -40.0), (-10.0, 17.0, -10.0),
            (0.0, 15.0, 0.0), (0.0, 15.0, 10.0))


def _fortifications(builder: MeshBuilder, rng: np.random.Generator, detail: float) -> None:
    """Curtain walls between the corners, a tower on each, and the gate house."""
    for i, ((x, z), (roof, is_round, height)) in enumerate(zip(_CORNERS, _TOWERS, strict=True)):
        site = Site.at(builder, x, YARD, z, 7.0 * i)
        if is_round:
            round_tower(site, rng, 3.3 if height == 13.0 else 4.7, height, roof, detail)
        else:
            square_tower(site, rng, 4.2, height, roof, detail)
        if i + 1 < len(_CORNERS):
            x2, z2 = _CORNERS[i + 1]
            dx, dz = x2 - x, z2 - z          # towards the next corner, so that +z is outwards
            length = float(np.sqrt(dx * dx + dz * dz))
            wall = Site(builder, 0.5 * (x + x2), YARD, 0.5 * (z + z2), dx / length, dz / length)
            curtain_wall(wall, rng, length - 4.0, _WALL, detail)
    gate = Site.at(builder, 0.0, YARD, 52.0)
    gate.add(arch(4.6, 3.4, 10.0, 11.0, 5.0, rounds(detail, 16)).moved(0.0, -0.3, 0.0), "stone")
    gate.add(arch(4.6, 3.4, 5.8, 6.3, 5.5, rounds(detail, 16)).moved(0.0, -0.3, 0.0), "stone_light")
    for turn in (0, 180):
        gate.inner(0.0, 0.0, 0.0, turn).add(crenellation(9.0, 10.6, 2.2, detail), "stone")
    bars = [box((x - 0.06, 4.4, -0.06), (x + 0.06, 6.2, 0.06)) for x in np.linspace(-2.0, 2.0, 9)]
    gate.add(join([*bars, *(box((-2.3, y, -0.04), (2.3, y + 0.1, 0.04)) for y in (4.8, 5.5))]), "iron")
    flight = stairs(max(6, round(18 * detail)), 2.4, 10.0, _WALL)
    for x, z, turn in ((27.0, 42.6, -72), (-49.0, 4.0, 0), (49.5, -14.0, 16)):
        Site.at(builder, x, YARD, z, turn).add(flight, "stone_light")


def _keep(builder: MeshBuilder, rng: np.random.Generator, detail: float) -> None:
    """Great tower with four turrets, hipped roof, three rows of windows and a stair to its door."""
    site = Site.at(builder, -8.0, YARD, -20.0, 8.0)
    x, z, height = 9.5, 7.5, 22.0
    site.add(box((-x, -4.0, -z), (x, height, z), ("-y",)), "stone")
    site.add(box((-x - 0.5, -4.0, -z - 0.5), (x + 0.5, 1.8, z + 0.5), ("-y",)), "stone_dark")
    site.add(box((-x - 0.3, 15.0, -z - 0.3), (x + 0.3, 15.4, z + 0.3)), "stone_light")
    for turn, across, out in ((0, x, z), (90, z, x), (180, x, z), (270, z, x)):
        side = site.inner(0.0, 0.0, 0.0, turn)
        side.add(crenellation(2 * across - 3.0, height, out - 0.25, detail), "stone")
        side.add(stones(rng, round(100 * detail * detail), 2 * across - 3.0, 2.0, 21.0).moved(0, 0, out),
                 "stone_light")
        for y in (6.0, 11.0, 17.0):
            for c in (-0.5, 0.0, 0.5):
                arched_window(side.inner(c * across, y, out), 1.1, 2.4, detail)
    for cx, cz in ((-x, -z), (x, -z), (x, z), (-x, z)):
        round_tower(site.inner(cx, 0.0, cz), rng, 2.2, height + 3.5, "slate", 0.7 * detail)
    ridge = [(0.9 * x, 0.0, 0.9 * z), (0.4 * x, 5.5, 0.0)]
    (a, b, c), (d, e, f) = ridge
    roof = np.array([[-a, b, -c], [a, b, -c], [a, b, c], [-a, b, c], [-d, e, f], [d, e, f]])
    faces = [(3, 2, 5), (3, 5, 4), (1, 0, 4), (1, 4, 5), (2, 1, 5), (0, 3, 4)]
    site.add(Shape(roof, np.array(faces)).moved(0.0, height + 0.3, 0.0), "slate")
    site.add(stairs(max(4, round(10 * detail)), 3.0, 5.0, 3.4).turned_degrees(180).moved(0.0, 0.0, z + 6.6),
             "stone_light")
    site.add(box((-1.5, -1.0, z), (1.5, 3.4, z + 1.6), ("-y", "-z")), "stone_light")
    site.inner(0.0, 3.4, z).add(arch(1.8, 2.0, 2.8, 3.6, 0.8, rounds(detail, 12)), "stone_light")
    site.add(box((-0.9, 3.4, z - 0.2), (0.9, 6.0, z + 0.1), ("-z",)), "wood")


def _chapel_and_arcade(builder: MeshBuilder, rng: np.random.Generator, detail: float) -> None:
    """Chapel with a spire, and a covered walk of round arches in front of it."""
    site = Site.at(builder, 30.0, YARD, -24.0, 14.0)
    site.add(box((-4.5, -3.0, -9.0), (4.5, 6.5, 9.0), ("-y", "+y")), "plaster")
    gable = np.array([[-4.5, 6.5, 0.0], [4.5, 6.5, 0.0], [0.0, 11.5, 0.0]])
    for turn in (0, 180):
        end = site.inner(0.0, 0.0, 0.0, turn)
        end.add(Shape(gable, np.array([[0, 1, 2]])).moved(0.0, 0.0, 9.0), "plaster")
        arched_window(end.inner(0.0, 2.6, 9.0), 2.0, 4.2, detail)
    for turn in (90, 270):
        for c in (-5.5, -1.8, 1.8, 5.5):
            arched_window(site.inner(0.0, 0.0, 0.0, turn).inner(c, 2.0, 4.5), 1.2, 3.2, detail)
    gable_roof(site.inner(0.0, 11.65, 0.0), 10.4, 19.0, 5.6, 1.4 * detail, "slate")
    square_tower(site.inner(0.0, 0.0, -10.5), rng, 2.4, 17.0, None, 0.7 * detail)
    site.add(lathe([(2.5, 17.0), (0.0, 27.0)], 8).moved(0.0, 0.0, -10.5), "slate")

    walk = Site.at(builder, 26.0, YARD, -2.0, 14.0)
    for k in range(7):
        bay = walk.inner(3.6 * (k - 3), 0.0, 0.0)
        bay.add(arch(2.6, 2.4, 3.6, 4.4, 0.7, rounds(detail, 16)), "stone_light")
        bay.add(lathe([(0.5, -0.5), (0.5, 0.3), (0.34, 0.4), (0.3, 2.1), (0.48, 2.4), (0.48, 2.6)],
                      rounds(detail, 12)).moved(1.8, 0.0, 0.5), "stone")
    walk.add(sheet([(-4.0, 6.4), (-0.2, 4.6), (0.9, 4.3)], 26.0, max(1, round(8 * detail))), "tile")
    walk.add(box((-12.6, -1.0, -4.4), (12.6, 6.2, -3.9), ("-y",)), "stone")
    walk.add(stones(rng, round(60 * detail * detail), 25.0, 0.3, 5.5).moved(0.0, 0.0, -3.9), "stone_dark")


def _market(builder: MeshBuilder, rng: np.random.Generator, detail: float) -> None:
    """Well, stalls with cloth roofs, barrels, crates, cart-loads of stone: what stands in the yard."""
    well = Site.at(builder, -9.0, YARD, 16.0)
    well.add(lathe([(1.5, -0.5), (1.5, 1.0), (1.2, 1.0), (1.2, -0.5)], rounds(detail, 20)), "stone_light")
    well.add(join([box((x - 0.1, 0.0, -0.1), (x + 0.1, 3.0, 0.1)) for x in (-1.35, 1.35)]), "wood")
    gable_roof(well.inner(0.0, 3.9, 0.0, 90), 3.0, 3.6, 1.0, 0.5 * detail, "thatch")
    for k, (x, z, turn) in enumerate(((12.0, 24.0, 20), (14.5, 16.0, 8), (-15.0, 26.0, 160), (-17.0, 9.0, 190))):
        stall = Site.at(builder, x, YARD, z, turn)
        posts = [box((a - 0.07, -0.3, b - 0.07), (a + 0.07, 2.4 + 0.25 * b, b + 0.07))
                 for a in (-1.8, 1.8) for b in (-1.0, 1.0)]
        stall.add(join(posts), "wood")
        stall.add(box((-1.9, 0.85, -0.2), (1.9, 0.95, 1.1)), "wood")
        dip = [(-1.3, 2.05), (-0.5, 2.3), (0.4, 2.4), (1.3, 2.75)]
        stall.add(sheet(dip, 4.2, max(1, round(6 * detail))), ("cloth", "awning")[k % 2])
    n = max(6, round(26 * detail))
    feet = np.stack([rng.uniform(10.0, 20.0, n) * rng.choice([-1.0, 1.0], n), np.full(n, YARD),
                     rng.uniform(10.0, 32.0, n)], axis=1)
    for k, (foot, turn) in enumerate(zip(feet, whole_degrees(rng, n), strict=True)):
        shape, name = ((barrel(rounds(detail, 12)), "wood"), (CRATE, "thatch"))[k % 2]
        builder.add(shape.turned_degrees(turn).moved(*foot), name)
        if k % 6 == 1:
            builder.add(CRATE.scaled(0.8, 0.8, 0.8).turned_degrees(turn + 25).moved(foot[0], YARD + 0.9, foot[2]),
                        "wood")


def _trees(builder: MeshBuilder, seed: int, ground: Hill, detail: float) -> FloatArray:
    """Firs outside the walls and leafy trees on both sides; returns the middles of the latter's crowns (k, 3)."""
    rng = np.random.default_rng([seed, 2])
    n_firs = 46 if detail >= ORNAMENT_DETAIL else 16
    firs = ground.around(rng, n_firs, 70.0, 102.0, clear=22.0)
    scales = rng.uniform(7.0, 13.0, (n_firs, 1))
    builder.add(copies(conifer(4, rounds(detail, 12, 4)), firs, whole_degrees(rng, n_firs), scales), "fir")
    feet = np.concatenate([ground.around(rng, 10, 68.0, 96.0, clear=26.0), _YARD_TREES])
    for foot in feet:
        stem = trunk(foot - np.array([0.0, 0.5, 0.0]), 4.6, 0.32)
        builder.add(tubes(stem, rounds(detail, 8, 4)), "bark")
        builder.add(tubes(branches(rng, stem, 7, 2.1), rounds(detail, 4, 4)), "bark")
    return feet + np.array([0.0, 5.2, 0.0])


def _build(detail: float, seed: int) -> MeshBuilder:
    """Build everything but the small things that make up the count. The count depends on `detail` alone."""
    rng = np.random.default_rng(seed)
    builder, ground = MeshBuilder(_COLORS), Hill(seed)
    for shape, material in terrain(ground, detail, _CORNERS):
        builder.add(shape, material)
    _fortifications(builder, rng, detail)
    _keep(builder, rng, detail)
    _chapel_and_arcade(builder, rng, detail)
    for x, z, turn, width, length, eaves, rise, roof in _HOUSES:
        site = Site.at(builder, x, float(ground(x, z)), z, turn)
        house(site, (width, length, eaves, rise), roof, detail)
    _market(builder, rng, detail)
    return builder


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the citadel with exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("citadel", triangles, MINIMUM)
    ground, rng = Hill(seed), np.random.default_rng([seed, 1])
    trees = MeshBuilder(_COLORS)
    start = math.sqrt(max(0.0, _SHARE * triangles - _FIXED) / _GROWING)
    crowns = _trees(trees, seed, ground, min(1.0, start))
    builder = fit_detail(lambda detail: _build(detail, seed), triangles - trees.n_triangles, start)
    builder.extend(trees)

    def foliage(n: int) -> Shape:
        per_tree = n // (2 * len(crowns))
        points = [crown(rng, per_tree, centre, (2.4, 2.0, 2.4)) for centre in crowns]
        return leaves(rng, np.concatenate(points), 0.62)

    def rubble(n: int) -> Shape:
        return scatter_rocks(rng, ground.around(rng, n // 8, 58.0, 100.0), 0.8)

    fill(builder, triangles, [(0.7, "leaf", foliage), (0.2, "stone_dark", rubble)],
         lambda n: blades(rng, ground.around(rng, n, 56.0, 100.0), 0.6), "leaf")
    return ProceduralScene(builder.mesh(), _EYES, _TARGETS, closed=True, fov_y=60.0, near=0.1, far=500.0,
                           light=Light.point(-170.0, 95.0, 15.0))
