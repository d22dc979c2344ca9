"""What is at a point of a surface: barycentric coordinates, textures, colour, opacity, and the light that passes.

Plain NumPy over arrays of points: for the reference, for pictures, and for what the camera sees. Shadow algorithms have
lookups of their own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import FloatArray, Material, Mesh, Texture, Wrap, cross, dot

Indices = NDArray[np.integer]


def barycentrics(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Barycentric coordinates of points in the planes of triangles, float64 (n, 3).

    Parameters
    ----------
    corners : float64 (n, 3, 3); points : float64 (n, 3), each in the plane of its triangle, up to rounding.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = cross(b - a, c - a)
    parts = np.stack([dot(cross(c - b, points - b), normal), dot(cross(a - c, points - c), normal),
                      dot(cross(b - a, points - a), normal)], axis=-1)
    return parts / dot(normal, normal)[:, None]


def texture_coordinates(mesh: Mesh, triangles: Indices, points: FloatArray) -> FloatArray:
    """Texture coordinates at points of triangles, float64 (n, 2). The mesh must have some."""
    assert mesh.uv is not None
    weights = barycentrics(mesh.corners[triangles], points)
    uv = mesh.uv[triangles]
    return (weights[:, 0, None] * uv[:, 0] + weights[:, 1, None] * uv[:, 1]) + weights[:, 2, None] * uv[:, 2]


def _texel(index: NDArray[np.int64], size: int, wrap: Wrap) -> NDArray[np.int64]:
    """Texel that stands at a place beyond the edge."""
    if wrap == "clamp":
        return np.clip(index, 0, size - 1)
    if wrap == "repeat":
        return index % size
    index = index % (2 * size)
    return np.where(index < size, index, 2 * size - 1 - index)


def look_up(texture: Texture, uv: FloatArray) -> FloatArray:
    """Look a texture up with bilinear filtering, float64 (n, 4). Texel centres are at half-integers."""
    rows, columns = texture.pixels.shape[:2]
    x, y = uv[:, 0] * columns - 0.5, (1.0 - uv[:, 1]) * rows - 0.5
    column, row = np.floor(x), np.floor(y)
    fx, fy = (x - column)[:, None], (y - row)[:, None]
    left, right = (_texel(column.astype(np.int64) + step, columns, texture.wrap[0]) for step in (0, 1))
    upper, lower = (_texel(row.astype(np.int64) + step, rows, texture.wrap[1]) for step in (0, 1))
    pixels = texture.pixels
    above = pixels[upper, left] * (1.0 - fx) + pixels[upper, right] * fx
    below = pixels[lower, left] * (1.0 - fx) + pixels[lower, right] * fx
    return np.asarray(above * (1.0 - fy) + below * fy, np.float64)


def covering(material: Material, uv: FloatArray) -> FloatArray:
    """Share that a surface covers, with `alpha` and the cutoff applied where there is one, float64 (n,)."""
    if material.alpha_texture is None:
        return np.ones(len(uv))
    covered = look_up(material.alpha_texture, uv)[:, 3]
    if material.alpha_cutoff is not None:
        return (covered * material.alpha >= material.alpha_cutoff).astype(np.float64)
    return covered


def transmittance(material: Material, uv: FloatArray, colored: bool) -> FloatArray:
    """Share of the light that passes, float64 (n, 1), or (n, 3) for red, green and blue.

    Parameters
    ----------
    uv : float64 (n, 2), texture coordinates; ignored if the material does not vary.
    """
    whole = np.array(material.transmittance(colored))
    if not material.varies(colored):
        return np.broadcast_to(whole, (len(uv), len(whole)))
    if material.alpha_cutoff is not None:
        return np.repeat(1.0 - covering(material, uv)[:, None], len(whole), axis=1)
    passing = np.broadcast_to(whole, (len(uv), len(whole)))
    if colored and material.color_texture is not None:
        passing = passing * look_up(material.color_texture, uv)[:, :3]
    covered = covering(material, uv)[:, None]
    return 1.0 - covered + covered * passing


def _by_material(mesh: Mesh, triangles: Indices) -> list[tuple[Material, NDArray[np.int64]]]:
    """Materials in use, and which of the points are theirs; points off all triangles (-1) belong to none."""
    shown = np.where(triangles >= 0, mesh.material[triangles], -1)
    return [(mesh.materials[index], np.flatnonzero(shown == index)) for index in np.unique(shown[shown >= 0])]


def surface_opacity(mesh: Mesh, triangles: Indices, points: FloatArray) -> FloatArray:
    """Opacity at points of triangles, float64 (n,); 1 for triangle -1."""
    opacity = np.ones(len(triangles))
    for material, mine in _by_material(mesh, triangles):
        if not material.is_opaque:
            uv = np.zeros((len(mine), 2))
            if material.varies(False):
                uv = texture_coordinates(mesh, triangles[mine], points[mine])
            opacity[mine] = 1.0 - transmittance(material, uv, False)[:, 0]
    return opacity


def surface_transmittance(mesh: Mesh, triangles: Indices, points: FloatArray) -> FloatArray:
    """Share of red, green and blue that passes at points of triangles, float64 (n, 3); 0 for triangle -1."""
    passing = np.zeros((len(triangles), 3))
    for material, mine in _by_material(mesh, triangles):
        if not material.is_opaque:
            uv = np.zeros((len(mine), 2))
            if material.varies(True):
                uv = texture_coordinates(mesh, triangles[mine], points[mine])
            passing[mine] = transmittance(material, uv, True)
    return passing


def base_color(mesh: Mesh, triangles: Indices, points: FloatArray) -> FloatArray:
    """Base colour at points of triangles, linear RGB, float64 (n, 3); white for triangle -1."""
    color = np.array([m.color for m in mesh.materials], np.float64)[mesh.material[triangles]]
    color[triangles < 0] = 1.0
    if all(m.color_texture is None for m in mesh.materials):
        return color
    for material, mine in _by_material(mesh, triangles):
        if material.color_texture is not None:
            uv = texture_coordinates(mesh, triangles[mine], points[mine])
            color[mine] *= look_up(material.color_texture, uv)[:, :3]
    return color
