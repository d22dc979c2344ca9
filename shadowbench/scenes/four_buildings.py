"""Four town buildings at a crossing (a stand-in for "4 buildings" of Hertel et al. 2009): facades of many small boxes.

Lengths are metres.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import Light
from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, Site, fit_detail, require_triangles
from shadowbench.scenes.shapes import box, copies, frame, join, lathe, prism
from shadowbench.scenes.tubes import tube

MINIMUM = 10_600
"""Fewest triangles: the buildings in their coarsest form, and a little ground."""

_DEFAULT = 11_154
_FEWEST_GROUND = 60
_HALF, _CORNER = 44.0, 15.5     # half the side of the ground; from the crossing's middle to a building's middle

_COLORS = {"brick": (0.5, 0.25, 0.18), "plaster": (0.78, 0.66, 0.47), "concrete": (0.6, 0.59, 0.57), "pale": (0.8, 0.77,
                                                                                                              0.7),
           "trim": (0.85, 0.82, 0.76), "glass": (0.09, 0.13, 0.18), "metal": (0.3, 0.32, 0.34), "wood": (0.4, 0.26, 0.15),
           "roof": (0.36, 0.17, 0.13), "asphalt": (0.26, 0.26, 0.27), "pavement": (0.5, 0.49, 0.47)}


def _window(site: Site, width: float, height: float, sill: bool) -> None:
    """Pane, frame, and a sill under it, on the plane z = 0, centred on the origin."""
    x, y = 0.5 * width, 0.5 * height
    site.add(box((-x, -y, -0.05), (x, y, 0.03)), "glass")
    site.add(frame(width, height, 0.1, 0.22), "trim")
    if sill:
        site.add(box((-x - 0.2, -y - 0.24, -0.1), (x + 0.2, -y - 0.1, 0.3)), "trim")


def _balcony(site: Site, width: float) -> None:
    """Slab and railing on the plane z = 0; the origin is the middle of the slab's top."""
    x = 0.5 * width
    site.add(box((-x, -0.18, -0.1), (x, 0.0, 1.3)), "concrete")
    site.add(box((-x, 0.95, 1.2), (x, 1.02, 1.28)), "metal")
    n = max(4, round(width / 0.45))
    places = np.stack([np.linspace(-x + 0.05, x - 0.05, n), np.zeros(n), np.full(n, 1.24)], axis=1)
    site.add(copies(box((-0.02, 0.0, -0.02), (0.02, 0.96, 0.02)), places), "metal")


def _facades(site: Site, half: tuple[float, float], floors: range, storey: float, step: float,
             balconies: bool = False) -> None:
    """Windows on all four sides of a block; a balcony under every other window towards +z, where wanted. They are at
    least `step` metres apart."""
    for turn in (0, 90, 180, 270):
        across, out = half if turn % 180 == 0 else half[::-1]
        n = int((2.0 * across - 1.0) / step)
        for floor in floors:
            for k in range(n):
                x = (k + 0.5) * 2.0 * across / n - across
                side = site.inner(0.0, 0.0, 0.0, turn).inner(x, storey * (floor + 0.58), out)
                _window(side, 1.3, 1.7, sill=not balconies or k % 2 == 0 or turn != 0)
                if balconies and turn == 0 and k % 2 and floor:
                    _balcony(side.inner(0.0, -0.95, 0.0), 2.4)


def _cornices(site: Site, half: tuple[float, float], heights: tuple[float, ...], name: str) -> None:
    """Bands round a block."""
    for y in heights:
        site.add(box((-half[0] - 0.3, y - 0.18, -half[1] - 0.3), (half[0] + 0.3, y + 0.18, half[1] + 0.3)), name)


