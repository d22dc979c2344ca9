"""Small scenes whose shadow is known in closed form, independent of any triangle test.

Casters are convex solids (a segment is clipped against half-spaces) and flat convex panels, with or without a hole
(the point is projected through the light onto the panel's plane). All coordinates are multiples of 2^-16, so the
closed form speaks of the very surfaces that are triangulated. Edges are skewed or offset so that shadow boundaries do
not run along rows of samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.geometry import FloatArray, Light, Vector, cross, dot
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene
from shadowbench.scenes.shapes import Shape, box, unit_circle

TOUCH = 1e-9
"""World length below which a segment only touches a solid: the rounding of a sample on the solid's own face."""

_GROUND_CELLS = 5
_COLORS = {"ground": (0.62, 0.62, 0.60), "caster": (0.72, 0.36, 0.22)}


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex body: `shape`, wound outwards, bounds it."""

    shape: Shape

    def blocks(self, points: FloatArray, light: Light) -> NDArray[np.bool_]:
        """True where the segment from a point (n, 3) to the light passes through the inside; bool (n,)."""
        corners = self.shape.vertices[self.shape.triangles]
        normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.sqrt(dot(normals, normals))[:, None]
        towards, limit = _towards(points, light)
        enter, leave = np.zeros(len(points)), limit
        # Clip the segment, point + s * towards with s in length units, against every face's half-space.
        for normal, corner in zip(normals, corners[:, 0], strict=True):
            outside, rate = dot(normal, points - corner), dot(normal, towards)
            with np.errstate(divide="ignore", invalid="ignore"):
                crossing = -outside / rate
            enter = np.where(rate < 0, np.maximum(enter, crossing), enter)
            leave = np.where(rate > 0, np.minimum(leave, crossing), leave)
            leave = np.where((rate == 0) & (outside > 0), -1.0, leave)
        return np.asarray(leave - enter > TOUCH)


@dataclass(frozen=True, eq=False)
class Panel:
    """A flat convex polygon (k, 3), anticlockwise seen against `normal`, with an optional convex hole in it."""

    outline: FloatArray
    hole: FloatArray | None = None

    @property
    def shape(self) -> Shape:
        """Triangles: a fan, or a band between outline and hole, which have equally many points."""
        k = len(self.outline)
        i, j = np.arange(k), (np.arange(k) + 1) % k
        if self.hole is None:
            return Shape(self.outline, np.stack([np.zeros(k - 2, np.int64), i[1:-1], i[2:]], axis=1))
        band = np.concatenate([np.stack([i, j, k + j], axis=1), np.stack([i, k + j, k + i], axis=1)])
        return Shape(np.concatenate([self.outline, self.hole]), band)

    def blocks(self, points: FloatArray, light: Light) -> NDArray[np.bool_]:
        """True where the segment from a point (n, 3) to the light crosses the panel; bool (n,)."""
        normal = cross(self.outline[1] - self.outline[0], self.outline[2] - self.outline[0])
        towards, limit = _towards(points, light)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = dot(normal, self.outline[0] - points) / dot(normal, towards)
        hit = points + np.where(np.isfinite(s), s, 0.0)[:, None] * towards
        crosses = np.isfinite(s) & (s > TOUCH) & (s < limit) & _inside(hit, self.outline, normal)
        return crosses if self.hole is None else crosses & ~_inside(hit, self.hole, normal)


def _towards(points: FloatArray, light: Light) -> tuple[FloatArray, FloatArray]:
    """Unit vectors from points to the light, and the distances to it (infinite for a directional light)."""
    position = light.xyzw()
    towards = position[:3] - position[3] * points
    lengths = np.sqrt(dot(towards, towards))
    return towards / lengths[:, None], np.full(len(points), np.inf) if light.is_directional else lengths


def _inside(points: FloatArray, polygon: FloatArray, normal: FloatArray) -> NDArray[np.bool_]:
    """True for points of the polygon's plane within it; bool (n,)."""
    inside = np.ones(len(points), bool)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        inside &= dot(cross(np.broadcast_to(b - a, points.shape), points - a), normal) >= 0
    return inside


@dataclass(frozen=True, eq=False)
class AnalyticScene:
    """A ground plane at height 0, casters, light and camera."""

    casters: Sequence[Solid | Panel]
    light: Light
    eye: Vector = (7.3, 6.1, 10.7)
    target: Vector = (0.4, 0.6, 0.3)
    ground: float = 16.0

    def closed_form(self, points: FloatArray) -> NDArray[np.bool_]:
        """Tell which points (n, 3) of the scene's surfaces are in shadow; bool (n,).

        Holds for points that face the light and lie farther than the bias behind any caster they are shadowed by.
        """
        shadow = np.zeros(len(points), bool)
        for caster in self.casters:
            shadow |= caster.blocks(points, self.light)
        return shadow

    def scene(self) -> ProceduralScene:
        """Triangulate."""
        builder = MeshBuilder(_COLORS)
        n, size = _GROUND_CELLS, self.ground
        ticks = np.array([round((-size + 2 * size * i / n) * 16) / 16 for i in range(n + 1)])
        x, z = (a.ravel() for a in np.meshgrid(ticks, ticks))
        cell = np.array([(0, n + 1, n + 2), (0, n + 2, 1)])
        starts = [j * (n + 1) + i for j in range(n) for i in range(n)]
        builder.add(Shape(np.stack([x, np.zeros(len(x)), z], axis=1),
                          np.concatenate([cell + start for start in starts])), "ground")
        for caster in self.casters:
            builder.add(caster.shape, "caster")
        return ProceduralScene(builder.mesh(), [self.eye], [self.target], closed=False, fov_y=60.0, near=0.1, far=200.0,
                               light=self.light)


