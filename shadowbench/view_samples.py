"""View samples: the visible surface points of a frame, found by rasterisation from the camera.

The sample grid is the image with each pixel split into cells, one sample each, at the positions that
`SAMPLE_PATTERNS` lists. Row 0 is the top of the image.

Accuracy. A sample is ``eye + t ray``, with t from the plane of the triangle (not from interpolation), all in
float64. Its distance from that plane, ``|n . (p - a)| / |n|``, comes from the rounding of n . (a - eye), of
n . ray and of the position itself: each a few units in the last place of the largest coordinate (of eye, vertex
or sample). `PLANE_ERROR` states the bound that tests hold it to, eight decimal digits below the shadow bias.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import Camera, FloatArray, Frame, ImageSize, Light, Mesh, ViewSamples
from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.projection import N_WORKERS, View, chunk, screen_axis
from shadowbench.kernels.rasterizer import Target
from shadowbench.peeling import seen_surfaces
from shadowbench.spreading import spread_samples
from shadowbench.surfaces import surface_opacity

PLANE_ERROR = 1e-13
"""Largest distance of a sample from its triangle's plane, relative to the largest coordinate in play (450 ulp)."""

SIDE_ERROR = (7.0 + 56.0 * 2.0**-53) * 2.0**-53
"""Relative error bound of a rounded 3 x 3 orientation determinant (Shewchuk 1997, o3derrboundA)."""


class SamplePattern(NamedTuple):
    """Where the samples of a pixel lie, in pixels from its top left corner.

    Attributes
    ----------
    x : offset of each column of cells, increasing.
    y : offset of each row of cells, increasing.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]


SAMPLE_PATTERNS = {
    1: SamplePattern((0.5,), (0.5,)),
    2: SamplePattern((0.25, 0.75), (0.5,)),
    4: SamplePattern((0.25, 0.75), (0.25, 0.75)),
    8: SamplePattern((0.125, 0.375, 0.625, 0.875), (0.25, 0.75)),
    16: SamplePattern((0.125, 0.375, 0.625, 0.875), (0.125, 0.375, 0.625, 0.875)),
}
"""Samples per pixel and their positions: the centres of equal cells. Positions are exact binary fractions, so four
samples per pixel are, bit for bit, the image of twice the width and height."""


class _Visible(NamedTuple):
    """What is known of the samples after rasterisation, and what is to be filled in; see `ViewSamples`."""

    depth: FloatArray
    triangle: NDArray[np.int32]
    plane_x: FloatArray
    plane_y: FloatArray
    position: FloatArray
    normal: FloatArray
    candidate: NDArray[np.bool_]


def camera_view(camera: Camera, image: ImageSize) -> View:
    """Make the view of a camera, with the samples of an image.

    Raises
    ------
    ValueError
        If the number of samples per pixel has no pattern, or the image is empty, or near is not positive.
    """
    if image.samples not in SAMPLE_PATTERNS:
        raise ValueError(f"image samples must be one of {', '.join(map(str, SAMPLE_PATTERNS))}, not {image.samples}")
    if image.width < 1 or image.height < 1:
        raise ValueError(f"image must have at least one pixel, not {image.width} x {image.height}")
    if not 0.0 < camera.near < camera.far:
        raise ValueError(f"camera near and far must be 0 < near < far, not {camera.near} and {camera.far}")
    basis, pattern = camera.basis(image.width / image.height), SAMPLE_PATTERNS[image.samples]
    # Rows run down the screen, against the camera's up axis
    return View(basis.eye, basis.right, basis.up, basis.forward, float(basis.near), float(basis.far), True,
                *screen_axis(image.width, pattern.x, basis.tan_x),
                *screen_axis(image.height, pattern.y, -basis.tan_y))


def render_view_samples(mesh: Mesh, camera: Camera, light: Light, image: ImageSize) -> ViewSamples:
    """Find the visible surface point of every sample of an image.

    A sample is a lit candidate if the eye and the light lie strictly on the same side of its triangle's plane. A
    side is decided only where float64 proves it: a light (or eye) within rounding error of the plane counts as in
    the plane, so the triangle is edge-on to it and its samples are no candidates.

    Parameters
    ----------
    mesh : triangles in world space; both sides are visible.
    camera : resolved here for the aspect of the image.
    light : only decides which samples are lit candidates.
    image : size in pixels and samples per pixel (1, 2, 4, 8 or 16).
    """
    return render_layers(mesh, camera, light, image, 1)[0]


def render_frame(mesh: Mesh, camera: Camera, light: Light, image: ImageSize, bias: float, compared: bool = False) -> Frame:
    """Render all that a shadow algorithm may look at, with its deeper layers.

    Parameters
    ----------
    compared : True to render the samples on the surfaces that they see too, where the image's are spread by derivatives.
    """
    basis = camera.basis(image.width / image.height)
    first, *others = render_layers(mesh, camera, light, image, image.layers)
    deeper = tuple(Frame(mesh, light, basis, image, samples, bias) for samples in others)
    seen = None
    if compared and image.sampling == "derivative":
        seen = render_view_samples(mesh, camera, light, replace(image, sampling="surface"))
    return Frame(mesh, light, basis, image, first, bias, deeper=deeper, supersampled=seen)


def render_layers(mesh: Mesh, camera: Camera, light: Light, image: ImageSize, n_layers: int) -> list[ViewSamples]:
    """Find the nearest surfaces of every sample of an image, layer by layer (depth peeling, Everitt 2001).

    Each layer shows, behind the surface of the layer before, the next one; where that surface is opaque, or there is none,
    it is background. Places that a texture covers by less than half are not seen, in any layer (`peeling.SEEN_FROM`). There
    are at most `n_layers`, and fewer if nothing is left to show, but always one.

    Parameters as in `render_view_samples`.
    """
    pixels = replace(image, samples=1) if image.sampling == "derivative" else image
    view = camera_view(camera, pixels)
    layers: list[ViewSamples] = []
    behind: Target | None = None
    while len(layers) < n_layers:
        target = seen_surfaces(mesh, view, behind)
        rows, columns = target.depth.shape
        shown = _surface(mesh, view, target, light.xyzw())
        samples = ViewSamples(rows, columns, shown.position, shown.normal, shown.depth, shown.triangle, shown.candidate,
                              shown.plane_x, shown.plane_y)
        if layers and not (samples.triangle >= 0).any():
            break
        layers.append(samples if pixels is image else spread_samples(samples, camera_view(camera, image), image))
        if len(layers) < n_layers:
            opaque = surface_opacity(mesh, samples.triangle, samples.position) >= 1.0
            behind = Target(np.where(opaque.reshape(target.depth.shape), np.inf, target.depth), target.triangle)
    return layers


def resolve_to_pixels(values: NDArray, image: ImageSize) -> NDArray:
    """Combine the samples of each pixel: the sum of integers (and of truth values), the average of floats.

    Parameters
    ----------
    values : (n_samples,) or (n_samples, n_channels), in the order of the sample grid.

    Returns
    -------
    (height, width) or (height, width, n_channels): int64 for integers, float64 for floats.
    """
    values = np.asarray(values)
    pattern = SAMPLE_PATTERNS[image.samples]
    cells = values.reshape(image.height, len(pattern.y), image.width, len(pattern.x), *values.shape[1:])
    if np.issubdtype(values.dtype, np.floating):
        return cells.mean(axis=(1, 3), dtype=np.float64)
    return cells.sum(axis=(1, 3), dtype=np.int64)


def _surface(mesh: Mesh, view: View, target: Target, light: FloatArray) -> _Visible:
    """Fill in position, normal and candidate of every sample."""
    n_samples = target.depth.size
    visible = _Visible(target.depth.reshape(-1), target.triangle.reshape(-1), np.empty(n_samples),
                       np.empty(n_samples), np.empty((n_samples, 3)), np.empty((n_samples, 3)),
                       np.empty(n_samples, np.bool_))
    _surface_all(mesh.vertices, mesh.triangles, view, light, visible)
    return visible


@kernel
def _side(n, v, permanent):
    """Sign of n . v, or 0 where rounding could have changed it.

    `permanent` holds, for each component of the normal n, the sum of the magnitudes of its two products.
    """
    value = n[0] * v[0] + n[1] * v[1] + n[2] * v[2]
    bound = SIDE_ERROR * (permanent[0] * abs(v[0]) + permanent[1] * abs(v[1]) + permanent[2] * abs(v[2]))
    return 1 if value > bound else (-1 if value < -bound else 0)


@kernel
def _triangle_plane(a, b, c):
    """Normal of a triangle, not scaled, and the sum of magnitudes in each of its components (see `_side`)."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return ((uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx),
            (abs(uy * vz) + abs(uz * vy), abs(uz * vx) + abs(ux * vz), abs(ux * vy) + abs(uy * vx)))


