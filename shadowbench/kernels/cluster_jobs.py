"""First pass of the traversal of clusters: everything is walked down to the split level (Sintorn et al. 2014, sec. 2.2).

What is walked is a frustum, or the bounding frustum of a group: a unit. A job is a unit and a node of the split level
that it meets.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.cluster_shadow import spread
from shadowbench.kernels.group_frustum import GROUP_EYE_ROW, GROUP_ROW_SIZE
from shadowbench.kernels.lanes import (
    LANES,
    classify_boxes,
    count_bits,
    outside_eye_planes,
    outside_group_planes,
    outside_wedge_planes,
)
from shadowbench.kernels.shadow_frustum import EYE_ROW, ROW_SIZE, WEDGE_ROW

N_WORKERS = 64
"""Parts that the units are cut into."""

JOBS_PER_UNIT = 8
"""Jobs that there is room for at first, on average over a part."""

_STACK_SIZE = 256       # a node leaves at most 31 siblings per level, and there are up to 7 levels
_ONE = np.uint64(1)


class Rules(NamedTuple):
    """Which culling planes to test, and whether to skip what is in shadow already."""

    eye: bool
    wedge: bool
    skip_shadowed: bool
    whole_tiles: bool


class Jobs(NamedTuple):
    """What the second pass has to do: units by node of the split level.

    Attributes
    ----------
    first_node : the first node of the split level.
    start : int64 (n_split_nodes + 1,), where each node's jobs start.
    unit : int32 (n_jobs,), increasing for each node.
    """

    first_node: int
    start: np.ndarray
    unit: np.ndarray


class ExpandCounts(NamedTuple):
    """Operation counts of the first pass: int64 (N_WORKERS, nodes above the split level), and by unit.

    Attributes
    ----------
    visits : times that a node's children were tested; tests : children tested.
    accepts, rejects, refinements : a node's children wholly inside a frustum, outside one of its planes, and neither.
    unit_visits : int32 (n_units,), nodes visited; unit_tests : int64 (n_units,), children tested.
    """

    visits: np.ndarray
    tests: np.ndarray
    accepts: np.ndarray
    rejects: np.ndarray
    refinements: np.ndarray
    unit_visits: np.ndarray
    unit_tests: np.ndarray


class _Expanded(NamedTuple):
    """Jobs as the first pass finds them: a stretch of the arrays per part; `count` may exceed it."""

    node: np.ndarray
    unit: np.ndarray
    start: np.ndarray
    count: np.ndarray


@allocating_kernel
def _expand_part(n_units, nodes, frusta, groups, rules, split_level, expanded, shadow, counts, worker):
    """Walk a share of the units down to the split level: frusta, or groups; the other is None.

    Frusta test all children and mark those that they enclose: no part can know what another has found. Groups come
    when the frusta that are walked by themselves are done, and skip what these have shadowed.
    """
    first_job_node, full = nodes.first[split_level], shadow.full
    place, end = expanded.start[worker], expanded.start[worker + 1]
    stack = np.empty(_STACK_SIZE, np.int64)
    for unit in range(n_units * worker // N_WORKERS, n_units * (worker + 1) // N_WORKERS):
        stack[0], n_stacked = 0, 1
        while n_stacked > 0:
            n_stacked -= 1
            node = stack[n_stacked]
            n_chunks, at, occupied = nodes.n_chunks[node], nodes.place[node], nodes.occupied[node]
            candidates, alive, accepted = occupied, occupied, np.uint64(0)
            if groups is not None:
                first, candidates = unit * GROUP_ROW_SIZE, shadow.open[node]
                alive = candidates & ~outside_eye_planes(groups, first + 4 * GROUP_EYE_ROW, nodes, n_chunks, at, LANES,
                                                         at, at, candidates)
                alive &= ~outside_group_planes(groups, first, nodes, n_chunks, at, LANES, at, at, alive)
            if frusta is not None:
                first = unit * ROW_SIZE
                if rules.eye:
                    alive &= ~outside_eye_planes(frusta, first + 4 * EYE_ROW, nodes, n_chunks, at, LANES, at, at, alive)
                if rules.wedge:
                    alive &= ~outside_wedge_planes(frusta, first + 4 * WEDGE_ROW, nodes, n_chunks, at, LANES, at, at,
                                                   alive)
                outside, partial = classify_boxes(frusta, first, nodes, n_chunks, at, LANES, at, at, alive)
                alive &= ~outside
                accepted = alive & ~partial
            if counts is not None:
                counts.visits[worker, node] += 1
                counts.tests[worker, node] += count_bits(candidates)
                counts.accepts[worker, node] += count_bits(accepted)
                counts.rejects[worker, node] += count_bits(candidates & ~alive)
                counts.refinements[worker, node] += count_bits(alive & ~accepted)
                counts.unit_visits[unit] += 1
                counts.unit_tests[unit] += count_bits(candidates)
            while alive != 0:
                bit = alive & (~alive + _ONE)
                alive ^= bit
                child = nodes.first_child[node] + count_bits(occupied & (bit - _ONE))
                if accepted & bit != 0:
                    full[child] = 1
                elif child >= first_job_node:
                    if place < end:
                        expanded.node[place], expanded.unit[place] = child, unit
                    place += 1
                else:
                    stack[n_stacked] = child
                    n_stacked += 1
    expanded.count[worker] = place - expanded.start[worker]


@parallel_kernel
def _expand(n_units, nodes, frusta, groups, rules, split_level, expanded, shadow, counts):
    for worker in prange(N_WORKERS):
        _expand_part(n_units, nodes, frusta, groups, rules, split_level, expanded, shadow, counts, worker)


@kernel
def _sort_jobs(expanded, first_node, next_place, unit):
    """Deal out the jobs by node, part by part, so that the units keep their order."""
    for worker in range(N_WORKERS):
        for i in range(expanded.start[worker], expanded.start[worker] + expanded.count[worker]):
            node = expanded.node[i] - first_node
            unit[next_place[node]] = expanded.unit[i]
            next_place[node] += 1


def expand(n_units, nodes, frusta, groups, rules, split_level, shadow, counts):
    """Find all jobs.

    Parameters
    ----------
    n_units : number of frusta, or of groups, to walk.
    nodes : the tree; frusta : the casters, or None with groups; rules : what to test.
    groups : None, or the bounding frusta of the groups.
    split_level : 1 to the level of the clusters.
    shadow : nodes down to the split level that lie wholly in one frustum are marked.
    counts : `Counts` to add to, or None for the build that does not count.

    Returns
    -------
    The jobs; int32 and int64 (n_units,), visits and tests of each unit, or None if not counting.
    """
    first_node, n_nodes = int(nodes.first[split_level]), int(nodes.first[split_level + 1] - nodes.first[split_level])
    part, own_counts = np.arange(N_WORKERS + 1) * n_units // N_WORKERS, None
    for room in (min(JOBS_PER_UNIT, n_nodes), n_nodes):
        start = part * room
        expanded = _Expanded(np.empty(start[-1], np.int32), np.empty(start[-1], np.int32), start,
                             np.zeros(N_WORKERS, np.int64))
        if counts is not None:
            own_counts = ExpandCounts(*(np.zeros((N_WORKERS, first_node), np.int64) for _ in range(5)),
                                      np.zeros(n_units, np.int32), np.zeros(n_units, np.int64))
        _expand(n_units, nodes, frusta, groups, rules, split_level, expanded, shadow, own_counts)
        if np.all(expanded.count <= np.diff(start)):
            break
    spread(nodes, shadow.full, 0, int(nodes.first[split_level + 1]))
    next_place = np.zeros(n_nodes + 1, np.int64)
    for at, n in zip(start[:-1], expanded.count, strict=True):
        next_place[1:] += np.bincount(expanded.node[at:at + n] - first_node, minlength=n_nodes)
    start = np.cumsum(next_place)
    unit = np.empty(start[-1], np.int32)
    _sort_jobs(expanded, first_node, start.copy(), unit)
    if counts is None:
        return Jobs(first_node, start, unit), None
    _add(counts, own_counts, groups is not None)
    return Jobs(first_node, start, unit), (own_counts.unit_visits, own_counts.unit_tests)


def _add(counts, own_counts, grouped):
    """Add what the first pass counted, to the nodes above the split level."""
    n_top = own_counts.visits.shape[1]
    tests = counts.group_tests if grouped else counts.tests
    tests[:n_top] += own_counts.tests.sum(axis=0)
    counts.visits[:n_top] += own_counts.visits.sum(axis=0)
    if not grouped:
        counts.accepts[:n_top] += own_counts.accepts.sum(axis=0)
        counts.rejects[:n_top] += own_counts.rejects.sum(axis=0)
        counts.refinements[:n_top] += own_counts.refinements.sum(axis=0)
