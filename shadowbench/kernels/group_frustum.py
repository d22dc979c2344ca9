"""The bounding frustum of a group of shadow frusta, as plane rows in proj space.

It is the set of points that the light sees through a rectangle of light space and beyond its nearest depth: four side
planes, a cap plane, and the planes through the eye that bound its outline.

**Why it rejects no sample of a member.** Exactly computed, the rectangle encloses every member (see `frustum_groups`). Let R
be the largest 1 / depth of a sample, l the longest ray at depth 1, and D the light's distance from the eye (for a
directional light, how far vertices and eye are from the origin). A rounded row's value at a sample, over its depth, is then
wrong by at most ``ROUNDING (D R + l)`` times the length of the normal. Rows are moved outwards by `SLACK`, and a row that
this does not cover is left out. The planes through the eye have that from `eye_planes`.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.culling_planes import SLACK, UNUSED, Space, row_in_proj, tolerance_growth
from shadowbench.kernels.eye_planes import store_eye_planes
from shadowbench.kernels.frustum_groups import light_coordinates
from shadowbench.kernels.lanes import N_EYE_PLANES, N_GROUP_PLANES
from shadowbench.kernels.vectors import add, corner, dot, item, minus, scaled, store_row, vector

GROUP_EYE_ROW = N_GROUP_PLANES
"""First row of the planes through the eye, after the side planes and the cap plane."""

N_GROUP_ROWS = GROUP_EYE_ROW + N_EYE_PLANES

GROUP_ROW_SIZE = 4 * N_GROUP_ROWS
"""float32 values per group."""

N_WORKERS = 64
"""Parts that the groups are cut into."""

GROUP_EDGES = np.array([[0, 4, 3, 0], [1, 5, 0, 1], [2, 6, 1, 2], [3, 7, 2, 3],
                        [0, 8, 0, 4], [1, 9, 1, 4], [2, 8, 2, 4], [3, 9, 3, 4],
                        [4, 8, 0, 5], [5, 9, 1, 5], [6, 8, 2, 5], [7, 9, 3, 5]])
"""Edges of a bounding frustum, as `culling_planes.EDGES`: rays of light, edges of the cap, and their likes at infinity.

Directions 0 to 3 are the vertices, 4 to 7 the rays there, 8 and 9 the axes of the rectangle. Faces 0 to 3 are the sides,
4 is the cap, 5 the face at infinity."""

ROUNDING = 2.0**-48
"""Bounds the relative float64 error of a row: a quotient, six products and sums, and the axes' own rounding; 16 times."""

class Groups(NamedTuple):
    """The bounding frusta of all groups.

    Attributes
    ----------
    rows : float32 (n_groups * GROUP_ROW_SIZE,), scaled as `lanes` asks.
    first : int64 (n_groups + 1,), the frusta of each group.
    """

    rows: np.ndarray
    first: np.ndarray


@kernel
def _row(m, c, error, space):
    """Row of a plane moved outwards, or `UNUSED` if that does not cover the rounding."""
    row, weight = row_in_proj(m, c, space)
    if not error * np.sqrt(dot(m, m)) <= SLACK * weight:
        return UNUSED
    scale = 1.0 / weight
    return row[0] * scale, row[1] * scale, row[2] * scale, row[3] * scale - SLACK


@kernel
def _unit(v):
    length = np.sqrt(dot(v, v))
    return scaled(v, 1.0 / length if length > 0.0 else 0.0), length


