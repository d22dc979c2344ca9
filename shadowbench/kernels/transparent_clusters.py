"""Traversal of the cluster hierarchy by the frusta of casters that let light through.

The rules of transparent shadows (Sintorn, Olsson, Assarsson 2011, sec. 3.2) on the tree of Sintorn et al. 2014. A worker
owns one of the root's children with all below it, and takes the frusta in order, so products of floats do not depend on
threads. A leaf tests all samples of its tile if the method does, but shades its own alone: a sample is shaded once.
"""

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.cluster_keys import TILE, TILE_SAMPLES
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
from shadowbench.kernels.tile_traversal import RootTests
from shadowbench.kernels.transparency import add_root_counts, shade_node, shade_samples

N_WORKERS = 64
"""Parts that the frusta's root tests, and the clusters of the merge, are cut into."""

_TILE_CHUNKS = TILE_SAMPLES // LANES
_STACK_SIZE = 256       # a node leaves at most 31 siblings per level, and there are up to 7 levels
_INSIDE = np.int64(1) << 62     # marks a stack entry that lies inside the frustum
_ONE = np.uint64(1)


@kernel
def _test_children(nodes, node, frusta, first, rules, candidates):
    """Masks of a node's children that the frustum does not miss, and of those of them that it does not surely hold."""
    n_chunks, at, alive = nodes.n_chunks[node], nodes.place[node], candidates
    if rules.eye:
        alive &= ~outside_eye_planes(frusta, first + 4 * EYE_ROW, nodes, n_chunks, at, LANES, at, at, alive)
    if rules.wedge:
        alive &= ~outside_wedge_planes(frusta, first + 4 * WEDGE_ROW, nodes, n_chunks, at, LANES, at, at, alive)
    outside, partial = classify_boxes(frusta, first, nodes, n_chunks, at, LANES, at, at, alive)
    alive &= ~outside
    return alive, partial & alive


@kernel
def _root_part(nodes, frusta, rules, tests, worker):
    n = len(tests.alive)
    for k in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        tests.alive[k], tests.partial[k] = _test_children(nodes, 0, frusta, k * ROW_SIZE, rules, nodes.occupied[0])


@parallel_kernel
def _test_root(nodes, frusta, rules, tests):
    for worker in prange(N_WORKERS):
        _root_part(nodes, frusta, rules, tests, worker)


@kernel
def _close(nodes, open_children, node):
    """Tell the ancestors below the root, as far as it matters, that a node has nothing left to test."""
    while nodes.parent[node] > 0:
        parent = nodes.parent[node]
        open_children[parent] &= ~(_ONE << np.uint64(nodes.lane[node]))
        if open_children[parent] != 0:
            return
        node = parent


@kernel
def _test_tile(samples, leaves, cluster, frusta, k, candidates, depth):
    """Masks of a tile's samples that are in the frustum, and of those decided in float64."""
    outside, unsure = classify_samples(frusta, k * ROW_SIZE, samples, _TILE_CHUNKS, leaves.x0[cluster], 0,
                                       leaves.y0[cluster], leaves.r0[cluster], candidates)
    inside = candidates & ~outside
    retried = inside & unsure
    waiting, first_x, first_y = retried, leaves.x0[cluster], leaves.y0[cluster] // TILE
    while waiting != 0:
        lane = lowest_bit(waiting)
        waiting &= waiting - _ONE
        x, y = first_x + lane % TILE, first_y + lane // TILE
        if not inside_in_float64(frusta.exact_rows, k, samples.plane_x[x], samples.plane_y[y],
                                 1.0 / depth[y * len(samples.plane_x) + x]):
            inside &= ~(_ONE << np.uint64(lane))
    return inside, retried


