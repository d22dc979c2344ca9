"""Faces of shadow volumes as they appear on the image: projected borders, planes, and what rows they cover.

A face knows the function f of its plane: the shadow's side of it is ``f <= 0``. On an edge's plane, zero goes to the
side on which its volume lies, as the definition of shadow wants. A face seen edge-on keeps its borders instead.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel
from shadowbench.kernels.shadow_volumes import EDGE_ON, dot
from shadowbench.kernels.volume_polygons import clip_and_project

BEHIND_PLANE, BEFORE_PLANE, EDGE_ON_PLANE, AT_INFINITY = 0, 1, 2, 3
"""Where the eye is: on the side f <= 0 of a face, on the other, in its plane; and the mark of dark caps."""


class Faces(NamedTuple):
    """Faces that cover at least one sample's row and column.

    Attributes
    ----------
    first : int64 (N_WORKERS + 1,), where each worker's faces start; the last is the capacity.
    end : int64 (N_WORKERS,), one past the last face of each worker.
    polygon : float64 (capacity, 9, 2), corners on the image plane, counter-clockwise seen from the side f > 0.
    n_corners : int32 (capacity,).
    plane : float64 (capacity, 4), f at the eye and its slope along right, up and forward.
    eye_side : int8 (capacity,), BEHIND_PLANE, BEFORE_PLANE, EDGE_ON_PLANE or AT_INFINITY.
    multiplicity : int32 (capacity,), times drawn; positive if the volume lies where f <= 0.
    rows : int32 (capacity, 2), first and last row of the samples within its bounds.
    borders : float64 (capacity, 4, 4), for faces seen edge-on: value at the eye and slopes of planes through its
        borders, positive on its inner side.
    triangle : int32 (capacity,), the triangle it belongs to; the first one for an edge.
    """

    first: NDArray[np.int64]
    end: NDArray[np.int64]
    polygon: NDArray[np.float64]
    n_corners: NDArray[np.int32]
    plane: NDArray[np.float64]
    eye_side: NDArray[np.int8]
    multiplicity: NDArray[np.int32]
    rows: NDArray[np.int32]
    borders: NDArray[np.float64]
    triangle: NDArray[np.int32]


class Scratch(NamedTuple):
    """Room for the face at work.

    Attributes
    ----------
    corners : float64 (4, 4), homogeneous view space.
    room : float64 (2, 9, 4), for clipping.
    """

    corners: NDArray[np.float64]
    room: NDArray[np.float64]


@kernel
def first_at_or_after(positions, per_unit, value):
    """Index of the first sample whose position is at least `value`; the number of samples if there is none."""
    n = len(positions)
    if not value > positions[0]:
        return 0
    if value > positions[n - 1]:
        return n
    # Regular positions make the guess right to within one sample; others are walked to
    i = min(int((value - positions[0]) * per_unit), n - 1)
    while i > 0 and positions[i - 1] >= value:
        i -= 1
    while positions[i] < value:
        i += 1
    return i


@kernel
def project_face(view, scratch, n_corners, faces, slot):
    """Clip and project the face at work, and tell whether a sample's row and a sample's column cross its bounds."""
    for i in range(n_corners):
        for c in range(4):
            scratch.room[0, i, c] = scratch.corners[i, c]
    n = clip_and_project(view, scratch.room, n_corners, faces.polygon, slot)
    left = top = np.inf
    right = bottom = -np.inf
    for i in range(n):
        x, down = faces.polygon[slot, i, 0], faces.polygon[slot, i, 1]
        left, right, top, bottom = min(left, x), max(right, x), min(top, down), max(bottom, down)
    if not (left <= view.x[-1] and right >= view.x[0] and top <= view.down[-1] and bottom >= view.down[0]):
        return False
    column = first_at_or_after(view.x, view.columns_per_unit, left)
    row = first_at_or_after(view.down, view.rows_per_unit, top)
    if view.x[column] > right or view.down[row] > bottom:
        return False
    # A level border at the bottom covers nothing, so its row may be left out or kept
    faces.rows[slot, 0] = row
    faces.rows[slot, 1] = first_at_or_after(view.down, view.rows_per_unit, bottom) - 1
    faces.n_corners[slot] = n
    return True


@kernel
def _set_borders(scratch, n_corners, faces, slot):
    """Set up planes through the borders of a face, at right angles to it, positive on its inner side."""
    nx, ny, nz = faces.plane[slot, 1], faces.plane[slot, 2], faces.plane[slot, 3]
    for i in range(4):
        j = i + 1 if i + 1 < n_corners else 0
        a, b = (i, j) if scratch.corners[i, 3] == 1.0 else (j, i)
        mx = my = mz = at_eye = 0.0
        if i < n_corners and scratch.corners[a, 3] == 1.0:
            x, y, z = scratch.corners[b, 0], scratch.corners[b, 1], scratch.corners[b, 2]
            px, py, pz = scratch.corners[a, 0], scratch.corners[a, 1], scratch.corners[a, 2]
            if scratch.corners[b, 3] == 1.0:
                x, y, z = x - px, y - py, z - pz
            sign = 1.0 if a == i else -1.0
            # Right, up and forward are a left-handed system: the product of (normal, direction) changes sign
            mx, my, mz = sign * (y * nz - z * ny), sign * (z * nx - x * nz), sign * (x * ny - y * nx)
            at_eye = -(mx * px + my * py + mz * pz)
        faces.borders[slot, i, 0] = at_eye
        faces.borders[slot, i, 1], faces.borders[slot, i, 2], faces.borders[slot, i, 3] = mx, my, mz


@kernel
def set_plane(view, scratch, n_corners, normal, value, terms, sign, faces, slot):
    """Store the plane of a projected face, its normal times `sign`."""
    faces.plane[slot, 0] = sign * value
    faces.plane[slot, 1] = sign * dot(normal, view.right)
    faces.plane[slot, 2] = sign * dot(normal, view.up)
    faces.plane[slot, 3] = sign * dot(normal, view.forward)
    if abs(value) <= EDGE_ON * terms:
        faces.eye_side[slot] = EDGE_ON_PLANE
        _set_borders(scratch, n_corners, faces, slot)
    else:
        faces.eye_side[slot] = BEHIND_PLANE if sign * value < 0.0 else BEFORE_PLANE
