"""Plain records of what is rendered: mesh, material, light, camera, image and one frame of view samples.

World space is right-handed; lengths are in the scene's own unit. Everything that decides a count or a sign is
computed with + - * / and sqrt on float64 elements alone, never through BLAS (``@``, ``dot``, ``linalg``), whose
sums differ between machines.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.trigonometry import tan_degrees

Vector = tuple[float, float, float]
FloatArray = NDArray[np.float64]


Wrap = Literal["repeat", "clamp", "mirror"]
"""What lies beyond the edge of a texture."""


@dataclass(frozen=True)
class Texture:
    """An image on a surface, looked up with bilinear filtering. Textures of the same name and wrapping are equal.

    Attributes
    ----------
    name : path of the image, or of the file that it is embedded in.
    pixels : float32 (rows, columns, 4), linear RGB and opacity in 0..1; row 0 is the top, at v = 1.
    wrap : beyond the left and right edges, and beyond the lower and upper ones.
    """

    name: str
    pixels: NDArray[np.float32] = field(compare=False, repr=False)
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")


@dataclass(frozen=True)
class Material:
    """Surface of a group of triangles.

    A surface covers the share `alpha_texture` of a place, and what it covers lets the share ``1 - alpha`` of the light
    through. So without a texture `alpha` is the opacity, and with one the opacity is the product of both. Coloured
    light is dyed by the base colour where it passes through the substance: partial coverage and transmission in the
    sense of McGuire and Enderton, "Colored Stochastic Shadow Maps", 2011.

    Attributes
    ----------
    color : base colour, linear RGB in 0..1.
    alpha : opacity in 0..1; 1 is opaque.
    alpha_texture : image whose opacity multiplies `alpha`, or None.
    alpha_cutoff : opacity from which a place counts as opaque, and below which as clear (glTF mode MASK), or None for
        blending.
    color_texture : image whose colour multiplies `color`, or None.
    """

    name: str = "default"
    color: Vector = (1.0, 1.0, 1.0)
    alpha: float = 1.0
    alpha_texture: Texture | None = None
    alpha_cutoff: float | None = None
    color_texture: Texture | None = None

    @property
    def opacity(self) -> float:
        """Opacity where the texture, if there is one, covers all: `alpha`, or 0 or 1 with a cutoff."""
        if self.alpha_cutoff is None:
            return self.alpha
        return 1.0 if self.alpha >= self.alpha_cutoff else 0.0

    @property
    def is_opaque(self) -> bool:
        """True if no light passes anywhere."""
        return self.alpha_texture is None and self.opacity == 1.0

    def transmittance(self, colored: bool) -> tuple[float, ...]:
        """Share of the light that passes where the texture covers all: one number, or one each for red, green and blue."""
        passing = 1.0 - self.opacity
        if not colored:
            return (passing,)
        dyed = self.color if self.alpha_cutoff is None else (1.0, 1.0, 1.0)
        return tuple(passing * channel for channel in dyed)

    def varies(self, colored: bool) -> bool:
        """True if a texture must be looked up to know what passes."""
        if self.alpha_texture is not None:
            return True
        return colored and self.color_texture is not None and self.alpha_cutoff is None and self.alpha < 1.0


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in world space.

    Attributes
    ----------
    vertices : float64 (n_vertices, 3), world.
    triangles : int32 (n_triangles, 3), vertex indices.
    part : int32 (n_triangles,), index of the scene's geometry entry that each triangle came from.
    material : int32 (n_triangles,), index into `materials`.
    materials : surfaces.
    uv : float64 (n_triangles, 3, 2), texture coordinates per corner, or None.
    """

    vertices: FloatArray
    triangles: NDArray[np.int32]
    part: NDArray[np.int32]
    material: NDArray[np.int32]
    materials: tuple[Material, ...] = (Material(),)
    uv: FloatArray | None = None

    @staticmethod
    def from_arrays(vertices: Any, triangles: Any) -> Mesh:
        """Make a mesh of one part and one default material from arrays of any numeric type."""
        triangles = np.ascontiguousarray(np.asarray(triangles, np.int32).reshape(-1, 3))
        zeros = np.zeros(len(triangles), np.int32)
        vertices = np.ascontiguousarray(np.asarray(vertices, np.float64).reshape(-1, 3))
        return Mesh(vertices, triangles, zeros, zeros)

    @property
    def n_triangles(self) -> int:
        """Number of triangles, degenerate ones included."""
        return len(self.triangles)

    @cached_property
    def corners(self) -> FloatArray:
        """float64 (n_triangles, 3, 3): world position of each triangle's three vertices."""
        return np.ascontiguousarray(self.vertices[self.triangles])

    def bounds(self) -> FloatArray:
        """float64 (2, 3): smallest and largest coordinate over all vertices that a triangle uses."""
        if self.n_triangles == 0:
            return np.zeros((2, 3))
        points = self.corners.reshape(-1, 3)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def diagonal(self) -> float:
        """Length of the diagonal of `bounds`, world units."""
        x, y, z = (float(v) for v in np.subtract(*self.bounds()[::-1]))
        return float(np.sqrt(x * x + y * y + z * z))


@dataclass(frozen=True)
class Light:
    """A homogeneous light position: w = 1 a point light at (x, y, z), w = 0 one infinitely far towards it."""

    position: tuple[float, float, float, float]

    @staticmethod
    def point(x: float, y: float, z: float) -> Light:
        """Make a point light at a world position."""
        return Light((float(x), float(y), float(z), 1.0))

    @staticmethod
    def directional(x: float, y: float, z: float) -> Light:
        """Make a light so far away that its rays all travel along (x, y, z)."""
        return Light((-float(x), -float(y), -float(z), 0.0))

    @property
    def is_directional(self) -> bool:
        """True for a light at infinity."""
        return self.position[3] == 0.0

    def xyzw(self) -> FloatArray:
        """float64 (4,)."""
        return np.array(self.position, np.float64)


