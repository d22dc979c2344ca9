"""The shadow frusta that contain the eye: what z-pass must start from.

The papers call this unsolved, because they look at what the near plane cuts. Here the eye is tested against every
frustum, with the error bounds of its planes and a margin as wide as the small pyramid in front of the eye in which no
faces are drawn. A frustum is then *around* the pyramid as a whole, or *apart* from it as a whole, or it *touches* it.
The few that touch are left out of the volumes, and every sample is tested against them by definition.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.shadow_volumes import EDGE_ON, N_WORKERS, Casters, cap_plane, chunk, dot, side_plane

APART, AROUND, TOUCHING = 0, 1, 2
"""How a triangle's frustum lies to the eye."""

_N_PLANES = 4


class EyeVolumes(NamedTuple):
    """What z-pass starts from.

    Attributes
    ----------
    around : int64 (n,), triangles whose frusta contain the eye.
    touching : int64 (n,), triangles whose frusta touch the eye: their volumes are not drawn.
    casters : Casters without those that touch.
    n_tests : frusta that were tested.
    """

    around: NDArray[np.int64]
    touching: NDArray[np.int64]
    casters: Casters
    n_tests: int


@kernel
def _eye_state(triangle, adjacency, light, casters, bias, view, reach):
    """Decide how a frustum lies to the eye."""
    normal, behind, terms = cap_plane(adjacency, casters, triangle, view.eye)
    margin = EDGE_ON * terms + reach
    # The unbiased cap counts for "apart": faces between the two are drawn and taken away again
    if behind < -margin:
        return APART
    state = AROUND if behind - bias > margin else TOUCHING
    for k in range(3):
        edge = adjacency.triangle_edges[triangle, k]
        normal, value, terms = side_plane(adjacency, light, edge, view.eye)
        inside = -value * casters.facing[triangle] * adjacency.along[triangle, k]
        margin = EDGE_ON * terms + reach * np.sqrt(dot(normal, normal))
        if inside < -margin:
            return APART
        if not inside > margin:
            state = TOUCHING
    return state


@kernel
def _eye_chunk(worker, adjacency, light, casters, bias, view, reach, state):
    """Decide one worker's share of the triangles."""
    first, end = chunk(worker, len(state))
    for t in range(first, end):
        state[t] = APART
        if casters.facing[t] != 0:
            state[t] = _eye_state(t, adjacency, light, casters, bias, view, reach)


@parallel_kernel
def _all_eye_states(adjacency, light, casters, bias, view, reach, state):
    for worker in prange(N_WORKERS):
        _eye_chunk(np.int64(worker), adjacency, light, casters, bias, view, reach, state)


def _eye_states(adjacency, light, casters, bias, view):
    """Tell how every triangle's frustum lies to the eye, int8 (n_triangles,); APART for one that casts nothing."""
    state = np.empty(len(casters.facing), np.int8)
    # The farthest corner of the pyramid between the eye and the nearest faces, out to the guard planes
    reach = view.nearest * float(np.sqrt(1.0 + view.guard_x * view.guard_x + view.guard_y * view.guard_y))
    _all_eye_states(adjacency, light, casters, float(bias), view, reach, state)
    return state


def find_eye_volumes(adjacency, light: NDArray[np.float64], casters: Casters, bias: float, view,
                     robust: bool) -> EyeVolumes:
    """Test the eye against every shadow frustum.

    Parameters
    ----------
    adjacency : EdgeAdjacency of the mesh.
    light : float64 (4,), homogeneous, world.
    casters : Casters.
    bias : shadow bias, world units.
    view : VolumeView; faces are drawn from its `nearest` depth on.
    robust : False to test nothing, and start from zero.
    """
    if not robust:
        return EyeVolumes(np.empty(0, np.int64), np.empty(0, np.int64), casters, 0)
    state = _eye_states(adjacency, light, casters, bias, view)
    touching = np.flatnonzero(state == TOUCHING)
    facing = casters.facing.copy()
    facing[touching] = 0
    return EyeVolumes(np.flatnonzero(state == AROUND), touching, casters._replace(facing=facing),
                      int(np.count_nonzero(casters.facing)))


def eye_totals(eye: EyeVolumes, adjacency, light: NDArray[np.float64], casters: Casters, bias: float,
               view) -> dict[str, int]:
    """Counts of the eye's tests by name; parameters as in `find_eye_volumes`."""
    n_around = int(np.count_nonzero(_eye_states(adjacency, light, casters, bias, view) == AROUND))
    return {"eye_tests": eye.n_tests, "eye_volumes": n_around, "eye_volumes_ignored": n_around - len(eye.around)}


@kernel
def _frustum_planes(triangle, adjacency, light, casters, bias, view, planes):
    """Set up a frustum in view space: value at the eye and slopes of each plane; inside is f >= 0, for the cap > 0."""
    for k in range(_N_PLANES):
        if k < 3:
            edge = adjacency.triangle_edges[triangle, k]
            normal, value, _ = side_plane(adjacency, light, edge, view.eye)
            sign = -casters.facing[triangle] * adjacency.along[triangle, k]
        else:
            normal, value, _ = cap_plane(adjacency, casters, triangle, view.eye)
            sign, value = 1, value - bias
        planes[k, 0] = sign * value
        planes[k, 1], planes[k, 2] = sign * dot(normal, view.right), sign * dot(normal, view.up)
        planes[k, 3] = sign * dot(normal, view.forward)


@kernel
def _value(planes, k, x, down, depth):
    """Evaluate a plane of a frustum at a sample."""
    return planes[k, 0] + depth * (planes[k, 3] + x * planes[k, 1] - down * planes[k, 2])


@allocating_kernel
def _test_rows(worker, touching, adjacency, light, casters, bias, view, target):
    """Test one worker's share of the rows against the frusta that touch the eye."""
    first, end = chunk(worker, len(view.down))
    planes = np.empty((_N_PLANES, 4))
    for i in range(len(touching)):
        _frustum_planes(touching[i], adjacency, light, casters, bias, view, planes)
        for row in range(first, end):
            down = view.down[row]
            for column in range(len(view.x)):
                x, depth = view.x[column], target.depth[row, column]
                if (_value(planes, 3, x, down, depth) > 0.0 and _value(planes, 0, x, down, depth) >= 0.0
                        and _value(planes, 1, x, down, depth) >= 0.0 and _value(planes, 2, x, down, depth) >= 0.0):
                    target.stencil[row, column] += np.uint32(1)


@parallel_kernel
def add_touching(touching, adjacency, light, casters, bias, view, target):
    """Add 1 to the stencil value of every sample in each of the frusta that touch the eye.

    Parameters
    ----------
    touching : int64 (n,), triangles.
    adjacency, light, casters, bias, view : as in `find_eye_volumes`.
    target : StencilTarget, updated in place.
    """
    for worker in prange(N_WORKERS):
        _test_rows(np.int64(worker), touching, adjacency, light, casters, bias, view, target)