def _polygon(sides: int, radius: float, turn: float, centre: Vector, slope: float = 0.0) -> FloatArray:
    """Regular polygon seen from above, its plane rising by `slope` (a multiple of 1/4) along x; float64 (sides, 3)."""
    circle = radius * unit_circle(sides)
    c, s = unit_circle(360)[int(turn)]
    x = np.rint((c * circle[:, 0] - s * circle[:, 1]) * 2**14) / 2**14      # so that a quarter is still on the grid
    z = np.rint((s * circle[:, 0] + c * circle[:, 1]) * 2**14) / 2**14
    return np.stack([x + centre[0], slope * x + centre[1], z + centre[2]], axis=1)[::-1]


def _tetrahedron() -> Shape:
    """Four corners, wound outwards."""
    corners = np.array([[-1.5, 0.75, 1.25], [1.75, 1.0, 1.5], [0.25, 1.25, -2.0], [0.125, 3.5, 0.25]])
    return Shape(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))


def _treads() -> list[Solid]:
    """Seven steps of an open staircase."""
    return [Solid(box((-1.5 + 0.0625 * i, 0.5 + 0.5 * i, 2.0 - 0.75 * i), (1.5, 0.625 + 0.5 * i, 2.5625 - 0.75 * i)))
            for i in range(7)]


_SUN = Light.directional(-0.53125, -1.0, -0.34375)
_LAMP = Light.point(3.1875, 9.0625, 2.3125)

_SCENES: dict[str, AnalyticScene] = {
    "plane_square": AnalyticScene([Panel(_polygon(4, 2.0, 17, (0.1875, 2.0, 0.0625)))], _LAMP),
    "plane_disc": AnalyticScene([Panel(_polygon(24, 2.25, 5, (0.125, 2.5, -0.25), 0.25))], _LAMP),
    "plane_frame": AnalyticScene([Panel(_polygon(4, 2.75, 29, (0.1875, 2.25, 0.0625)),
                                        _polygon(4, 1.625, 29, (0.1875, 2.25, 0.0625)))], _LAMP),
    "plane_box": AnalyticScene([Solid(box((-1.0625, 0.6875, -1.3125), (1.4375, 2.5625, 0.9375)))], _LAMP),
    "plane_tetrahedron": AnalyticScene([Solid(_tetrahedron())], _LAMP),
    "slit": AnalyticScene([Solid(box((-5.0, 0.125, -0.3125), (-0.15625, 3.1875, 0.1875))),
                           Solid(box((0.09375, 0.125, -0.3125), (5.0, 3.1875, 0.1875)))],
                          Light.point(0.4375, 4.5625, -6.3125)),
    "treads": AnalyticScene(_treads(), Light.point(-5.0625, 9.1875, -1.4375)),
    "sunlit_square": AnalyticScene([Panel(_polygon(4, 2.0, 17, (0.1875, 2.0, 0.0625)))], _SUN),
    "sunlit_boxes": AnalyticScene([Solid(box((1.0625, 0.25, 0.3125), (2.4375, 3.5625, 1.9375))),
                                   Solid(box((-2.3125, 0.25, -1.6875), (-0.4375, 1.6875, 0.8125)))], _SUN),
}

ANALYTIC_SCENES: dict[str, Callable[[FloatArray], NDArray[np.bool_]]] = {
    name: scene.closed_form for name, scene in _SCENES.items()}
"""The closed form of each analytic scene: points (n, 3) on its surfaces to bool (n,), True in shadow."""


def _generate(name: str, triangles: int, seed: int) -> ProceduralScene:
    """Triangulate an analytic scene; `seed` changes nothing.

    Raises
    ------
    InputError
        If `triangles` is not the scene's own number.
    """
    scene = _SCENES[name].scene()
    if triangles != scene.mesh.n_triangles:
        raise InputError(f"{name} always has {scene.mesh.n_triangles} triangles, not {triangles}: "
                         "leave 'triangles' out")
    return scene


plane_square = partial(_generate, "plane_square")
plane_disc = partial(_generate, "plane_disc")
plane_frame = partial(_generate, "plane_frame")
plane_box = partial(_generate, "plane_box")
plane_tetrahedron = partial(_generate, "plane_tetrahedron")
slit = partial(_generate, "slit")
treads = partial(_generate, "treads")
sunlit_square = partial(_generate, "sunlit_square")
sunlit_boxes = partial(_generate, "sunlit_boxes")
