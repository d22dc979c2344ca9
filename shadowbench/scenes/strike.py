"""A bowling ball running into ten pins of 450 triangles each (a stand-in for the "strike" scene of Sen et al. 2003).

Shadows fall on curved receivers: on pins, on the ball and into the gutters. Lengths are decimetres.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import Light
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, require_triangles, whole_degrees
from shadowbench.scenes.shapes import Shape, box, lathe, strip, unit_circle, zigzag
from shadowbench.trigonometry import cos_degrees, sin_degrees

N_PINS = 10
PIN_TRIANGLES = 450
"""Triangles of a pin at its coarsest, as in the paper."""

_INCH = 0.254
_PIN = ((0.0, 1.015), (0.75, 1.414), (2.25, 1.953), (3.375, 2.255), (4.5, 2.383), (5.875, 2.281), (7.25, 1.852),
        (8.625, 1.236), (9.375, 0.983), (10.0, 0.899), (10.875, 0.935), (11.75, 1.047), (12.625, 1.203),
        (13.5, 1.274), (14.45, 0.98), (15.0, 0.0))
"""Height and radius of a pin, inches: 15 rings and the top."""

_PIN_SIDES, _BALL_SIDES, _BALL_RINGS = 15, 24, 11
_BALL_TRIANGLES = 2 * _BALL_SIDES * _BALL_RINGS
_BALL_RADIUS = 1.08
_SPACING, _ROW = 3.05, 2.64                 # between pins in a row, and between rows
_HALF_LANE, _GUTTER = 5.25, 1.17
_FRONT, _BACK, _END = 26.0, -12.0, -18.0
_BACKDROP, _HIGH, _LOW = 22.0, 15.0, -1.5   # half width, top and bottom of the wall at the end
_BOARDS = 30
_GUTTER_SIDES, _GUTTER_LENGTHS = 12, 8

_FIXED = 2 * _BOARDS + 2 * (2 * _GUTTER_SIDES * _GUTTER_LENGTHS) + 2 * 6 + 2
MINIMUM = N_PINS * PIN_TRIANGLES + _BALL_TRIANGLES + _FIXED + 2

_COLORS = {"pin": (0.88, 0.86, 0.80), "ball": (0.10, 0.14, 0.42), "maple": (0.72, 0.52, 0.30), "pine": (0.78, 0.60, 0.38),
           "gutter": (0.34, 0.33, 0.35), "wall": (0.46, 0.22, 0.18), "apron": (0.52, 0.50, 0.47)}


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the alley with exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("strike", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    # More triangles go into rounder pins and a rounder ball; the rest into the floor behind the pins
    detail = (triangles - _FIXED - 2) // (N_PINS * PIN_TRIANGLES + _BALL_TRIANGLES)
    builder = MeshBuilder(_COLORS)
    _add_alley(builder)
    _add_pins(builder, rng, _PIN_SIDES * detail)
    builder.add(_ball(_BALL_SIDES * detail).moved(rng.uniform(0.5, 1.1), _BALL_RADIUS, 2.3), "ball")
    near, far = (((-_HALF_LANE, 0.0, z), (_HALF_LANE, 0.0, z)) for z in (_BACK, _END))
    builder.add(zigzag(near, far, triangles - builder.n_triangles), "apron")
    eyes = [(-4.5, 6.5, 15.0), (-1.5, 4.5, 13.0), (3.5, 4.0, 12.0), (5.0, 7.0, 10.0)]
    targets = [(0.3, 1.4, -2.5), (0.3, 1.5, -2.5), (0.2, 1.5, -3.0), (0.0, 1.0, -4.0)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=False, fov_y=42.0, near=0.1, far=200.0,
                           light=Light.point(-6.5, 11.0, 9.0))


def _add_alley(builder: MeshBuilder) -> None:
    """Add the boards of the lane, the gutters, the side walls and the wall at the back."""
    width = 2.0 * _HALF_LANE / _BOARDS
    for name, first in (("maple", 0), ("pine", 1)):
        for board in range(first, _BOARDS, 2):
            x = -_HALF_LANE + width * board
            builder.add(zigzag(((x, 0.0, _FRONT), (x + width, 0.0, _FRONT)), ((x, 0.0, _BACK), (x + width, 0.0, _BACK)),
                               2), name)
    z = np.linspace(_FRONT, _END, _GUTTER_LENGTHS + 1)
    round_part = unit_circle(2 * _GUTTER_SIDES)[_GUTTER_SIDES:]
    arc = np.concatenate([round_part, [[1.0, 0.0]]]) * _GUTTER
    for middle in (-_HALF_LANE - _GUTTER, _HALF_LANE + _GUTTER):
        lines = np.stack([np.stack([middle + arc[:, 0], arc[:, 1], np.full(len(arc), s)], axis=1) for s in z])
        builder.add(strip(lines), "gutter")
    for side in (-1.0, 1.0):
        low, high = sorted((side * (_HALF_LANE + 2.0 * _GUTTER), side * _BACKDROP))
        builder.add(box((low, 0.0, _END), (high, 0.8, 4.0), ("-y", "+x" if side > 0 else "-x", "-z")),
                    "wall")
    wall = [((-_BACKDROP, y, _END), (_BACKDROP, y, _END)) for y in (_LOW, _HIGH)]
    builder.add(zigzag(wall[0], wall[1], 2), "wall")


def _add_pins(builder: MeshBuilder, rng: np.random.Generator, sides: int) -> None:
    """Add ten pins in a triangle; those around the head pin are falling."""
    pin = lathe([(_INCH * r, _INCH * y) for y, r in _PIN], sides, bottom=True)
    for row in range(4):
        for i in range(row + 1):
            lean, way = int(rng.integers(6, 17)), int(whole_degrees(rng, 1, 100)[0]) - 50
            falling = pin if row == 3 else _leaning(pin, lean * (3 - row) // 2, way)
            builder.add(falling.moved((i - 0.5 * row) * _SPACING, 0.0, -row * _ROW), "pin")


def _leaning(shape: Shape, lean: int, way: int) -> Shape:
    """Lean a shape by whole degrees away from +z, turned by `way` degrees, and set it on the ground."""
    points, c, s = shape.vertices.copy(), cos_degrees(float(lean)), sin_degrees(float(lean))
    y, z = points[:, 1].copy(), points[:, 2].copy()
    points[:, 1], points[:, 2] = c * y + s * z, c * z - s * y
    leaning = Shape(points, shape.triangles).turned_degrees(way)
    return leaning.moved(0.0, -float(leaning.vertices[:, 1].min()), 0.0)


def _ball(sides: int) -> Shape:
    """Sphere about the origin."""
    half_turn = unit_circle(2 * (_BALL_RINGS + 1))
    profile = [(0.0, -_BALL_RADIUS)]
    profile += [(_BALL_RADIUS * s, -_BALL_RADIUS * c) for c, s in half_turn[1:_BALL_RINGS + 1].tolist()]
    return lathe([*profile, (0.0, _BALL_RADIUS)], sides)
