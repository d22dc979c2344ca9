"""Groups of shadow frusta, each within a bounding frustum, so that a traversal can walk the group in place of its members.

No paper has this; the bounds follow the frusta of Sintorn et al. 2011 and 2014. Triangles are sorted along a Morton curve in
light space, anew each frame. Those much larger than their neighbours stay alone and come first, largest first: they
shadow most, and what they shadow the groups can skip. The others are grouped with neighbours of about their size.

**Light space.** A point light sees the casters through the faces of a cube: on the face of axis W the coordinates of v
are ``(v - L) . U / w`` and ``(v - L) . V / w`` with ``w = (v - L) . W``. A directional light has one face, and nothing
is divided by w. Both coordinates stay the same along a ray of light, and w does not fall: so a rectangle that
encloses the triangles' vertices, from their smallest w on, encloses all their shadow frusta.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.vectors import corner, dot, item, minus

N_WORKERS = 64
"""Parts that triangles are cut into."""

ALONE_SIZE = 8.0
"""A triangle stays alone if it is larger than this many times the spacing that evenly spread triangles would have."""

GRID_BITS = 13
"""Bits of each coordinate on the Morton curve."""

STEEPEST = 0.2
"""A vertex must be at least so far along its face's axis, per distance along the others: seen flatter, it stays alone."""

_SIZE_BITS, _FACE_BITS, _INDEX_BITS = 5, 3, 28
_INDEX = (1 << _INDEX_BITS) - 1
_MIDDLE_SIZE = 1 << _SIZE_BITS - 1
_NO_FACE = 6


class Units(NamedTuple):
    """What a traversal takes one by one: single frusta, then groups.

    Attributes
    ----------
    order : int64 (n_frusta,), the triangles in the order of the frusta.
    first : int64 (n_units + 1,), the frusta of each unit.
    face : int8 (n_units,), face of each group.
    n_single : number of units that are one frustum, walked by itself; they come first.
    """

    order: np.ndarray
    first: np.ndarray
    face: np.ndarray
    n_single: int


class Faces(NamedTuple):
    """Coordinate axes of light space.

    Attributes
    ----------
    u, v, w : float64 (n_faces, 3), world, orthonormal.
    light : float64 (4,), homogeneous.
    """

    u: np.ndarray
    v: np.ndarray
    w: np.ndarray
    light: np.ndarray


class _Places(NamedTuple):
    """Where each triangle lies in light space: int8 face (_NO_FACE: nowhere), centre and size, float64."""

    face: np.ndarray
    u: np.ndarray
    v: np.ndarray
    size: np.ndarray


def light_faces(light):
    """Choose the axes of light space for a homogeneous light, float64 (4,)."""
    if light[3] == 0.0:
        w = -light[:3] / np.sqrt(light[0] * light[0] + light[1] * light[1] + light[2] * light[2])
        helper = np.zeros(3)
        helper[int(np.argmin(np.abs(w)))] = 1.0
        u = np.array(_cross(w, helper))
        u /= np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        return Faces(u[None], np.array(_cross(w, u))[None], w[None], light)
    axes = np.eye(3)
    w = np.concatenate([axes, -axes])
    return Faces(np.roll(w, 1, axis=1), np.roll(w, 2, axis=1), w, light)


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def light_coordinates(point, u, v, w, light):
    """Coordinates of a point on a face, and how far it is along the face's axis."""
    if light[3] == 0.0:
        return dot(point, u), dot(point, v), dot(point, w)
    ray = minus(point, (light[0], light[1], light[2]))
    along = dot(ray, w)
    return dot(ray, u) / along, dot(ray, v) / along, along


@kernel
def _face_of(ray):
    """Face of the cube that a direction points to."""
    x, y, z = abs(ray[0]), abs(ray[1]), abs(ray[2])
    axis = 0 if x >= y and x >= z else (1 if y >= z else 2)
    return axis if ray[axis] > 0.0 else axis + 3


@kernel
def _place_part(corners, triangles, faces, places, worker):
    """Find where a share of the triangles lies in light space."""
    light = faces.light[0], faces.light[1], faces.light[2], faces.light[3]
    axes_u, axes_v, axes_w = faces.u, faces.v, faces.w
    face_out, u_out, v_out, size_out = places.face, places.u, places.v, places.size
    n = len(triangles)
    for i in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        t, face = triangles[i], 0
        if light[3] != 0.0:
            face = _face_of(minus(corner(corners, t, 0), (light[0], light[1], light[2])))
        u, v, w = item(axes_u, face), item(axes_v, face), item(axes_w, face)
        u0, v0, along = light_coordinates(corner(corners, t, 0), u, v, w, light)
        u1, v1, seen = u0, v0, True
        for j in range(3):
            uj, vj, along = light_coordinates(corner(corners, t, j), u, v, w, light)
            u0, u1, v0, v1 = min(u0, uj), max(u1, uj), min(v0, vj), max(v1, vj)
            seen = seen and (light[3] == 0.0 or (along > 0.0 and max(abs(uj), abs(vj)) * STEEPEST < 1.0))
        face_out[i] = face if seen else _NO_FACE
        u_out[i], v_out[i], size_out[i] = 0.5 * (u0 + u1), 0.5 * (v0 + v1), max(u1 - u0, v1 - v0)


