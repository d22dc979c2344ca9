"""A walled town on a hill: the stand-in for the game level of Sintorn et al. 2011 (fig. 7) and 2014 (figs. 5, 6).

About 200 m across: one-sided terrain, curtain walls, towers, gate house, keep, arcade, chapel, houses and props, of
which most stand in the ground without a bottom face, and some are closed. The light is a point high in the west,
whose long shadows cross the yards; the path enters by the gate and returns around the walls.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import FloatArray, Light
from shadowbench.scenes.buildings import (
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
from shadowbench.scenes.props import (
    CRATE,
    barrel,
    blades,
    conifer,
    crown,
    fill,
    leaves,
    scatter_rocks,
    trunk,
    tubes,
)
from shadowbench.scenes.shapes import Shape, arch, box, copies, grid, join, lathe, sheet, stairs, unit_circle

MINIMUM = 26_000
"""Fewest triangles: every building in its coarsest form."""

_START = 0.98       # detail per square root of (triangles / 60,000) at which about an eighth is left for small things
_HALF = 105.0       # half the side of the terrain
_YARD = 12.0        # height of the hill's flat top
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
    (22.0, 75.0, 100, 6.5, 8.0, 3.8, 3.2, "thatch"), (-20.0, 83.0, 75, 7.0, 9.0, 4.0, 3.6, "thatch"),
)

_EYES = ((-64.0, 27.0, 104.0), (-14.0, 20.0, 90.0), (0.0, 15.2, 67.0), (0.0, 14.6, 52.0), (0.0, 14.8, 38.0),
         (4.0, 15.5, 22.0), (15.5, 18.0, 4.0), (19.0, 30.0, -14.0), (8.0, 43.0, -44.0), (-34.0, 45.0, -72.0),
         (-86.0, 38.0, -40.0), (-96.0, 30.0, 36.0))
_TARGETS = ((0.0, 16.0, 20.0), (0.0, 15.0, 50.0), (0.0, 15.4, 30.0), (0.0, 16.5, 10.0), (-4.0, 20.0, -10.0),
            (-7.0, 22.0, -20.0), (28.0, 16.0, -22.0), (6.0, 20.0, -52.0), (-24.0, 22.0, -40.0), (-10.0, 17.0, -10.0),
            (0.0, 15.0, 0.0), (0.0, 15.0, 10.0))


class _Ground:
    """Height of the terrain: a hill with a flat top and a ramp to the gate, in rolling land."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._noise = SmoothNoise(rng, 34.0)
        self._fine = SmoothNoise(rng, 7.0)

    def __call__(self, x: FloatArray | float, z: FloatArray | float) -> FloatArray:
        x, z = np.asarray(x, np.float64), np.asarray(z, np.float64)
        distance = np.sqrt(x * x + z * z)
        outside = smooth_step((distance - 60.0) / 38.0)
        rolling = 3.2 * self._noise(x, z) + 0.35 * self._fine(x, z)
        hill = _YARD * (1.0 - outside) + rolling * outside + 0.06 * self._fine(x, z) * (1.0 - outside)
        ramp = smooth_step((abs(x) - 4.0) / 9.0) + smooth_step((44.0 - z) / 4.0)
        road = _YARD * (1.0 - smooth_step((z - 56.0) / 46.0)) + 0.6 * outside
        ramp = np.minimum(ramp, 1.0)
        return np.asarray(hill * ramp + road * (1.0 - ramp))


def _terrain(builder: MeshBuilder, ground: _Ground, detail: float) -> None:
    """One-sided height field; paths and yard in earth, the rest in grass, as two parts that share a border."""
    n = max(20, round(72 * detail))
    ticks = np.linspace(-_HALF, _HALF, n + 1)
    x, z = (a.ravel() for a in np.meshgrid(ticks, ticks))
    vertices = np.stack([x, ground(x, z), z], axis=1)
    triangles = grid(n, n)
    centre_x, centre_z = (vertices[triangles[:, 0], k] + vertices[triangles[:, 2], k] for k in (0, 2))
    centre_x, centre_z = 0.5 * centre_x, 0.5 * centre_z
    yard = centre_x * centre_x + centre_z * centre_z < 46.0 * 46.0
    earth = yard | ((np.abs(centre_x) < 4.5) & (centre_z > 30.0))
    builder.add(Shape(vertices, triangles[earth]), "earth")
    builder.add(Shape(vertices, triangles[~earth]), "grass")


