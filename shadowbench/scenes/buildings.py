"""Castle walls, towers and houses. Each function adds one building's parts at a site; lengths are in metres.

Most bodies stand in the ground without a bottom face, and parts run into each other, as in models made for games:
many objects that look closed are open. `detail` scales the number of sides, stones and tile rows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shadowbench.scenes.procedural import Site, whole_degrees
from shadowbench.scenes.shapes import (
    Point,
    Shape,
    arch,
    box,
    copies,
    frame,
    join,
    lathe,
    prism,
    sheet,
    unit_circle,
)

_MERLON = box((-0.5, 0.0, -0.25), (0.5, 1.0, 0.25), without=("-y",))
_STONE = box((-0.5, -0.5, -0.05), (0.5, 0.5, 0.05), without=("-z",))
_ALL_BUT_FRONT = ("-x", "+x", "-y", "+y", "-z")

ORNAMENT_DETAIL = 0.25
"""Detail below which timber, window frames, slits, mouldings and every other merlon are left out."""

_SLIT = box((-0.09, -0.75, -0.05), (0.09, 0.75, 0.03), without=("-z",))


def rounds(detail: float, sides: int, least: int = 8) -> int:
    """Sides of a round body: `sides` at detail 1, a multiple of 4."""
    return max(least, 4 * round(sides * detail / 4))


def stones(rng: np.random.Generator, n: int, length: float, low: float, high: float) -> Shape:
    """Stones that stand out of a wall's face, which is the plane z = 0 seen from +z, centred on x = 0."""
    courses = max(1, int((high - low) / 0.5))
    height = 0.5 * rng.integers(0, courses, n) + low + 0.25
    size = np.stack([rng.uniform(0.5, 1.3, n), rng.uniform(0.36, 0.48, n), rng.uniform(0.6, 2.2, n)], axis=1)
    x = rng.uniform(-0.5, 0.5, n) * (length - 1.6)
    return copies(_STONE, np.stack([x, height, np.zeros(n)], axis=1), scales=size)


def stones_around(rng: np.random.Generator, n: int, radius: float, low: float, high: float) -> Shape:
    """Stones that stand out of an upright cylinder about the y axis."""
    degrees = whole_degrees(rng, n)
    circle = unit_circle(360)[degrees]
    courses = max(1, int((high - low) / 0.5))
    height = 0.5 * rng.integers(0, courses, n) + low + 0.25
    size = np.stack([rng.uniform(0.4, 0.9, n), rng.uniform(0.36, 0.48, n), rng.uniform(1.0, 2.6, n)], axis=1)
    offsets = np.stack([radius * circle[:, 0], height, radius * circle[:, 1]], axis=1)
    return copies(_STONE, offsets, degrees - 90, size)


def crenellation(length: float, y: float, z: float, detail: float) -> Shape:
    """Row of merlons without bottom faces along x, centred."""
    n = max(2, round(length / (2.1 if detail >= ORNAMENT_DETAIL else 4.2)))
    x = (np.arange(n) + 0.5) * (length / n) - 0.5 * length
    offsets = np.stack([x, np.full(n, y), np.full(n, z)], axis=1)
    return copies(_MERLON, offsets, scales=np.tile([1.15, 1.1, 1.0], (n, 1)))


def crenellation_around(radius: float, y: float, detail: float) -> Shape:
    """Ring of merlons about the y axis."""
    n = max(6, round(radius * (3.3 if detail >= ORNAMENT_DETAIL else 1.65)))
    degrees = np.array([round(360 * i / n) for i in range(n)])
    circle = unit_circle(360)[degrees]
    offsets = np.stack([radius * circle[:, 0], np.full(n, y), radius * circle[:, 1]], axis=1)
    return copies(_MERLON, offsets, degrees - 90, np.tile([1.0, 1.1, 0.9], (n, 1)))


def tile_rows(run: float, rise: float, rows: int, step: float = 0.07) -> list[Point]:
    """Profile (distance from the ridge, height) of a roof slope in overlapping rows, ridge at height 0."""
    profile: list[Point] = []
    for i in range(rows):
        profile.append((run * i / rows, -rise * i / rows))
        profile.append((run * (i + 1) / rows, -rise * (i + 1) / rows + step))
    return [*profile, (run, -rise)]


def cone_roof(radius: float, height: float, detail: float) -> Shape:
    """Pointed roof in overlapping rows, open below; its eaves are at y = 0."""
    rows = max(2, round(5 * detail))
    profile = [(r, height + y) for r, y in tile_rows(radius, height, rows, 0.12)]
    return lathe(profile[::-1], rounds(detail, 32))


def gable_roof(site: Site, width: float, length: float, rise: float, detail: float, material: str) -> None:
    """Two one-sided slopes with the ridge along z at y = 0, `width` from eave to eave, and a closed ridge beam."""
    rows, columns = max(1, round(6 * detail)), max(1, round(3 * detail))
    slope = sheet(tile_rows(0.5 * width, rise, rows), length, columns)
    site.add(slope.turned(0.0, -1.0), material)
    site.add(slope.turned(0.0, 1.0), material)
    site.add(box((-0.12, -0.08, -0.5 * length - 0.05), (0.12, 0.12, 0.5 * length + 0.05)), material)


