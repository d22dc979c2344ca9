"""Shadow boundaries from a silhouette map: which corner of its cell a sample takes its answer from.

Lines from a cell's silhouette point to the points of the four cells beside it part the cell into four skewed quadrants,
one per corner (Sen et al. 2003, Fig. 5). With every point at its default, the centre, that is the nearest corner, and the
silhouette map is a shadow map.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.depth_maps import ALL_LIT, ALL_SHADOWED, BOTTOM_LEFT, BOTTOM_RIGHT, TOP_LEFT, TOP_RIGHT
from shadowbench.kernels.light_maps import LightMaps, cell, locate
from shadowbench.kernels.projection import N_WORKERS, FloatArray, chunk


class Places(NamedTuple):
    """Where samples fall in the warped grid, for pictures.

    Attributes
    ----------
    texel : int64 (n_samples, 2), row and column of the depth that each sample takes its answer from; -1 for samples that
        are no candidates.
    distance : float64 (n_samples,), cells between the sample and the silhouette point of its cell; inf where that is the
        default point.
    """

    texel: NDArray[np.int64]
    distance: FloatArray


@kernel
def _turn(a_x, a_y, b_x, b_y):
    """Cross product: positive if b lies clockwise of a, on a map whose rows run downwards."""
    return a_x * b_y - a_y * b_x


@kernel
def quadrant(x, y, own, left, right, above, below):
    """Find the quadrant of a cell that a place lies in, by the eight pie-shaped regions of Sen et al. (2003), Fig. 5.

    Parameters
    ----------
    x, y : the place, 0 to 1 to the right and downwards from the cell's upper left corner.
    own, left, right, above, below : silhouette points of the cell and of the cells beside it, each from the centre of
        its own cell.

    Returns
    -------
    `TOP_LEFT`, `TOP_RIGHT`, `BOTTOM_LEFT` or `BOTTOM_RIGHT`. A place on a line belongs to the quadrant to its right
    and below. Pies without inside, where points coincide, hold nothing.
    """
    px, py = own[0] + 0.5, own[1] + 0.5
    x, y = x - px, y - py
    to_left = _turn(left[0] - 0.5 - px, left[1] + 0.5 - py, x, y)
    to_above = _turn(above[0] + 0.5 - px, above[1] - 0.5 - py, x, y)
    to_right = _turn(right[0] + 1.5 - px, right[1] + 0.5 - py, x, y)
    to_below = _turn(below[0] + 0.5 - px, below[1] + 1.5 - py, x, y)
    # Two pies per corner: from the line before it to the corner, and from there to the line after it
    corner = _turn(-px, -py, x, y)
    if (to_left > 0.0 and corner <= 0.0) or (corner >= 0.0 and to_above < 0.0):
        return TOP_LEFT
    corner = _turn(1.0 - px, -py, x, y)
    if (to_above >= 0.0 and corner < 0.0) or (corner >= 0.0 and to_right < 0.0):
        return TOP_RIGHT
    corner = _turn(-px, 1.0 - py, x, y)
    if (to_below > 0.0 and corner <= 0.0) or (corner > 0.0 and to_left <= 0.0):
        return BOTTOM_LEFT
    return BOTTOM_RIGHT


@kernel
def _quadrant_at(points, layer, row, column, y, x):
    """Find the quadrant of a place on a silhouette map."""
    return quadrant(x, y,
                    (float(points[layer, row, column, 0]), float(points[layer, row, column, 1])),
                    (float(points[layer, row, column - 1, 0]), float(points[layer, row, column - 1, 1])),
                    (float(points[layer, row, column + 1, 0]), float(points[layer, row, column + 1, 1])),
                    (float(points[layer, row - 1, column, 0]), float(points[layer, row - 1, column, 1])),
                    (float(points[layer, row + 1, column, 0]), float(points[layer, row + 1, column, 1])))


@kernel
def _shade_chunk(worker, maps, points, position, nearer, shadow):
    """Resolve one worker's share of the candidates."""
    eye, axes, half, layer, fitted, perspective = (maps.eye, maps.axes, maps.half, maps.layer, maps.fitted,
                                                   maps.perspective)
    first, end = chunk(worker, len(nearer))
    for i in range(first, end):
        if nearer[i] == ALL_SHADOWED:
            shadow[i] = 1.0
        elif nearer[i] != ALL_LIT:
            face, u, v, _ = locate(axes, half, fitted, perspective, position[i, 0] - eye[0], position[i, 1] - eye[1],
                                   position[i, 2] - eye[2])
            row, column, y, x = cell(u, v, half[face], maps.resolution, maps.border)
            shadow[i] = 1.0 if nearer[i] & _quadrant_at(points, layer[face], row, column, y, x) else 0.0


@parallel_kernel
def _shade_all(maps, points, position, nearer, shadow):
    for worker in prange(N_WORKERS):
        _shade_chunk(worker, maps, points, position, nearer, shadow)


def shade(maps: LightMaps, points: NDArray[np.float32], position: FloatArray,
          nearer: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Resolve samples: unanimous corners decide, else the corner of the sample's quadrant.

    Parameters
    ----------
    maps : the views, with a border of `depth_maps.CELL_BORDER` texels.
    points : float32 (n_layers, side - 1, side - 1, 2), the silhouette maps.
    position : float64 (n_samples, 3), world.
    nearer : uint8 (n_samples,), from `depth_maps.compare_corners`.

    Returns
    -------
    float32 (n_samples,), 1 in shadow.
    """
    shadow = np.zeros(len(nearer), np.float32)
    _shade_all(maps, points, position, nearer, shadow)
    return shadow


@kernel
def _place_chunk(worker, maps, points, position, candidate, places):
    """Place one worker's share of the candidates."""
    eye, axes, half, layer, fitted, perspective = (maps.eye, maps.axes, maps.half, maps.layer, maps.fitted,
                                                   maps.perspective)
    first, end = chunk(worker, len(candidate))
    for i in range(first, end):
        if candidate[i]:
            face, u, v, _ = locate(axes, half, fitted, perspective, position[i, 0] - eye[0], position[i, 1] - eye[1],
                                   position[i, 2] - eye[2])
            row, column, y, x = cell(u, v, half[face], maps.resolution, maps.border)
            corner = _quadrant_at(points, layer[face], row, column, y, x)
            places.texel[i, 0] = row + (corner >= BOTTOM_LEFT)
            places.texel[i, 1] = column + (corner in (TOP_RIGHT, BOTTOM_RIGHT))
            px, py = points[layer[face], row, column, 0], points[layer[face], row, column, 1]
            if px != 0.0 or py != 0.0:
                places.distance[i] = np.sqrt((x - 0.5 - px) * (x - 0.5 - px) + (y - 0.5 - py) * (y - 0.5 - py))


@parallel_kernel
def _place_all(maps, points, position, candidate, places):
    for worker in prange(N_WORKERS):
        _place_chunk(worker, maps, points, position, candidate, places)


def find_places(maps: LightMaps, points: NDArray[np.float32], position: FloatArray,
                candidate: NDArray[np.bool_]) -> Places:
    """Find every candidate's place in the warped grid; see `shade` for the parameters."""
    places = Places(np.full((len(candidate), 2), -1), np.full(len(candidate), np.inf))
    _place_all(maps, points, position, candidate, places)
    return places
