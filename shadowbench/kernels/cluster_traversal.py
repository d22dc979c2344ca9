"""Traversal of the cluster hierarchy by shadow frusta, in two passes (Sintorn et al. 2014, Algorithm 1 and sec. 2.2).

The first pass, `shadowbench.kernels.cluster_jobs`, walks every frustum down to the split level. The second takes the
nodes of that level apart: a worker owns one of them with all below it, and does its jobs in the order of the frusta. So
counts and shadows are those of a serial loop, for any number of threads.

Grouped frusta take both passes after those that are walked by themselves, with the parents of the clusters as split
level: down to there the group is tested, from there on its members.
"""

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.cluster_keys import TILE, TILE_SAMPLES
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
from shadowbench.kernels.shadow_frustum import EYE_ROW, ROW_SIZE, WEDGE_ROW, inside_in_float64

TILE_CHUNKS = TILE_SAMPLES // LANES
"""Chunks of lanes of a tile's samples."""

_STACK_SIZE = 256       # a node leaves at most 31 siblings per level, and there are up to 7 levels
_ONE = np.uint64(1)


@kernel
def _outside_in_float64(samples, leaves, cluster, exact_rows, k, undecided, depth):
    """Mask of those samples of a tile, among the undecided ones, that are not in the frustum."""
    outside, n_columns = np.uint64(0), len(samples.plane_x)
    first_x, first_y = leaves.x0[cluster], leaves.y0[cluster] // TILE
    while undecided != 0:
        lane = lowest_bit(undecided)
        bit = _ONE << np.uint64(lane)
        undecided ^= bit
        x, y = first_x + lane % TILE, first_y + lane // TILE
        if not inside_in_float64(exact_rows, k, samples.plane_x[x], samples.plane_y[y], 1.0 / depth[y * n_columns + x]):
            outside |= bit
    return outside


@kernel
def _mark_full(nodes, full, node, accepted):
    """Mark the accepted children of a node."""
    occupied = nodes.occupied[node]
    while accepted != 0:
        bit = accepted & (~accepted + _ONE)
        accepted ^= bit
        full[nodes.first_child[node] + count_bits(occupied & (bit - _ONE))] = 1


@kernel
def _close(nodes, open_children, node, top):
    """Tell the ancestors up to `top`, as far as it matters, that a node has nothing left to test."""
    while node != top:
        parent = nodes.parent[node]
        open_children[parent] &= ~(_ONE << np.uint64(nodes.lane[node]))
        if open_children[parent] != 0:
            return
        node = parent


