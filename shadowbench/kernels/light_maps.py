"""Views of a light: the maps that map-based methods render from it, and where a sample falls in them.

A point light has up to seven faces. Face 0 is a spot map: a square that fits the lit candidates within
`MAX_SPOT_ANGLE` of their mean direction. Faces 1 to 6 are the sides of a cube along the world axes. A directional
light has face 0 alone, a parallel projection that fits all candidates. Only faces in which some candidate falls are
rendered. Every candidate falls in exactly one face, so none is left without an answer: candidates outside the spot
map go to the cube.

Maps have a border of texels around the square that the samples fall in, so a filter around any sample reads texels
that were rendered with the same projection.

The near plane of a point light lies at `NEAR_FRACTION` of the distance of the nearest candidate. Depth is measured
along the axis in float64 and does not depend on the near plane, so this costs no precision, and it is so small that
a caster is cut only where its depth, itself a rounded number, is zero. Triangles that reach the light or pass it
are cut there and drawn in every face that they reach. A parallel view has no near plane.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.projection import N_WORKERS, FloatArray, View, chunk, screen_axis

N_FACES = 7
MAX_SPOT_ANGLE = 60.0
"""Degrees between the axis of a spot map and its farthest sample: beyond it, texels would get very uneven."""

_COS_SPOT = 0.5                  # cosine of MAX_SPOT_ANGLE
NEAR_FRACTION = 2.0**-200
_SMALLEST_HALF = 2.0**-24        # keeps texels of a map around a single sample above rounding error
_MARGIN = 1.0 + 2.0**-20         # room around fitted samples in a parallel view, far above rounding error


class LightMaps(NamedTuple):
    """The faces of a light; see the module's description.

    Attributes
    ----------
    eye : float64 (3,), world: the light, or the centre of a directional light's view.
    axes : float64 (7, 3, 3), per face: right, up and forward.
    half : float64 (7,), half the side of the square that samples fall in: at depth 1, or in world units.
    layer : int64 (7,), where each face lies in the stack of maps; -1 for faces that are not rendered.
    fitted : True if face 0 exists.
    perspective : False for a directional light.
    resolution, border : texels along the side of that square, and around it.
    near : depth of the near plane.
    """

    eye: FloatArray
    axes: FloatArray
    half: FloatArray
    layer: NDArray[np.int64]
    fitted: bool
    perspective: bool
    resolution: int
    border: int
    near: float

    @property
    def n_layers(self) -> int:
        """Number of maps to render."""
        return int(self.layer.max()) + 1

    @property
    def side(self) -> int:
        """Texels along the side of a map, border included."""
        return self.resolution + 2 * self.border


def fit_light_maps(light: FloatArray, position: FloatArray, candidate: NDArray[np.bool_], projection: str,
                   resolution: int, border: int) -> LightMaps:
    """Choose the maps of a light for the lit candidates of a frame.

    Parameters
    ----------
    light : float64 (4,), homogeneous, world.
    position : float64 (n_samples, 3), world.
    candidate : bool (n_samples,), the samples to fit.
    projection : ``spot``, ``cube``, or ``auto``: spot if all candidates fit it. Ignored for a directional light.
    resolution : texels along the side of a map, without its border.
    border : texels around that, at least 1.
    """
    axes = np.concatenate([np.zeros((1, 3, 3)), _cube_axes()])
    half, layer = np.ones(N_FACES), np.full(N_FACES, -1, np.int64)
    if light[3] == 0.0:
        axes[0] = axes_along(-light[:3])
        eye, half[0] = _fit_parallel(axes, position, candidate)
        layer[0] = 0 if candidate.any() else -1
        return LightMaps(eye, axes, half, layer, True, False, resolution, border, -np.inf)
    eye = light[:3] / light[3]
    sums = np.zeros((N_WORKERS, 4))
    sums[:, 3] = np.inf
    _sum_directions(eye, position, candidate, sums)
    near = NEAR_FRACTION * (sums[:, 3].min() if np.isfinite(sums[:, 3].min()) else 1.0)
    axes[0] = axes_along(np.cumsum(sums[:, :3], axis=0)[-1])
    # Fit the spot map to the candidates within its cone, and see whether all of them are
    extent = np.zeros((N_WORKERS, 2))
    _measure_cone(eye, axes, position, candidate, extent)
    half[0] = max(extent[:, 0].max(), _SMALLEST_HALF)
    fitted = projection == "spot" or (projection == "auto" and not extent[:, 1].any())
    maps = LightMaps(eye, axes, half, layer, fitted, True, resolution, border, near)
    used = np.zeros((N_WORKERS, N_FACES), np.int64)
    _count_faces(maps, position, candidate, used)
    faces = np.flatnonzero(used.any(axis=0))
    layer[faces] = np.arange(len(faces))
    return maps


def axes_along(direction: FloatArray) -> FloatArray:
    """Right, up and forward, float64 (3, 3), with forward along `direction` (along -z if that is zero)."""
    x, y, z = (float(v) for v in direction)
    length = np.sqrt(x * x + y * y + z * z)
    forward = (x / length, y / length, z / length) if length > 0.0 else (0.0, 0.0, -1.0)
    x, y, z = forward
    # Cross forward with the world axis that it is farthest from
    smallest = int(np.argmin(np.abs(forward)))
    right = ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))[smallest]
    scale = np.sqrt(right[0] * right[0] + right[1] * right[1] + right[2] * right[2])
    a, b, c = (v / scale for v in right)
    return np.array([(a, b, c), (b * z - c * y, c * x - a * z, a * y - b * x), forward])


def map_view(maps: LightMaps, face: int) -> View:
    """Make the view of one face, with a sample at each texel's centre."""
    right, up, forward = (np.ascontiguousarray(v) for v in maps.axes[face])
    half = maps.half[face] * maps.side / maps.resolution
    return View(maps.eye, right, up, forward, float(maps.near), np.inf, maps.perspective,
                *screen_axis(maps.side, (0.5,), half), *screen_axis(maps.side, (0.5,), -half))