def _fortifications(builder: MeshBuilder, rng: np.random.Generator, detail: float) -> None:
    """Curtain walls between the corners, a tower on each, and the gate house."""
    for i, ((x, z), (roof, is_round, height)) in enumerate(zip(_CORNERS, _TOWERS, strict=True)):
        site = Site.at(builder, x, _YARD, z, 7.0 * i)
        if is_round:
            round_tower(site, rng, 3.3 if height == 13.0 else 4.7, height, roof, detail)
        else:
            square_tower(site, rng, 4.2, height, roof, detail)
        if i + 1 < len(_CORNERS):
            x2, z2 = _CORNERS[i + 1]
            dx, dz = x - x2, z - z2          # from the next corner to this one, so that +z is outwards
            length = float(np.sqrt(dx * dx + dz * dz))
            wall = Site(builder, 0.5 * (x + x2), _YARD, 0.5 * (z + z2), dx / length, dz / length)
            curtain_wall(wall, rng, length - 4.0, _WALL, detail)
    gate = Site.at(builder, 0.0, _YARD, 52.0)
    gate.add(arch(4.6, 3.4, 10.0, 11.0, 5.0, rounds(detail, 16)).moved(0.0, -0.3, 0.0), "stone")
    gate.add(arch(4.6, 3.4, 5.8, 6.3, 5.5, rounds(detail, 16)).moved(0.0, -0.3, 0.0), "stone_light")
    for turn in (0, 180):
        gate.inner(0.0, 0.0, 0.0, turn).add(crenellation(9.0, 10.6, 2.2), "stone")
    bars = [box((x - 0.06, 4.4, -0.06), (x + 0.06, 6.2, 0.06)) for x in np.linspace(-2.0, 2.0, 9)]
    gate.add(join([*bars, *(box((-2.3, y, -0.04), (2.3, y + 0.1, 0.04)) for y in (4.8, 5.5))]), "iron")
    flight = stairs(max(6, round(18 * detail)), 2.4, 10.0, _WALL)
    for x, z, turn in ((27.0, 42.6, -72), (-49.0, 4.0, 0), (49.5, -14.0, 16)):
        Site.at(builder, x, _YARD, z, turn).add(flight, "stone_light")


def _keep(builder: MeshBuilder, rng: np.random.Generator, detail: float) -> None:
    """Great tower with four turrets, hipped roof, three rows of windows and a stair to its door."""
    site = Site.at(builder, -8.0, _YARD, -20.0, 8.0)
    x, z, height = 9.5, 7.5, 22.0
    site.add(box((-x, -4.0, -z), (x, height, z), ("-y",)), "stone")
    site.add(box((-x - 0.5, -4.0, -z - 0.5), (x + 0.5, 1.8, z + 0.5), ("-y",)), "stone_dark")
    site.add(box((-x - 0.3, 15.0, -z - 0.3), (x + 0.3, 15.4, z + 0.3)), "stone_light")
    for turn, across, out in ((0, x, z), (90, z, x), (180, x, z), (270, z, x)):
        side = site.inner(0.0, 0.0, 0.0, turn)
        side.add(crenellation(2 * across - 3.0, height, out - 0.25), "stone")
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
    site = Site.at(builder, 30.0, _YARD, -24.0, 14.0)
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

    walk = Site.at(builder, 26.0, _YARD, -2.0, 14.0)
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
    well = Site.at(builder, -9.0, _YARD, 16.0)
    well.add(lathe([(1.5, -0.5), (1.5, 1.0), (1.2, 1.0), (1.2, -0.5)], rounds(detail, 20)), "stone_light")
    well.add(join([box((x - 0.1, 0.0, -0.1), (x + 0.1, 3.0, 0.1)) for x in (-1.35, 1.35)]), "wood")
    gable_roof(well.inner(0.0, 3.9, 0.0, 90), 3.0, 3.6, 1.0, 0.5 * detail, "thatch")
    for k, (x, z, turn) in enumerate(((12.0, 24.0, 20), (14.5, 16.0, 8), (-15.0, 26.0, 160), (-17.0, 9.0, 190))):
        stall = Site.at(builder, x, _YARD, z, turn)
        posts = [box((a - 0.07, -0.3, b - 0.07), (a + 0.07, 2.4 + 0.25 * b, b + 0.07))
                 for a in (-1.8, 1.8) for b in (-1.0, 1.0)]
        stall.add(join(posts), "wood")
        stall.add(box((-1.9, 0.85, -0.2), (1.9, 0.95, 1.1)), "wood")
        dip = [(-1.3, 2.05), (-0.5, 2.3), (0.4, 2.4), (1.3, 2.75)]
        stall.add(sheet(dip, 4.2, max(1, round(6 * detail))), ("cloth", "awning")[k % 2])
    n = max(6, round(26 * detail))
    feet = np.stack([rng.uniform(10.0, 20.0, n) * rng.choice([-1.0, 1.0], n), np.full(n, _YARD),
                     rng.uniform(10.0, 32.0, n)], axis=1)
    for k, (foot, turn) in enumerate(zip(feet, whole_degrees(rng, n), strict=True)):
        shape, name = ((barrel(rounds(detail, 12)), "wood"), (CRATE, "thatch"))[k % 2]
        builder.add(shape.turned_degrees(turn).moved(*foot), name)
        if k % 6 == 1:
            builder.add(CRATE.scaled(0.8, 0.8, 0.8).turned_degrees(turn + 25).moved(foot[0], _YARD + 0.9, foot[2]),
                        "wood")