@allocating_kernel
def _finish_node(nodes, leaves, samples, frusta, groups, rules, jobs, depth, shadow, counts, worker):
    """Do all jobs of a node of the split level.

    The loop calls functions with records only on rare paths: a call takes a reference count for each array in them.

    Parameters
    ----------
    groups : None if the units are frusta, or the groups' rows and where each group's frusta start.
    """
    top, n_inner = jobs.first_node + worker, len(nodes.first_child)
    stack = np.empty(_STACK_SIZE, np.int64)
    if rules.skip_shadowed and shadow.full[top] != 0:
        return
    for job in range(jobs.start[worker], jobs.start[worker + 1]):
        k, k_end, met = jobs.unit[job], jobs.unit[job] + 1, ~np.uint64(0)
        if groups is not None:
            # The top node's children that the group may meet, for all its members
            if top < n_inner:
                first, n_chunks, at = k * GROUP_ROW_SIZE, nodes.n_chunks[top], nodes.place[top]
                candidates = shadow.open[top]
                met = candidates & ~outside_eye_planes(groups, first + 4 * GROUP_EYE_ROW, nodes, n_chunks, at, LANES, at,
                                                       at, candidates)
                met &= ~outside_group_planes(groups, first, nodes, n_chunks, at, LANES, at, at, met)
                if counts is not None:
                    counts.visits[top] += 1
                    counts.group_tests[top] += count_bits(candidates)
                    counts.job_visits[job] += 1
                    counts.job_tests[job] += count_bits(candidates)
            k, k_end = groups.first[k], groups.first[k + 1]
        for frustum in range(k, k_end):
            if groups is not None and top < n_inner and shadow.open[top] & met == 0:
                break
            stack[0], n_stacked, first = top, 1, frustum * ROW_SIZE
            while n_stacked > 0:
                n_stacked -= 1
                node = stack[n_stacked]
                if node >= n_inner:
                    # The samples; what float32 leaves open is decided in float64
                    cluster = node - n_inner
                    candidates = shadow.waiting[cluster]
                    outside, unsure = classify_samples(frusta, first, samples, TILE_CHUNKS, leaves.x0[cluster], 0,
                                                       leaves.y0[cluster], leaves.r0[cluster], candidates)
                    closed = candidates & ~outside
                    n_tests = TILE_SAMPLES if rules.whole_tiles else count_bits(candidates)
                    if counts is not None:
                        counts.retries[node] += count_bits(closed & unsure)
                    if closed & unsure != 0:
                        closed &= ~_outside_in_float64(samples, leaves, cluster, frusta.exact_rows, frustum,
                                                       closed & unsure, depth)
                    shadow.samples[cluster] |= closed
                    if rules.skip_shadowed and closed != 0:
                        shadow.waiting[cluster] = candidates & ~closed
                        if candidates & ~closed & leaves.own[cluster] == 0:
                            _close(nodes, shadow.open, node, top)
                else:
                    # The node's children: culling planes first, the frustum's own for those that survive
                    candidates, n_chunks, at = shadow.open[node], nodes.n_chunks[node], nodes.place[node]
                    if groups is not None and node == top:
                        candidates &= met
                    alive = candidates
                    if rules.eye:
                        alive &= ~outside_eye_planes(frusta, first + 4 * EYE_ROW, nodes, n_chunks, at, LANES, at, at,
                                                     alive)
                    if rules.wedge:
                        alive &= ~outside_wedge_planes(frusta, first + 4 * WEDGE_ROW, nodes, n_chunks, at, LANES, at,
                                                       at, alive)
                    outside, partial = classify_boxes(frusta, first, nodes, n_chunks, at, LANES, at, at, alive)
                    alive &= ~outside
                    partial &= alive
                    closed = alive ^ partial
                    n_tests = count_bits(candidates)
                    if counts is not None:
                        counts.accepts[node] += count_bits(closed)
                        counts.rejects[node] += count_bits(candidates & ~alive)
                        counts.refinements[node] += count_bits(partial)
                    first_child, occupied = nodes.first_child[node], nodes.occupied[node]
                    while partial != 0:
                        bit = partial & (~partial + _ONE)
                        partial ^= bit
                        stack[n_stacked] = first_child + count_bits(occupied & (bit - _ONE))
                        n_stacked += 1
                    if closed != 0:
                        _mark_full(nodes, shadow.full, node, closed)
                        if rules.skip_shadowed:
                            shadow.open[node] &= ~closed
                            if shadow.open[node] == 0:
                                _close(nodes, shadow.open, node, top)
                if counts is not None:
                    counts.visits[node] += 1
                    counts.tests[node] += n_tests
                    counts.job_visits[job] += 1
                    counts.job_tests[job] += n_tests
            if rules.skip_shadowed and (shadow.open[top] if top < n_inner else
                                        shadow.waiting[top - n_inner] & leaves.own[top - n_inner]) == 0:
                return


@parallel_kernel
def _finish(n_nodes, nodes, leaves, samples, frusta, groups, rules, jobs, depth, shadow, counts):
    for worker in prange(n_nodes):
        _finish_node(nodes, leaves, samples, frusta, groups, rules, jobs, depth, shadow, counts, worker)


@kernel
def _update_open(nodes, leaves, shadow):
    """Tell all nodes which of their children have nothing left to test."""
    n_inner = len(nodes.first_child)
    for node in range(len(nodes.parent) - 1, 0, -1):
        if node < n_inner:
            over = shadow.open[node] == 0
        else:
            over = shadow.waiting[node - n_inner] & leaves.own[node - n_inner] == 0
        if over or shadow.full[node] != 0:
            shadow.open[nodes.parent[node]] &= ~(_ONE << np.uint64(nodes.lane[node]))


def finish(tree, samples, frusta, groups, rules, jobs, depth, shadow, counts):
    """Do all jobs of the first pass.

    Parameters
    ----------
    tree : nodes and leaves; samples : their coordinates.
    frusta : the casters.
    groups : None if a job's unit is a frustum, or the groups that they are.
    rules : what to test and to skip.
    depth : float64 (n_samples,), of the samples row by row, for the decisions in float64.
    shadow : filled, and afterwards up to date on all levels.
    counts : `Counts` to fill, or None for the build that does not count.

    Returns
    -------
    int32 and int64 (n_jobs,), the visits and tests of each job; None if not counting.
    """
    nodes, leaves = tree
    if counts is not None:
        counts = counts._replace(job_visits=np.zeros(len(jobs.unit), np.int32),
                                 job_tests=np.zeros(len(jobs.unit), np.int64))
    _finish(len(jobs.start) - 1, nodes, leaves, samples, frusta, groups, rules, jobs, depth, shadow, counts)
    if rules.skip_shadowed:
        _update_open(nodes, leaves, shadow)
    return None if counts is None else (counts.job_visits, counts.job_tests)