def _cube_axes() -> FloatArray:
    """Axes of the faces +x, -x, +y, -y, +z and -z."""
    return np.stack([axes_along(sign * np.eye(3)[k]) for k in range(3) for sign in (1.0, -1.0)])


def _fit_parallel(axes: FloatArray, position: FloatArray, candidate: NDArray[np.bool_]) -> tuple[FloatArray, float]:
    """Centre and half side of the square that holds all candidates, seen along a direction."""
    bounds = np.full((N_WORKERS, 5), -np.inf)
    _measure_extent(axes, position, candidate, bounds)
    u_max, u_min, v_max, v_min, largest = bounds.max(axis=0) * (1.0, -1.0, 1.0, -1.0, 1.0)
    if not np.isfinite(largest):
        return np.zeros(3), 1.0
    u, v = 0.5 * (u_min + u_max), 0.5 * (v_min + v_max)
    half = max(0.5 * (u_max - u_min), 0.5 * (v_max - v_min), _SMALLEST_HALF * max(largest, _SMALLEST_HALF))
    return u * axes[0, 0] + v * axes[0, 1], half * _MARGIN


@kernel
def along(axes, face, axis, x, y, z):
    """Component of a vector along one axis of a face."""
    return x * axes[face, axis, 0] + y * axes[face, axis, 1] + z * axes[face, axis, 2]


@kernel
def locate(axes, half, fitted, perspective, x, y, z):
    """Find the face that a point falls in, and where.

    Parameters
    ----------
    axes, half, fitted, perspective : of the `LightMaps`.
    x, y, z : the point, relative to the eye.

    Returns
    -------
    face, u, v, depth : u and v on the map plane, within ``half[face]`` of its centre.
    """
    if fitted:
        u, v, depth = along(axes, 0, 0, x, y, z), along(axes, 0, 1, x, y, z), along(axes, 0, 2, x, y, z)
        if not perspective:
            return 0, u, v, depth
        if depth > 0.0 and abs(u / depth) <= half[0] and abs(v / depth) <= half[0]:
            return 0, u / depth, v / depth, depth
    # The longest component names the face of the cube
    if abs(x) >= abs(y) and abs(x) >= abs(z):
        face = 1 if x > 0.0 else 2
    elif abs(y) >= abs(z):
        face = 3 if y > 0.0 else 4
    else:
        face = 5 if z > 0.0 else 6
    depth = along(axes, face, 2, x, y, z)
    if depth > 0.0:
        return face, along(axes, face, 0, x, y, z) / depth, along(axes, face, 1, x, y, z) / depth, depth
    return face, 0.0, 0.0, 0.0


