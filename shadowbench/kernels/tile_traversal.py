"""Traversal of a tile tree by shadow frusta.

Work is split by the root's children: a worker owns one of them with all that lies below, and takes the frusta in
order. The root itself is tested once per frustum, beforehand. So counts and shadows are those of a serial loop over
the frusta, for any number of threads.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.lanes import (
    LANES,
    classify_boxes,
    classify_samples,
    count_bits,
    lowest_bit,
    outside_eye_planes,
    outside_wedge_planes,
)
from shadowbench.kernels.shadow_frustum import EYE_ROW, ROW_SIZE, WEDGE_ROW, inside_in_float64

N_WORKERS = 64
"""Parts that the root tests are cut into."""

STACK_SIZE = 1024
"""A node leaves at most branching - 1 siblings per level: 63 * 7 levels, or 3 * 20."""

_COLUMN_BITS = 28      # a stack entry packs level, row and column


class Planes(NamedTuple):
    """Which culling planes to test, and whether to skip what is in shadow already."""

    eye: bool
    wedge: bool
    skip_shadowed: bool


class RootTests(NamedTuple):
    """Outcome of every frustum's test of the root's children, uint64 (n_frusta,).

    Attributes
    ----------
    alive : bits of the children that are not rejected.
    partial : bits of the children that are not certainly inside.
    """

    alive: np.ndarray
    partial: np.ndarray


@kernel
def _root_part(tree, frusta, planes, tests, worker):
    """Test the root's children against a share of the frusta."""
    n, occupied = len(tests.alive), tree.occupied[0]
    for k in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        first, alive = k * ROW_SIZE, occupied
        if planes.eye:
            alive &= ~outside_eye_planes(frusta, first + 4 * EYE_ROW, tree, tree.n_chunks, 0, 0, 0, 0, alive)
        if planes.wedge and alive != 0:
            alive &= ~outside_wedge_planes(frusta, first + 4 * WEDGE_ROW, tree, tree.n_chunks, 0, 0, 0, 0, alive)
        outside, partial = classify_boxes(frusta, first, tree, tree.n_chunks, 0, 0, 0, 0, alive)
        tests.alive[k], tests.partial[k] = alive & ~outside, partial


@parallel_kernel
def test_root(tree, frusta, planes, tests):
    """Test the root's children against all frusta."""
    for worker in prange(N_WORKERS):
        _root_part(tree, frusta, planes, tests, worker)


@kernel
def outside_in_float64(tree, frusta, k, row, column, undecided, depth):
    """Mask of those samples of a tile, among the undecided ones, that are not in the frustum."""
    level = tree.levels[-1]
    outside = np.uint64(0)
    while undecided != 0:
        lane = lowest_bit(undecided)
        bit = np.uint64(1) << np.uint64(lane)
        undecided ^= bit
        y, x = row * level.grid_y + lane // level.grid_x, column * level.grid_x + lane % level.grid_x
        r = 1.0 / depth[y * len(tree.plane_x) + x]
        if not inside_in_float64(frusta.exact_rows, k, tree.plane_x[x], tree.plane_y[y], r):
            outside |= bit
    return outside


@kernel
def mark_full(tree, shadow, index, row, column, accepted):
    """Mark the accepted children of a node."""
    level, below = tree.levels[index], tree.levels[index + 1]
    while accepted != 0:
        lane = lowest_bit(accepted)
        accepted ^= np.uint64(1) << np.uint64(lane)
        child_row, child_column = row * level.grid_y + lane // level.grid_x, column * level.grid_x + lane % level.grid_x
        shadow.full[below.first + child_row * below.columns + child_column] = 1


@kernel
def close_tile(tree, shadow, index, row, column):
    """Tell the ancestors below the root, as far as it matters, that a tile has nothing left to test."""
    while index > 1:
        index -= 1
        level = tree.levels[index]
        lane = row % level.grid_y * level.grid_x + column % level.grid_x
        row, column = row // level.grid_y, column // level.grid_x
        node = level.first + row * level.columns + column
        shadow.open[node] &= ~(np.uint64(1) << np.uint64(lane))
        if shadow.open[node] != 0:
            return


@kernel
def pack(index, row, column):
    """Pack a node into one integer."""
    return ((index << _COLUMN_BITS) + row << _COLUMN_BITS) + column


@kernel
def unpack(entry):
    """Undo `pack`."""
    low_bits = (1 << _COLUMN_BITS) - 1
    return entry >> 2 * _COLUMN_BITS, entry >> _COLUMN_BITS & low_bits, entry & low_bits


@kernel
def _push_root_child(tree, shadow, tests, planes, k, worker, stack):
    """Start the walk of frustum k below the root's child; returns the number of nodes stacked."""
    root, level = tree.levels[0], tree.levels[1]
    row, column = worker // root.grid_x, worker % root.grid_x
    if tests.partial[k] >> np.uint64(worker) & np.uint64(1) != 0:
        stack[0] = pack(1, row, column)
        return 1
    node = level.first + row * level.columns + column
    shadow.full[node] = 1
    if planes.skip_shadowed:
        shadow.open[node] = 0
    return 0


