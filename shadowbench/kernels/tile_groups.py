"""Traversal of a tile tree by groups of shadow frusta (not in the papers; see `shadowbench.kernels.frustum_groups`).

A group's bounding frustum is walked down to the tiles whose children hold the samples; from there on its members are
tested. As in `shadowbench.kernels.tile_traversal` a worker owns a child of the root. Groups come after the frusta that
are walked by themselves, and skip what these have shadowed.
"""

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.group_frustum import GROUP_EYE_ROW, GROUP_ROW_SIZE
from shadowbench.kernels.lanes import (
    LANES,
    classify_boxes,
    classify_samples,
    count_bits,
    lowest_bit,
    outside_eye_planes,
    outside_group_planes,
    outside_wedge_planes,
)
from shadowbench.kernels.shadow_frustum import EYE_ROW, ROW_SIZE, WEDGE_ROW
from shadowbench.kernels.tile_traversal import (
    N_WORKERS,
    STACK_SIZE,
    close_tile,
    mark_full,
    outside_in_float64,
    pack,
    unpack,
)

FEWEST_LEVELS = 3
"""A group is tested at the root and at a tile below; its members at the samples' tiles."""

_ONE = np.uint64(1)


@kernel
def _root_part(tree, groups, alive, worker):
    """Test the root's children against a share of the groups."""
    n, occupied = len(alive), tree.occupied[0]
    for g in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        first = g * GROUP_ROW_SIZE
        met = occupied & ~outside_eye_planes(groups, first + 4 * GROUP_EYE_ROW, tree, tree.n_chunks, 0, 0, 0, 0, occupied)
        alive[g] = met & ~outside_group_planes(groups, first, tree, tree.n_chunks, 0, 0, 0, 0, met)


@parallel_kernel
def _test_root(tree, groups, alive):
    for worker in prange(N_WORKERS):
        _root_part(tree, groups, alive, worker)


@allocating_kernel
def _walk_groups(tree, frusta, groups, planes, alive_at_root, depth, shadow, worker, counts):
    """Walk all groups through the root's child `worker`."""
    root, level, last = tree.levels[0], tree.levels[1], len(tree.levels) - 1
    row, column = worker // root.grid_x, worker % root.grid_x
    if row >= level.rows or column >= level.columns:
        return
    tile_node, tile_bit = level.first + row * level.columns + column, _ONE << np.uint64(worker)
    stack, lanes = np.empty(STACK_SIZE, np.int64), tree.n_chunks * LANES
    start = pack(1, row, column)
    for g in range(len(alive_at_root)):
        if alive_at_root[g] & tile_bit == 0:
            continue
        if planes.skip_shadowed and shadow.open[tile_node] == 0:
            return
        stack[0], n_stacked, first = start, 1, g * GROUP_ROW_SIZE
        while n_stacked > 0:
            n_stacked -= 1
            index, row, column = unpack(stack[n_stacked])
            level = tree.levels[index]
            node = level.first + row * level.columns + column
            x0, y0, r0 = level.first_x + column * (2 * LANES), level.first_y + row * (2 * lanes), 2 * lanes * node
            candidates = shadow.open[node]
            met = candidates & ~outside_eye_planes(groups, first + 4 * GROUP_EYE_ROW, tree, tree.n_chunks, x0, 0, y0, r0,
                                                   candidates)
            met &= ~outside_group_planes(groups, first, tree, tree.n_chunks, x0, 0, y0, r0, met)
            if counts is not None:
                counts.group_visits[node] += 1
                counts.unit_visits[worker, g] += 1
            if index == last - 1:
                for k in range(groups.first[g], groups.first[g + 1]):
                    if shadow.open[node] & met == 0:
                        break
                    _test_member(tree, frusta, planes, index, row, column, k, met, depth, shadow, worker, counts)
                continue
            while met != 0:
                lane = lowest_bit(met)
                met &= met - _ONE
                stack[n_stacked] = pack(index + 1, row * level.grid_y + lane // level.grid_x,
                                        column * level.grid_x + lane % level.grid_x)
                n_stacked += 1