def _shop(site: Site, half: tuple[float, float], detail: float) -> None:
    """Brick house with shop fronts, awnings, a water tank and chimneys."""
    height = 15.2
    site.add(box((-half[0], -0.5, -half[1]), (half[0], height, half[1])), "brick")
    _facades(site, half, range(1, 5), 3.0, 3.4)
    _cornices(site, half, (3.2, height), "trim")
    for x in (-4.0, 0.0, 4.0):
        front = site.inner(x, 0.0, half[1])
        front.add(box((-1.6, 0.3, -0.1), (1.6, 2.6, 0.06)), "glass")
        front.add(prism([(0.0, 2.7), (1.4, 2.35), (1.4, 2.42), (0.0, 2.95)], 3.5).turned(0.0, -1.0), "roof")
    tank = lathe([(1.4, 0.0), (1.45, 2.4), (0.0, 3.3)], rounds(detail, 14), bottom=True)
    site.add(tank.moved(2.4, height + 1.5, -1.5), "wood")
    for x in (1.6, 3.2):
        for z in (-2.3, -0.7):
            site.add(box((x - 0.1, height, z - 0.1), (x + 0.1, height + 1.55, z + 0.1)), "metal")
    for x in (-3.5, -1.5):
        site.add(box((x - 0.5, height, -3.0), (x + 0.5, height + 2.1, -2.2)), "brick")


def _flats(site: Site, half: tuple[float, float], detail: float) -> None:
    """Tall plastered block with balconies, a stair head and aerials."""
    height = 21.4
    site.add(box((-half[0], -0.5, -half[1]), (half[0], height, half[1])), "plaster")
    _facades(site, half, range(7), 3.0, 4.1, balconies=True)
    _cornices(site, half, (height,), "trim")
    site.add(box((-2.2, height, -2.0), (1.4, height + 2.8, 1.8)), "plaster")
    for x, z in ((3.4, 2.0), (4.2, -2.4), (-4.4, 3.0)):
        site.add(tube([(x, height, z), (x, height + 3.6, z)], (0.05, 0.03), 5), "metal")
        site.add(box((x - 0.7, height + 2.9, z - 0.03), (x + 0.7, height + 2.96, z + 0.03)), "metal")
    vents = lathe([(0.35, 0.0), (0.35, 0.9), (0.5, 0.95), (0.2, 1.3)], rounds(detail, 10), bottom=True, top=True)
    site.add(copies(vents, np.array([[-3.0, height, -4.0], [0.0, height, 3.6], [2.6, height, -4.2]])), "metal")


def _house(site: Site, half: tuple[float, float], detail: float) -> None:
    """Pale old house with a steep roof, dormers and chimneys."""
    height = 10.4
    site.add(box((-half[0], -0.5, -half[1]), (half[0], height, half[1])), "pale")
    _facades(site, half, range(3), 3.3, 3.4)
    _cornices(site, half, (3.5, height), "trim")
    x = half[0] + 0.6
    site.add(prism([(-x, height), (x, height), (0.0, height + 6.0)], 2.0 * half[1] + 1.0), "roof")
    for z in (-3.0, 0.5, 4.0):
        for side in (-1.0, 1.0):
            low, high = sorted((side * 1.2, side * (half[0] - 0.8)))
            site.add(box((low, height + 0.5, z - 0.7), (high, height + 2.6, z + 0.7)), "pale")
            low, high = sorted((side * 0.9, side * (half[0] - 0.5)))
            site.add(box((low, height + 2.6, z - 0.9), (high, height + 2.8, z + 0.9)), "roof")
    for z in (-4.5, 3.0):
        site.add(box((-0.5, height + 4.0, z - 0.4), (0.5, height + 7.4, z + 0.4)), "brick")
    post = lathe([(0.22, 0.0), (0.16, 0.3), (0.15, 2.6), (0.25, 2.9)], rounds(detail, 12), bottom=True, top=True)
    site.add(copies(post, np.array([[-1.3, 0.0, half[1] + 0.9], [1.3, 0.0, half[1] + 0.9]])), "trim")
    site.add(box((-1.8, 2.9, half[1] - 0.1), (1.8, 3.2, half[1] + 1.3)), "trim")


