"""Derivative antialiasing: several samples in the plane of the surface that a pixel's centre sees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import ImageSize, ViewSamples, dot
from shadowbench.kernels.projection import View

FARTHEST_SPREAD = 64.0
"""Greatest ratio of the depths of a sample and of its pixel's centre; only planes seen edge-on come near it."""


def spread_samples(centres: ViewSamples, view: View, image: ImageSize) -> ViewSamples:
    """Spread the samples of each pixel over the plane of the surface that its centre sees.

    1 / depth is linear over the image plane, so its two derivatives and the depth of the centre say where they lie: the
    antialiasing of Sintorn, Olsson, Assarsson 2011, sec. 3.3. Where the plane is seen edge-on, depths are kept within
    `FARTHEST_SPREAD` times the centre's, and as much nearer.

    Parameters
    ----------
    centres : one sample per pixel.
    view, image : the image with all its samples.
    """
    up, across = image.rows // image.height, image.columns // image.width

    def each(values: NDArray) -> NDArray:
        """Repeat a pixel's value for its samples, row by row."""
        cells = values.reshape(image.height, image.width, *values.shape[1:])
        return np.ascontiguousarray(cells.repeat(up, axis=0).repeat(across, axis=1).reshape(-1, *values.shape[1:]))

    plane_x, plane_y = np.tile(view.x_plane, image.rows), np.repeat(view.y_plane, image.columns)
    n, seen = centres.normal, centres.triangle >= 0
    towards, along_x, along_y = (dot(n, axis) for axis in (view.forward, view.right, view.up))
    with np.errstate(invalid="ignore", divide="ignore"):
        # n . (depth ray) is the plane's distance from the eye, so 1 / depth is n . ray over it
        distance = centres.depth * (towards + centres.plane_x * along_x + centres.plane_y * along_y)
        r = (each(towards) + plane_x * each(along_x) + plane_y * each(along_y)) / each(distance)
        centre = each(1.0 / centres.depth)
        r = np.where(np.isfinite(r), r, centre)
        depth = np.where(each(seen), 1.0 / np.clip(r, centre / FARTHEST_SPREAD, centre * FARTHEST_SPREAD), np.inf)
    ray = view.forward + plane_x[:, None] * view.right + plane_y[:, None] * view.up
    position = np.where(each(seen)[:, None], view.eye + np.where(np.isfinite(depth), depth, 0.0)[:, None] * ray, 0.0)
    return ViewSamples(image.rows, image.columns, position, each(n), depth, each(centres.triangle),
                       each(centres.candidate), plane_x, plane_y)