def _around(rng: np.random.Generator, ground: _Ground, n: int, inner: float, outer: float) -> FloatArray:
    """float64 (n, 3): points on the ground at a distance from the middle, off the road."""
    circle = unit_circle(360)[whole_degrees(rng, n)]
    distance = inner + (outer - inner) * np.sqrt(rng.uniform(0.0, 1.0, n))
    x, z = distance * circle[:, 0], distance * circle[:, 1]
    x = np.where((np.abs(x) < 6.0) & (z > 0.0), x + 12.0, x)
    return np.stack([x, ground(x, z) - 0.05, z], axis=1)


def _build(detail: float, seed: int) -> tuple[MeshBuilder, _Ground, FloatArray]:
    """Build everything but the small things that make up the count; also the ground and the trees' crowns."""
    rng = np.random.default_rng(seed)
    builder, ground = MeshBuilder(_COLORS), _Ground(rng)
    _terrain(builder, ground, detail)
    _fortifications(builder, rng, detail)
    _keep(builder, rng, detail)
    _chapel_and_arcade(builder, rng, detail)
    for x, z, turn, width, length, eaves, rise, roof in _HOUSES:
        site = Site.at(builder, x, float(ground(x, z)), z, turn)
        house(site, (width, length, eaves, rise), roof, detail)
    _market(builder, rng, detail)
    firs = _around(rng, ground, 46, 72.0, 102.0)
    scales = rng.uniform(7.0, 13.0, (46, 1))
    builder.add(copies(conifer(4, rounds(detail, 12)), firs, whole_degrees(rng, 46), scales), "fir")
    trees = np.concatenate([_around(rng, ground, 10, 70.0, 98.0),
                            [[-4.0, _YARD, 31.0], [20.0, _YARD, 9.0], [-26.0, _YARD, 4.0]]])
    for foot in trees:
        builder.add(tubes(trunk(foot - np.array([0.0, 0.5, 0.0]), 4.6, 0.32), rounds(detail, 8, 4)), "bark")
    return builder, ground, trees + np.array([0.0, 5.4, 0.0])


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the citadel with exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("citadel", triangles, MINIMUM)
    start = _START * (triangles / 60_000) ** 0.5
    builder = fit_detail(lambda detail: _build(detail, seed)[0], triangles, start)
    _, ground, crowns = _build(0.0, seed)
    rng = np.random.default_rng([seed, 1])

    def foliage(n: int) -> Shape:
        per_tree = n // (2 * len(crowns))
        points = [crown(rng, per_tree, centre, (2.3, 2.0, 2.3)) for centre in crowns]
        return leaves(rng, np.concatenate(points), 0.75)

    fill(builder, triangles,
         [(0.55, "leaf", foliage),
          (0.25, "stone_dark", lambda n: scatter_rocks(rng, _around(rng, ground, n // 8, 58.0, 100.0), 0.8))],
         lambda n: blades(rng, _around(rng, ground, n, 56.0, 100.0), 0.6), "leaf")
    return ProceduralScene(builder.mesh(), _EYES, _TARGETS, closed=True, fov_y=60.0, near=0.1, far=500.0,
                           light=Light.point(-150.0, 135.0, 95.0))
