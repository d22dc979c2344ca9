"""Scissor and depth bounds: the part of the image, and of its depths, that a part's shadow volume can reach.

A part of the scene is bounded by a box, and so are the lit candidates, the only samples that matter. The part's shadow
lies in its box swept away from the light; what that shares with the samples' box is bounded by a box again, whose
corners give a rectangle of the screen (the scissor: Lengyel 2002, Everitt and Kilgard 2003) and a range of depths (the
depth bounds). Outside of them a sample is in none of the part's frusta, so all faces of that part can be left out
there, with no change to what z-pass and z-fail count.
"""

import numpy as np
from numpy.typing import NDArray

from shadowbench.kernels.volume_bins import VolumeLimits

LIMIT_MARGIN = 2.0**-40
"""Boxes and depths are widened by this share of the largest coordinate in play: far more than their rounding errors
(some ten units of 2^-53), far less than a pixel."""


def _swept_box(box, away, receivers):
    """Bound what a box, swept along the light's rays, shares with the receivers' box; None if that is nothing.

    Parameters
    ----------
    box, receivers : float64 (2, 3), smallest and largest coordinates, world.
    away : float64 (2, 3), smallest and largest components of the light's rays at the points of the box.
    """
    farthest = np.inf
    for k in range(3):
        if away[0, k] > 0.0:
            farthest = min(farthest, (receivers[1, k] - box[0, k]) / away[0, k])
        elif away[1, k] < 0.0:
            farthest = min(farthest, (box[1, k] - receivers[0, k]) / -away[1, k])
    if farthest < 0.0:
        return None
    with np.errstate(invalid="ignore"):
        low = box[0] + np.where(away[0] < 0.0, away[0] * farthest, 0.0)
        high = box[1] + np.where(away[1] > 0.0, away[1] * farthest, 0.0)
    shared = np.stack([np.maximum(low, receivers[0]), np.minimum(high, receivers[1])])
    return shared if np.all(shared[0] <= shared[1]) else None


def _screen_bounds(box, view):
    """Project a box: ranges of x, of down and of depth; everything if it reaches in front of the nearest depth."""
    corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) - view.eye
    across, up, depth = (corners[:, 0] * axis[0] + corners[:, 1] * axis[1] + corners[:, 2] * axis[2]
                         for axis in (view.right, view.up, view.forward))
    margin = LIMIT_MARGIN * (np.abs(corners).max() + np.abs(view.eye).max())
    depths = (float(depth.min() - margin), float(depth.max() + margin))
    if not depths[0] > view.nearest:
        return (-np.inf, np.inf), (-np.inf, np.inf), depths
    x, down = across / depth, -up / depth
    # A margin in space is seen enlarged by the slope of the ray
    slack = (2.0 + np.abs(x).max() + np.abs(down).max()) * margin / depths[0]
    return (x.min() - slack, x.max() + slack), (down.min() - slack, down.max() + slack), depths


def no_limits(n_triangles: int, samples) -> VolumeLimits:
    """Let everything through: one part that may reach all samples."""
    return VolumeLimits(np.zeros(n_triangles, np.int32), np.int32([[0, samples.rows - 1]]),
                        np.int32([[0, samples.columns - 1]]), np.array([[-np.inf, np.inf]]))


def volume_limits(corners, part, casting, light, samples, view, scissor: bool, depth_bounds: bool) -> VolumeLimits:
    """Find scissor and depth bounds of every part.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.
    part : int32 (n_triangles,).
    casting : bool (n_triangles,), triangles that have a shadow volume.
    light : float64 (4,), homogeneous, world.
    samples : ViewSamples of the frame.
    view : VolumeView.
    scissor, depth_bounds : which of the two to find; the other lets everything through.
    """
    if not scissor and not depth_bounds:
        return no_limits(len(part), samples)
    n_parts = int(part.max(initial=0)) + 1
    rows, columns = np.tile(np.int32([0, -1]), (n_parts, 1)), np.tile(np.int32([0, -1]), (n_parts, 1))
    depths = np.tile([-np.inf, np.inf], (n_parts, 1))
    points: NDArray[np.float64] = samples.position[samples.candidate]
    for p in range(n_parts if len(points) else 0):
        own = corners[(part == p) & casting].reshape(-1, 3)
        if len(own) == 0:
            continue
        margin = LIMIT_MARGIN * max(np.abs(own).max(), np.abs(points).max())
        box = np.stack([own.min(axis=0) - margin, own.max(axis=0) + margin])
        receivers = np.stack([points.min(axis=0) - margin, points.max(axis=0) + margin])
        shared = _swept_box(box, light[3] * box - light[:3], receivers)
        if shared is None:
            continue
        x, down, depth = _screen_bounds(shared, view)
        if not scissor:
            x = down = (-np.inf, np.inf)
        if depth_bounds:
            depths[p] = depth
        columns[p] = np.searchsorted(view.x, x[0], "left"), np.searchsorted(view.x, x[1], "right") - 1
        rows[p] = np.searchsorted(view.down, down[0], "left"), np.searchsorted(view.down, down[1], "right") - 1
    return VolumeLimits(part, rows, columns, depths)
