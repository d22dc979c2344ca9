"""An open jeep on sandy ground (a stand-in for the "jeep" scene of Sen et al. 2003): a small game model of closed bodies.

Lengths are metres; the jeep points to +x.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import Light
from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, fit_detail, require_triangles
from shadowbench.scenes.shapes import Shape, box, frame, lathe, prism
from shadowbench.scenes.tubes import ring, tube

MINIMUM = 1_650
"""Fewest triangles: the jeep in its coarsest form, and a little ground."""

_DEFAULT = 1_732
_FEWEST_GROUND = 40
_HALF = 9.0
_WHEEL, _AXLES, _TRACK = 0.42, (-1.12, 1.18), 0.72     # radius; where the axles are along x; half the distance of the wheels

_COLORS = {"paint": (0.24, 0.29, 0.13), "paint_light": (0.33, 0.38, 0.19), "tyre": (0.05, 0.05, 0.05),
           "steel": (0.45, 0.46, 0.46), "seat": (0.36, 0.25, 0.14), "lamp": (0.85, 0.83, 0.7), "sand": (0.66, 0.53, 0.34)}


_MUDGUARD = ([(0.52, 0.86), (0.86, 0.88), (0.82, 0.95), (0.5, 0.93)], [(0.86, 0.88), (1.55, 0.88), (1.58, 0.95), (0.82,
                                                                                                                  0.95)],
             [(1.55, 0.88), (1.78, 0.62), (1.86, 0.66), (1.58, 0.95)])
"""Outlines of a front mudguard's three pieces, seen from the side."""


def _across(shape: Shape) -> Shape:
    """Lay a shape's y axis along z."""
    x, y, z = shape.vertices.T
    return Shape(np.stack([x, -z, y], axis=1), shape.triangles)


def _upright(shape: Shape) -> Shape:
    """Turn a shape's y axis along x."""
    x, y, z = shape.vertices.T
    return Shape(np.stack([y, -x, z], axis=1), shape.triangles)


def _wheel(detail: float) -> list[tuple[Shape, str]]:
    """Tyre and hub about the z axis."""
    tyre = [(0.24, -0.1), (0.38, -0.115), (_WHEEL, -0.06), (_WHEEL, 0.06), (0.38, 0.115), (0.24, 0.1)]
    hub = [(0.18, -0.12), (0.09, -0.15), (0.09, 0.15), (0.18, 0.12)]
    return [(_across(lathe(profile, rounds(detail, sides), bottom=True, top=True)), name)
            for profile, sides, name in ((tyre, 12, "tyre"), (hub, 8, "steel"))]


def _body(builder: MeshBuilder) -> None:
    """Tub, bonnet, mudguards, bumpers and grille."""
    low, wide = 0.52, 0.62
    # The sides are lower where one gets in
    for outline in ([(-1.75, low), (0.5, low), (0.5, 0.78), (-1.75, 0.78)], [(0.1, 0.78), (0.5, 0.78), (0.5, 1.02), (0.28,
                                                                                                                     1.02)],
                    [(-1.75, 0.78), (-0.45, 0.78), (-0.6, 1.0), (-1.75, 1.0)]):
        for side in (-1.0, 1.0):
            builder.add(prism(outline, 0.06).moved(0.0, 0.0, side * wide), "paint")
    builder.add(box((-1.75, low, -wide), (0.5, 0.6, wide)), "paint")
    builder.add(box((-1.81, low, -wide - 0.03), (-1.74, 1.0, wide + 0.03)), "paint")
    builder.add(prism([(0.5, low), (1.62, low), (1.62, 0.98), (0.5, 1.08)], 1.02), "paint")
    builder.add(prism([(0.48, 1.06), (1.66, 0.96), (1.66, 1.0), (0.48, 1.11)], 1.08), "paint_light")
    for side in (-1.0, 1.0):
        for piece in _MUDGUARD:
            builder.add(prism(piece, 0.36).moved(0.0, 0.0, side * 0.7), "paint_light")
        builder.add(box((-1.7, 0.86, side * 0.7 - 0.18), (-0.62, 0.93, side * 0.7 + 0.18)), "paint_light")
        builder.add(box((1.5, 0.4, side * 0.35 - 0.05), (1.95, 0.5, side * 0.35 + 0.05)), "steel")
        builder.add(box((-2.0, 0.42, side * 0.55 - 0.06), (-1.75, 0.56, side * 0.55 + 0.06)), "steel")
    builder.add(box((1.9, 0.36, -0.78), (2.0, 0.56, 0.78)), "steel")
    builder.add(box((-1.7, 0.36, -0.5), (1.5, 0.46, 0.5)), "steel")
    for k in range(7):
        builder.add(box((1.6, 0.6, 0.085 * (k - 3) - 0.024), (1.66, 0.9, 0.085 * (k - 3) + 0.024)), "paint_light")


