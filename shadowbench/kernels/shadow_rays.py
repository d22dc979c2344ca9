"""Shadow rays: where they run, and the exact test of a ray against a triangle.

**The test** is `shadow_frustum.inside_in_float64`, operation by operation: the sample, in the space ``_proj``, is on or
inside the three side planes of the triangle's shadow frustum and strictly inside its cap plane, with the rows of
`shadow_frustum.make_frusta`. So a ray tracer that asks it of enough triangles gives the same bits as `ptsv`.

**Rays** run from the light to the sample that the test sees, ``eye + depth (forward + x right + y up)``, taken relative to
an origin near both: the light, or for a directional light the scene's centre.

**What the test can say beyond the truth.** Let u = 2^-53, and W bound the distances between the eye, the samples and
the vertices. With r the light's ray to a vertex, e an edge, m = r x e and h = |n . r| for the triangle's unit normal n, the
rounded side plane is turned by at most 8 u |r| |e| / |m| and, with the rows' own rounding, a sample that passes lies at most
(8 |r| |e| / |m| + 32) u W outside it. Where its ray meets the triangle's plane it is then at most 40 u W |r| / h outside
the edge, as the planes meet at the sine |e| h / |m|; and at most that over the sine of half the smallest angle, which
is at least |e x f| / 2 |e| |f| for the two longest edges, from the triangle. `LOOSE` triangles are those for which
this may exceed one grid unit: seen almost edge-on, or needles. Every ray is tested against each of them.

**Where a ray meets a triangle's plane** follows from the cap plane's row (`crossing`), to within some 20 u W |r| / h along
the ray: for triangles that are not loose a quarter of a grid unit at most.
"""

from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.elements import get, pointer
from shadowbench.kernels.kdtree_clip import GRID
from shadowbench.kernels.shadow_frustum import CAP_ROW, View, find_facing, make_frusta
from shadowbench.kernels.vectors import corner, cross, dot, minus

N_WORKERS = 64
"""Parts that triangles and samples are cut into."""

ROW_SIZE = 16
"""Values per triangle: a, b, d and c of the three side planes and the cap plane."""

_LOOSE = 128.0 * 2.0**-53
"""80 u of the module's text, with room for the rounding of the bound itself."""

MARGIN = 2.0
"""Grid units by which cells are widened for rays: 1 for what the test can say beyond the truth, `CLIP_MARGIN` for the
tree, and the rest for rounding within the grid. It is a 2^23rd of the scene, a hundredth of the usual bias."""

PARALLEL_LENGTH = 2.0
"""Length of a directional light's rays, relative to the frame's reach: from outside the scene to any sample."""

FAR_ROUNDING = 64.0 * 2.0**-53
"""Rounding of a ray, relative to the distances of eye and light, which may lie far outside the grid."""


class ShadowRays(NamedTuple):
    """The rays of a frame and the planes of all triangles.

    Attributes
    ----------
    rows : float64 (n_triangles, ROW_SIZE), values a, b, d and c of each triangle's four planes; those of triangles
        that cast nothing are outside everywhere.
    loose : int64 (n_loose,), triangles to be tested against every ray.
    is_loose : bool (n_triangles,), the same.
    sides : int8 (n_triangles,), from `find_facing`: zero for triangles that cast nothing.
    plane_x, plane_y, depth : float64 (n_samples,), the samples as the test sees them.
    target : float64 (n_samples, 3), the samples relative to `origin`, world axes.
    origin : float64 (3,), world: the light, or the scene's centre for a directional light.
    travel : float64 (3,), unit vector along a directional light's rays; zero for a point light.
    start_view : float64 (4,), view space: the light and 1, or the way from any sample to the start of its ray and 0.
    bias : world distance.
    reach : world distance that bounds those between light (if it is a point), eye and the scene's farthest corner.
    """

    rows: np.ndarray
    loose: np.ndarray
    is_loose: np.ndarray
    sides: np.ndarray
    plane_x: np.ndarray
    plane_y: np.ndarray
    depth: np.ndarray
    target: np.ndarray
    origin: np.ndarray
    travel: np.ndarray
    start_view: np.ndarray
    bias: float
    reach: float


