"""A farmhouse kitchen under a lamp (a stand-in for "kitchen" of Hertel et al. 2009): an interior with many objects.

Lengths are metres. Nearly every body is closed. The light is the lamp over the table, so shadows run outwards over
floor, walls and ceiling.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import Light
from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.kitchen_ware import add_crockery, add_hanging_pans, add_table_ware
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, Site, fit_detail, require_triangles
from shadowbench.scenes.shapes import box, copies, frame, join, lathe
from shadowbench.scenes.tubes import tube

MINIMUM = 24_000
"""Fewest triangles: all objects in their coarsest form, and a little floor."""

_START = 2.1 / 103_351          # detail per triangle: how round everything is
_FEWEST_FLOOR = 200
_X, _Z, _HIGH = 3.6, 3.0, 2.7           # half the room's sides and its height
_TOP = 0.9                              # height of the worktops
_LAMP = (0.1, 1.86, 0.2)

_COLORS = {"wall": (0.8, 0.74, 0.6), "ceiling": (0.82, 0.8, 0.75), "floor": (0.5, 0.34, 0.24), "tile": (0.62, 0.7, 0.7),
           "wood": (0.42, 0.27, 0.15), "wood_light": (0.62, 0.45, 0.26), "cabinet": (0.36, 0.46, 0.42), "top": (0.7, 0.67,
                                                                                                                0.62),
           "steel": (0.55, 0.56, 0.58), "iron": (0.1, 0.1, 0.11), "china": (0.86, 0.85, 0.8), "blue": (0.2, 0.32, 0.55),
           "glass": (0.25, 0.42, 0.33), "copper": (0.64, 0.33, 0.2), "clay": (0.6, 0.34, 0.22), "red": (0.66, 0.13, 0.09),
           "green": (0.3, 0.45, 0.12), "bread": (0.66, 0.46, 0.24)}


def _shell(builder: MeshBuilder) -> None:
    """Walls, ceiling with beams, skirting, a window and a door; the room is open towards +z."""
    builder.add(box((-_X, 0.0, -_Z), (_X, _HIGH, _Z), ("-y", "+y", "+z")).flipped(), "wall")
    builder.add(box((-_X, _HIGH, -_Z), (_X, _HIGH + 0.1, _Z)), "ceiling")
    for x in np.linspace(-3.0, 3.0, 7):
        builder.add(box((x - 0.07, _HIGH - 0.16, -_Z), (x + 0.07, _HIGH + 0.05, _Z)), "wood")
    builder.add(box((-_X, 0.0, -_Z), (_X, 0.1, -_Z + 0.03)), "wood")
    window = Site.at(builder, 1.3, 1.65, -_Z)
    window.add(box((-0.62, -0.47, -0.05), (0.62, 0.47, 0.012)), "blue")
    window.add(frame(1.2, 0.9, 0.08, 0.12), "china")
    window.add(join([box((-0.02, -0.46, 0.0), (0.02, 0.46, 0.04)), box((-0.61, -0.02, 0.0), (0.61, 0.02, 0.04))]), "china")
    window.add(box((-0.8, -0.62, 0.0), (0.8, -0.57, 0.2)), "wood_light")
    door = Site.at(builder, -_X, 0.0, 1.4, 270)
    door.add(box((-0.48, 0.0, -0.02), (0.48, 2.05, 0.05)), "cabinet")
    for x, low, high in ((-0.22, 0.2, 0.9), (0.22, 0.2, 0.9), (-0.22, 1.1, 1.9), (0.22, 1.1, 1.9)):
        door.add(box((x - 0.16, low, 0.03), (x + 0.16, high, 0.075)), "cabinet")


def _tiles(builder: MeshBuilder) -> None:
    """Tiles on the back wall above the worktop."""
    size, gap = 0.15, 0.008
    columns, rows = 42, 4
    x, y = (a.ravel() for a in np.meshgrid(np.arange(columns) * size - 3.15, _TOP + 0.02 + size * np.arange(rows)))
    keep = ~((x > 0.45) & (x < 2.1) & (y > 1.0))
    one = box((gap, gap, 0.0), (size, size, 0.012), ("-z",))
    builder.add(copies(one, np.stack([x, y, np.full(len(x), -_Z)], axis=1)[keep]), "tile")


def _cabinet(site: Site, width: float, drawers: bool, detail: float) -> None:
    """Base cabinet against the plane z = 0, 0.6 m deep: carcass, plinth, worktop, doors or drawers with knobs."""
    x = 0.5 * width
    site.add(box((-x, 0.1, 0.0), (x, _TOP - 0.04, 0.58)), "cabinet")
    site.add(box((-x, 0.0, 0.05), (x, 0.1, 0.5)), "wood")
    site.add(box((-x - 0.01, _TOP - 0.04, 0.0), (x + 0.01, _TOP, 0.63)), "top")
    knob = lathe([(0.012, 0.0), (0.01, 0.015), (0.02, 0.025), (0.0, 0.035)], rounds(detail, 12), bottom=True)
    out = knob.vertices[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])
    knob = knob._replace(vertices=out)
    fronts = [(-x, 0.12 + 0.185 * k, x, 0.29 + 0.185 * k) for k in range(4)] if drawers else [
        (-x, 0.12, 0.0, 0.84), (0.0, 0.12, x, 0.84)]
    for left, low, right, high in fronts:
        site.add(box((left + 0.012, low, 0.57), (right - 0.012, high, 0.6)), "cabinet")
        site.add(box((left + 0.06, low + 0.04, 0.59), (right - 0.06, high - 0.04, 0.612)), "cabinet")
        at = 0.5 * (left + right) if drawers else (-0.06 if left < -0.01 else 0.06)
        site.add(knob.moved(at, 0.5 * (low + high) if drawers else 0.7, 0.612), "copper")


def _stove(site: Site, detail: float) -> None:
    """Range with an oven door, rings, a kettle and a pipe."""
    site.add(box((-0.45, 0.0, 0.0), (0.45, _TOP, 0.62)), "iron")
    site.add(box((-0.36, 0.2, 0.6), (0.36, 0.66, 0.65)), "steel")
    site.add(tube([(-0.3, 0.72, 0.7), (0.3, 0.72, 0.7)], (0.014, 0.014), rounds(detail, 10)), "steel")
    plate = lathe([(0.12, 0.0), (0.12, 0.018), (0.05, 0.022), (0.04, 0.016)], rounds(detail, 24), bottom=True, top=True)
    for x in (-0.22, 0.22):
        for z in (0.17, 0.45):
            site.add(plate.moved(x, _TOP, z), "iron")
    site.add(tube([(0.0, _TOP, 0.1), (0.0, _HIGH, 0.1)], (0.09, 0.09), rounds(detail, 20)), "iron")


def _table(site: Site, detail: float) -> None:
    """Table with turned legs."""
    site.add(box((-1.0, 0.72, -0.5), (1.0, 0.77, 0.5)), "wood_light")
    site.add(box((-0.9, 0.6, -0.4), (0.9, 0.72, 0.4)), "wood")
    leg = [(0.03, 0.0), (0.045, 0.06), (0.03, 0.12), (0.035, 0.3), (0.05, 0.36), (0.032, 0.42), (0.045, 0.5), (0.045, 0.72)]
    turned = lathe(leg, rounds(detail, 20), bottom=True, top=True)
    site.add(copies(turned, np.array([[x, 0.0, z] for x in (-0.88, 0.88) for z in (-0.38, 0.38)])), "wood")


def _chair(site: Site, detail: float) -> None:
    """Chair with turned legs and a back of spindles, its front towards +z."""
    leg = [(0.014, 0.0), (0.02, 0.1), (0.015, 0.16), (0.022, 0.3), (0.018, 0.45)]
    turned = lathe(leg, rounds(detail, 12), bottom=True, top=True)
    site.add(copies(turned, np.array([[x, 0.0, z] for x in (-0.18, 0.18) for z in (-0.17, 0.18)])), "wood")
    site.add(box((-0.22, 0.44, -0.2), (0.22, 0.475, 0.22)), "wood_light")
    spindle = lathe([(0.012, 0.0), (0.018, 0.15), (0.01, 0.3), (0.012, 0.46)], rounds(detail, 10), bottom=True, top=True)
    site.add(copies(spindle, np.stack([np.linspace(-0.17, 0.17, 6), np.full(6, 0.47), np.full(6, -0.17)], axis=1)), "wood")
    site.add(box((-0.21, 0.9, -0.195), (0.21, 1.0, -0.15)), "wood_light")
    for z in (-0.17, 0.18):
        site.add(tube([(-0.18, 0.2, z), (0.18, 0.2, z)], (0.01, 0.01), rounds(detail, 8, 4)), "wood")


def _lamp(site: Site, detail: float) -> None:
    """Shade open below, on a flex; the light hangs under it."""
    shade = [(0.26, 0.0), (0.25, 0.05), (0.1, 0.16), (0.04, 0.2), (0.03, 0.24)]
    inside = [(0.03, 0.23), (0.09, 0.155), (0.235, 0.05), (0.26, 0.0)]
    sides = rounds(detail, 32)
    site.add(lathe(shade, sides, top=True), "green")
    site.add(lathe(inside[::-1], sides).flipped(), "china")
    site.add(tube([(0.0, 0.23, 0.0), (0.0, _HIGH - _LAMP[1], 0.0)], (0.008, 0.008), 6), "iron")


def _build(detail: float, seed: int) -> MeshBuilder:
    """Build everything but the floor."""
    rng = np.random.default_rng(seed)
    builder = MeshBuilder(_COLORS)
    _shell(builder)
    _tiles(builder)
    back = Site.at(builder, 0.0, 0.0, -_Z)
    for x, width, drawers in ((-3.1, 0.8, True), (-0.95, 0.9, False), (-0.05, 0.9, True), (0.85, 0.9, False), (1.75, 0.9,
                                                                                                               False),
                              (2.75, 1.1, True)):
        _cabinet(back.inner(x, 0.0, 0.0), width, drawers, detail)
    _stove(back.inner(-2.05, 0.0, 0.0), detail)
    side = Site.at(builder, _X, 0.0, -0.6, 90)
    add_crockery(side, rng, detail)
    add_hanging_pans(Site.at(builder, -2.6, 2.0, -_Z + 0.3), detail)
    table = Site.at(builder, 0.1, 0.0, 0.2, 8)
    _table(table, detail)
    for x, z, turn in ((-0.5, 0.75, 172), (0.45, 0.8, 190), (-0.5, -0.75, -12), (0.5, -0.72, 5), (-1.35, 0.0, -80),
                       (1.4, 0.15, 100)):
        _chair(table.inner(x, 0.0, z, turn), detail)
    add_table_ware(table.inner(0.0, 0.77, 0.0), rng, detail)
    add_table_ware(back.inner(0.4, _TOP, 0.3), rng, 0.8 * detail)
    _lamp(Site.at(builder, _LAMP[0], _LAMP[1], _LAMP[2]), detail)
    return builder


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the kitchen with exactly `triangles` triangles; `seed` places what stands about.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("kitchen", triangles, MINIMUM)
    builder = fit_detail(lambda detail: _build(detail, seed), triangles - _FEWEST_FLOOR, _START * triangles)
    builder.add(ground((-_X, _X), (-_Z, _Z), triangles - builder.n_triangles), "floor")
    eyes = [(1.9, 1.9, 3.3), (-0.6, 1.6, 2.6), (-2.5, 1.8, 1.9), (-2.4, 1.5, -1.2), (0.6, 1.6, -1.7), (2.2, 1.7, 1.6)]
    targets = [(-0.5, 0.85, -1.0), (0.2, 0.9, -1.0), (0.6, 0.8, -0.8), (1.5, 0.9, 0.2), (1.0, 1.0, 0.6), (-1.5, 1.0, -1.5)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=False, fov_y=56.0, near=0.05, far=30.0,
                           light=Light.point(_LAMP[0], _LAMP[1] + 0.02, _LAMP[2]))
