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
def _plane_value(view, plane, v):
    """Evaluate a clip plane at a vertex; what is kept has values from 0 up."""
    if plane == 0:
        return v[2] - view.nearest * v[3]
    if plane == 1:
        return v[0] + view.guard_x * v[2]
    if plane == 2:
        return view.guard_x * v[2] - v[0]
    if plane == 3:
        return v[1] + view.guard_y * v[2]
    return view.guard_y * v[2] - v[1]


@kernel
def _precedes(a, b):
    """True if a comes before b in lexicographic order."""
    for i in range(4):
        if a[i] != b[i]:
            return a[i] < b[i]
    return False


@kernel
def _clip_by_plane(view, plane, source, n_source, target):
    """Clip a polygon by one plane (Sutherland and Hodgman) and return the number of corners left."""
    n = 0
    for i in range(n_source):
        a, b = source[i], source[(i + 1) % n_source]
        value_a, value_b = _plane_value(view, plane, a), _plane_value(view, plane, b)
        if value_a >= 0.0:
            target[n] = a
            n += 1
        if (value_a >= 0.0) != (value_b >= 0.0):
            if _precedes(b, a):
                a, b, value_a, value_b = b, a, value_b, value_a
            s = value_a / (value_a - value_b)
            for c in range(4):
                target[n, c] = a[c] + (b[c] - a[c]) * s
            n += 1
    return n


@kernel
def clip_and_project(view, polygon, n_corners, spare, out):
    """Clip a homogeneous polygon and project what is left.

    Parameters
    ----------
    view : VolumeView.
    polygon : float64 (9, 4), its corners; overwritten.
    n_corners : 3 or 4.
    spare : float64 (9, 4), overwritten.
    out : float64 (9, 2), receives the image-plane positions: to the right, and down.

    Returns
    -------
    Number of corners: 0 if nothing is left.
    """
    for plane in range(_N_PLANES):
        n_outside = 0
        for i in range(n_corners):
            if not _plane_value(view, plane, polygon[i]) >= 0.0:
                n_outside += 1
        if n_outside == n_corners:
            return 0
        if n_outside > 0:
            n_corners = _clip_by_plane(view, plane, polygon, n_corners, spare)
            polygon, spare = spare, polygon
    for i in range(n_corners):
        # Clamping keeps a corner cut at the eye itself, of depth 0 but for rounding, on its side of the image
        depth = polygon[i, 2]
        out[i, 0] = min(max(polygon[i, 0] / depth, -2.0 * view.guard_x), 2.0 * view.guard_x)
        out[i, 1] = min(max(-(polygon[i, 1] / depth), -2.0 * view.guard_y), 2.0 * view.guard_y)
    return n_corners
