"""The fast stage: each triangle's shadow frustum walks the light tree.

A batch of triangles is first dealt out to the work nodes it may reach (`deal`), then each work node walks its
own list in triangle order (`walk`). Work nodes own disjoint samples, flags and pair buffers, and skip what is
finished, so results and counts depend on neither threads nor timing.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.reference.face_planes import (
    ACCEPT,
    REFINE,
    REJECT,
    face_frame,
    face_planes,
    outside_box,
    planes_test,
    triangle_box,
)
from shadowbench.reference.predicates import ALL_FLAGS, FINISHED, classify

N_BLOCKS = 16
"""Blocks of triangles that are dealt out side by side."""
STACK_SIZE = 64
"""Nodes waiting in a walk: at most (BRANCHING - 1) per level and one, for up to 20 levels of 4**20 leaves."""


class Work(NamedTuple):
    """State of the traversal.

    Attributes
    ----------
    flags : uint8 (n,), flags of the sorted samples.
    finished : bool (n_nodes,), no sample of the node can change any more.
    next_item : int64 (n_work,), where each work node goes on in its list.
    pair_sample, pair_triangle : int32 (n_work, capacity), undecided pairs.
    pair_flags : uint8 (n_work, capacity), the flags that each of them leaves open.
    n_pairs : int64 (n_work,).
    """

    flags: np.ndarray
    finished: np.ndarray
    next_item: np.ndarray
    pair_sample: np.ndarray
    pair_triangle: np.ndarray
    pair_flags: np.ndarray
    n_pairs: np.ndarray


class WalkCounts(NamedTuple):
    """Counts of the traversal.

    Attributes
    ----------
    node_tests, sample_tests : int64 (n_work,) and, for tests while dealing out, (N_BLOCKS,) in
        `dealing_tests`.
    heat : int64 (n,), sample tests per sorted sample.
    """

    node_tests: np.ndarray
    sample_tests: np.ndarray
    dealing_tests: np.ndarray
    heat: np.ndarray


@allocating_kernel
def _deal_block(tree, frusta, corners, space, biases, finished, reached, lists, block, counts):
    """Find the work nodes that one block of triangles may reach; see `deal`."""
    # Arrays are taken from their records once: doing so in the loop counts references.
    box, children, facing, all_planes = tree.box, tree.children, frusta.facing, frusta.planes
    first_work, end_work = tree.work_nodes[0], tree.work_nodes[1]
    stack = np.empty(STACK_SIZE, np.int64)
    n = len(facing)
    n_tests = 0
    for root in range(tree.roots[0], tree.roots[1]):
        frame = face_frame(space, tree.face[root], biases)
        for t in range(block * n // N_BLOCKS, (block + 1) * n // N_BLOCKS):
            if facing[t] == 0:
                continue
            planes = face_planes(all_planes, t, frame)
            bound = triangle_box(corners, t, frame, planes)
            stack[0], depth = root, 1
            while depth > 0:
                depth -= 1
                node = stack[depth]
                if finished[node]:
                    continue
                n_tests += 1
                x0, x1, y0, y1 = box[node, 0], box[node, 1], box[node, 2], box[node, 3]
                if outside_box(bound, x0, x1, y0, y1, box[node, 6]):
                    continue
                answer = planes_test(planes, x0, x1, y0, y1, box[node, 4], box[node, 5], box[node, 6])
                if answer == REJECT:
                    continue
                if node >= end_work:
                    for child in range(children[node, 0], children[node, 1]):
                        stack[depth] = child
                        depth += 1
                    continue
                place = reached[block, node - first_work]
                if place < len(lists):
                    lists[place] = t
                reached[block, node - first_work] = place + 1
    if counts is not None:
        counts.dealing_tests[block] += n_tests


@parallel_kernel
def deal(tree, frusta, corners, space, biases, finished, reached, lists, counts):
    """Deal triangles out to the work nodes that they may reach.

    Called twice: with no room in `lists` to count, then with `reached` turned into places, to fill the lists.

    Parameters
    ----------
    tree, frusta, space : records.
    corners : float64 (n, 3, 3), the batch's triangles, world.
    biases : float64 (3,), rounding floor, bias, twice the bias; world units.
    finished : bool (n_nodes,), nodes to leave out.
    reached : int64 (N_BLOCKS, n_work), where the next triangle of each block goes for each work node; moved
        on.
    lists : int32, written where there is room: triangles, ascending within a work node.
    counts : `WalkCounts` or None.
    """
    for block in prange(N_BLOCKS):
        _deal_block(tree, frusta, corners, space, biases, finished, reached, lists, block, counts)


@kernel
def _finish(tree, finished, node):
    """Mark a node, and each ancestor whose children are all finished, as finished."""
    finished[node] = True
    node = tree.parent[node]
    # Stop below the work level's parents: those belong to several workers.
    while 0 <= node < tree.work_nodes[1]:
        for child in range(tree.children[node, 0], tree.children[node, 1]):
            if not finished[child]:
                return
        finished[node] = True
        node = tree.parent[node]


@kernel
def _look_closer(tree, corners, facing, t, light, biases, work, w, n_pairs, i):
    """Decide the flags of sample i and triangle t in the careful test.

    What stays open goes to place `n_pairs` of the pair buffer of work node w. Return the number of pairs
    added.
    """
    certain, undecided = classify(corners, t, facing[t], light, tree.position, i, tree.tie[i], biases)
    work.flags[i] |= certain
    undecided &= ~work.flags[i]
    if undecided == 0:
        return 0
    work.pair_sample[w, n_pairs], work.pair_triangle[w, n_pairs] = i, t
    work.pair_flags[w, n_pairs] = undecided
    return 1


@allocating_kernel
def _walk_work_node(tree, frusta, corners, space, biases, lists, ends, work, w, counts):
    """Walk the list of one work node until it ends or its pair buffer may overflow.

    One long function on purpose: arrays are taken from their records once, since each time counts references,
    over which threads would fight.
    """
    box, children, samples, coordinate = tree.box, tree.children, tree.samples, tree.coordinate
    tie_light, flags, finished, all_planes = tree.tie_light, work.flags, work.finished, frusta.planes
    stack = np.empty(STACK_SIZE, np.int64)
    top = tree.work_nodes[0] + w
    frame = face_frame(space, tree.face[top], biases)
    # A triangle leaves at most one pair per sample.
    most_pairs = work.pair_sample.shape[1] - (samples[top, 1] - samples[top, 0])
    n_pairs, k, end = 0, work.next_item[w], ends[w]
    while k < end and not finished[top] and n_pairs <= most_pairs:
        t = np.int64(lists[k])
        k += 1
        planes = face_planes(all_planes, t, frame)
        bound = triangle_box(corners, t, frame, planes)
        stack[0], depth = top, 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if finished[node]:
                continue
            if counts is not None:
                counts.node_tests[w] += 1
            x0, x1, y0, y1 = box[node, 0], box[node, 1], box[node, 2], box[node, 3]
            if outside_box(bound, x0, x1, y0, y1, box[node, 6]):
                continue
            answer = planes_test(planes, x0, x1, y0, y1, box[node, 4], box[node, 5], box[node, 6])
            if answer == REJECT:
                continue
            first, last = samples[node, 0], samples[node, 1]
            if answer == ACCEPT:
                flags[first:last] = ALL_FLAGS
                _finish(tree, finished, node)
                continue
            if children[node, 0] < children[node, 1]:
                for child in range(children[node, 0], children[node, 1]):
                    stack[depth] = child
                    depth += 1
                continue
            # A leaf: test its unfinished samples one by one.
            n_open = 0
            for i in range(first, last):
                if flags[i] & FINISHED == FINISHED:
                    continue
                if counts is not None:
                    counts.sample_tests[w] += 1
                    counts.heat[i] += 1
                x, y, r = coordinate[i, 0], coordinate[i, 1], coordinate[i, 2]
                answer = planes_test(planes, x, x, y, y, r, r, tie_light[i])
                if answer == ACCEPT:
                    flags[i] = ALL_FLAGS
                elif answer == REFINE:
                    n_pairs += _look_closer(tree, corners, frusta.facing, t, space.light, biases, work, w,
                                            n_pairs, i)
                if flags[i] & FINISHED != FINISHED:
                    n_open += 1
            if n_open == 0:
                _finish(tree, finished, node)
    work.n_pairs[w] = n_pairs
    work.next_item[w] = end if finished[top] else k


@parallel_kernel
def walk(tree, frusta, corners, space, biases, lists, ends, work, counts):
    """Walk all work nodes until their lists end or their pair buffers may overflow (see `Work.next_item`).

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), the batch's triangles, world.
    lists : int32, triangles per work node, from `Work.next_item` to `ends`.
    ends : int64 (n_work,).
    work : `Work`, read and written.
    counts : `WalkCounts` or None.
    (the others as in `deal`)
    """
    for w in prange(len(ends)):
        _walk_work_node(tree, frusta, corners, space, biases, lists, ends, work, w, counts)