@kernel
def _test_member(tree, frusta, planes, index, row, column, k, met, depth, shadow, worker, counts):
    """Test a member against those children of a tile that its group meets, and against their samples."""
    level, below, lanes, first = tree.levels[index], tree.levels[index + 1], tree.n_chunks * LANES, k * ROW_SIZE
    node = level.first + row * level.columns + column
    x0, y0, r0 = level.first_x + column * (2 * LANES), level.first_y + row * (2 * lanes), 2 * lanes * node
    candidates = shadow.open[node] & met
    alive = candidates
    if planes.eye:
        alive &= ~outside_eye_planes(frusta, first + 4 * EYE_ROW, tree, tree.n_chunks, x0, 0, y0, r0, alive)
    if planes.wedge:
        alive &= ~outside_wedge_planes(frusta, first + 4 * WEDGE_ROW, tree, tree.n_chunks, x0, 0, y0, r0, alive)
    outside, partial = classify_boxes(frusta, first, tree, tree.n_chunks, x0, 0, y0, r0, alive)
    alive &= ~outside
    partial &= alive
    accepted = alive ^ partial
    if counts is not None:
        counts.visits[node] += 1
        counts.frustum_visits[worker, k] += 1
        counts.rejects[worker, index] += count_bits(candidates & ~alive)
        counts.accepts[worker, index] += count_bits(accepted)
        counts.refinements[worker, index] += count_bits(partial)
    if accepted != 0:
        mark_full(tree, shadow, index, row, column, accepted)
        if planes.skip_shadowed:
            shadow.open[node] &= ~accepted
            if shadow.open[node] == 0:
                close_tile(tree, shadow, index, row, column)
    while partial != 0:
        lane = lowest_bit(partial)
        partial &= partial - _ONE
        child_row, child_column = row * level.grid_y + lane // level.grid_x, column * level.grid_x + lane % level.grid_x
        tile = child_row * below.columns + child_column
        child = below.first + tile
        candidates = shadow.open[child]
        outside, unsure = classify_samples(frusta, first, tree, tree.n_chunks, below.first_x + child_column * (2 * LANES), 0,
                                           below.first_y + child_row * (2 * lanes), lanes * (2 * below.first + tile),
                                           candidates)
        closed = candidates & ~outside
        retried = closed & unsure
        if retried != 0:
            closed &= ~outside_in_float64(tree, frusta, k, child_row, child_column, retried, depth)
        shadow.samples[tile] |= closed
        if counts is not None:
            counts.visits[child] += 1
            counts.frustum_visits[worker, k] += 1
            counts.retries[worker] += count_bits(retried)
            counts.fruitful[worker, index] += np.int64(closed != 0)
        if planes.skip_shadowed and closed != 0:
            shadow.open[child] = candidates & ~closed
            if shadow.open[child] == 0:
                close_tile(tree, shadow, index + 1, child_row, child_column)


@parallel_kernel
def _traverse(n_tiles, tree, frusta, groups, planes, alive_at_root, depth, shadow, counts):
    for worker in prange(n_tiles):
        _walk_groups(tree, frusta, groups, planes, alive_at_root, depth, shadow, worker, counts)


def traverse_groups(tree, frusta, groups, planes, depth, shadow, counts):
    """Rasterise the frusta of all groups into the shadow buffer.

    Parameters
    ----------
    tree : the samples, of at least `FEWEST_LEVELS` levels.
    frusta : the casters; groups : bounding frusta of the last ones.
    planes, depth, shadow, counts : as for `tile_traversal.traverse`.
    """
    n_groups = len(groups.first) - 1
    if n_groups == 0 or tree.occupied[0] == 0:
        return
    alive = np.empty(n_groups, np.uint64)
    _test_root(tree, groups, alive)
    n_tiles = int(tree.levels[0]["grid_x"]) * int(tree.levels[0]["grid_y"])
    _traverse(n_tiles, tree, frusta, groups, planes, alive, depth, shadow, counts)
    if counts is not None:
        counts.group_visits[0] = n_groups
