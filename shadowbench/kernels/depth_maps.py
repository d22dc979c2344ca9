"""Depth maps of a light and the comparison of view samples with the four depths around them.

Depths are sampled at texel centres. Four neighbouring centres are the corners of a *cell*: the texel of a grid that is
shifted by half a texel. Sen et al. (2003, sec. 2) keep one silhouette point per cell, and Chan and Durand (2004, sec. 3)
take the cells whose corners disagree for the cells that a shadow's edge runs through.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.light_maps import LightMaps, along, cell, locate, map_view
from shadowbench.kernels.projection import N_WORKERS, FloatArray, chunk
from shadowbench.kernels.rasterizer import Target, empty_counts, rasterize

TOP_LEFT, TOP_RIGHT, BOTTOM_LEFT, BOTTOM_RIGHT = 1, 2, 4, 8
"""Bits of a comparison, one per corner of a cell, row by row: set where something nearer to the light hides the sample."""

ALL_LIT, ALL_SHADOWED = 0, TOP_LEFT + TOP_RIGHT + BOTTOM_LEFT + BOTTOM_RIGHT

TEXEL_REACH = 0.5
"""Texels from a sample to the nearest texel centre, at most, in each direction."""

CELL_BORDER = 2
"""Texels that maps need around the samples, so that each sample's cell and the four cells beside it have corners."""


class Receivers(NamedTuple):
    """The view samples that are compared, and how.

    Attributes
    ----------
    position, normal : float64 (n_samples, 3), world.
    candidate : bool (n_samples,).
    bias : depth bias, world units.
    slope_bias : a sample's own plane can't shadow it within so many times the distance to the nearest texel centre, at
        most, or to the corner that it is compared with.
    """

    position: FloatArray
    normal: FloatArray
    candidate: NDArray[np.bool_]
    bias: float
    slope_bias: float


class DepthMaps(NamedTuple):
    """Rendered depth maps.

    Attributes
    ----------
    depth : float64 (n_layers, side, side), nearest depth per texel centre; inf where there is nothing.
    n_fragments, n_written : texel centres covered, and texels that took a nearer depth; 0 unless counting.
    n_bytes : memory while rendering.
    """

    depth: FloatArray
    n_fragments: int
    n_written: int
    n_bytes: int


def render_depth(maps: LightMaps, vertices: FloatArray, triangles: NDArray[np.int32],
                 casting: NDArray[np.bool_] | None = None, counting: bool = False) -> DepthMaps:
    """Rasterise the scene into every map of a light.

    Parameters
    ----------
    maps : the views.
    vertices : float64 (n_vertices, 3), world.
    triangles : int32 (n_triangles, 3).
    casting : bool (n_triangles,), the triangles to draw; None for all.
    counting : True to count.
    """
    if casting is not None:
        triangles = np.ascontiguousarray(triangles[casting])
    depth = np.full((maps.n_layers, maps.side, maps.side), np.inf)
    triangle = np.full((maps.side, maps.side), -1, np.int32)      # needed by the rasteriser alone
    n_fragments = n_written = 0
    for face in np.flatnonzero(maps.layer >= 0):
        view = map_view(maps, int(face))
        counts = empty_counts(view) if counting else None
        rasterize(view, vertices, triangles, Target(depth[maps.layer[face]], triangle), counts)
        if counts is not None:
            n_fragments += int(counts.fragments.sum(dtype=np.int64))
            n_written += int(counts.written.sum(dtype=np.int64))
    return DepthMaps(depth, n_fragments, n_written, depth.nbytes + triangle.nbytes)


@kernel
def nearest_own_depth(axes, face, perspective, u, v, depth, n, step_u, step_v):
    """Smallest depth that a sample's own plane has on rays up to `step_u` and `step_v` away on the map plane.

    The plane through the sample with normal n has the depth ``depth (n . ray) / (n . other ray)`` on another ray of
    a perspective map.
    """
    along_right, along_up = along(axes, face, 0, n[0], n[1], n[2]), along(axes, face, 1, n[0], n[1], n[2])
    facing = along(axes, face, 2, n[0], n[1], n[2])
    if perspective:
        facing += u * along_right + v * along_up
    change = (step_u * abs(along_right) + step_v * abs(along_up)) / abs(facing)
    return depth / (1.0 + change) if perspective else depth - change


@kernel
def _compare_chunk(worker, maps, map_depth, receivers, nearer):
    """Compare one worker's share of the candidates with the corners of their cells."""
    position, normal, candidate = receivers.position, receivers.normal, receivers.candidate
    eye, axes, half, layer, fitted, perspective = (maps.eye, maps.axes, maps.half, maps.layer, maps.fitted,
                                                   maps.perspective)
    resolution, border, bias = maps.resolution, maps.border, receivers.bias
    first, end = chunk(worker, len(candidate))
    for i in range(first, end):
        if candidate[i]:
            face, u, v, depth = locate(axes, half, fitted, perspective, position[i, 0] - eye[0],
                                       position[i, 1] - eye[1], position[i, 2] - eye[2])
            n = (normal[i, 0], normal[i, 1], normal[i, 2])
            row, column, y, x = cell(u, v, half[face], resolution, border)
            # A far corner sees more of the sample's own plane than the nearest one
            reach = receivers.slope_bias * 2.0 * half[face] / resolution
            bits = 0
            for corner in range(4):
                below, right = corner >> 1, corner & 1
                limit = nearest_own_depth(axes, face, perspective, u, v, depth, n,
                                          reach * max(TEXEL_REACH, abs(right - x)),
                                          reach * max(TEXEL_REACH, abs(below - y)))
                if map_depth[layer[face], row + below, column + right] < limit - bias:
                    bits += 1 << corner
            nearer[i] = bits


@parallel_kernel
def _compare_all(maps, map_depth, receivers, nearer):
    for worker in prange(N_WORKERS):
        _compare_chunk(worker, maps, map_depth, receivers, nearer)


def compare_corners(maps: LightMaps, map_depth: FloatArray, receivers: Receivers) -> NDArray[np.uint8]:
    """Compare every lit candidate with the four depths around it.

    Returns
    -------
    uint8 (n_samples,) : `TOP_LEFT` and so on where the corner is nearer to the light than the sample's own plane is
        within reach; 0 for samples that are no candidates.
    """
    nearer = np.zeros(len(receivers.candidate), np.uint8)
    _compare_all(maps, map_depth, receivers, nearer)
    return nearer