@kernel
def _orientation(n, permanent, a, eye, light):
    """Whether eye and light lie strictly on the same side, and the length of n, negative if it points away."""
    to_eye = (eye[0] - a[0], eye[1] - a[1], eye[2] - a[2])
    to_light = (light[0] - light[3] * a[0], light[1] - light[3] * a[1], light[2] - light[3] * a[2])
    eye_side = _side(n, to_eye, permanent)
    candidate = eye_side != 0 and eye_side == _side(n, to_light, permanent)
    length = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if n[0] * to_eye[0] + n[1] * to_eye[1] + n[2] * to_eye[2] < 0.0:
        length = -length
    return candidate, length


@kernel
def _surface_chunk(worker, vertices, triangles, view, light, visible):
    """Fill in the samples of one worker's share of the rows."""
    depths, shown, x_plane, y_plane = visible.depth, visible.triangle, view.x_plane, view.y_plane
    plane_x, plane_y, position, normal = visible.plane_x, visible.plane_y, visible.position, visible.normal
    candidate, eye, right, up, forward = visible.candidate, view.eye, view.right, view.up, view.forward
    n_columns = len(x_plane)
    first, end = chunk(worker, len(y_plane))
    for row in range(first, end):
        for column in range(n_columns):
            i, x, y = row * n_columns + column, x_plane[column], y_plane[row]
            plane_x[i], plane_y[i], t = x, y, shown[i]
            if t >= 0:
                j, k, m = triangles[t, 0], triangles[t, 1], triangles[t, 2]
                a = (vertices[j, 0], vertices[j, 1], vertices[j, 2])
                n, permanent = _triangle_plane(a, (vertices[k, 0], vertices[k, 1], vertices[k, 2]),
                                               (vertices[m, 0], vertices[m, 1], vertices[m, 2]))
                candidate[i], length = _orientation(n, permanent, a, eye, light)
                scale = 1.0 / length
                for axis in range(3):
                    normal[i, axis] = n[axis] * scale
                    position[i, axis] = eye[axis] + depths[i] * (forward[axis] + x * right[axis] + y * up[axis])
            else:
                candidate[i] = False
                for axis in range(3):
                    position[i, axis] = normal[i, axis] = 0.0


@parallel_kernel
def _surface_all(vertices, triangles, view, light, visible):
    for worker in prange(N_WORKERS):
        _surface_chunk(worker, vertices, triangles, view, light, visible)
