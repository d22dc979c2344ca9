"""Traversal of a kd-tree by shadow rays, from the light to the sample, until any triangle shadows the sample.

Three traversals visit the same leaves in the same order:

``stack``       the far child of a node whose two children the ray meets waits on a stack.
``restart``     no stack (Foley and Sugerman 2005): after each leaf, descend again from the root.
``short_stack`` (Horn et al. 2007): a stack of `SHORT_STACK` entries, of which a push on a full one drops the oldest;
                when it runs empty, descend again, from the deepest node that holds the whole rest of the ray
                ("push-down").

**Restarts.** The papers restart with the ray's interval beginning where the last leaf ended. Cells here are widened, so
the intervals of two children overlap, and such a restart could lose a leaf that is met in an overlap alone. Instead a
bit per level notes where the far child is still to be visited, and another where it is being visited (Laine: "Restart
Trail for Stackless BVH Traversal", 2010).

**Conservative steps.** A ray is ``origin + t (target - origin)``, 0 <= t <= 1, in grid units. A plane at s is met at
t = (s - origin) / direction; the near child is entered if the ray's interval starts before t + m / |direction|, the
far one if it ends after t - m / |direction|, where m is `shadow_rays.MARGIN`, plus what the rounding of a far light or
eye adds. So a ray visits each leaf whose cell it passes within m, less the rounding of t. A triangle that shadows the
sample by the test of `shadow_rays`, if not loose, is met within one unit by the ray, at a distance of at least the bias
(less that unit) from the sample; the ray's end is drawn back accordingly, so that rays leave most surfaces untested
that they end on.

**Direction.** From the light outwards, rays that the conservative map shortens take the fewest steps: on the gate 22
nodes and 2.9 leaves a ray, against 26 and 3.6 from the sample towards the light; whole rays differ by 4 % either way.

**Where a ray ends.** A triangle that spans several leaves shadows the sample in each of them, also in those that the ray
leaves before it meets the triangle. It ends the ray only in a leaf whose interval does not end before the
`shadow_rays.crossing`; until then it is a deferred hit, and the ray goes on. So a ray that starts later, but before
all crossings, visits those leaves of the whole ray whose intervals do not end before its start, finds the same
triangle in the same leaf at the latest, and never visits more nodes. That comparison needs no tolerance of its
own: cells are widened by `shadow_rays.MARGIN`, of which the test (1), the clipping (`CLIP_MARGIN`) and the rounding of
the crossing (a quarter) leave a part. Should rounding, or a loose triangle, whose crossing is not known, still leave
a hit deferred to the end of the walk, the sample is in shadow all the same.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.elements import get, increment, put
from shadowbench.kernels.kdtree_build import MAX_DEPTH
from shadowbench.kernels.kdtree_walk import SHORT_STACK, Ray, RayCounts, walk, walk_again
from shadowbench.kernels.shadow_rays import FAR_ROUNDING, MARGIN, N_WORKERS, PARALLEL_LENGTH, is_shadowed_by

TILE = 8
"""Side of the blocks of samples that are traced one after the other: neighbouring rays use the same nodes."""

_SMALLEST = 2.0**-40
"""Components of a direction below this, in grid units over the whole ray, are set to it: far below `MARGIN`."""


class Start(NamedTuple):
    """Where rays start: float64 (n_samples,), as a share of the way from the light to the sample, whose length is
    `parallel_length` for a directional light."""

    share: np.ndarray


def empty_counts(n_samples):
    """Make counts that are all zero."""
    return RayCounts(*(np.zeros(n_samples, np.int32) for _ in range(3)))


class _Grid(NamedTuple):
    """The rays' frame in grid units.

    Attributes
    ----------
    origin : float64 (3,), origin of the rays' targets.
    parallel : True for a directional light.
    travel : float64 (3,), from a directional light's starting points to the targets.
    scale : grid units per world unit.
    margin : widening of cells.
    stop : distance from the sample within which nothing can shadow it.
    """

    origin: np.ndarray
    parallel: bool
    travel: np.ndarray
    scale: float
    margin: float
    stop: float


def trace(tree, rays, traced, start, traversal, columns, shadow, counts=None):
    """Trace shadow rays.

    Parameters
    ----------
    tree : `KdTree` of the mesh.
    rays : `ShadowRays`.
    traced : bool (n_samples,), the samples to trace a ray for.
    start : `Start`, or None to trace the whole way.
    traversal : ``stack``, ``short_stack`` or ``restart``.
    columns : samples in a row.
    shadow : float32 (n_samples,), set to 1 for samples in shadow, else left alone.
    counts : `RayCounts`, increased, or None.
    """
    origin = (rays.origin - tree.base) * tree.scale
    reach = rays.reach * tree.scale
    grid = _Grid(origin, bool(rays.travel.any()), rays.travel * parallel_length(rays) * tree.scale, tree.scale,
                 MARGIN + FAR_ROUNDING * reach, rays.bias * tree.scale)
    # One type of start for both cases halves the time that compiling takes
    start = Start(np.zeros(len(traced))) if start is None else start
    n_stack = {"stack": MAX_DEPTH + 1, "short_stack": SHORT_STACK, "restart": 0}[traversal]
    _trace_all(tree, rays, grid, traced, start, n_stack, columns, shadow, counts)


def parallel_length(rays):
    """Length of a directional light's rays, world units: from outside the scene to any sample."""
    return PARALLEL_LENGTH * rays.reach