@allocating_kernel
def _group_part(corners, units, faces, view, groups, worker):
    """Write the rows of a share of the groups."""
    light = view.light[0], view.light[1], view.light[2], view.light[3]
    space = Space(vector(view.eye), vector(view.right), vector(view.up), vector(view.forward), light, view.bias,
                  vector(view.reach))
    order, first, face, rows = units.order, units.first, units.face, groups.rows
    axes_u, axes_v, axes_w, n = faces.u, faces.v, faces.w, len(units.face)
    longest_ray = np.sqrt(1.0 + space.reach[0] * space.reach[0] + space.reach[1] * space.reach[1])
    directions = np.zeros((10, 3))
    starts, alongs = np.zeros(len(GROUP_EDGES) + 1, np.int64), np.zeros(len(GROUP_EDGES) + 1, np.int64)
    for g in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        u, v, w = item(axes_u, face[g]), item(axes_v, face[g]), item(axes_w, face[g])
        # Enclose all vertices
        u0 = v0 = w0 = np.inf
        u1 = v1 = -np.inf
        farthest = 0.0
        for k in range(first[units.n_single + g], first[units.n_single + g + 1]):
            for j in range(3):
                point = corner(corners, order[k], j)
                pu, pv, pw = light_coordinates(point, u, v, w, light)
                u0, u1, v0, v1, w0 = min(u0, pu), max(u1, pu), min(v0, pv), max(v1, pv), min(w0, pw)
                farthest = max(farthest, abs(point[0]) + abs(point[1]) + abs(point[2]))
        directional = light[3] == 0.0
        origin = (0.0, 0.0, 0.0) if directional else (light[0], light[1], light[2])
        eye = minus(space.eye, origin)
        error = ROUNDING * (longest_ray + space.reach[2] * (abs(eye[0]) + abs(eye[1]) + abs(eye[2])
                                                            + (farthest if directional else 0.0)))
        # Side i runs from corner i to the next; corners (u0, v0), (u1, v0), (u1, v1), (u0, v1)
        k = 0.0 if directional else 1.0
        m0, m1 = minus(scaled(w, k * v0), v), minus(u, scaled(w, k * u1))
        m2, m3 = minus(v, scaled(w, k * v1)), minus(scaled(w, k * u0), u)
        k = 1.0 if directional else 0.0
        c0, c1 = dot(m0, eye) + k * v0, dot(m1, eye) - k * u1
        c2, c3 = dot(m2, eye) - k * v1, dot(m3, eye) + k * u0
        height = w0 - dot(w, eye)
        place = g * N_GROUP_ROWS
        for row, plane in enumerate(((m0, c0), (m1, c1), (m2, c2), (m3, c3), (scaled(w, -1.0), height))):
            store_row(rows, place + row, _row(plane[0], plane[1], error, space))
        # Outline: vertices of the cap and rays of light, seen from the eye, and the directions of the cap's edges
        largest_v = largest_e = 0.0
        for i in range(4):
            across = add(scaled(u, u0 if i == 0 or i == 3 else u1), scaled(v, v0 if i < 2 else v1))
            ray = w if directional else add(w, across)
            offset = add(scaled(w, w0), across) if directional else scaled(ray, w0)
            vertex, length = _unit(minus(offset, eye))
            direction, reach = _unit(ray)
            largest_v, largest_e = max(largest_v, length), max(largest_e, w0 * reach)
            store_row(directions, i, vertex)
            store_row(directions, 4 + i, direction)
        store_row(directions, 8, u)
        store_row(directions, 9, v)
        growth = tolerance_growth(largest_v, largest_e, w0, space)
        outside = (np.int64(c0 > 0.0) | np.int64(c1 > 0.0) << 1 | np.int64(c2 > 0.0) << 2 | np.int64(c3 > 0.0) << 3
                   | np.int64(height > 0.0) << 4)
        n_chosen = 0
        for edge in range(len(GROUP_EDGES)):
            starts[n_chosen], alongs[n_chosen] = GROUP_EDGES[edge, 0], GROUP_EDGES[edge, 1]
            n_chosen += (outside >> GROUP_EDGES[edge, 2] ^ outside >> GROUP_EDGES[edge, 3]) & 1
        store_eye_planes(rows, place + GROUP_EYE_ROW, directions, starts, alongs, n_chosen, 8, growth,
                         (space.right, space.up, space.forward), space.reach)


@parallel_kernel
def _fill_rows(corners, units, faces, view, groups):
    for worker in prange(N_WORKERS):
        _group_part(corners, units, faces, view, groups, worker)


def make_groups(corners, units, faces, view):
    """Set up the bounding frusta of all groups.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.
    units, faces : from `group_triangles`.
    view : as for `make_frusta`.
    """
    groups = Groups(np.empty(len(units.face) * GROUP_ROW_SIZE, np.float32), units.first[units.n_single:].copy())
    _fill_rows(corners, units, faces, view, groups)
    return groups


def needed_members(groups, needed):
    """Find the members of the groups that are needed.

    Parameters
    ----------
    needed : int32 (n,), numbers of groups, repeats allowed.

    Returns
    -------
    int64, which of the grouped frusta belong to these groups; and the groups with places among these alone.
    """
    lengths = np.diff(groups.first)
    kept = np.zeros(len(lengths), np.bool_)
    kept[needed] = True
    members = np.flatnonzero(np.repeat(kept, lengths))
    return members, Groups(groups.rows, np.concatenate([[0], np.cumsum(np.where(kept, lengths, 0))]))
