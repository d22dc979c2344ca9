"""Traversal of a tile tree by the frusta of casters that let light through (Sintorn, Olsson, Assarsson 2011, sec. 3.2).

It follows `tile_traversal`: a worker owns one of the root's children, and takes the frusta in order, so products of floats
do not depend on threads. A tile inside a frustum is shaded as a whole; if its caster has a texture, or if chance decides,
the walk goes on below it without tests down to the samples.
"""

import numpy as np

from shadowbench.jit import allocating_kernel, parallel_kernel, prange
from shadowbench.kernels.lanes import (
    LANES,
    classify_boxes,
    classify_samples,
    count_bits,
    lowest_bit,
    outside_eye_planes,
    outside_wedge_planes,
)
from shadowbench.kernels.shadow_frustum import EYE_ROW, ROW_SIZE, WEDGE_ROW
from shadowbench.kernels.tile_traversal import (
    STACK_SIZE,
    RootTests,
    close_tile,
    outside_in_float64,
    pack,
    test_root,
    unpack,
)
from shadowbench.kernels.transparency import add_root_counts, shade_node, shade_samples

N_WORKERS = 64
"""Parts that the rows of the merge are cut into."""

_INSIDE = np.int64(1) << 62     # marks a stack entry that lies inside the frustum
_ONE = np.uint64(1)


