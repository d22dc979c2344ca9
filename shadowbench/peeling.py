"""Which surfaces the camera sees: the nearest, those behind them layer by layer, and through what a texture leaves clear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import Mesh
from shadowbench.kernels.projection import View
from shadowbench.kernels.rasterizer import Target, empty_target, rasterize
from shadowbench.surfaces import covering, texture_coordinates

SEEN_FROM = 0.5
"""Share that a texture must cover for the camera to see the surface there: half, so that edges stay in place."""


def seen_surfaces(mesh: Mesh, view: View, behind: Target | None) -> Target:
    """Nearest surfaces behind others, places that a texture does not cover left out."""
    target = empty_target(view)
    rasterize(view, mesh.vertices, mesh.triangles, target, None, behind)
    masked = np.array([m.alpha_texture is not None for m in mesh.materials], np.bool_)
    clear = _not_covered(mesh, view, target, masked)
    while clear.any():
        # Look behind the clear places alone
        nearer = Target(np.where(clear, target.depth, np.inf), target.triangle)
        beyond = empty_target(view)
        rasterize(view, mesh.vertices, mesh.triangles, beyond, None, nearer)
        target.depth[clear], target.triangle[clear] = beyond.depth[clear], beyond.triangle[clear]
        clear &= _not_covered(mesh, view, target, masked)
    return target


def _not_covered(mesh: Mesh, view: View, target: Target, masked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """True where the texture of the surface that is seen covers less than `SEEN_FROM`, bool (rows, columns)."""
    clear = np.zeros(target.triangle.shape, np.bool_)
    seen = target.triangle >= 0
    seen[seen] = masked[mesh.material[target.triangle[seen]]]
    row, column = np.nonzero(seen)
    triangles, depth = target.triangle[seen], target.depth[seen][:, None]
    points = view.eye + depth * (view.forward + view.x_plane[column, None] * view.right
                                 + view.y_plane[row, None] * view.up)
    covered = np.ones(len(triangles))
    for index in np.unique(mesh.material[triangles]):
        mine = mesh.material[triangles] == index
        covered[mine] = covering(mesh.materials[index], texture_coordinates(mesh, triangles[mine], points[mine]))
    clear[seen] = covered < SEEN_FROM
    return clear
