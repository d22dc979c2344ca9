"""What stands and hangs about in a kitchen: crockery, pans, bottles, fruit; closed bodies, lengths in metres."""

from __future__ import annotations

import numpy as np

from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.procedural import Site
from shadowbench.scenes.shapes import Point, Shape, box, join, lathe
from shadowbench.scenes.tubes import tube

_PLATE: tuple[Point, ...] = ((0.06, 0.0), (0.075, 0.004), (0.12, 0.018), (0.122, 0.022), (0.074, 0.01), (0.0, 0.008))
_CUP: tuple[Point, ...] = ((0.024, 0.0), (0.022, 0.006), (0.036, 0.03), (0.042, 0.07), (0.039, 0.07), (0.033, 0.03), (0.0,
                                                                                                                      0.012))
_BOWL: tuple[Point, ...] = ((0.05, 0.0), (0.05, 0.012), (0.1, 0.04), (0.14, 0.09), (0.143, 0.095), (0.135, 0.09), (0.09,
                                                                                                                   0.045),
                            (0.0, 0.025))
_BOTTLE: tuple[Point, ...] = ((0.034, 0.0), (0.037, 0.01), (0.037, 0.18), (0.03, 0.21), (0.014, 0.24), (0.013, 0.3), (0.016,
                                                                                                                      0.302),
                              (0.016, 0.315))
_JUG: tuple[Point, ...] = ((0.05, 0.0), (0.055, 0.01), (0.085, 0.08), (0.08, 0.13), (0.05, 0.19), (0.055, 0.22), (0.05,
                                                                                                                  0.22),
                           (0.045, 0.19), (0.0, 0.15))
_POT: tuple[Point, ...] = ((0.1, 0.0), (0.11, 0.01), (0.115, 0.12), (0.12, 0.125), (0.11, 0.125), (0.105, 0.02), (0.0,
                                                                                                                  0.015))
_LID: tuple[Point, ...] = ((0.118, 0.0), (0.118, 0.006), (0.06, 0.025), (0.012, 0.03), (0.012, 0.045), (0.022, 0.055), (0.0,
                                                                                                                        0.062))
_JAR: tuple[Point, ...] = ((0.045, 0.0), (0.05, 0.01), (0.05, 0.11), (0.04, 0.13), (0.045, 0.132), (0.045, 0.15), (0.0,
                                                                                                                   0.155))


def _turned(profile: tuple[Point, ...], sides: int) -> Shape:
    """Closed body of revolution."""
    return lathe(profile, sides, bottom=True, top=profile[-1][0] > 0.0)


def _handle(low: float, high: float, near: float, far: float, sides: int) -> Shape:
    """Handle in the plane z = 0: out from x = near and back."""
    outer = [(near, high), (far, 0.75 * high + 0.25 * low), (far, 0.35 * high + 0.65 * low), (near, low)]
    return tube([(x, y, 0.0) for x, y in outer], [0.006] * 4, sides)


def _ball(radius: float, sides: int) -> Shape:
    """Slightly flattened ball on the origin: a fruit."""
    profile = [(0.0, 0.05), (0.5, 0.1), (0.86, 0.4), (1.0, 0.95), (0.86, 1.5), (0.5, 1.78), (0.0, 1.72)]
    return lathe([(radius * r, radius * y) for r, y in profile], sides)


def _cup(detail: float) -> list[Shape]:
    """Cup and handle."""
    return [_turned(_CUP, rounds(detail, 20)), _handle(0.02, 0.058, 0.034, 0.062, rounds(detail, 8, 4))]


def add_table_ware(site: Site, rng: np.random.Generator, detail: float) -> None:
    """Plates with cups and cutlery in a ring, and in the middle bottles, a jug, a bowl of fruit and a loaf."""
    wide, narrow = rounds(detail, 32), rounds(detail, 20)
    for x, z in ((-0.5, 0.3), (0.45, 0.3), (-0.5, -0.3), (0.45, -0.3)):
        seat = site.inner(x, 0.0, 0.75 * z, int(rng.integers(-8, 9)))
        seat.add(_turned(_PLATE, wide), "china")
        seat.add(_turned(_PLATE, wide).scaled(0.7, 0.9, 0.7).moved(0.0, 0.02, 0.0), "blue")
        for shape in _cup(detail):
            seat.inner(0.2, 0.0, 0.02, int(rng.integers(0, 360))).add(shape, "china")
        for k, offset in enumerate((-0.155, -0.175, 0.15)):
            seat.add(tube([(offset, 0.004, -0.09), (offset, 0.006, 0.09)], (0.004, 0.005), rounds(detail, 6, 4)), "steel")
            seat.add(box((offset - 0.008, 0.003, 0.08), (offset + 0.008, 0.007, 0.12 + 0.01 * k)), "steel")
    for x, z, name in ((-0.12, 0.02, "glass"), (0.05, -0.1, "glass"), (0.16, 0.06, "clay")):
        site.add(_turned(_BOTTLE, narrow).moved(x, 0.0, z), name)
    site.add(_turned(_JUG, narrow).moved(0.72, 0.0, 0.02), "blue")
    site.add(_handle(0.05, 0.19, 0.06, 0.13, rounds(detail, 8, 4)).moved(0.72, 0.0, 0.02), "blue")
    bowl = site.inner(-0.78, 0.0, 0.02)
    bowl.add(_turned(_BOWL, wide), "clay")
    for k in range(9):
        x, z = rng.uniform(-0.055, 0.055, 2)
        bowl.add(_ball(0.034, rounds(detail, 16)).moved(x, 0.035 + 0.018 * (k % 4), z), ("red", "green", "bread")[k % 3])
    site.add(box((0.1, 0.0, -0.3), (0.36, 0.015, -0.14)), "wood")
    site.add(_ball(0.075, narrow).scaled(1.7, 0.6, 0.9).moved(0.23, 0.012, -0.22), "bread")