@allocating_kernel
def _traverse_tile(tree, frusta, optics, planes, tests, depth, shadow, through, worker, counts):
    """Walk all frusta through the root's child `worker`."""
    root, level, last = tree.levels[0], tree.levels[1], len(tree.levels) - 1
    row, column = worker // root.grid_x, worker % root.grid_x
    if row >= level.rows or column >= level.columns:
        return
    tile_node, tile_bit = level.first + row * level.columns + column, _ONE << np.uint64(worker)
    tile_entry = pack(1, row, column)
    stack = np.empty(STACK_SIZE, np.int64)
    lanes = tree.n_chunks * LANES
    samples_r = 2 * lanes * tree.levels[last].first
    for k in range(len(tests.alive)):
        if planes.skip_shadowed and shadow.open[tile_node] == 0:
            return
        if tests.alive[k] & tile_bit == 0:
            if counts is not None:
                counts.root[worker, 1] += shadow.open[tile_node] != 0
            continue
        varies, first = optics.varies[optics.surface[k]], k * ROW_SIZE
        each_sample = varies or optics.by_chance
        stack[0], n_stacked = tile_entry, 1
        if tests.partial[k] & tile_bit == 0:
            stack[0] |= _INSIDE
            if counts is not None:
                counts.root[worker, 0] += 1
        elif counts is not None:
            counts.root[worker, 2] += 1
        fruitful = np.uint64(0)      # a bit per level: its latest node has been counted
        while n_stacked > 0:
            n_stacked -= 1
            entry = stack[n_stacked]
            index, row, column = unpack(entry & ~_INSIDE)
            level = tree.levels[index]
            tile = row * level.columns + column
            node = level.first + tile
            candidates, reached, partial = shadow.open[node], np.uint64(0), np.uint64(0)
            if entry & _INSIDE != 0:
                if not each_sample:
                    shade_node(optics, through, k, node)
                    if counts is not None:
                        counts.updates[node] += 1
                    continue
                reached = candidates
            else:
                x0, y0 = level.first_x + column * (2 * LANES), level.first_y + row * (2 * lanes)
                if counts is not None:
                    counts.visits[node] += 1
                    counts.frustum_visits[worker, k] += 1
                if index == last:
                    # The tile's samples; what float32 leaves open is decided in float64
                    outside, unsure = classify_samples(frusta, first, tree, tree.n_chunks, x0, 0, y0,
                                                       samples_r + lanes * tile, candidates)
                    reached = candidates & ~outside
                    if reached & unsure != 0:
                        if counts is not None:
                            counts.retries[node] += count_bits(reached & unsure)
                        reached &= ~outside_in_float64(tree, frusta, k, row, column, reached & unsure, depth)
                else:
                    # The node's children: culling planes first, the frustum's own for those that survive
                    r0, alive = 2 * lanes * node, candidates
                    if planes.eye:
                        alive &= ~outside_eye_planes(frusta, first + 4 * EYE_ROW, tree, tree.n_chunks, x0, 0, y0, r0,
                                                     alive)
                    if planes.wedge:
                        alive &= ~outside_wedge_planes(frusta, first + 4 * WEDGE_ROW, tree, tree.n_chunks, x0, 0, y0,
                                                       r0, alive)
                    outside, partial = classify_boxes(frusta, first, tree, tree.n_chunks, x0, 0, y0, r0, alive)
                    alive &= ~outside
                    partial &= alive
                    reached = alive ^ partial
                    if counts is not None:
                        counts.rejects[node] += count_bits(candidates & ~alive)
                        counts.accepts[node] += count_bits(reached)
                        counts.refinements[node] += count_bits(partial)
                if counts is not None:
                    # Note on all levels above that the latest refinement was of use
                    fruitful &= (_ONE << np.uint64(index)) - _ONE
                    above, tile_row, tile_column = index if reached != 0 else 0, row, column
                    while above > 0 and fruitful >> np.uint64(above) & _ONE == 0:
                        fruitful |= _ONE << np.uint64(above)
                        above -= 1
                        parent = tree.levels[above]
                        tile_row, tile_column = tile_row // parent.grid_y, tile_column // parent.grid_x
                        if above > 0:
                            counts.fruitful[parent.first + tile_row * parent.columns + tile_column] += 1
                        else:
                            counts.root[worker, 3] += 1
            if index == last:
                if reached != 0:
                    dark = shade_samples(optics, through, k, reached, column * level.grid_x, row * level.grid_y,
                                         level.grid_x, tree.plane_x, tree.plane_y, depth)
                    shadow.samples[tile] |= dark
                    if counts is not None:
                        counts.updates[node] += count_bits(reached)
                        counts.lookups[node] += count_bits(reached) if varies else 0
                    if planes.skip_shadowed and dark != 0:
                        shadow.open[node] = candidates & ~dark
                        if shadow.open[node] == 0:
                            close_tile(tree, shadow, index, row, column)
                continue
            child_row, child_column = row * level.grid_y, column * level.grid_x
            waiting = partial | reached
            while waiting != 0:
                lane = lowest_bit(waiting)
                waiting &= waiting - _ONE
                child = pack(index + 1, child_row + lane // level.grid_x, child_column + lane % level.grid_x)
                stack[n_stacked] = child if partial >> np.uint64(lane) & _ONE != 0 else child | _INSIDE
                n_stacked += 1


@parallel_kernel
def _traverse_tiles(n_tiles, tree, frusta, optics, planes, tests, depth, shadow, through, counts):
    for worker in prange(n_tiles):
        _traverse_tile(tree, frusta, optics, planes, tests, depth, shadow, through, worker, counts)


def traverse_transparent(tree, frusta, optics, planes, depth, shadow, through, counts):
    """Let transparent casters shade the samples, after the opaque ones.

    Parameters
    ----------
    tree : the samples; frusta : the transparent casters; optics : what they let through.
    planes : what to test and to skip.
    depth : float64 (n_samples,), of the samples row by row.
    shadow : says what is open, after the opaque casters; filled if chance decides.
    through : multiplied.
    counts : `transparency.ClearCounts` to fill, or None for the build that does not count.
    """
    n_frusta = len(optics.triangle)
    if n_frusta == 0 or tree.occupied[0] == 0:
        return
    tests = RootTests(np.empty(n_frusta, np.uint64), np.empty(n_frusta, np.uint64))
    test_root(tree, frusta, planes, tests)
    n_tiles = int(tree.levels[0]["grid_x"]) * int(tree.levels[0]["grid_y"])
    _traverse_tiles(n_tiles, tree, frusta, optics, planes, tests, depth, shadow, through, counts)
    if counts is not None:
        counts.visits[0] = n_frusta
        add_root_counts(counts)


@allocating_kernel
def _merge_rows(tree, through, dark, worker, arriving):
    """Multiply the samples of a band of tile rows with what their tiles let through."""
    level, n_columns, n_channels = tree.levels[-1], len(tree.plane_x), arriving.shape[1]
    share = np.empty(n_channels, np.float32)
    for row in range(level.rows * worker // N_WORKERS, level.rows * (worker + 1) // N_WORKERS):
        for column in range(level.columns):
            share[:] = 1.0
            tile_row, tile_column = row, column
            for index in range(len(tree.levels) - 1, 0, -1):
                here, above = tree.levels[index], tree.levels[index - 1]
                node = here.first + tile_row * here.columns + tile_column
                for channel in range(n_channels):
                    share[channel] *= through.nodes[node, channel]
                tile_row, tile_column = tile_row // above.grid_y, tile_column // above.grid_x
            for iy in range(min(level.grid_y, len(tree.plane_y) - row * level.grid_y)):
                first = (row * level.grid_y + iy) * n_columns + column * level.grid_x
                for sample in range(first, first + min(level.grid_x, n_columns - column * level.grid_x)):
                    for channel in range(n_channels):
                        value = through.samples[sample, channel] * share[channel]
                        arriving[sample, channel] = value if dark[sample] == 0 else 0.0


@parallel_kernel
def _merge(tree, through, dark, arriving):
    for worker in prange(N_WORKERS):
        _merge_rows(tree, through, dark, worker, arriving)


def merge_through(tree, through, dark):
    """Merge the levels downwards: float32 (n_samples, n_channels), share of the light that arrives at each sample; (0, 1)
    if chance decided.

    Parameters
    ----------
    dark : float32 (n_samples,), 1 for samples in the shadow of opaque casters.
    """
    arriving = np.empty_like(through.samples)
    if len(arriving) == 0:
        return arriving
    _merge(tree, through, dark, arriving)
    return arriving
