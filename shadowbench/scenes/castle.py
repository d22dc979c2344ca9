"""A small castle on a mound (a stand-in for the "castle" scene of Sen et al. 2003): a game model of closed bodies.

Lengths are metres.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import FloatArray, Light
from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.procedural import (
    MeshBuilder,
    ProceduralScene,
    Site,
    SmoothNoise,
    fit_detail,
    require_triangles,
    smooth_step,
)
from shadowbench.scenes.shapes import box, lathe, prism, slab, unit_circle
from shadowbench.scenes.tubes import tube

MINIMUM = 1_100
"""Fewest triangles: the castle in its coarsest form, and a little ground."""

_DEFAULT = 1_204
_FEWEST_GROUND = 60
_HALF = 46.0            # half the side of the ground
_COURT = 13.0           # from the middle to the middle of a wall
_WALL, _TOWER = 6.5, 10.5       # heights

_COLORS = {"stone": (0.56, 0.52, 0.46), "stone_dark": (0.4, 0.37, 0.34), "roof": (0.46, 0.17, 0.12), "wood": (0.3, 0.2,
                                                                                                              0.12),
           "cloth": (0.75, 0.55, 0.1), "grass": (0.27, 0.36, 0.13)}

_MERLON = box((-0.6, 0.0, -0.35), (0.6, 1.1, 0.35))


def _wall(site: Site, gate: bool) -> None:
    """Wall along x with merlons, its outer face towards +z; with a gateway in its middle, or not."""
    reach = _COURT - 1.5
    parts = [(-reach, -2.6), (2.6, reach)] if gate else [(-reach, reach)]
    for low, high in parts:
        site.add(box((low, -4.0, -0.9), (high, _WALL, 0.9)), "stone")
    x = [-8.6, -5.2, 5.2, 8.6] if gate else [-8.6, -4.3, 0.0, 4.3, 8.6]
    places = np.array([[a, _WALL, 0.5] for a in x])
    for place in places:
        site.add(_MERLON.moved(*place), "stone")


def _tower(site: Site, detail: float, roof: bool) -> None:
    """Round tower with an overhanging head and merlons, or a pointed roof."""
    radius, sides = 2.6, rounds(detail, 12)
    profile = [(1.15 * radius, -4.0), (radius, 1.0), (radius, _TOWER - 2.0), (1.2 * radius, _TOWER - 1.0),
               (1.2 * radius, _TOWER)]
    site.add(lathe(profile, sides, bottom=True, top=True), "stone")
    if roof:
        site.add(lathe([(1.38 * radius, _TOWER + 0.02), (0.0, _TOWER + 5.4)], sides, bottom=True), "roof")
        return
    for k in range(4):
        degrees = 45 + 90 * k
        c, s = unit_circle(360)[degrees]
        site.inner(radius * c, _TOWER, radius * s, degrees - 90).add(_MERLON, "stone")


def _gatehouse(site: Site) -> None:
    """Two blocks, a closed round arch between them, a lintel with merlons and a bridge before it."""
    for end in (-1.0, 1.0):
        low, high = sorted((end * 2.0, end * 4.4))
        site.add(box((low, -4.0, -1.6), (high, 8.2, 2.2)), "stone_dark")
        site.add(_MERLON.moved(end * 3.2, 8.2, 1.6), "stone_dark")
    circle = unit_circle(16)[8::-1]
    inner = [(2.0 * c, 3.0 + 2.0 * s) for c, s in circle]
    outer = [(2.05 * c, 6.0 if 0 < i < 8 else 3.0) for i, (c, _) in enumerate(circle)]
    site.add(slab(inner, outer, 2.6).moved(0.0, 0.0, 0.2), "stone_dark")
    site.add(box((-2.0, 5.9, -1.4), (2.0, 7.2, 1.6)), "stone_dark")
    site.add(_MERLON.moved(0.0, 7.2, 1.2), "stone_dark")
    site.add(box((-1.7, -0.35, 1.6), (1.7, 0.15, 12.0)), "wood")


def _keep(site: Site) -> None:
    """Square keep with a hall beside it, roofs and a flag."""
    site.add(box((-3.6, -4.0, -3.6), (3.6, 12.5, 3.6)), "stone")
    site.add(box((-4.0, 12.5, -4.0), (4.0, 13.6, 4.0)), "stone_dark")
    for x, z in ((-3.4, -3.5), (3.4, -3.5), (-3.4, 3.5), (3.4, 3.5), (0.0, 3.5), (0.0, -3.5)):
        site.add(_MERLON.moved(x, 13.6, z), "stone_dark")
    site.add(box((-1.0, 13.6, -1.0), (1.0, 16.0, 1.0)), "stone")
    site.add(lathe([(1.9, 16.0), (0.0, 19.0)], 4, bottom=True).turned_degrees(45), "roof")
    site.add(tube([(0.0, 18.6, 0.0), (0.0, 22.0, 0.0)], (0.08, 0.05), 4), "wood")
    site.add(prism([(0.05, 20.6), (2.4, 21.2), (0.05, 21.8)], 0.06), "cloth")
    hall = site.inner(8.3, 0.0, -4.0)
    hall.add(prism([(-2.4, -4.0), (2.4, -4.0), (2.4, 3.2), (0.0, 5.6), (-2.4, 3.2)], 10.0), "wood")
    for side in (-1.0, 1.0):
        slope = [(0.0, 5.7), (side * 2.8, 3.0), (side * 2.8, 3.2), (0.0, 6.0)]
        hall.add(prism(slope if side > 0 else slope[::-1], 10.6), "roof")


def _build(detail: float) -> MeshBuilder:
    """Build the castle."""
    builder = MeshBuilder(_COLORS)
    court = Site.at(builder, 0.0, 0.0, 0.0)
    for k in range(4):
        _wall(court.inner(0.0, 0.0, 0.0, 90 * k).inner(0.0, 0.0, _COURT), gate=k == 0)
        c, s = unit_circle(8)[2 * k + 1] * _COURT * 2.0**0.5
        _tower(court.inner(c, 0.0, s), detail, roof=k != 0)
    _gatehouse(court.inner(0.0, 0.0, _COURT))
    _keep(court.inner(-2.5, 0.0, -3.0))
    return builder


def _land(x: FloatArray, z: FloatArray, noise: SmoothNoise) -> FloatArray:
    """Height of the ground: a level top, rolling land around it."""
    away = smooth_step((np.maximum(np.abs(x), np.abs(z)) - 21.0) / 14.0)
    return np.asarray(away * (2.4 * noise(x, z) - 4.0))


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the castle with exactly `triangles` triangles; `seed` shapes the land around it.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("castle", triangles, MINIMUM)
    noise = SmoothNoise(np.random.default_rng(seed), 17.0)
    builder = fit_detail(_build, triangles - _FEWEST_GROUND, (triangles / _DEFAULT) ** 0.5)
    builder.add(ground((-_HALF, _HALF), (-_HALF, _HALF), triangles - builder.n_triangles, lambda x, z: _land(x, z, noise)),
                "grass")
    eyes = [(28.0, 26.0, 45.0), (3.0, 11.0, 47.0), (-31.0, 15.0, 36.0), (-45.0, 22.0, -4.0), (-19.0, 27.0, -40.0),
            (34.0, 20.0, -30.0), (46.0, 23.0, 12.0)]
    targets = [(0.0, 3.0, 1.0), (0.0, 5.0, 0.0), (0.0, 4.0, 0.0), (0.0, 4.0, -1.0), (0.0, 4.0, 0.0), (0.0, 5.0, 0.0),
               (0.0, 4.0, 0.0)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=True, fov_y=42.0, near=0.2, far=300.0,
                           light=Light.point(-44.0, 46.0, 34.0))
