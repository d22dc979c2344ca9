"""Scenes that every method must survive, by name, and random triangle soups."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import Camera, Frame, ImageSize, Light, Material, Mesh, Texture
from shadowbench.view_samples import render_view_samples

BIAS_OF_DIAGONAL = 1e-5
SMALL = ImageSize(48, 36)


@dataclass(frozen=True)
class Case:
    """A scene of one frame."""

    mesh: Mesh
    camera: Camera
    light: Light
    image: ImageSize = SMALL

    def scene(self) -> CaseScene:
        """What a method may ask a scene about."""
        return CaseScene(self)

    def frame(self) -> Frame:
        """Render the view samples."""
        samples = render_view_samples(self.mesh, self.camera, self.light, self.image)
        basis = self.camera.basis(self.image.width / self.image.height)
        bias = BIAS_OF_DIAGONAL * self.mesh.diagonal()
        return Frame(self.mesh, self.light, basis, self.image, samples, bias)


@dataclass(frozen=True)
class CaseScene:
    """A case with the interface of a scene, as far as `Algorithm.unsupported` may ask."""

    case: Case
    name: str = "case"
    n_frames: int = 1

    @property
    def image(self) -> ImageSize:
        """Pixels and samples per pixel."""
        return self.case.image

    @property
    def bias(self) -> float:
        """World distance, as in `Case.frame`."""
        return BIAS_OF_DIAGONAL * self.case.mesh.diagonal()

    def mesh(self, frame: int = 0) -> Mesh:
        """Geometry, the same at every frame."""
        return self.case.mesh

    def camera(self, frame: int = 0) -> Camera:
        """Camera, the same at every frame."""
        return self.case.camera

    def light(self, frame: int = 0) -> Light:
        """Light, the same at every frame."""
        return self.case.light


def box(low: tuple[float, ...], high: tuple[float, ...]) -> NDArray[np.float64]:
    """Closed box, corners (12, 3, 3), wound outwards."""
    x, y, z = zip(low, high, strict=True)
    v = np.array([[x[i & 1], y[i >> 1 & 1], z[i >> 2 & 1]] for i in range(8)], float)
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    return np.array([[v[q[i]] for i in t] for q in quads for t in ((0, 1, 2), (0, 2, 3))])


def ground(size: float = 10.0, y: float = 0.0) -> NDArray[np.float64]:
    """Two triangles facing up, corners (2, 3, 3)."""
    a, b, c, d = ([s * size, y, t * size] for s, t in ((-1, -1), (-1, 1), (1, 1), (1, -1)))
    return np.array([[a, b, c], [a, c, d]], float)


def mesh_of(*parts: Any) -> Mesh:
    """Make a mesh of corner arrays, one part number each, vertices not shared."""
    corners = np.concatenate([np.reshape(part, (-1, 3, 3)) for part in parts]) if parts else np.zeros((0, 3, 3))
    part = np.repeat(np.arange(len(parts)), [len(np.reshape(p, (-1, 3, 3))) for p in parts]).astype(np.int32)
    mesh = Mesh.from_arrays(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    return Mesh(mesh.vertices, mesh.triangles, part, mesh.material)


def _point(values: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z


def soup(seed: int, n_triangles: int = 60, kind: str = "random") -> Case:
    """Random triangles over a ground: ``random`` reals, an integer ``grid`` full of exact ties, or ``slivers``."""
    rng = np.random.default_rng(seed)
    if kind == "grid":
        corners = rng.integers(-3, 4, (n_triangles, 3, 3)).astype(float)
        light = Light((*rng.integers(-5, 6, 3).astype(float), float(rng.integers(0, 2))))
    else:
        corners = rng.uniform(-4, 4, (n_triangles, 1, 3)) + rng.normal(0, 1.2, (n_triangles, 3, 3))
        if kind == "slivers":
            corners[:, 2] = corners[:, 0] + (corners[:, 1] - corners[:, 0]) * rng.uniform(0, 1, (n_triangles, 1))
            corners[:, 2] += rng.normal(0, 1e-6, (n_triangles, 3))
        light = Light((*rng.uniform(-6, 6, 3), float(rng.integers(0, 2))))
    if not any(light.position[:3]):
        light = Light((0.0, 1.0, 0.0, light.position[3]))
    eye = rng.uniform(-7, 7, 3) + [0, 5, 0]
    camera = Camera(_point(eye), _point(rng.uniform(-1, 1, 3)), fov_y=70.0, near=0.05)
    return Case(mesh_of(ground(y=-4.5), corners), camera, light, ImageSize(40, 30))


CAMERA = Camera((7.0, 6.0, 9.0), (0.0, 0.5, 0.0))
LIGHT = Light.point(3.0, 8.0, 2.0)
BOX = box((-1, 0.5, -1), (1, 2.5, 1))
ONE = np.array([[[-2.0, 2, -1], [2, 2.5, -1.5], [0, 2, 2]]])


def _hard_cases() -> dict[str, Case]:
    """All fixed cases by name."""
    rng = np.random.default_rng(5)
    flipped, some = BOX.copy(), rng.permutation(12)[:5]
    flipped[some] = flipped[some, ::-1]
    zero_area = np.array([[[0.0, 1, 0]] * 3, [[0.0, 1, 0], [1, 2, 1], [2, 3, 2]], [[1.0, 1, 1], [1, 1, 1], [2, 1, 0]]])
    fan = np.array([[[0.0, 1, 0], [0, 3, 0], [2 * np.cos(a), 2, 2 * np.sin(a)]] for a in np.linspace(0.3, 6, 7)])
    scene = (ground(), BOX, ONE)
    cases = {
        "empty mesh": Case(mesh_of(), CAMERA, LIGHT),
        "one triangle": Case(mesh_of(ONE), CAMERA, Light.point(0, -5, 0)),
        "triangle over ground": Case(mesh_of(ground(), ONE), CAMERA, LIGHT),
        "zero area": Case(mesh_of(ground(), zero_area), CAMERA, LIGHT),
        "duplicates": Case(mesh_of(ground(), ONE, ONE, BOX, BOX, ground()), CAMERA, LIGHT),
        "light in a triangle's plane": Case(mesh_of(ground(), BOX), CAMERA, Light.point(1.0, 5.0, 0.25)),
        "light in two planes": Case(mesh_of(ground(), BOX), CAMERA, Light.point(1.0, 5.0, 1.0)),
        "light on a vertex": Case(mesh_of(ground(), BOX), CAMERA, Light.point(1.0, 2.5, 1.0)),
        "light on an edge": Case(mesh_of(ground(), BOX), CAMERA, Light.point(1.0, 2.5, 0.25)),
        "light on a triangle": Case(mesh_of(ground(), ONE), CAMERA, Light.point(*ONE[0].mean(axis=0))),
        "light inside a mesh": Case(mesh_of(ground(), BOX), CAMERA, Light.point(0.2, 1.5, 0.1)),
        "light in the ground's plane": Case(mesh_of(*scene), CAMERA, Light.point(4.0, 0.0, 1.0)),
        "light behind the camera": Case(mesh_of(*scene), CAMERA, Light.point(15.0, 12.0, 18.0)),
        "light at the eye's height": Case(mesh_of(*scene), CAMERA, Light.point(-7.0, 6.0, -9.0)),
        "light very near the camera": Case(mesh_of(*scene), CAMERA, Light.point(7.0, 6.0 + 1e-9, 9.0)),
        "light straight above": Case(mesh_of(*scene), CAMERA, Light.directional(0, -1, 0)),
        "light along an axis": Case(mesh_of(ground(), BOX), CAMERA, Light.directional(-1, 0, 0)),
        "sun": Case(mesh_of(*scene), CAMERA, Light.directional(-0.4, -1.0, 0.3)),
        "camera in a shadow volume": Case(mesh_of(*scene), Camera((-0.1, 0.2, 0.1), (4, 0.1, 4), near=0.01),
                                          Light.point(0.3, 8, 0.2)),
        "camera in many shadow volumes": Case(
            mesh_of(ground(), *[ONE + [0, 0.1 * i, 0] for i in range(20)]),
            Camera((0.1, 0.4, 0.2), (5, 0, 5), near=0.01), Light.point(0.3, 9, 0.2)),
        "camera inside a mesh": Case(mesh_of(ground(), BOX), Camera((0, 1.5, 0), (4, 1.2, 3), near=0.01),
                                     Light.point(0.3, 2.2, 0.2)),
        "triangles across the near plane": Case(
            mesh_of(ground(), box((-12, 3, -12), (12, 3.1, 12)), ONE), Camera((0, 1, 9), (0, 1.2, 0), near=0.5), LIGHT),
        "casters behind the eye": Case(mesh_of(ground(), BOX + [0, 3, 14]), Camera((0, 2, 9), (0, 0, 0)),
                                       Light.point(0, 9, 22)),
        "casters between eye and near plane": Case(
            mesh_of(ground(), ONE * [0.2, 0.2, 0.2] + [6.5, 5.3, 8.4]), Camera(CAMERA.eye, CAMERA.target, near=2.0),
            Light.point(9.0, 9.0, 12.0)),
        "open box": Case(mesh_of(ground(), BOX[:9]), CAMERA, LIGHT),
        "non-manifold fan": Case(mesh_of(ground(), fan), CAMERA, LIGHT),
        "inconsistent winding": Case(mesh_of(ground(), flipped), CAMERA, LIGHT),
        "boxes sharing faces": Case(mesh_of(ground(), BOX, BOX + [2, 0, 0], BOX + [0, 2, 0]), CAMERA, LIGHT),
        "axis-aligned grid": Case(
            mesh_of(ground(8), *[box((i, j + 1, k), (i + 1, j + 2, k + 1)) for i in (-2, 0) for j in (0, 2)
                                 for k in (-2, 0)]), Camera((0, 2, 8), (0, 2, 0)), Light.point(0, 8, 0)),
        "1x1 image": Case(mesh_of(*scene), CAMERA, LIGHT, ImageSize(1, 1)),
        "odd image": Case(mesh_of(*scene), CAMERA, LIGHT, ImageSize(67, 33)),
        "four samples per pixel": Case(mesh_of(*scene), CAMERA, LIGHT, ImageSize(31, 17, 4)),
    }
    for name, scale, shift in (("tiny", 1e-3, 0.0), ("huge", 1e5, 0.0), ("far from the origin", 1.0, 1e5),
                               ("tiny and far from the origin", 1e-3, 1e5)):
        def place(point: Any, scale: float = scale, shift: float = shift) -> tuple[float, float, float]:
            x, y, z = (float(v) * scale + shift for v in point)
            return x, y, z

        corners = np.concatenate(scene) * scale + shift
        camera = Camera(place(CAMERA.eye), place(CAMERA.target), near=0.1 * scale, far=1000 * scale)
        cases[name] = Case(mesh_of(corners), camera, Light.point(*place(LIGHT.position[:3])))
    return cases


HARD_CASES: dict[str, Case] = _hard_cases()

def _clear_case() -> Case:
    """A pane and a leaf with a hole over a ground and a box: constant alpha, a texture, and both over opaque casters."""
    texels = np.ones((4, 4, 4), np.float32)
    texels[1:3, 1:3, 3] = 0.0
    texels[0, :, 3] = 0.5
    materials = (Material(), Material("pane", (0.9, 0.3, 0.2), alpha=0.4),
                 Material("leaf", (0.2, 0.7, 0.3), alpha_texture=Texture("leaf", texels)))
    mesh = mesh_of(ground(), BOX, ONE + [0, 2, 0], ONE * [-1, 1, 1] + [1, 1.5, 1])
    uv = np.tile([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]], (mesh.n_triangles, 1, 1))
    material = np.array([0, 0, 1, 2], np.int32)[mesh.part]
    return Case(Mesh(mesh.vertices, mesh.triangles, mesh.part, material, materials, uv), CAMERA, LIGHT)


CLEAR_CASES: dict[str, Case] = {"casters that let light through": _clear_case()}
"""Cases with casters that are not opaque."""

LARGE_CASES: dict[str, Callable[[], Case]] = {
    "1921x1081 image": lambda: Case(mesh_of(ground(), BOX, ONE), CAMERA, LIGHT, ImageSize(1921, 1081)),
    "400,000 triangles": lambda: _many_triangles(400_000),
}
"""Cases that take seconds, made when they are needed."""


def _many_triangles(n: int) -> Case:
    """Small triangles all over a ground."""
    rng = np.random.default_rng(9)
    corners = rng.uniform((-9, 0.2, -9), (9, 2, 9), (n, 1, 3)) + rng.normal(0, 0.02, (n, 3, 3))
    return Case(mesh_of(ground(), corners), CAMERA, LIGHT)