def window(site: Site, width: float, height: float) -> None:
    """Framed window with a dark pane and crossing bars on the plane z = 0, centred on the origin."""
    site.add(box((-0.5 * width, -0.5 * height, 0.0), (0.5 * width, 0.5 * height, 0.02), _ALL_BUT_FRONT), "dark")
    site.add(frame(width, height, 0.12, 0.2), "wood")
    bars = [box((-0.04, -0.5 * height, 0.0), (0.04, 0.5 * height, 0.06), ("-z",)),
            box((-0.5 * width, -0.04, 0.0), (0.5 * width, 0.04, 0.05), ("-z",))]
    site.add(join(bars), "wood")


def arched_window(site: Site, width: float, height: float, detail: float) -> None:
    """Round-headed stone window on the plane z = 0, its sill at the origin; the pane lies in front of stones."""
    spring, border = height - 0.5 * width, 0.22
    site.add(box((-0.5 * width, 0.0, 0.0), (0.5 * width, height - 0.1, 0.13), _ALL_BUT_FRONT), "dark")
    if detail < ORNAMENT_DETAIL:
        return
    site.add(arch(width, spring, width + 2 * border, height + border, 0.36, rounds(detail, 8, 4)), "stone_light")
    site.add(box((-0.5 * width - 0.4, -0.2, -0.1), (0.5 * width + 0.4, 0.0, 0.32)), "stone_light")


def curtain_wall(site: Site, rng: np.random.Generator, length: float, height: float, detail: float) -> None:
    """Wall along x, centred, outer face towards +z, with plinth, walk, merlons, slits and buttresses."""
    thick, half = 2.6, 0.5 * length
    site.add(box((-half, -5.0, -0.5 * thick), (half, height, 0.5 * thick), ("-y", "-x", "+x")), "stone")
    plinth = [(0.5 * thick, 2.2), (0.5 * thick + 0.7, 1.3), (0.5 * thick + 0.7, -5.0)]
    site.add(sheet(plinth, length, max(1, round(4 * detail))), "stone_dark")
    site.add(box((-half, height - 0.3, 0.5 * thick - 0.1), (half, height, 0.5 * thick + 0.2)), "stone_light")
    parapet = box((-half, height - 0.2, 0.5 * thick - 0.3), (half, height + 0.7, 0.5 * thick + 0.2), ("-y",))
    site.add(parapet, "stone")
    site.add(crenellation(length, height + 0.7, 0.5 * thick - 0.05, detail), "stone")
    if detail < ORNAMENT_DETAIL:
        return
    n = max(1, round(length / 7.0))
    x = (np.arange(n) + 0.5) * (length / n) - half
    site.add(copies(_SLIT, np.stack([x, np.full(n, 5.6), np.full(n, 0.5 * thick)], axis=1)), "dark")
    buttress = prism([(-0.5 * thick - 1.3, -5.0), (-0.5 * thick, -5.0), (-0.5 * thick, 6.4),
                      (-0.5 * thick - 0.5, 5.4), (-0.5 * thick - 1.3, 1.0)], 1.1, bottom=False)
    offsets = np.stack([x + 0.5 * length / n, np.zeros(n), np.zeros(n)], axis=1)[:-1]
    site.add(copies(buttress.turned(0.0, -1.0), offsets), "stone_dark")
    n_stones = round(1.6 * length * detail * detail)
    outer, inner = stones(rng, n_stones, length, 2.4, height - 0.6), stones(rng, n_stones, length, 0.2, height)
    site.add(outer.moved(0.0, 0.0, 0.5 * thick), "stone_light")
    site.add(inner.turned(-1.0, 0.0).moved(0.0, 0.0, -0.5 * thick), "stone_dark")


def round_tower(site: Site, rng: np.random.Generator, radius: float, height: float, roof: str | None,
                detail: float) -> None:
    """Round tower about the y axis: a crenellated platform, or a pointed roof of the material `roof`."""
    sides, top = rounds(detail, 32), 1.16 * radius
    low, high = [(1.22 * radius, -6.0), (1.16 * radius, 0.6)], [(radius, height - 2.4), (top, height - 1.4)]
    bands = max(1, round(4 * detail))
    middle = [(radius, 2.4 + (height - 4.8) * i / bands) for i in range(bands)]
    site.add(lathe([*low, *middle, *high, (top, height)], sides), "stone")
    if detail >= ORNAMENT_DETAIL:
        moulding = [(top + 0.12, height - 1.5), (top + 0.15, height - 1.2), (0.98 * top, height - 1.18)]
        site.add(lathe(moulding, sides), "stone_light")
        site.add(stones_around(rng, round(90 * detail * detail), radius, 2.6, height - 2.6), "stone_light")
        for degrees, y in ((20, 0.35), (110, 0.55), (200, 0.7), (290, 0.45)):
            c, s = unit_circle(360)[degrees]
            site.add(_SLIT.turned_degrees(degrees - 90).moved(radius * c, height * y, radius * s), "dark")
    if roof is None:
        site.add(lathe([(top, height - 0.8), (0.0, height - 0.8)], sides), "stone_dark")
        site.add(crenellation_around(top - 0.2, height - 0.1, detail), "stone")
        return
    site.add(cone_roof(1.3 * radius, 2.3 * radius, detail).moved(0.0, height - 0.1, 0.0), roof)
    if detail < ORNAMENT_DETAIL:
        return
    tip = height + 2.3 * radius - 0.3
    site.add(lathe([(0.0, tip), (0.09, tip + 0.1), (0.07, tip + 2.2), (0.0, tip + 2.3)], 6), "iron")
    flag = np.array([[0.05, tip + 2.1, 0.0], [0.05, tip + 1.2, 0.0], [1.7, tip + 1.55, 0.35]])
    site.add(Shape(flag, np.array([[0, 1, 2]])), "cloth")


