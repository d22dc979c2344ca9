"""Soups of triangles that let light through: constant, textured, masked and coloured, some of them opaque."""

from dataclasses import replace

import numpy as np

from shadowbench.geometry import Camera, Frame, ImageSize, Light, Material, Mesh, Texture
from shadowbench.view_samples import render_view_samples


def texture(seed: int, rows: int = 8, columns: int = 8, wrap=("repeat", "repeat")) -> Texture:
    """Random RGBA, some of it fully clear or covered."""
    pixels = np.random.default_rng(seed).random((rows, columns, 4)).astype(np.float32)
    pixels[..., 3] = np.clip(1.6 * pixels[..., 3] - 0.3, 0.0, 1.0)
    return Texture(f"texture {seed} {wrap}", pixels, wrap)


def materials(seed: int) -> tuple[Material, ...]:
    """One of each kind; the first is opaque."""
    leaf, glass = texture(seed), texture(seed + 1, 3, 5, ("clamp", "mirror"))
    return (Material("opaque", (0.5, 0.6, 0.7)),
            Material("half", (0.9, 0.2, 0.1), 0.5),
            Material("thin", (0.1, 0.8, 0.9), 0.1),
            Material("clear", (1.0, 1.0, 1.0), 0.0),
            Material("covering", (1.0, 1.0, 1.0), 1.0, leaf),
            Material("window", (0.9, 0.9, 0.5), 0.6, glass, None, glass),
            Material("dyed", (0.8, 0.9, 1.0), 0.3, None, None, leaf),
            Material("masked", (1.0, 1.0, 1.0), 0.9, leaf, 0.4, leaf))


def transparent_mesh(corners, of_material, surfaces, uv) -> Mesh:
    """Loose triangles with materials and texture coordinates."""
    mesh = Mesh.from_arrays(np.reshape(corners, (-1, 3)), np.arange(3 * len(corners)).reshape(-1, 3))
    return replace(mesh, material=np.asarray(of_material, np.int32), materials=surfaces, uv=np.asarray(uv, np.float64))


def frame_of(mesh: Mesh, light: Light, camera: Camera, image: ImageSize) -> Frame:
    """Render the view samples."""
    samples = render_view_samples(mesh, camera, light, image)
    return Frame(mesh, light, camera.basis(image.width / image.height), image, samples, 1e-5 * mesh.diagonal())


def transparent_soup(seed: int, n: int = 60, image: ImageSize | None = None) -> Frame:
    """A soup above a floor, lit from above or from afar."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(n, 1, 3)) * [2, 2, 0.8] + rng.normal(size=(n, 3, 3)) * rng.choice([0.3, 0.8, 2], (n, 1, 1))
    corners = np.concatenate([corners, [[[-9, -9, -3], [9, -9, -3], [9, 9, -3]], [[-9, -9, -3], [9, 9, -3], [-9, 9, -3]]]])
    surfaces = materials(seed)
    of_material = np.append(rng.integers(0, len(surfaces), n), [0, 0])
    uv = rng.uniform(-1.5, 2.5, (n + 2, 3, 2))
    mesh = transparent_mesh(corners, of_material, surfaces, uv)
    light = Light.directional(*rng.normal(size=2), -3) if rng.random() < 0.3 else Light.point(*rng.normal(size=2), 6)
    camera = Camera((*(rng.normal(size=2) * 4), 7.0), (*rng.normal(size=2), -3.0), (0.1, 1, 0.2), rng.uniform(40, 90), 0.05)
    return frame_of(mesh, light, camera, image or ImageSize(64, 48))


def crossings(corners, light, p, bias):
    """Triangles that the light crosses on its way to a point, and the barycentric coordinates (1 - u - v, u, v) there.

    By solving p + s (L - w p) = a + u (b - a) + v (c - a), in float64: fit for points that are far from any edge.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    towards = np.broadcast_to(light[3] * p - light[:3], a.shape)
    s, u, v = np.linalg.solve(np.stack([towards, b - a, c - a], axis=2), (p - a)[..., None])[..., 0].T
    normal = np.cross(b - a, c - a)
    distance = s * np.abs((normal * towards).sum(axis=1)) / np.sqrt((normal * normal).sum(axis=1))
    hit = np.flatnonzero((u >= 0) & (v >= 0) & (u + v <= 1) & (distance > bias))
    return hit, np.stack([1 - u - v, u, v], axis=1)[hit]
