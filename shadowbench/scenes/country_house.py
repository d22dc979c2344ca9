"""A country house and what stands in its garden: balustrades, iron gates, fences, urns, hedges; lengths in metres.

Bodies that show all their sides are closed (boxes, piers, balls, hedges); balusters, columns, roofs and terraces
have no ends or no bottom, as in models made for games. `detail` scales the number of sides and rows.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import FloatArray
from shadowbench.scenes.buildings import arched_window, rounds, tile_rows, window
from shadowbench.scenes.procedural import Site
from shadowbench.scenes.shapes import (
    Point,
    Shape,
    box,
    copies,
    join,
    lathe,
    prism,
    slab,
    stairs,
    strip,
    subdivided_box,
    unit_circle,
)

_BALUSTER: tuple[Point, ...] = ((0.07, 0.0), (0.07, 0.06), (0.045, 0.1), (0.085, 0.24), (0.045, 0.42), (0.04, 0.5),
                                (0.065, 0.55))
_URN: tuple[Point, ...] = ((0.2, 0.0), (0.08, 0.12), (0.1, 0.2), (0.3, 0.42), (0.33, 0.6), (0.26, 0.66), (0.36, 0.76),
                           (0.3, 0.76), (0.0, 0.6))


def ball(radius: float, sides: int) -> Shape:
    """Closed ball about the origin; `sides` is a multiple of 4."""
    circle = unit_circle(sides)
    half = [(radius * circle[i, 0], radius * circle[i, 1]) for i in range(1 - sides // 4, sides // 4)]
    return lathe([(0.0, -radius), *half, (0.0, radius)], sides)


def pier(site: Site, half: float, height: float, detail: float, top: str) -> None:
    """Square stone post of closed boxes, with a "ball" or an "urn" on it."""
    site.add(box((-half, -0.5, -half), (half, height, half)), "stone")
    site.add(box((-1.2 * half, -0.5, -1.2 * half), (1.2 * half, 0.12 * height, 1.2 * half)), "stone_light")
    site.add(box((-1.25 * half, height, -1.25 * half), (1.25 * half, height + 0.14, 1.25 * half)), "stone_light")
    if top == "ball":
        radius = 0.85 * half
        site.add(lathe([(0.6 * half, 0.0), (0.3 * half, 0.1)], rounds(detail, 12)).moved(0, height + 0.14, 0), "stone")
        site.add(ball(radius, rounds(detail, 16)).moved(0.0, height + 0.2 + radius, 0.0), "stone_light")
    else:
        site.add(lathe(_URN, rounds(detail, 12)).scaled(2.4 * half, 1.0, 2.4 * half).moved(0, height + 0.14, 0), "clay")


def balustrade(site: Site, length: float, detail: float, spacing: float = 0.3) -> None:
    """Balustrade along x, centred, a metre high: closed plinth, rail and posts, balusters without ends."""
    half = 0.5 * length
    site.add(box((-half, -0.3, -0.14), (half, 0.18, 0.14)), "stone_light")
    site.add(box((-half, 0.73, -0.15), (half, 0.88, 0.15)), "stone_light")
    posts = max(1, round(length / 4.5))
    bay = length / posts
    post = box((-0.17, -0.3, -0.17), (0.17, 0.95, 0.17))
    site.add(join([post.moved(bay * i - half, 0.0, 0.0) for i in range(posts + 1)]), "stone_light")
    per_bay = int((bay - 0.34) / spacing)
    along = (np.arange(per_bay) + 0.5) * ((bay - 0.34) / per_bay) + 0.17
    x = (bay * np.arange(posts)[:, None] + along[None]).ravel() - half
    baluster = lathe(_BALUSTER, rounds(detail, 8, 4))
    site.add(copies(baluster, np.stack([x, np.full_like(x, 0.18), np.zeros_like(x)], axis=1)), "stone_light")


def bars(x: FloatArray, low: float, high: FloatArray, radius: float, sides: int) -> Shape:
    """Upright iron bars with spear points: closed, at float64 (k,) places along x; `high` float64 (k,)."""
    shaft = lathe([(0.0, 0.0), (1.0, 0.001), (1.0, 1.0), (0.0, 1.001)], sides)
    spear = lathe([(0.0, 0.0), (2.3, 0.05), (0.0, 0.26)], sides)
    n = len(x)
    foot = np.stack([x, np.full(n, low), np.zeros(n)], axis=1)
    tip = np.stack([x, high - 0.02, np.zeros(n)], axis=1)
    shafts = copies(shaft, foot, scales=np.stack([np.full(n, radius), high - low, np.full(n, radius)], axis=1))
    return join([shafts, copies(spear, tip, scales=np.tile([radius, 1.0, radius], (n, 1)))])


def iron_ring(radius: float, segments: int) -> Shape:
    """Closed ring of flat iron in the xy plane about the origin."""
    circle = unit_circle(segments) * radius
    return slab([(0.84 * x, 0.84 * y) for x, y in circle], [(x, y) for x, y in circle], 0.03, ring=True)


def gate_leaf(site: Site, width: float, hinge_height: float, rise: float, detail: float) -> None:
    """Iron gate leaf from x = 0 (hinge) to `width`, its head rising by `rise` towards the far end."""
    n = 13
    x = width * (np.arange(n) + 0.5) / n
    high = hinge_height + rise * (x / width) * (x / width)
    site.add(bars(x, 0.12, high, 0.016, rounds(detail, 8, 4)), "iron")
    short = x[:-1] + 0.5 * width / n
    site.add(bars(short, 0.12, np.full(n - 1, 0.75), 0.012, 4), "iron")
    for y, thick in ((0.16, 0.035), (0.62, 0.02), (1.25, 0.03), (1.46, 0.03), (hinge_height - 0.25, 0.03)):
        site.add(box((0.0, y - thick, -0.025), (width, y + thick, 0.025)), "iron")
    for end, top in ((0.03, hinge_height + 0.1), (width - 0.03, hinge_height + rise + 0.05)):
        site.add(box((end - 0.03, 0.05, -0.03), (end + 0.03, top, 0.03)), "iron")
    ring = iron_ring(0.075, rounds(detail, 12))
    site.add(join([ring.moved(c, 1.355, 0.0) for c in short]), "iron")


def overthrow(site: Site, width: float, spring: float, detail: float) -> None:
    """Arched iron band of two bows with rings between them, over a gate of `width`, and a lantern."""
    segments = rounds(detail, 24)
    circle = unit_circle(2 * segments)[segments::-1]

    def bow(radius: float, height: float) -> list[Point]:
        return [(radius * c, spring + height * s) for c, s in circle]

    half = 0.5 * width
    site.add(slab(bow(half, 0.75), bow(half + 0.03, 0.81), 0.06), "iron")
    site.add(slab(bow(half, 1.15), bow(half + 0.03, 1.21), 0.06), "iron")
    ring = iron_ring(0.15, rounds(detail, 12))
    middle = unit_circle(48)
    rings = [ring.moved(half * middle[k, 0], spring + 0.98 * middle[k, 1], 0.0) for k in range(4, 21, 2)]
    site.add(join(rings), "iron")
    site.add(box((-0.015, spring + 0.3, -0.015), (0.015, spring + 0.78, 0.015)), "iron")
    lamp = [(0.0, 0.0), (0.1, 0.03), (0.14, 0.32), (0.2, 0.34), (0.05, 0.46), (0.0, 0.5)]
    site.add(lathe(lamp, 6).moved(0.0, spring - 0.1, 0.0), "iron")


def fence(site: Site, length: float, detail: float) -> None:
    """Low wall along x from 0 to `length` with railings, and a post every 5 m."""
    site.add(box((0.0, -0.5, -0.22), (length, 0.55, 0.22)), "stone")
    site.add(box((0.0, 0.55, -0.28), (length, 0.65, 0.28)), "stone_light")
    n = int(length / 0.24)
    x = (np.arange(n, dtype=np.float64) + 0.5) * (length / n)
    site.add(bars(x, 0.6, np.full(n, 2.1), 0.014, 4), "iron")
    for y in (0.8, 1.85):
        site.add(box((0.0, y - 0.02, -0.02), (length, y + 0.02, 0.02)), "iron")
    for k in range(1, int(length / 5.0) + 1):
        pier(site.inner(5.0 * k, 0.0, 0.0), 0.32, 2.2, 0.6 * detail, "ball")


def hedge(site: Site, rng: np.random.Generator, length: float, height: float, detail: float) -> None:
    """Closed clipped hedge along x, centred, 0.8 m thick, its surface a little uneven."""
    shape = subdivided_box(max(1, round(4 * detail))).scaled(0.5 * length, 0.5 * height + 0.15, 0.4)
    uneven = shape.vertices + rng.uniform(-0.05, 0.05, shape.vertices.shape)
    site.add(Shape(uneven, shape.triangles).moved(0.0, 0.5 * height - 0.15, 0.0), "hedge")


def fountain(site: Site, detail: float) -> None:
    """Round basin with water, and a bowl on a stem in its middle."""
    sides = rounds(detail, 28)
    basin = [(3.0, -0.3), (3.0, 0.5), (3.15, 0.55), (3.15, 0.65), (2.7, 0.65), (2.7, 0.2)]
    site.add(lathe(basin, sides), "stone_light")
    site.add(lathe([(2.75, 0.42), (0.0, 0.42)], sides), "water")
    stem = [(0.6, 0.2), (0.5, 0.7), (0.2, 0.9), (0.26, 1.3), (0.16, 1.75), (0.3, 1.85), (1.1, 2.15), (1.15, 2.28),
            (0.9, 2.2), (0.15, 2.1), (0.2, 2.5), (0.1, 2.8), (0.32, 3.0), (0.36, 3.1), (0.0, 3.05)]
    site.add(lathe(stem, rounds(detail, 16)), "stone")


def column(site: Site, height: float, radius: float, detail: float) -> None:
    """Round column on a closed square base, with a square head; the shaft has no ends."""
    wide = 1.45 * radius
    site.add(box((-wide, -0.2, -wide), (wide, 0.25, wide)), "stone_light")
    shaft = [(1.3 * radius, 0.25), (1.3 * radius, 0.4), (radius, 0.5), (0.98 * radius, 0.4 * height),
             (0.82 * radius, height - 0.5), (0.95 * radius, height - 0.42), (1.3 * radius, height - 0.22)]
    site.add(lathe(shaft, rounds(detail, 20)), "stone_light")
    site.add(box((-wide, height - 0.22, -wide), (wide, height, wide)), "stone_light")


def hipped_roof(site: Site, half_x: float, half_z: float, rise: float, detail: float) -> None:
    """Four slopes in overlapping rows, open below, eaves at y = 0, with a closed ridge beam; half_x > half_z."""
    run = half_z - 0.3
    profile = [(d, rise + y) for d, y in tile_rows(run, rise, max(2, round(9 * detail)))][::-1]
    lines = []
    for distance, y in profile:
        inset = run - distance
        a, b = half_x - inset, half_z - inset
        lines.append([[a, y, -b], [a, y, b], [-a, y, b], [-a, y, -b]])
    site.add(strip(np.array(lines), closed=True), "tile")
    end = half_x - run
    site.add(box((-end - 0.1, rise - 0.2, -0.4), (end + 0.1, rise + 0.12, 0.4)), "tile")


def shuttered_window(site: Site, width: float, height: float) -> None:
    """Window on the plane z = 0 with a sill, a cornice and open shutters, centred on the origin."""
    x, y = 0.5 * width, 0.5 * height
    window(site, width, height)
    site.add(box((-x - 0.25, -y - 0.25, -0.1), (x + 0.25, -y - 0.1, 0.25)), "stone_light")
    site.add(box((-x - 0.3, y + 0.16, -0.1), (x + 0.3, y + 0.32, 0.32)), "stone_light")
    for side in (-1.0, 1.0):
        hinge = site.inner(side * (x + 0.14), 0.0, 0.06, -14.0 * side)
        low, high = sorted((0.0, side * 0.52 * width))
        hinge.add(box((low, -y, 0.0), (high, y, 0.05)), "shutter")


def _facade(side: Site, bays: FloatArray, out: float, detail: float, door: bool) -> None:
    """Two rows of windows, arched below and shuttered above, on the plane z = out."""
    for x in bays:
        if not (door and abs(x) < 0.1):
            arched_window(side.inner(float(x), 0.9, out), 1.4, 2.9, detail)
        shuttered_window(side.inner(float(x), 6.2, out), 1.3, 2.1)


def villa(site: Site, detail: float) -> None:
    """Two-storey house, front towards +z, with a columned porch, hipped roof, chimneys and quoins; 30 m by 14 m."""
    half_x, half_z, height = 15.0, 7.0, 8.6
    site.add(box((-half_x, -1.5, -half_z), (half_x, height, half_z)), "plaster")
    for low, high, out, name in ((-1.5, 0.5, 0.2, "stone"), (4.2, 4.5, 0.15, "stone_light"),
                                 (height - 0.7, height - 0.35, 0.25, "stone_light"),
                                 (height - 0.35, height, 0.6, "stone_light")):
        site.add(box((-half_x - out, low, -half_z - out), (half_x + out, high, half_z + out)), name)
    hipped_roof(site.inner(0.0, height - 0.02, 0.0), half_x + 0.9, half_z + 0.9, 4.4, detail)
    for x, z in ((-9.0, -2.0), (9.0, -2.0), (-6.0, 3.0), (6.5, 2.5)):
        site.add(box((x - 0.6, height, z - 0.4), (x + 0.6, height + 5.6, z + 0.4)), "brick")
        site.add(box((x - 0.72, height + 5.3, z - 0.52), (x + 0.72, height + 5.5, z + 0.52)), "stone_light")
    for turn, across, out, step in ((0, half_x, half_z, 4.0), (90, half_z, half_x, 3.2), (180, half_x, half_z, 4.0),
                                    (270, half_z, half_x, 3.2)):
        side = site.inner(0.0, 0.0, 0.0, turn)
        n = int((across - 1.0) / step)
        _facade(side, step * np.arange(-n, n + 1, dtype=np.float64), out, detail, turn == 0)
        for end in (-1.0, 1.0):
            quoins = [box((end * across - w, 0.5 + 0.6 * k, out - 0.1), (end * across + w, 1.0 + 0.6 * k, out + 0.07))
                      for k, w in zip(range(12), (0.75, 0.45) * 6, strict=True)]
            side.add(join(quoins), "stone_light")
    _porch(site.inner(0.0, 0.0, half_z), detail)


def _porch(site: Site, detail: float) -> None:
    """Six columns, entablature and pediment in front of the door, whose wall is the plane z = 0."""
    site.add(box((-5.6, 6.6, -0.2), (5.6, 7.5, 3.4)), "stone_light")
    site.add(box((-5.9, 7.5, -0.2), (5.9, 7.75, 3.7)), "stone_light")
    for x in (-5.0, -3.0, -1.35, 1.35, 3.0, 5.0):
        column(site.inner(x, 0.0, 2.8), 6.6, 0.36, detail)
    gable: list[Point] = [(-5.7, 7.75), (5.7, 7.75), (0.0, 10.2)]
    site.add(prism(gable, 7.0), "plaster")
    for end in (-1.0, 1.0):
        edge: list[Point] = [(0.0, 10.2), (0.0, 10.55), (end * 6.1, 7.95), (end * 6.1, 7.65)]
        site.add(prism(edge if end < 0 else edge[::-1], 7.5), "stone_light")
    site.add(box((-0.95, 0.0, -0.1), (0.95, 3.3, 0.1), ("-z",)), "wood")
    site.add(box((-1.3, 3.3, -0.1), (1.3, 3.6, 0.35)), "stone_light")
    for x in (-1.15, 1.15):
        site.add(box((x - 0.2, 0.0, -0.1), (x + 0.2, 3.3, 0.2)), "stone_light")


def terrace(site: Site, half: float, depth: float, height: float, detail: float) -> None:
    """Raised ground without a bottom face, from z = 0 forward, top at y = 0, with stairs and balustrades."""
    site.add(box((-half, -height - 0.5, -0.5), (half, 0.0, depth), ("-y", "-z")), "stone")
    site.add(box((-half - 0.1, -0.16, -0.5), (half + 0.1, 0.02, depth + 0.1)), "stone_light")
    gap = 3.4
    for end in (-1.0, 1.0):
        balustrade(site.inner(0.5 * end * (half + gap), 0.0, depth - 0.2), half - gap, detail)
        balustrade(site.inner(end * (half - 0.2), 0.0, 0.5 * depth, 90.0), depth - 0.4, detail)
        pier(site.inner(end * gap, 0.0, depth - 0.2), 0.28, 1.15, detail, "urn")
        pier(site.inner(end * (half - 0.2), 0.0, depth - 0.2), 0.28, 1.15, detail, "urn")
        site.add(box((end * 3.25 - 0.25, -height - 0.5, depth), (end * 3.25 + 0.25, -0.3, depth + 3.2)), "stone")
    flight = stairs(max(4, round(8 * detail)), 6.0, 3.0, height)
    site.add(flight.turned_degrees(180).moved(0.0, -height, depth + 3.0), "stone_light")