class CameraBasis(NamedTuple):
    """What kernels need of a camera. The ray of a point (x, y) of the image plane is forward + x right + y up.

    Attributes
    ----------
    eye, right, up, forward : float64 (3,), world; the last three are orthonormal.
    tan_x, tan_y : half the image plane's width and height at depth 1.
    near, far : smallest and largest visible depth along `forward`.
    """

    eye: FloatArray
    right: FloatArray
    up: FloatArray
    forward: FloatArray
    tan_x: float
    tan_y: float
    near: float
    far: float


def _unit(v: FloatArray) -> FloatArray:
    """Scale a vector to length 1."""
    return v / np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product over the last axis, in plain IEEE operations."""
    return np.stack([a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
                     a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
                     a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]], axis=-1)


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Scalar product over the last axis, in plain IEEE operations and a fixed order."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. `fov_y` is the full vertical angle in degrees; near and far are depths along the view."""

    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    fov_y: float = 60.0
    near: float = 0.1
    far: float = 1000.0

    def basis(self, aspect: float) -> CameraBasis:
        """Resolve the camera for an image whose width is `aspect` times its height.

        Raises
        ------
        ValueError
            If eye and target coincide, or `up` is parallel to the view.
        """
        eye, target = np.array(self.eye, np.float64), np.array(self.target, np.float64)
        if not np.any(target - eye):
            raise ValueError("camera eye and target are the same point: move one of them")
        forward = _unit(target - eye)
        side = cross(forward, _unit(np.array(self.up, np.float64)))
        if not dot(side, side) > 1e-24:      # sine of the angle between up and view below 1e-12
            raise ValueError("camera up is parallel to the view direction: choose another up vector")
        right = _unit(side)
        tan_y = tan_degrees(self.fov_y / 2)
        return CameraBasis(eye, right, cross(right, forward), forward, tan_y * aspect, tan_y, self.near, self.far)


@dataclass(frozen=True)
class ImageSize:
    """Pixels of the image, and how they are sampled.

    Attributes
    ----------
    width, height : pixels.
    samples : view samples per pixel.
    sampling : where the samples of a pixel lie: each on the surface that it sees, or all in the plane of the surface that
        the pixel's centre sees, where the derivatives of its depth say.
    layers : transparent surfaces behind each other that are shaded, the nearest first.
    """

    width: int = 1024
    height: int = 1024
    samples: int = 1
    sampling: Literal["surface", "derivative"] = "surface"
    layers: int = 1

    @property
    def columns(self) -> int:
        """Columns of the sample grid: the samples of a pixel are 1, 2 or 4 side by side."""
        return self.width << self.samples.bit_length() // 2

    @property
    def rows(self) -> int:
        """Rows of the sample grid."""
        return self.height << (self.samples.bit_length() - 1) // 2


class ViewSamples(NamedTuple):
    """The visible surface points of a frame, row by row from the top left of the sample grid.

    The sample grid is the image with each pixel split into ``columns / image.width`` by ``rows / image.height``
    cells, one sample each (see `shadowbench.view_samples`). Background samples have triangle -1.

    Attributes
    ----------
    rows, columns : size of the sample grid; n_samples = rows * columns.
    position : float64 (n_samples, 3), world; zero on background.
    normal : float64 (n_samples, 3), world, unit length, towards the camera; zero on background.
    depth : float64 (n_samples,), along the camera's forward axis; inf on background.
    triangle : int32 (n_samples,), the visible triangle.
    candidate : bool (n_samples,), True for lit candidates: the surface faces the light, so a test is needed.
    plane_x, plane_y : float64 (n_samples,), where the sample's ray crosses the image plane at depth 1, so the
        ray is ``forward + plane_x right + plane_y up``.
    """

    rows: int
    columns: int
    position: FloatArray
    normal: FloatArray
    depth: FloatArray
    triangle: NDArray[np.int32]
    candidate: NDArray[np.bool_]
    plane_x: FloatArray
    plane_y: FloatArray


@dataclass(frozen=True, eq=False)
class Frame:
    """All that a shadow algorithm may look at for one frame. Arrays are read-only.

    Attributes
    ----------
    mesh, light, samples : the scene at this frame.
    camera : the camera resolved for the image.
    image : pixels and samples per pixel.
    bias : world distance by which a sample must lie behind a triangle's plane to be shadowed by it.
    pixel_footprint : side of a pixel at depth 1, world units; multiply by a sample's depth.
    prepared : what the algorithm's own `prepare` returned for `mesh`.
    deeper : the frame's further layers of surfaces behind transparent ones, with samples of their own.
    supersampled : where `samples` are spread by derivatives, the samples on the surfaces that they would see; else None.
    """

    mesh: Mesh
    light: Light
    camera: CameraBasis
    image: ImageSize
    samples: ViewSamples
    bias: float
    prepared: Any = None
    deeper: tuple[Frame, ...] = ()
    supersampled: ViewSamples | None = None

    @property
    def layers(self) -> tuple[Frame, ...]:
        """This frame and its deeper layers."""
        return (self, *self.deeper)

    @property
    def pixel_footprint(self) -> float:
        """Side of a pixel at depth 1, world units."""
        return 2.0 * self.camera.tan_y / self.image.height