@kernel
def texel(u, v, half, resolution, border):
    """Row and column of the texel that a point of the map plane falls in; `border` or more from the map's edge."""
    middle = 0.5 * resolution + border
    return int(np.floor(middle - v / half * (0.5 * resolution))), int(np.floor(middle + u / half * (0.5 * resolution)))


@kernel
def cell(u, v, half, resolution, border):
    """Find the four texel centres around a point of the map plane.

    Returns
    -------
    row, column : of the upper left one.
    y, x : the point from there, 0 to 1 downwards and to the right. From 0.5 on, `texel` is the next row or column.
    """
    middle = 0.5 * resolution + border
    y, x = middle - v / half * (0.5 * resolution) - 0.5, middle + u / half * (0.5 * resolution) - 0.5
    row, column = int(np.floor(y)), int(np.floor(x))
    return row, column, y - row, x - column


@kernel
def _sum_chunk(worker, eye, position, candidate, sums):
    """Add up the unit directions of one worker's candidates, in order, and find the nearest (largest component)."""
    first, end = chunk(worker, len(candidate))
    for i in range(first, end):
        if candidate[i]:
            x, y, z = position[i, 0] - eye[0], position[i, 1] - eye[1], position[i, 2] - eye[2]
            length = np.sqrt(x * x + y * y + z * z)
            if length > 0.0:
                sums[worker, 0] += x / length
                sums[worker, 1] += y / length
                sums[worker, 2] += z / length
                sums[worker, 3] = min(sums[worker, 3], max(abs(x), abs(y), abs(z)))


@kernel
def _cone_chunk(worker, eye, axes, position, candidate, extent):
    """Largest offset on the plane of the spot map among candidates within its cone, and the number beyond it."""
    first, end = chunk(worker, len(candidate))
    for i in range(first, end):
        if candidate[i]:
            x, y, z = position[i, 0] - eye[0], position[i, 1] - eye[1], position[i, 2] - eye[2]
            depth = along(axes, 0, 2, x, y, z)
            if depth > 0.0 and depth >= _COS_SPOT * np.sqrt(x * x + y * y + z * z):
                u, v = along(axes, 0, 0, x, y, z) / depth, along(axes, 0, 1, x, y, z) / depth
                extent[worker, 0] = max(extent[worker, 0], abs(u), abs(v))
            else:
                extent[worker, 1] += 1.0


@kernel
def _face_chunk(worker, maps, position, candidate, used):
    """Count one worker's candidates per face."""
    first, end = chunk(worker, len(candidate))
    eye, axes, half, fitted, perspective = maps.eye, maps.axes, maps.half, maps.fitted, maps.perspective
    for i in range(first, end):
        if candidate[i]:
            face, _, _, _ = locate(axes, half, fitted, perspective, position[i, 0] - eye[0], position[i, 1] - eye[1],
                                   position[i, 2] - eye[2])
            used[worker, face] += 1


@kernel
def _extent_chunk(worker, axes, position, candidate, bounds):
    """Largest u, -u, v, -v on the map plane and largest coordinate among one worker's candidates."""
    first, end = chunk(worker, len(candidate))
    for i in range(first, end):
        if candidate[i]:
            x, y, z = position[i, 0], position[i, 1], position[i, 2]
            u, v = along(axes, 0, 0, x, y, z), along(axes, 0, 1, x, y, z)
            values = (u, -u, v, -v, max(abs(x), abs(y), abs(z)))
            for k in range(5):
                bounds[worker, k] = max(bounds[worker, k], values[k])


@parallel_kernel
def _sum_directions(eye, position, candidate, sums):
    for worker in prange(N_WORKERS):
        _sum_chunk(worker, eye, position, candidate, sums)


@parallel_kernel
def _measure_cone(eye, axes, position, candidate, extent):
    for worker in prange(N_WORKERS):
        _cone_chunk(worker, eye, axes, position, candidate, extent)


@parallel_kernel
def _count_faces(maps, position, candidate, used):
    for worker in prange(N_WORKERS):
        _face_chunk(worker, maps, position, candidate, used)


@parallel_kernel
def _measure_extent(axes, position, candidate, bounds):
    for worker in prange(N_WORKERS):
        _extent_chunk(worker, axes, position, candidate, bounds)