def square_tower(site: Site, rng: np.random.Generator, half: float, height: float, roof: str | None,
                 detail: float) -> None:
    """Square tower about the y axis with a corbelled, crenellated head; `roof` is a material or None."""
    head = half + 0.5
    site.add(box((-half, -6.0, -half), (half, height - 1.5, half), ("-y", "+y")), "stone")
    skirt = box((-1.0, -6.0, -1.0), (1.0, 1.4, 1.0), ("-y",)).scaled(half + 0.4, 1.0, half + 0.4)
    site.add(skirt, "stone_dark")
    site.add(box((-head, height - 1.6, -head), (head, height, head)), "stone")
    for k, degrees in enumerate((0, 90, 180, 270)):
        side = site.inner(0.0, 0.0, 0.0, degrees)
        side.add(crenellation(2.0 * head - 0.6, height, head - 0.3, detail), "stone")
        side.add(stones(rng, round(20 * detail * detail), 2.0 * half, 1.6, height - 2.0).moved(0, 0, half),
                 "stone_light")
        corbels = copies(box((-0.25, -0.7, 0.0), (0.25, 0.0, 0.5), ("+y", "-z")),
                         np.array([[x * half, height - 1.6, half] for x in (-0.8, -0.3, 0.3, 0.8)]))
        side.add(corbels, "stone_dark")
        arched_window(side.inner(0.0, height * (0.45 + 0.08 * (k % 2)), half), 0.9, 1.9, detail)
    if roof is not None:
        pyramid = lathe([(1.28 * half, 0.0), (0.0, 1.7 * half)], 4).turned_degrees(45)
        site.add(pyramid.moved(0.0, height + 0.2, 0.0), roof)
        site.add(box((-0.78 * half, 0.0, -0.78 * half), (0.78 * half, 0.6, 0.78 * half), ("-y",))
                 .moved(0.0, height, 0.0), "wood")


def house(site: Site, size: Sequence[float], roof: str, detail: float) -> None:
    """Timber-framed house with its gables at +z and -z; size is width, length, height of eaves, rise of roof."""
    width, length, height, rise = size
    x, z = 0.5 * width, 0.5 * length
    outline = [(-x, -2.0), (x, -2.0), (x, height), (0.0, height + rise), (-x, height)]
    site.add(prism(outline, length, bottom=False), "plaster")
    site.add(box((-x - 0.12, -2.0, -z - 0.12), (x + 0.12, 0.9, z + 0.12), ("-y",)), "stone_dark")
    over = 1.0 + 0.9 / width
    gable_roof(site.inner(0.0, height + rise + 0.06, 0.0), width * over, length + 1.1, rise * over, detail, roof)
    site.add(box((0.18 * width, height, -0.3 * length), (0.18 * width + 0.9, height + rise + 1.1,
                                                        -0.3 * length + 0.9), ("-y",)), "stone_dark")
    site.add(box((0.08 * width, -0.5, z - 0.05), (0.08 * width + 1.1, 2.15, z + 0.08)), "wood")
    if detail < ORNAMENT_DETAIL:
        return
    beam, out = 0.11, 0.07
    for turn in (0, 180):
        side = site.inner(0.0, 0.0, 0.0, turn)
        uprights = [box((c - beam, 0.9, z - out), (c + beam, height, z + out))
                    for c in (-x, -0.36 * width, 0.36 * width, x)]
        side.add(join([*uprights, box((-x, height - beam, z - out), (x, height + beam, z + out))]), "wood")
        window(side.inner(-0.2 * width, 1.9, z), 0.9, 1.1)
        window(side.inner(0.0, height + 0.35 * rise, z), 0.8, 0.9)
    for turn in (90, 270):
        side = site.inner(0.0, 0.0, 0.0, turn)
        ends = np.linspace(-z, z, 4)
        side.add(join([box((c - beam, 0.9, x - out), (c + beam, height, x + out)) for c in ends]), "wood")
        for c in (-0.3 * length, 0.3 * length):
            window(side.inner(c, 1.9, x), 0.9, 1.1)