def _fittings(builder: MeshBuilder, detail: float) -> None:
    """Windscreen, seats, steering wheel, roll bar, lamps, can, shovel and aerial."""
    screen = frame(1.2, 0.42, 0.05, 0.05)
    points = screen.vertices.copy()
    lean = Shape(np.stack([points[:, 2] - 0.28 * points[:, 1], points[:, 1], -points[:, 0]], axis=1), screen.triangles)
    builder.add(lean.moved(0.4, 1.34, 0.0), "paint_light")
    builder.add(box((0.37, 1.13, -0.02), (0.42, 1.54, 0.02)), "paint_light")
    for x, z, wide in ((-0.25, -0.32, 0.22), (-0.25, 0.32, 0.22), (-1.25, 0.0, 0.5)):
        builder.add(box((x - 0.22, 0.6, z - wide), (x + 0.22, 0.84, z + wide)), "seat")
        builder.add(prism([(x - 0.26, 0.8), (x - 0.16, 0.8), (x - 0.26, 1.3), (x - 0.35, 1.3)], 2.0 * wide).moved(0, 0, z),
                    "seat")
    wheel = _upright(ring(0.19, 0.018, rounds(detail, 12), 4))
    builder.add(wheel.moved(0.2, 1.12, -0.32), "tyre")
    builder.add(tube([(0.48, 0.94, -0.32), (0.19, 1.12, -0.32)], (0.022, 0.022), 5), "steel")
    sides = rounds(0.75 * detail, 8, 4)
    for z in (-0.56, 0.56):
        builder.add(tube([(-0.72, 0.9, z), (-0.74, 1.68, z)], (0.03, 0.03), sides), "steel")
        builder.add(tube([(-0.72, 1.58, z), (-1.7, 0.96, z)], (0.026, 0.026), sides), "steel")
    builder.add(tube([(-0.74, 1.66, -0.58), (-0.74, 1.66, 0.58)], (0.03, 0.03), sides), "steel")
    lamp = lathe([(0.06, -0.06), (0.115, 0.02), (0.115, 0.06)], rounds(detail, 12), bottom=True, top=True)
    for z in (-0.42, 0.42):
        builder.add(_upright(lamp).moved(1.66, 0.78, z), "lamp")
    builder.add(box((-1.98, 0.62, 0.28), (-1.82, 1.02, 0.58)), "paint")
    builder.add(tube([(-1.5, 1.0, 0.8), (0.1, 0.99, 0.8)], (0.02, 0.02), 4), "seat")
    builder.add(box((0.05, 0.94, 0.76), (0.4, 1.06, 0.82)), "steel")
    builder.add(tube([(-1.7, 0.98, -0.6), (-1.82, 2.4, -0.64)], (0.012, 0.006), 4), "steel")


def _build(detail: float) -> MeshBuilder:
    """Build the jeep."""
    builder = MeshBuilder(_COLORS)
    _body(builder)
    _fittings(builder, detail)
    for x in _AXLES:
        builder.add(tube([(x, _WHEEL, -_TRACK), (x, _WHEEL, _TRACK)], (0.05, 0.05), 5), "steel")
    for shape, name in _wheel(detail):
        for x in _AXLES:
            for side in (-1.0, 1.0):
                builder.add(shape.moved(x, _WHEEL, side * _TRACK), name)
        builder.add(shape.turned_degrees(90).moved(-1.93, 0.95, -0.2), name)
    return builder


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the jeep with exactly `triangles` triangles; `seed` makes the ground uneven.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("jeep", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    builder = fit_detail(_build, triangles - _FEWEST_GROUND, (triangles / _DEFAULT) ** 0.5)
    sand = ground((-_HALF, _HALF), (-_HALF, _HALF), triangles - builder.n_triangles)
    away = np.maximum(np.abs(sand.vertices[:, 0]) - 3.4, np.abs(sand.vertices[:, 2]) - 3.0)
    rise = np.where(away > 0.0, rng.uniform(0.0, 0.5, len(away)) * np.minimum(away, 3.0) / 3.0, 0.0)
    builder.add(Shape(sand.vertices + rise[:, None] * np.array([0.0, 1.0, 0.0]), sand.triangles), "sand")
    eyes = [(4.4, 2.6, 4.2), (5.2, 1.9, 0.8), (3.9, 2.2, -4.4), (-3.6, 2.9, -4.6), (-5.4, 2.4, 1.0), (-2.2, 2.2, 5.2)]
    targets = [(0.0, 0.6, 0.0), (0.2, 0.6, 0.0), (0.0, 0.6, -0.2), (0.0, 0.6, -0.2), (0.0, 0.6, 0.0), (0.0, 0.6, 0.4)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=True, fov_y=42.0, near=0.1, far=100.0,
                           light=Light.point(-3.6, 6.4, 3.4))