def make_shadow_rays(mesh_corners, bounds, camera, light, bias, samples):
    """Set up the planes of all triangles and the rays of all lit candidates.

    Parameters
    ----------
    mesh_corners : float64 (n_triangles, 3, 3), world.
    bounds : float64 (2, 3), smallest and largest coordinate of the mesh.
    camera : eye, right, up and forward, float64 (3,) each.
    light : float64 (4,), homogeneous, world.
    bias : world distance.
    samples : record with plane_x, plane_y, depth and candidate.
    """
    eye = camera[0]
    nearest = samples.depth[samples.candidate].min(initial=np.inf)
    r = np.float32(1.0) / np.float32(nearest)
    reach = np.array([np.abs(samples.plane_x).max(), np.abs(samples.plane_y).max(), r])
    sides = np.empty(len(mesh_corners), np.int8)
    find_facing(mesh_corners, light, sides)
    frusta = make_frusta(mesh_corners, sides, np.flatnonzero(sides), View(*camera, light, bias, reach), 0, False)
    centre = 0.5 * (bounds[0] + bounds[1])
    diagonal = _length(bounds[1] - bounds[0])
    origin, travel = light[:3].copy(), np.zeros(3)
    if light[3] == 0.0:
        origin, travel = centre, -light[:3] / _length(light[:3])
    near = _length(eye - centre) + 2.0 * diagonal
    rows, loose = np.empty((len(mesh_corners), ROW_SIZE)), np.zeros(len(mesh_corners), np.bool_)
    largest = (bounds[1] - bounds[0]).max() if len(mesh_corners) else 1.0
    rows[:] = _OUTSIDE
    _fill_rows(mesh_corners, light, frusta, _LOOSE * near * GRID / max(largest, np.finfo(float).tiny), rows, loose)
    target = np.zeros((len(samples.depth), 3))
    _find_targets(*camera, origin, samples, target)
    reach = near + _length(origin - centre)
    start = light[:3] - eye if light[3] else -travel * (PARALLEL_LENGTH * reach)
    right, up, forward = camera[1:]
    start_view = np.array([*(v[0] * start[0] + v[1] * start[1] + v[2] * start[2] for v in (right, up, forward)), light[3]])
    return ShadowRays(rows, np.flatnonzero(loose), loose, sides, samples.plane_x, samples.plane_y, samples.depth, target,
                      origin, travel, start_view, bias, reach)


_OUTSIDE = np.repeat([0.0, 0.0, 1.0, 0.0], 4)


def _length(v):
    return float(np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))


@kernel
def _rows_part(corners, light, frusta, loose_factor, rows, loose, worker):
    """Copy the rows of one worker's share of the frusta, plane by plane, and find loose triangles."""
    n, triangle, exact_rows = len(frusta.triangle), frusta.triangle, frusta.exact_rows
    for k in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        t = triangle[k]
        for plane in range(4):
            rows[t, plane], rows[t, 4 + plane] = exact_rows[k, plane, 0], exact_rows[k, plane, 1]
            rows[t, 8 + plane], rows[t, 12 + plane] = exact_rows[k, plane, 3], exact_rows[k, plane, 2]
        a, b, c = corner(corners, t, 0), corner(corners, t, 1), corner(corners, t, 2)
        edges, ray = (minus(b, a), minus(c, b), minus(a, c)), 0.0
        for v in (a, b, c):
            w = light[3]
            r = w * v[0] - light[0], w * v[1] - light[1], w * v[2] - light[2]
            ray = max(ray, dot(r, r))
        # The two longest edges: the product of all three over the shortest
        x, y, z = dot(edges[0], edges[0]), dot(edges[1], edges[1]), dot(edges[2], edges[2])
        longest = np.sqrt(max(x * y, y * z, z * x))
        r = light[3] * a[0] - light[0], light[3] * a[1] - light[1], light[3] * a[2] - light[2]
        determinant = abs(dot(cross(minus(b, a), minus(c, a)), r))
        loose[t] = not loose_factor * np.sqrt(ray) * longest <= determinant


@parallel_kernel
def _fill_rows(corners, light, frusta, loose_factor, rows, loose):
    for worker in prange(N_WORKERS):
        _rows_part(corners, light, frusta, loose_factor, rows, loose, worker)


