"""A curly closed body in a cage of bars, lit from its middle (a stand-in for "dragon cage" of Chan and Durand 2004).

Shadows of body and bars cover the room, and their volumes overlap many times in every pixel.
"""

from __future__ import annotations

import math

import numpy as np

from shadowbench.geometry import FloatArray, Light, cross, dot
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, require_triangles
from shadowbench.scenes.shapes import Shape, box, lathe, zigzag
from shadowbench.trigonometry import cos_degrees, sin_degrees

_HALF, _HEIGHT = 14.0, 20.0                 # of the room, which is open towards the camera
_N_BARS, _BAR_SIDES, _HOOP_STEPS = 40, 6, 64
_CAGE, _BAR, _CAGE_HEIGHT = 5.6, 0.11, 9.5
_HOOPS = (0.3, 4.9, 9.2)
_CENTRE = 4.6
"""Height of the body's middle, where the light hangs."""

_TURNS, _CURLS = 3, 13
"""The body winds so often round the middle, and so often round its own ring, before it bites its tail."""
_RING, _CURL, _THICKNESS, _RIDGE, _N_RIDGES = 3.0, 1.35, 0.27, 0.08, 60
_SIDES, _FEWEST_STEPS, _STEPS_PER_SIDE = 12, 120, 24
_FLOOR_TRIANGLES, _WALL_TRIANGLES = 16, 8

_FIXED = (_N_BARS * 4 * _BAR_SIDES + len(_HOOPS) * 2 * _BAR_SIDES * _HOOP_STEPS + _WALL_TRIANGLES + _FLOOR_TRIANGLES)
MINIMUM = _FIXED + 2 * _SIDES * _FEWEST_STEPS

_COLORS = {"wall": (0.60, 0.58, 0.55), "floor": (0.46, 0.44, 0.42), "iron": (0.22, 0.23, 0.26), "hide": (0.24, 0.50, 0.30)}


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the cage with exactly `triangles` triangles; `seed` turns the body and the bars.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("dragon_cage", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    builder = MeshBuilder(_COLORS)
    builder.add(box((-_HALF, 0, -_HALF), (_HALF, _HEIGHT, _HALF), ("-y", "+z")).flipped(), "wall")
    _add_cage(builder, int(rng.integers(0, 11)))
    # The body takes what the rest leaves, with rings about as far apart as the points in them
    left = triangles - builder.n_triangles - _FLOOR_TRIANGLES
    sides = max(_SIDES, math.isqrt(left // (2 * _STEPS_PER_SIDE)))
    body = _body(left // (2 * sides), sides).turned_degrees(int(rng.integers(0, 360)))
    builder.add(body.moved(0.0, _CENTRE, 0.0), "hide")
    near, far = (((-_HALF, 0.0, z), (_HALF, 0.0, z)) for z in (_HALF, -_HALF))
    builder.add(zigzag(near, far, triangles - builder.n_triangles), "floor")
    eyes = [(7.0, 10.5, 20.0), (-3.0, 7.0, 22.0), (-11.0, 12.0, 16.0), (0.0, 15.0, 20.0)]
    targets = [(-0.5, 4.8, 0.0), (0.0, 5.0, 0.0), (0.5, 4.0, 0.0), (0.0, 4.5, 0.0)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=True, fov_y=52.0, near=0.1, far=200.0,
                           light=Light.point(0.0, _CENTRE + 0.2, 0.0))


def _add_cage(builder: MeshBuilder, degrees: int) -> None:
    """Add upright bars and level hoops."""
    bar = lathe([(_BAR, 0.0), (_BAR, _CAGE_HEIGHT)], _BAR_SIDES, bottom=True, top=True)
    for k in range(_N_BARS):
        angle = degrees + 360.0 * k / _N_BARS
        builder.add(bar.moved(_CAGE * cos_degrees(angle), 0.0, _CAGE * sin_degrees(angle)), "iron")
    for height in _HOOPS:
        turn = 360.0 / _HOOP_STEPS
        circle = np.array([[cos_degrees(turn * i), 0.0, sin_degrees(turn * i)] for i in range(_HOOP_STEPS)])
        radius = np.full(_HOOP_STEPS, 1.4 * _BAR)
        builder.add(_tube(_CAGE * circle, radius, _BAR_SIDES).moved(0.0, height, 0.0), "iron")


def _body(steps: int, sides: int) -> Shape:
    """Knot on a ring about the origin, with ridges: closed, and without touching itself."""
    points, radius = np.empty((steps, 3)), np.empty(steps)
    for i in range(steps):
        turn, curl = 360.0 * (_TURNS * i % steps) / steps, 360.0 * (_CURLS * i % steps) / steps
        out = _RING + _CURL * cos_degrees(curl)
        points[i] = out * cos_degrees(turn), _CURL * sin_degrees(curl), out * sin_degrees(turn)
        radius[i] = _THICKNESS + _RIDGE * cos_degrees(360.0 * (_N_RIDGES * i % steps) / steps)
    return _tube(points, radius, sides)


def _tube(points: FloatArray, radius: FloatArray, sides: int) -> Shape:
    """Closed tube round a closed curve, float64 (n, 3), that winds about the y axis without crossing it."""
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    along /= np.sqrt(dot(along, along))[:, None]
    # Across the curve: away from the y axis, then at right angles to both
    out = points * np.array([1.0, 0.0, 1.0])
    out -= dot(out, along)[:, None] * along
    out /= np.sqrt(dot(out, out))[:, None]
    up = cross(along, out)
    circle = [(cos_degrees(360.0 * k / sides), sin_degrees(360.0 * k / sides)) for k in range(sides)]
    rings = np.stack([points + radius[:, None] * (c * out + s * up) for c, s in circle], axis=1)
    n = len(points)
    i, k = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(sides), indexing="ij"))
    here, there = i * sides, (i + 1) % n * sides
    a, b, c, d = here + k, here + (k + 1) % sides, there + (k + 1) % sides, there + k
    return Shape(rings.reshape(-1, 3), np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))