@parallel_kernel
def _place(corners, triangles, faces, places):
    for worker in prange(N_WORKERS):
        _place_part(corners, triangles, faces, places, worker)


@kernel
def _spread_bits(value):
    """Put a zero between the bits of a number of up to 16 bits."""
    value = (value | value << 8) & 0x00FF00FF
    value = (value | value << 4) & 0x0F0F0F0F
    value = (value | value << 2) & 0x33333333
    return (value | value << 1) & 0x55555555


@kernel
def _keys_part(places, low, cells_per_unit, spacing, keys, worker):
    """Write the sort keys of a share of the triangles: alone or not, size, face, place, number."""
    n, last_cell = len(keys), (1 << GRID_BITS) - 1
    face, u, v, sizes = places.face, places.u, places.v, places.size
    for i in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        # Size class: doublings of the spacing
        size, limit = _MIDDLE_SIZE, spacing
        alone = face[i] == _NO_FACE or not sizes[i] <= ALONE_SIZE * spacing
        while size < (1 << _SIZE_BITS) - 1 and sizes[i] > limit:
            size, limit = size + 1, 2.0 * limit
        cell_u = min(max(int((u[i] - low[face[i], 0]) * cells_per_unit), 0), last_cell) if face[i] != _NO_FACE else 0
        cell_v = min(max(int((v[i] - low[face[i], 1]) * cells_per_unit), 0), last_cell) if face[i] != _NO_FACE else 0
        place = _spread_bits(cell_u) | _spread_bits(cell_v) << 1
        key = np.int64(0 if alone else 1) << _SIZE_BITS | ((1 << _SIZE_BITS) - 1 - size)
        keys[i] = ((key << _FACE_BITS | face[i]) << 2 * GRID_BITS | place) << _INDEX_BITS | i


@parallel_kernel
def _make_keys(places, low, cells_per_unit, spacing, keys):
    for worker in prange(N_WORKERS):
        _keys_part(places, low, cells_per_unit, spacing, keys, worker)


def group_triangles(corners, triangles, light, size):
    """Sort the casting triangles for grouping and cut them into units; returns `Units` and `Faces`.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.
    triangles : int64 (n_casters,), the casting triangles.
    light : float64 (4,), homogeneous.
    size : largest number of frusta in a group.
    """
    faces, n = light_faces(light), len(triangles)
    places = _Places(np.empty(n, np.int8), np.empty(n), np.empty(n), np.empty(n))
    _place(corners, triangles, faces, places)
    low, extent, area = _extents(places)
    spacing = np.sqrt(area / max(n, 1))
    keys = np.empty(n, np.int64)
    _make_keys(places, low, (1 << GRID_BITS) / extent, spacing, keys)
    keys.sort()
    n_alone = int(np.searchsorted(keys, 1 << _SIZE_BITS + _FACE_BITS + 2 * GRID_BITS + _INDEX_BITS))
    # Cells as wide as an evenly spread group of triangles of this size; a group stays within one
    cells = keys[n_alone:] >> _INDEX_BITS
    size_class = (1 << _SIZE_BITS) - 1 - (cells >> _FACE_BITS + 2 * GRID_BITS & (1 << _SIZE_BITS) - 1) - _MIDDLE_SIZE
    width = np.sqrt(size) * spacing * (1 << GRID_BITS) / extent
    bits = np.minimum(max(0, int(width).bit_length() - 1) + size_class, GRID_BITS)
    cells >>= 2 * bits
    changes = np.concatenate([[True], cells[1:] != cells[:-1]]) if len(cells) else np.zeros(0, np.bool_)
    runs = np.flatnonzero(changes)
    in_run = np.arange(len(cells)) - np.repeat(runs, np.diff(np.append(runs, len(cells))))
    starts = n_alone + np.flatnonzero(in_run % size == 0)
    lengths = np.diff(np.append(starts, n))
    # Groups of one are walked by themselves, after those that are alone for their size
    in_group = np.concatenate([np.zeros(n_alone, np.bool_), np.repeat(lengths > 1, lengths)])
    order = (keys & _INDEX)[np.argsort(in_group, kind="stable")]
    lengths, n_single = lengths[lengths > 1], n - int(in_group.sum())
    first = np.concatenate([np.arange(n_single), n_single + np.cumsum(np.append(0, lengths))])
    return Units(triangles[order], first, places.face[order[first[n_single:-1]]], n_single), faces


def _extents(places):
    """Smallest coordinates on each face, the largest extent of any, and the sum of their areas."""
    low, extent, area = np.zeros((_NO_FACE, 2)), 0.0, 0.0
    for face in range(_NO_FACE):
        on_face = places.face == face
        if on_face.any():
            u, v = places.u[on_face], places.v[on_face]
            low[face] = u.min(), v.min()
            extent = max(extent, u.max() - u.min(), v.max() - v.min())
            area += (u.max() - u.min()) * (v.max() - v.min())
    return low, (extent if extent > 0.0 else 1.0), area
