"""Polygons of shadow volumes in homogeneous view space: clipping and projection.

A vertex is (right, up, depth, w): w = 1 a point, w = 0 a direction, that is a point at infinity. The eye is the origin.
A polygon is clipped by a plane of smallest depth and by four *guard planes* through the eye, well outside the image.
Nothing of it that a sample can see is lost, and every corner that is left projects to a moderate position, also
where the polygon passes behind the eye or reaches infinity. There is no far plane.

Where an edge is cut, its ends are taken in one canonical order, so that neighbouring polygons, which run along the edge
in opposite directions, get the same point bit for bit.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel

MAX_CORNERS = 9
"""A quad cut by five planes."""

GUARD = 8.0
"""Guard planes lie this many times as far out as the border of the image."""

_N_PLANES = 5


class VolumeView(NamedTuple):
    """The camera, and the grid of its samples on the image plane at depth 1.

    Attributes
    ----------
    eye, right, up, forward : float64 (3,), world; the last three are orthonormal.
    x : float64 (columns,), image-plane position of each column, increasing.
    down : float64 (rows,), of each row, measured downwards, increasing.
    columns_per_unit, rows_per_unit : samples in one unit of length on the image plane.
    guard_x, guard_y : slope of the guard planes.
    nearest : smallest depth that is drawn.
    """

    eye: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    forward: NDArray[np.float64]
    x: NDArray[np.float64]
    down: NDArray[np.float64]
    columns_per_unit: float
    rows_per_unit: float
    guard_x: float
    guard_y: float
    nearest: float


def _per_unit(positions: NDArray[np.float64]) -> float:
    """Samples per unit of length; any positive number will do for a single one."""
    return 1.0 if len(positions) < 2 else float((len(positions) - 1) / (positions[-1] - positions[0]))


def volume_view(camera, samples, nearest: float) -> VolumeView:
    """Make the view of a frame.

    Parameters
    ----------
    camera : CameraBasis of the frame.
    samples : ViewSamples of the frame.
    nearest : smallest depth that is drawn, above 0.
    """
    x = np.ascontiguousarray(samples.plane_x[:samples.columns])
    down = np.ascontiguousarray(-samples.plane_y[::samples.columns])
    return VolumeView(camera.eye, camera.right, camera.up, camera.forward, x, down, _per_unit(x), _per_unit(down),
                      GUARD * float(camera.tan_x), GUARD * float(camera.tan_y), float(nearest))


@kernel
def _plane_value(planes, plane, x, y, depth, w):
    """Evaluate a clip plane at a corner; what is kept has values from 0 up. `planes`: nearest, guard_x, guard_y."""
    if plane == 0:
        return depth - planes[0] * w
    guard = planes[1] if plane < 3 else planes[2]
    value = x if plane < 3 else y
    return guard * depth + (value if plane == 1 or plane == 3 else -value)


@kernel
def _precedes(room, side, i, j):
    """True if corner i comes before corner j in lexicographic order."""
    for c in range(4):
        if room[side, i, c] != room[side, j, c]:
            return room[side, i, c] < room[side, j, c]
    return False


@kernel
def _clip_by_plane(planes, plane, room, side, n_corners):
    """Clip the polygon in one side of `room` by a plane into the other (Sutherland and Hodgman); count corners."""
    n = 0
    for i in range(n_corners):
        j = i + 1 if i + 1 < n_corners else 0
        value_i = _plane_value(planes, plane, room[side, i, 0], room[side, i, 1], room[side, i, 2], room[side, i, 3])
        value_j = _plane_value(planes, plane, room[side, j, 0], room[side, j, 1], room[side, j, 2], room[side, j, 3])
        if value_i >= 0.0:
            for c in range(4):
                room[1 - side, n, c] = room[side, i, c]
            n += 1
        if (value_i >= 0.0) != (value_j >= 0.0):
            # Cut from the corner that comes first, whichever way the polygon runs
            a, b, s = i, j, value_i / (value_i - value_j)
            if _precedes(room, side, j, i):
                a, b, s = j, i, value_j / (value_j - value_i)
            for c in range(4):
                room[1 - side, n, c] = room[side, a, c] + (room[side, b, c] - room[side, a, c]) * s
            n += 1
    return n


@kernel
def clip_and_project(view, room, n_corners, out, slot):
    """Clip a homogeneous polygon and project what is left.

    Parameters
    ----------
    view : VolumeView.
    room : float64 (2, 9, 4), the polygon's corners in room[0]; overwritten.
    n_corners : 3 or 4.
    out : float64 (n, 9, 2), receives in out[slot] the image-plane positions: to the right, and down.

    Returns
    -------
    Number of corners: 0 if nothing is left.
    """
    # Records and arrays stay out of the calls in this loop: each would cost more than the arithmetic
    planes = (view.nearest, view.guard_x, view.guard_y)
    side = 0
    for plane in range(_N_PLANES):
        n_outside = 0
        for i in range(n_corners):
            if not _plane_value(planes, plane, room[side, i, 0], room[side, i, 1], room[side, i, 2],
                                room[side, i, 3]) >= 0.0:
                n_outside += 1
        if n_outside == n_corners:
            return 0
        if n_outside > 0:
            n_corners = _clip_by_plane(planes, plane, room, side, n_corners)
            side = 1 - side
    for i in range(n_corners):
        # Clamping keeps a corner cut at the eye itself, of depth 0 but for rounding, on its side of the image
        x, down = room[side, i, 0] / room[side, i, 2], -(room[side, i, 1] / room[side, i, 2])
        out[slot, i, 0] = min(max(x, -2.0 * view.guard_x), 2.0 * view.guard_x)
        out[slot, i, 1] = min(max(down, -2.0 * view.guard_y), 2.0 * view.guard_y)
    return n_corners