def add_crockery(site: Site, rng: np.random.Generator, detail: float) -> None:
    """Dresser against the plane z = 0: shelves with plates, cups, jars and jugs, on a base with doors."""
    half, deep = 1.0, 0.34
    site.add(box((-half, 0.0, 0.0), (half, 0.86, 0.46)), "wood")
    site.add(box((-half - 0.03, 0.86, 0.0), (half + 0.03, 0.9, 0.5)), "wood_light")
    for left in (-0.95, -0.3, 0.35):
        site.add(box((left, 0.1, 0.45), (left + 0.6, 0.6, 0.475)), "wood_light")
        site.add(box((left, 0.66, 0.45), (left + 0.6, 0.82, 0.475)), "wood_light")
    for side in (-1.0, 1.0):
        site.add(box((side * half - 0.02, 0.9, 0.0), (side * half + 0.02, 2.2, deep)), "wood")
    site.add(box((-half - 0.05, 2.2, 0.0), (half + 0.05, 2.28, deep + 0.06)), "wood")
    wide, narrow = rounds(detail, 28), rounds(detail, 20)
    for row, y in enumerate((1.24, 1.56, 1.88)):
        site.add(box((-half, y - 0.025, 0.0), (half, y, deep)), "wood")
        for k in range(7):
            x = -0.84 + 0.28 * k
            kind = (k + row) % 3
            if kind == 0:
                for pile in range(int(rng.integers(4, 8))):
                    site.add(_turned(_PLATE, wide).moved(x, y + 0.016 * pile, 0.18), "china" if row % 2 else "blue")
            elif kind == 1:
                for dz in (0.1, 0.23):
                    for shape in _cup(detail):
                        site.inner(x, y, dz, int(rng.integers(0, 360))).add(shape, "china")
            else:
                profile, name = ((_JAR, "clay"), (_JUG, "copper"), (_BOTTLE, "glass"))[int(rng.integers(0, 3))]
                site.add(_turned(profile, narrow).scaled(0.85, 0.85, 0.85).moved(x, y, 0.16), name)
    for x in (-0.7, -0.2, 0.35, 0.75):
        site.add(_turned(_JAR, narrow).scaled(1.5, 1.4, 1.5).moved(x, 0.9, 0.2), "china")


def add_hanging_pans(site: Site, detail: float) -> None:
    """Rail along x with hooks and pans, and pots with lids on the stove below it."""
    site.add(tube([(-0.7, 0.0, 0.0), (1.5, 0.0, 0.0)], (0.012, 0.012), rounds(detail, 10)), "iron")
    wide = rounds(detail, 28)
    for k in range(6):
        pan = site.inner(-0.5 + 0.36 * k, -0.42, 0.0)
        size = 0.7 + 0.1 * (k % 3)
        body = _turned(_POT, wide).scaled(size, 0.6 * size, size)
        x, y, z = body.vertices.T
        pan.add(Shape(np.stack([x, -z, y - 0.03], axis=1), body.triangles), "copper")
        pan.add(tube([(0.0, 0.1 * size, 0.0), (0.0, 0.36, 0.0)], (0.011, 0.008), rounds(detail, 8, 4)), "iron")
        pan.add(tube([(0.0, 0.34, 0.0), (0.02, 0.4, 0.012), (0.0, 0.43, 0.0)], (0.004, 0.004, 0.004), 5), "iron")
    for x, z in ((0.33, 0.15), (0.77, -0.13)):
        pot = site.inner(x, -1.078, z)
        pot.add(_turned(_POT, wide).scaled(1.0, 1.3, 1.0), "steel")
        pot.add(_turned(_LID, wide).moved(0.0, 0.163, 0.0), "steel")
        pot.add(join([_handle(0.08, 0.14, end * 0.11, end * 0.16, rounds(detail, 8, 4)) for end in (-1.0, 1.0)]), "steel")
