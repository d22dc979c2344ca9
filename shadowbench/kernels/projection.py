"""Views of a scene, from a camera or a light: projection of vertices to the screen, and the near plane.

The screen is measured in units (pixels of an image, texels of a map) from its top left corner, x to the right and
y down. Only + - * / on float64 in source order: the same vertex gives the same bits in every triangle that uses it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel, parallel_kernel, prange

FloatArray = NDArray[np.float64]

N_WORKERS = 64
"""Parts that lists of vertices and triangles are cut into: a constant, so no result depends on the threads."""


class Axis(NamedTuple):
    """One axis of the screen and the sample positions on it.

    Attributes
    ----------
    position : float64 (n,), screen coordinate of each sample column or row, increasing.
    plane : float64 (n,), the same on the image plane: at depth 1 (perspective) or in world units (parallel).
    extent : size of the screen in units.
    half : half the size of the screen on the image plane; negative where the two run in opposite directions.
    per_unit : samples in one unit of the screen.
    """

    position: FloatArray
    plane: FloatArray
    extent: float
    half: float
    per_unit: float


class View(NamedTuple):
    """A perspective or a parallel projection and its grid of samples.

    The ray of a sample is ``eye + t (forward + x_plane right + y_plane up)`` in a perspective view and
    ``(eye + x_plane right + y_plane up) + t forward`` in a parallel one; t is the depth in both. (The two axes are
    spelled out because Numba's parallel loops take no records within records.)

    Attributes
    ----------
    eye, right, up, forward : float64 (3,), world; the last three are orthonormal.
    near, far : smallest and largest depth that is drawn; near > 0 in a perspective view.
    perspective : False for a parallel projection.
    x_position, x_plane, x_extent, x_half, x_per_unit : the horizontal `Axis`, columns from left to right.
    y_position, y_plane, y_extent, y_half, y_per_unit : the vertical `Axis`, rows from top to bottom.
    """

    eye: FloatArray
    right: FloatArray
    up: FloatArray
    forward: FloatArray
    near: float
    far: float
    perspective: bool
    x_position: FloatArray
    x_plane: FloatArray
    x_extent: float
    x_half: float
    x_per_unit: float
    y_position: FloatArray
    y_plane: FloatArray
    y_extent: float
    y_half: float
    y_per_unit: float

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the sample grid."""
        return len(self.y_position), len(self.x_position)


class ProjectedMesh(NamedTuple):
    """A mesh as one view sees it.

    Attributes
    ----------
    vertices : float64 (n_vertices, 3), world.
    triangles : int32 (n_triangles, 3).
    vertices_view : float64 (n_vertices, 3): along right, along up, depth.
    screen : float64 (n_vertices, 3): x and y in screen units (not a number before the near plane), depth.
    """

    vertices: FloatArray
    triangles: NDArray[np.int32]
    vertices_view: FloatArray
    screen: FloatArray


def screen_axis(n_units: int, offsets: tuple[float, ...], half: float) -> Axis:
    """Place ``len(offsets)`` samples in each of `n_units` units, at these offsets (increasing, in 0..1)."""
    position = (np.arange(n_units)[:, None] + np.array(offsets)).ravel()
    plane = (2.0 * position / n_units - 1.0) * half
    return Axis(position, plane, float(n_units), float(half), float(len(offsets)))


@kernel
def chunk(worker, n_items):
    """Return first and one past the last item of a worker's share of a list."""
    return worker * n_items // N_WORKERS, (worker + 1) * n_items // N_WORKERS


@kernel
def to_screen(view, x, y, depth):
    """Project a view-space point whose depth is not before the near plane."""
    scale = depth if view.perspective else 1.0
    return ((1.0 + x / (scale * view.x_half)) * (0.5 * view.x_extent),
            (1.0 + y / (scale * view.y_half)) * (0.5 * view.y_extent))


@kernel
def _project_chunk(worker, view, mesh):
    """Transform and project one worker's share of the vertices."""
    first, end = chunk(worker, len(mesh.vertices))
    eye, right, up, forward = view.eye, view.right, view.up, view.forward
    vertices, vertices_view, screen = mesh.vertices, mesh.vertices_view, mesh.screen
    for i in range(first, end):
        x, y, z = vertices[i, 0] - eye[0], vertices[i, 1] - eye[1], vertices[i, 2] - eye[2]
        x_view = x * right[0] + y * right[1] + z * right[2]
        y_view = x * up[0] + y * up[1] + z * up[2]
        depth = x * forward[0] + y * forward[1] + z * forward[2]
        vertices_view[i, 0], vertices_view[i, 1], vertices_view[i, 2] = x_view, y_view, depth
        screen[i, 0] = screen[i, 1] = np.nan
        screen[i, 2] = depth
        if depth >= view.near:
            screen[i, 0], screen[i, 1] = to_screen(view, x_view, y_view, depth)


@parallel_kernel
def _project_all(view, mesh):
    for worker in prange(N_WORKERS):
        _project_chunk(worker, view, mesh)


def project(view: View, vertices: FloatArray, triangles: NDArray[np.int32]) -> ProjectedMesh:
    """Transform and project every vertex once."""
    # Read-only arrays are copied: Numba would compile every kernel a second time for their type
    vertices, triangles = np.require(vertices, requirements="CW"), np.require(triangles, requirements="CW")
    mesh = ProjectedMesh(vertices, triangles, np.empty((len(vertices), 3)), np.empty((len(vertices), 3)))
    _project_all(view, mesh)
    return mesh


@kernel
def _cut_edge(ax, ay, a_depth, bx, by, b_depth, near):
    """Find x and y (view space) of the point where an edge meets the near plane.

    Its two vertices are taken in lexicographic order, whichever way the triangle runs, so that all triangles that
    share the edge get the same bits.
    """
    if ax > bx or (ax == bx and (ay > by or (ay == by and a_depth > b_depth))):
        ax, ay, a_depth, bx, by, b_depth = bx, by, b_depth, ax, ay, a_depth
    s = (near - a_depth) / (b_depth - a_depth)
    return ax + (bx - ax) * s, ay + (by - ay) * s


@kernel
def clip_near(view, mesh, triangle, polygon):
    """Clip a triangle against the near plane and project what is left.

    Parameters
    ----------
    polygon : float64 (4, 3), receives x and y on the screen and the depth of up to four corners.

    Returns
    -------
    Number of corners: 0, 3 or 4.
    """
    triangles, vertices, near = mesh.triangles, mesh.vertices_view, view.near
    n_corners = 0
    for k in range(3):
        i, j = triangles[triangle, k], triangles[triangle, (k + 1) % 3]
        x, y, depth, next_depth = vertices[i, 0], vertices[i, 1], vertices[i, 2], vertices[j, 2]
        if depth >= near:
            polygon[n_corners, 0], polygon[n_corners, 1] = to_screen(view, x, y, depth)
            polygon[n_corners, 2] = depth
            n_corners += 1
        if (depth >= near) != (next_depth >= near):
            x, y = _cut_edge(x, y, depth, vertices[j, 0], vertices[j, 1], next_depth, near)
            polygon[n_corners, 0], polygon[n_corners, 1] = to_screen(view, x, y, near)
            polygon[n_corners, 2] = near
            n_corners += 1
    return n_corners