def _office(site: Site, half: tuple[float, float], detail: float) -> None:
    """Concrete slab with fins between its windows, on columns, and plant on its roof."""
    height, low = 19.0, 3.4
    site.add(box((-half[0], low, -half[1]), (half[0], height, half[1])), "concrete")
    site.add(box((-0.6 * half[0], -0.5, -0.6 * half[1]), (0.6 * half[0], low, 0.6 * half[1])), "glass")
    pillar = lathe([(0.32, 0.0), (0.32, low)], rounds(detail, 12), bottom=True, top=True)
    xs, zs = np.meshgrid(np.linspace(-half[0] + 0.6, half[0] - 0.6, 5), (-half[1] + 0.6, half[1] - 0.6))
    site.add(copies(pillar, np.stack([xs.ravel(), np.zeros(10), zs.ravel()], axis=1)), "concrete")
    for turn in (0, 90, 180, 270):
        across, out = half if turn % 180 == 0 else half[::-1]
        side = site.inner(0.0, 0.0, 0.0, turn)
        for floor in range(5):
            y = low + 3.0 * floor
            side.add(box((-across + 0.3, y + 0.8, out - 0.1), (across - 0.3, y + 2.6, out + 0.04)), "glass")
        n = round(2.0 * across / 1.5)
        fins = [box((x - 0.06, low, out - 0.1), (x + 0.06, height, out + 0.5)) for x in np.linspace(-across, across, n + 1)]
        side.add(join(fins), "trim")
    _cornices(site, half, (height,), "concrete")
    for x in (-3.4, 0.4, 3.6):
        site.add(box((x - 1.2, height, -1.4), (x + 1.2, height + 1.5, 1.2)), "metal")
        site.add(lathe([(0.7, 0.0), (0.7, 0.3)], rounds(detail, 12), bottom=True, top=True).moved(x, height + 1.5, 0.0),
                 "metal")


def _street(builder: MeshBuilder, detail: float) -> None:
    """Pavements, lamps, benches and bollards."""
    for x in (-1.0, 1.0):
        for z in (-1.0, 1.0):
            low, high = (sorted((a * 6.0, a * 27.0)) for a in (x, z))
            builder.add(box((low[0], -0.3, high[0]), (low[1], 0.14, high[1])), "pavement")
            site = Site.at(builder, x * 6.8, 0.14, z * 6.8)
            site.add(tube([(0.0, 0.0, 0.0), (0.0, 5.2, 0.0)], (0.1, 0.06), rounds(detail, 8)), "metal")
            site.add(lathe([(0.12, 5.1), (0.34, 5.5), (0.0, 5.75)], rounds(detail, 8), bottom=True), "trim")
            for k in range(4):
                bollard = lathe([(0.13, 0.0), (0.1, 0.85), (0.0, 0.98)], rounds(detail, 8), bottom=True)
                site.add(bollard.moved(x * 2.2 * (k + 1), 0.0, -0.3 * z), "metal")
            site.add(box((x * 4.0 - 0.9, 0.4, z * 1.6 - 0.25), (x * 4.0 + 0.9, 0.5, z * 1.6 + 0.25)), "wood")
            for end in (-0.7, 0.7):
                site.add(box((x * 4.0 + end - 0.08, 0.0, z * 1.6 - 0.2), (x * 4.0 + end + 0.08, 0.4, z * 1.6 + 0.2)),
                         "metal")


def _build(detail: float) -> MeshBuilder:
    """Build everything but the road."""
    builder = MeshBuilder(_COLORS)
    y, c = 0.14, _CORNER
    _shop(Site.at(builder, -c, y, -c), (6.2, 5.4), detail)
    _flats(Site.at(builder, c, y, -c), (6.4, 5.2), detail)
    _house(Site.at(builder, -c, y, c, 90), (5.4, 6.6), detail)
    _office(Site.at(builder, c, y, c, 180), (7.2, 5.0), detail)
    _street(builder, detail)
    return builder


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the crossing with exactly `triangles` triangles; `seed` makes the road uneven.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("four_buildings", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    builder = fit_detail(_build, triangles - _FEWEST_GROUND, (triangles / _DEFAULT) ** 0.5)
    road = ground((-_HALF, _HALF), (-_HALF, _HALF), triangles - builder.n_triangles)
    road.vertices[:, 1] -= rng.uniform(0.0, 0.05, len(road.vertices))
    builder.add(road, "asphalt")
    eyes = [(9.0, 37.0, 52.0), (3.0, 15.0, 41.0), (1.0, 3.0, 27.0), (-2.0, 2.0, 4.0), (-22.0, 6.0, 0.5), (-39.0, 22.0, 18.0)]
    targets = [(0.0, 6.0, 0.0), (0.5, 6.0, 0.0), (0.0, 6.0, -6.0), (2.0, 6.0, -16.0), (0.0, 6.0, -4.0), (0.0, 6.0, 0.0)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=False, fov_y=54.0, near=0.1, far=300.0,
                           light=Light.point(-62.0, 74.0, 46.0))