@allocating_kernel
def _traverse_child(nodes, leaves, samples, frusta, optics, rules, tests, depth, shadow, through, worker, counts):
    """Walk all frusta through the root's child `worker`."""
    top, n_inner = nodes.first_child[0] + worker, len(nodes.first_child)
    top_bit = _ONE << np.uint64(nodes.lane[top])
    stack = np.empty(_STACK_SIZE, np.int64)
    if rules.skip_shadowed and shadow.open[0] & top_bit == 0:
        return
    for k in range(len(tests.alive)):
        if rules.skip_shadowed and (shadow.open[top] if top < n_inner else
                                    shadow.waiting[top - n_inner] & leaves.own[top - n_inner]) == 0:
            return
        if tests.alive[k] & top_bit == 0:
            if counts is not None:
                counts.root[worker, 1] += 1
            continue
        varies, first = optics.varies[optics.surface[k]], k * ROW_SIZE
        each_sample = varies or optics.by_chance
        stack[0], n_stacked = top, 1
        if tests.partial[k] & top_bit == 0:
            stack[0] |= _INSIDE
        if counts is not None:
            counts.root[worker, 0] += tests.partial[k] & top_bit == 0
            counts.root[worker, 2] += tests.partial[k] & top_bit != 0
        while n_stacked > 0:
            n_stacked -= 1
            entry = stack[n_stacked]
            node, is_inside = entry & ~_INSIDE, entry & _INSIDE != 0
            if is_inside and not each_sample:
                shade_node(optics, through, k, node)
                if counts is not None:
                    counts.updates[node] += 1
                continue
            if node >= n_inner:
                # The samples: those of the whole tile are tested, those of the cluster are shaded
                cluster = node - n_inner
                waiting = shadow.waiting[cluster]
                reached = waiting & leaves.own[cluster]
                if not is_inside:
                    reached, retried = _test_tile(samples, leaves, cluster, frusta, k, waiting, depth)
                    reached &= leaves.own[cluster]
                    if counts is not None:
                        n_tests = TILE_SAMPLES if rules.whole_tiles else count_bits(waiting)
                        counts.visits[node] += 1
                        counts.tests[node] += n_tests
                        counts.retries[node] += count_bits(retried)
                        counts.frustum_visits[worker, k] += 1
                        counts.frustum_tests[worker, k] += n_tests
                if reached == 0:
                    continue
                dark = shade_samples(optics, through, k, reached, leaves.x0[cluster], leaves.y0[cluster] // TILE, TILE,
                                     samples.plane_x, samples.plane_y, depth)
                shadow.samples[cluster] |= dark
                if counts is not None:
                    counts.updates[node] += count_bits(reached)
                    counts.lookups[node] += count_bits(reached) if varies else 0
                if rules.skip_shadowed and dark != 0:
                    shadow.waiting[cluster] = waiting & ~dark
                    if waiting & ~dark & leaves.own[cluster] == 0:
                        _close(nodes, shadow.open, node)
                continue
            candidates = shadow.open[node]
            alive, partial = candidates, np.uint64(0)
            if not is_inside:
                alive, partial = _test_children(nodes, node, frusta, first, rules, candidates)
                if counts is not None:
                    n_tests = count_bits(candidates)
                    counts.visits[node] += 1
                    counts.tests[node] += n_tests
                    counts.accepts[node] += count_bits(alive & ~partial)
                    counts.rejects[node] += count_bits(candidates & ~alive)
                    counts.refinements[node] += count_bits(partial)
                    counts.frustum_visits[worker, k] += 1
                    counts.frustum_tests[worker, k] += n_tests
            first_child, occupied = nodes.first_child[node], nodes.occupied[node]
            while alive != 0:
                bit = alive & (~alive + _ONE)
                alive ^= bit
                child = np.int64(first_child + count_bits(occupied & (bit - _ONE)))
                stack[n_stacked] = child if partial & bit != 0 else child | _INSIDE
                n_stacked += 1


@parallel_kernel
def _traverse(n_children, nodes, leaves, samples, frusta, optics, rules, tests, depth, shadow, through, counts):
    for worker in prange(n_children):
        _traverse_child(nodes, leaves, samples, frusta, optics, rules, tests, depth, shadow, through, worker, counts)


def traverse_transparent(tree, samples, frusta, optics, rules, depth, shadow, through, counts):
    """Let transparent casters shade the samples, after the opaque ones.

    Parameters
    ----------
    tree : nodes and leaves; samples : their coordinates.
    frusta : the transparent casters; optics : what they let through.
    rules : what to test and to skip.
    depth : float64 (n_samples,), of the samples row by row.
    shadow : says what is open, after the opaque casters; filled if chance decides.
    through : multiplied.
    counts : `transparency.ClearCounts` to fill, one worker per child of the root, or None for the build that does not
        count.
    """
    nodes, leaves = tree
    n_frusta, n_children = len(optics.triangle), root_children(nodes)
    if n_frusta == 0:
        return
    tests = RootTests(np.empty(n_frusta, np.uint64), np.empty(n_frusta, np.uint64))
    _test_root(nodes, frusta, rules, tests)
    _traverse(n_children, nodes, leaves, samples, frusta, optics, rules, tests, depth, shadow, through, counts)
    if counts is not None:
        counts.visits[0] += n_frusta
        counts.tests[0] += n_frusta * n_children
        add_root_counts(counts)


def root_children(nodes):
    """How many children the root has."""
    return int(nodes.first[2] - nodes.first[1])


@kernel
def _spread(nodes, through):
    """Multiply every node with what its parent lets through."""
    for node in range(1, len(nodes.parent)):
        for channel in range(through.nodes.shape[1]):
            through.nodes[node, channel] *= through.nodes[nodes.parent[node], channel]


@kernel
def _merge_part(n_inner, leaves, samples, through, dark, worker, arriving):
    """Multiply the samples of a share of the clusters with what their cluster lets through."""
    n = len(leaves.own)
    for cluster in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        own, first_x, first_y = leaves.own[cluster], leaves.x0[cluster], leaves.y0[cluster] // TILE
        while own != 0:
            lane = lowest_bit(own)
            own &= own - _ONE
            sample = (first_y + lane // TILE) * len(samples.plane_x) + first_x + lane % TILE
            for channel in range(arriving.shape[1]):
                value = through.samples[sample, channel] * through.nodes[n_inner + cluster, channel]
                arriving[sample, channel] = value if dark[sample] == 0 else 0.0


@parallel_kernel
def _merge(n_inner, leaves, samples, through, dark, arriving):
    for worker in prange(N_WORKERS):
        _merge_part(n_inner, leaves, samples, through, dark, worker, arriving)


def merge_through(tree, samples, through, dark):
    """Merge the levels downwards: float32 (n_samples, n_channels), share of the light that arrives at each sample; (0, 1)
    if chance decided.

    Parameters
    ----------
    dark : float32 (n_samples,), 1 for samples in the shadow of opaque casters.
    """
    nodes, leaves = tree
    arriving = np.ones_like(through.samples)
    if len(arriving) == 0:
        return arriving
    _spread(nodes, through)
    _merge(len(nodes.first_child), leaves, samples, through, dark, arriving)
    return arriving