@parallel_kernel
def _trace_all(tree, rays, grid, traced, start, n_stack, columns, shadow, counts):
    for worker in prange(N_WORKERS):
        _trace_part(tree, rays, grid, traced, start, n_stack, columns, shadow, counts, worker)


@allocating_kernel
def _trace_part(tree, rays, grid, traced, start, n_stack, columns, shadow, counts, worker):
    """Trace the rays of one worker's share of the tiles."""
    ray = Ray(np.empty(9), np.empty(MAX_DEPTH + 1, np.int64), np.empty(MAX_DEPTH + 1), np.empty(MAX_DEPTH + 1),
               np.empty(MAX_DEPTH + 1, np.int64))
    plane_x, plane_y, depth, rows = rays.plane_x, rays.plane_y, rays.depth, len(traced) // columns
    n_loose = len(rays.loose)
    tile_columns, tile_rows = (columns + TILE - 1) // TILE, (rows + TILE - 1) // TILE
    n_tiles = tile_columns * tile_rows
    for tile in range(n_tiles * worker // N_WORKERS, n_tiles * (worker + 1) // N_WORKERS):
        first_row, first_column = tile // tile_columns * TILE, tile % tile_columns * TILE
        for row in range(first_row, min(first_row + TILE, rows)):
            for column in range(first_column, min(first_column + TILE, columns)):
                i = row * columns + column
                if traced[i]:
                    begin, end = _set_up_ray(tree, rays, grid, i, get(start, "share", i), ray)
                    x, y, r = plane_x[i], plane_y[i], 1.0 / depth[i]
                    if n_stack > MAX_DEPTH:
                        hit = walk(tree, rays, ray, begin, end, x, y, r, i, counts)
                    else:
                        hit = walk_again(tree, rays, ray, n_stack, begin, end, x, y, r, i, counts)
                    if hit or _hits_loose(rays, n_loose, x, y, r, i, counts):
                        shadow[i] = 1.0


@kernel
def _hits_loose(rays, n_loose, x, y, r, i, counts):
    """Test a sample against the triangles that the tree is no guide to."""
    for k in range(n_loose):
        t = get(rays, "loose", k)
        if counts is not None:
            increment(counts, "tests", i)
        if is_shadowed_by(rays, t, x, y, r):
            return True
    return False


@kernel
def _set_up_ray(tree, rays, grid, i, begin, ray):
    """Fill in a ray's terms per axis and clip it to the root's cell.

    Returns
    -------
    Begin and end of its interval; the begin lies after the end if it misses the cell.
    """
    length, end = 0.0, 1.0
    for k in range(3):
        here = get(rays, "target", 3 * i + k) * grid.scale
        direction, origin = here, get(grid, "origin", k)
        if grid.parallel:
            direction, origin = get(grid, "travel", k), get(grid, "origin", k) + here - get(grid, "travel", k)
        length += direction * direction
        if abs(direction) < _SMALLEST:
            direction = _SMALLEST
        inverse = 1.0 / direction
        first, last = (-grid.margin - origin) * inverse, (get(tree, "high", k) + grid.margin - origin) * inverse
        begin, end = max(begin, min(first, last)), min(end, max(first, last))
        put(ray, "axis", k, origin)
        put(ray, "axis", 3 + k, inverse)
        put(ray, "axis", 6 + k, grid.margin * abs(inverse))
    if grid.stop > grid.margin:
        end = min(end, 1.0 - (grid.stop - grid.margin) / np.sqrt(length))
    return begin, end