@kernel
def _targets_part(eye, right, up, forward, origin, samples, target, worker):
    """Place one worker's share of the lit candidates relative to the origin."""
    n, depth, plane_x, plane_y = len(samples.depth), samples.depth, samples.plane_x, samples.plane_y
    candidate = samples.candidate
    for i in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        if candidate[i]:
            for k in range(3):
                target[i, k] = (eye[k] - origin[k]) + depth[i] * (forward[k] + plane_x[i] * right[k] + plane_y[i] * up[k])


@parallel_kernel
def _find_targets(eye, right, up, forward, origin, samples, target):
    for worker in prange(N_WORKERS):
        _targets_part(eye, right, up, forward, origin, samples, target, worker)


@kernel
def is_behind(rays, t, x, y, r):
    """Tell whether a sample is strictly inside the cap plane of triangle t."""
    first = ROW_SIZE * t + CAP_ROW
    return (get(rays, "rows", first) * x + (get(rays, "rows", first + 4) * y + get(rays, "rows", first + 8))
            + get(rays, "rows", first + 12) * r) < 0.0


_FOUR = ir.VectorType(ir.DoubleType(), 4)
_SMALLEST_DOUBLE = 5e-324


@intrinsic
def _inside_all(typing_context, rays, t, x, y, r):
    """Tell whether a sample is inside all four planes of triangle t.

    The sample is outside where a side plane's value is above zero, or the cap plane's at or above it, that is, above
    the largest number below zero.
    """
    def codegen(context, builder, signature, args):
        record, t, *coordinates = args
        rows = pointer(context, builder, signature.args[0], record, "rows")
        first = builder.mul(t, ir.Constant(t.type, ROW_SIZE))
        x, y, r = (_splat(builder, value) for value in coordinates)
        a, b, d, c = (_load(builder, rows, builder.add(first, ir.Constant(t.type, 4 * k))) for k in range(4))
        value = builder.fadd(builder.fadd(builder.fmul(a, x), builder.fadd(builder.fmul(b, y), d)), builder.fmul(c, r))
        outside = builder.fcmp_ordered(">", value, ir.Constant(_FOUR, [0.0, 0.0, 0.0, -_SMALLEST_DOUBLE]))
        mask = builder.bitcast(outside, ir.IntType(4))
        return builder.icmp_unsigned("==", mask, ir.Constant(ir.IntType(4), 0))

    return types.boolean(rays, types.int64, types.float64, types.float64, types.float64), codegen


def _splat(builder, scalar):
    """Copy a scalar to all lanes."""
    empty = ir.Constant(_FOUR, ir.Undefined)
    vector = builder.insert_element(empty, scalar, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(vector, empty, ir.Constant(ir.VectorType(ir.IntType(32), 4), [0] * 4))


def _load(builder, data, offset):
    """Load four values, aligned like one."""
    vector = builder.load(builder.bitcast(builder.gep(data, [offset]), _FOUR.as_pointer()))
    vector.align = 8
    return vector


@kernel
def is_shadowed_by(rays, t, x, y, r):
    """Tell whether a sample is in the shadow frustum of triangle t."""
    return _inside_all(rays, t, x, y, r)


@kernel
def crossing(rays, t, x, y, r):
    """Where the ray to a sample meets the plane of a triangle that shadows it.

    Returns
    -------
    A share of the way from the light, or from the ray's start, to the sample; infinite for loose triangles, of which
    the planes do not tell.
    """
    if get(rays, "is_loose", t):
        return np.inf
    first, depth, w = ROW_SIZE * t + CAP_ROW, 1.0 / r, get(rays, "start_view", 3)
    a, b, d, c = (get(rays, "rows", first), get(rays, "rows", first + 4), get(rays, "rows", first + 8),
                  get(rays, "rows", first + 12))
    # Heights above the sample, in the row's own scale: of the triangle's plane, and of the ray's start
    plane = np.sqrt(a * a + b * b + d * d) * rays.bias - (a * x + (b * y + d) + c * r) * depth
    start = (a * (get(rays, "start_view", 0) - w * x * depth) + b * (get(rays, "start_view", 1) - w * y * depth)
             + d * (get(rays, "start_view", 2) - w * depth))
    return 1.0 - plane / start
