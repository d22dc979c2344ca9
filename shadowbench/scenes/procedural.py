"""What every procedural scene is made with: the snapped grid, the mesh builder, smooth noise, and the result.

Scenes repeat bit for bit on every machine: random numbers come from ``default_rng(seed)`` as integers or uniforms,
angles are whole degrees or fractions of a turn looked up in correctly rounded tables, the rest is + - * / sqrt, and
every vertex is rounded to a grid of 2^-16 units before anything sees it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.geometry import FloatArray, Light, Material, Mesh, Vector
from shadowbench.scenes.shapes import Shape
from shadowbench.trigonometry import cos_degrees, sin_degrees

GRID_STEPS = 65536.0
"""Vertex grid steps per world unit: a power of two, so snapping is exact, and far finer than any detail."""


@dataclass(frozen=True, eq=False)
class ProceduralScene:
    """A generated scene.

    Attributes
    ----------
    mesh : the geometry; `Mesh.part` numbers its bodies, each of which is either closed or open.
    eyes, targets : Catmull-Rom key frames of a fly-through, world; frame 0 is the first.
    closed : True if the path returns to its first key frame.
    fov_y : full vertical angle of view, degrees.
    near, far : depths along the view, world units.
    light : the light.
    """

    mesh: Mesh
    eyes: Sequence[Vector]
    targets: Sequence[Vector]
    closed: bool
    fov_y: float
    near: float
    far: float
    light: Light


def snap(points: FloatArray) -> FloatArray:
    """Round coordinates to the 2^-16 grid; negative zero becomes zero."""
    return np.rint(points * GRID_STEPS) / GRID_STEPS + 0.0


class MeshBuilder:
    """Collects shapes into one mesh.

    Parameters
    ----------
    colors : linear RGB per material name; shapes are added by these names.
    """

    def __init__(self, colors: dict[str, Vector]) -> None:
        self.materials = tuple(Material(name, color) for name, color in colors.items())
        self._index = {name: i for i, name in enumerate(colors)}
        self._shapes: list[tuple[Shape, int]] = []
        self.n_triangles = 0

    def add(self, shape: Shape, material: str) -> None:
        """Add a shape as one part; a shape without triangles adds nothing."""
        if len(shape.triangles):
            self._shapes.append((shape, self._index[material]))
            self.n_triangles += len(shape.triangles)

    def extend(self, other: MeshBuilder) -> None:
        """Add the parts of a builder that has the same materials."""
        self._shapes += other._shapes
        self.n_triangles += other.n_triangles

    def mesh(self) -> Mesh:
        """Join all shapes, with vertices snapped to the grid."""
        shapes = [shape for shape, _ in self._shapes]
        sizes = [len(s.triangles) for s in shapes]
        first = np.cumsum([0] + [len(s.vertices) for s in shapes])
        triangles = np.concatenate([s.triangles + start for s, start in zip(shapes, first, strict=False)])
        return Mesh(
            vertices=snap(np.concatenate([s.vertices for s in shapes])),
            triangles=np.ascontiguousarray(triangles, np.int32),
            part=np.repeat(np.arange(len(shapes), dtype=np.int32), sizes),
            material=np.repeat(np.array([m for _, m in self._shapes], np.int32), sizes),
            materials=self.materials)


def fit_detail(build: Callable[[float], MeshBuilder], triangles: int, start: float) -> MeshBuilder:
    """Build with the finest of a falling row of details that needs no more than `triangles`.

    Parameters
    ----------
    build : makes the scene for a detail (1 at the scene's default count; linear, so counts grow with its square).
        Its count at detail 0 is the scene's stated minimum or less.
    triangles : the number asked for.
    start : first detail to try.
    """
    detail = start
    while True:
        builder = build(detail)
        if builder.n_triangles <= triangles or detail == 0.0:
            return builder
        # Aim 3 % below the ratio of the counts, and give up on detail where that is next to nothing.
        detail *= 0.97 * math.sqrt(triangles / builder.n_triangles)
        detail = 0.0 if detail < 0.02 else detail


def require_triangles(scene: str, triangles: int, minimum: int) -> None:
    """Refuse a count that the scene can't be built from.

    Raises
    ------
    InputError
        If `triangles` is below `minimum`.
    """
    if triangles < minimum:
        raise InputError(f"{scene} needs at least {minimum} triangles, not {triangles}: raise 'triangles'")


class SmoothNoise:
    """Noise over the plane: random values on an integer lattice, joined by cubic smooth steps, three octaves.

    Parameters
    ----------
    rng : source of the lattice values.
    spacing : distance between lattice points of the coarsest octave, world units.
    """

    _SIZE = 64      # lattice points per side before it repeats

    def __init__(self, rng: np.random.Generator, spacing: float) -> None:
        self._values = rng.uniform(-1.0, 1.0, (self._SIZE, self._SIZE))
        self._spacing = spacing

    def __call__(self, x: FloatArray | float, z: FloatArray | float) -> FloatArray:
        """Value at (x, z), between -1.75 and 1.75, mostly within 1."""
        x, z = np.asarray(x, np.float64) / self._spacing, np.asarray(z, np.float64) / self._spacing
        total = self._octave(x, z)
        total = total + 0.5 * self._octave(2.0 * x + 17.3, 2.0 * z + 5.9)
        return total + 0.25 * self._octave(4.0 * x + 41.7, 4.0 * z + 23.1)

    def _octave(self, x: FloatArray, z: FloatArray) -> FloatArray:
        """Interpolate the lattice."""
        column, row = np.floor(x), np.floor(z)
        u, v = smooth_step(x - column), smooth_step(z - row)
        i0, j0 = column.astype(np.int64) % self._SIZE, row.astype(np.int64) % self._SIZE
        i1, j1 = (i0 + 1) % self._SIZE, (j0 + 1) % self._SIZE
        low = self._values[j0, i0] * (1.0 - u) + self._values[j0, i1] * u
        high = self._values[j1, i0] * (1.0 - u) + self._values[j1, i1] * u
        return np.asarray(low * (1.0 - v) + high * v)


def smooth_step(t: FloatArray | float) -> FloatArray:
    """Cubic that rises from 0 at t <= 0 to 1 at t >= 1."""
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def whole_degrees(rng: np.random.Generator, n: int, limit: int = 360) -> NDArray[np.int64]:
    """Draw `n` angles of 0 to `limit` - 1 whole degrees."""
    return rng.integers(0, limit, n)


@dataclass(frozen=True)
class Site:
    """Where a building stands: shapes given in its own axes are turned, moved and added to the builder.

    Attributes
    ----------
    builder : receives the shapes.
    x, y, z : origin of the site, world.
    cosine, sine : direction of the site's own x axis, (cosine, 0, sine) in world space.
    """

    builder: MeshBuilder
    x: float
    y: float
    z: float
    cosine: float = 1.0
    sine: float = 0.0

    @staticmethod
    def at(builder: MeshBuilder, x: float, y: float, z: float, degrees: float = 0.0) -> Site:
        """Site whose x axis is turned by an angle from the world's x towards z."""
        return Site(builder, x, y, z, cos_degrees(float(degrees)), sin_degrees(float(degrees)))

    def add(self, shape: Shape, material: str) -> None:
        """Add one part."""
        self.builder.add(shape.turned(self.cosine, self.sine).moved(self.x, self.y, self.z), material)

    def inner(self, x: float, y: float, z: float, degrees: float = 0.0) -> Site:
        """Site given in this site's axes."""
        c, s = cos_degrees(float(degrees)), sin_degrees(float(degrees))
        return Site(self.builder, self.x + self.cosine * x - self.sine * z, self.y + y,
                    self.z + self.sine * x + self.cosine * z,
                    self.cosine * c - self.sine * s, self.sine * c + self.cosine * s)