@allocating_kernel
def _traverse_tile(tree, frusta, planes, tests, depth, shadow, worker, counts):
    """Walk all frusta through the root's child `worker`.

    The loop calls functions with records only on rare paths: a call takes a reference count for each array in them.
    """
    root, level, last = tree.levels[0], tree.levels[1], len(tree.levels) - 1
    row, column = worker // root.grid_x, worker % root.grid_x
    if row >= level.rows or column >= level.columns:
        return
    tile_node = level.first + row * level.columns + column
    tile_bit = np.uint64(1) << np.uint64(worker)
    stack = np.empty(STACK_SIZE, np.int64)
    lanes = tree.n_chunks * LANES
    samples_r = 2 * lanes * tree.levels[last].first
    for k in range(len(tests.alive)):
        if tests.alive[k] & tile_bit == 0:
            if counts is not None and shadow.open[tile_node] != 0:
                counts.rejects[worker, 0] += 1
            continue
        if planes.skip_shadowed and shadow.open[tile_node] == 0:
            return
        n_stacked = _push_root_child(tree, shadow, tests, planes, k, worker, stack)
        if counts is not None:
            counts.refinements[worker, 0] += n_stacked
            counts.accepts[worker, 0] += 1 - n_stacked
        first = k * ROW_SIZE
        fruitful = np.uint64(0)      # a bit per level: its latest node has been counted; levels above hold the ancestors
        while n_stacked > 0:
            n_stacked -= 1
            index, row, column = unpack(stack[n_stacked])
            level = tree.levels[index]
            tile = row * level.columns + column
            node = level.first + tile
            x0, y0 = level.first_x + column * (2 * LANES), level.first_y + row * (2 * lanes)
            candidates = shadow.open[node]
            if counts is not None:
                counts.visits[node] += 1
                counts.frustum_visits[worker, k] += 1
            if index == last:
                # The tile's samples; what float32 leaves open is decided in float64
                r0 = samples_r + lanes * tile
                outside, unsure = classify_samples(frusta, first, tree, tree.n_chunks, x0, 0, y0, r0, candidates)
                closed = candidates & ~outside
                if closed & unsure != 0:
                    if counts is not None:
                        counts.retries[worker] += count_bits(closed & unsure)
                    closed &= ~outside_in_float64(tree, frusta, k, row, column, closed & unsure, depth)
                shadow.samples[tile] |= closed
            else:
                # The node's children: culling planes first, the frustum's own for those that survive
                r0, alive = 2 * lanes * node, candidates
                if planes.eye:
                    alive &= ~outside_eye_planes(frusta, first + 4 * EYE_ROW, tree, tree.n_chunks, x0, 0, y0, r0, alive)
                if planes.wedge:
                    alive &= ~outside_wedge_planes(frusta, first + 4 * WEDGE_ROW, tree, tree.n_chunks, x0, 0, y0, r0, alive)
                outside, partial = classify_boxes(frusta, first, tree, tree.n_chunks, x0, 0, y0, r0, alive)
                alive &= ~outside
                partial &= alive
                closed = alive ^ partial
                if counts is not None:
                    counts.rejects[worker, index] += count_bits(candidates & ~alive)
                    counts.accepts[worker, index] += count_bits(closed)
                    counts.refinements[worker, index] += count_bits(partial)
                if closed != 0:
                    mark_full(tree, shadow, index, row, column, closed)
                child_row, child_column = row * level.grid_y, column * level.grid_x
                while partial != 0:
                    lane = lowest_bit(partial)
                    partial &= partial - np.uint64(1)
                    stack[n_stacked] = pack(index + 1, child_row + lane // level.grid_x,
                                             child_column + lane % level.grid_x)
                    n_stacked += 1
            if counts is not None:
                fruitful &= (np.uint64(1) << np.uint64(index)) - np.uint64(1)
                above = index if closed != 0 else 0
                while above > 0 and fruitful >> np.uint64(above) & np.uint64(1) == 0:
                    fruitful |= np.uint64(1) << np.uint64(above)
                    above -= 1
                    counts.fruitful[worker, above] += 1
            if planes.skip_shadowed and closed != 0:
                shadow.open[node] = candidates & ~closed
                if candidates == closed:
                    close_tile(tree, shadow, index, row, column)


@parallel_kernel
def _traverse_tiles(n_tiles, tree, frusta, planes, tests, depth, shadow, counts):
    for worker in prange(n_tiles):
        _traverse_tile(tree, frusta, planes, tests, depth, shadow, worker, counts)


def traverse(tree, frusta, n_frusta, planes, depth, shadow, counts):
    """Rasterise frusta into the shadow buffer.

    Parameters
    ----------
    tree : the samples; frusta : the casters; n_frusta : how many of them, from the first on.
    planes : what to test and to skip.
    depth : float64 (n_samples,), of the samples row by row, for the decisions in float64.
    shadow : filled.
    counts : filled, or None for the build that does not count.
    """
    if n_frusta == 0 or tree.occupied[0] == 0:
        return
    tests = RootTests(np.empty(n_frusta, np.uint64), np.empty(n_frusta, np.uint64))
    test_root(tree, frusta, planes, tests)
    n_tiles = int(tree.levels[0]["grid_x"]) * int(tree.levels[0]["grid_y"])
    _traverse_tiles(n_tiles, tree, frusta, planes, tests, depth, shadow, counts)
    if counts is not None:
        counts.visits[0] = n_frusta
