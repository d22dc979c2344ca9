"""The fast stage: each triangle's shadow frustum walks the light tree.

A batch of triangles is first dealt out to the work nodes it may reach (`count_reached`, `list_reached`), then each
work node walks its own list in triangle order. Work nodes own disjoint samples, flags and pair buffers, and skip what
is finished, so results and counts depend on neither threads nor timing.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.reference.face_planes import ACCEPT, REJECT, face_planes, outside_box, planes_test, triangle_box
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
    node_tests, sample_tests : int64 (n_work,) and, for tests while dealing out, (N_BLOCKS,) in `dealing_tests`.
    heat : int64 (n,), sample tests per sorted sample.
    """

    node_tests: np.ndarray
    sample_tests: np.ndarray
    dealing_tests: np.ndarray
    heat: np.ndarray


@kernel
def _deal_block(tree, frusta, corners, space, biases, finished, reached, lists, block, counts):
    """Find the work nodes that one block of triangles may reach; see `count_reached` and `list_reached`."""
    box, children, facing = tree.box, tree.children, frusta.facing
    first_work, end_work = tree.work_nodes[0], tree.work_nodes[1]
    stack = np.empty(STACK_SIZE, np.int64)
    n = len(facing)
    n_tests = 0
    for t in range(block * n // N_BLOCKS, (block + 1) * n // N_BLOCKS):
        if facing[t] == 0:
            continue
        for root in range(tree.roots[0], tree.roots[1]):
            planes = face_planes(frusta, t, space, tree.face[root], biases)
            bound = triangle_box(corners, t, space, tree.face[root], planes)
            stack[0], depth = root, 1
            while depth > 0:
                depth -= 1
                node = stack[depth]
                if finished[node]:
                    continue
                n_tests += 1
                x0, x1, y0, y1 = box[node, 0], box[node, 1], box[node, 2], box[node, 3]
                if (outside_box(bound, x0, x1, y0, y1, box[node, 6])
                        or planes_test(planes, x0, x1, y0, y1, box[node, 4], box[node, 5], box[node, 6]) == REJECT):
                    continue
                if node >= end_work:
                    for child in range(children[node, 0], children[node, 1]):
                        stack[depth] = child
                        depth += 1
                    continue
                # In the second pass `reached` holds where the block writes in the list of the work node.
                if lists is not None:
                    lists[reached[block, node - first_work]] = t
                reached[block, node - first_work] += 1
    if counts is not None:
        counts.dealing_tests[block] += n_tests


@parallel_kernel
def count_reached(tree, frusta, corners, space, biases, finished, reached):
    """Count the triangles of each block that may reach each work node.

    Parameters
    ----------
    tree, frusta, space : records.
    corners : float64 (n, 3, 3), the batch's triangles, world.
    biases : float64 (3,), rounding floor, bias, twice the bias; world units.
    finished : bool (n_nodes,), nodes to leave out.
    reached : int64 (N_BLOCKS, n_work), zero; written.
    """
    for block in prange(N_BLOCKS):
        _deal_block(tree, frusta, corners, space, biases, finished, reached, None, block, None)


@parallel_kernel
def list_reached(tree, frusta, corners, space, biases, finished, reached, lists, counts):
    """List the triangles that may reach each work node, in ascending order.

    Parameters
    ----------
    reached : int64 (N_BLOCKS, n_work), where each block starts to write for each work node; moved on.
    lists : int32, written.
    counts : `WalkCounts` or None.
    (the others as in `count_reached`)
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
def _look_closer(tree, corners, facing, t, light, biases, work, w, i):
    """Decide the flags of sample i and triangle t in the careful test; what stays open goes to the pair buffer."""
    certain, undecided = classify(corners, t, facing[t], light, tree.position, i, tree.tie[i], biases)
    flags = work.flags[i] | certain
    work.flags[i] = flags
    undecided &= ~flags
    if undecided != 0:
        k = work.n_pairs[w]
        work.pair_sample[w, k], work.pair_triangle[w, k], work.pair_flags[w, k] = i, t, undecided
        work.n_pairs[w] = k + 1
    return flags


@kernel
def _walk(tree, frusta, corners, light, biases, t, planes, bound, stack, work, w, counts):
    """Walk triangle t's frustum down from the root that `stack` holds."""
    # Arrays are taken from their records once: doing so in the loop counts references.
    box, children, samples, coordinate = tree.box, tree.children, tree.samples, tree.coordinate
    tie_light, flags, finished = tree.tie_light, work.flags, work.finished
    depth = 1
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
        first, end = samples[node, 0], samples[node, 1]
        if answer == ACCEPT:
            for i in range(first, end):
                flags[i] = ALL_FLAGS
            _finish(tree, finished, node)
            continue
        if children[node, 0] < children[node, 1]:
            for child in range(children[node, 0], children[node, 1]):
                stack[depth] = child
                depth += 1
            continue
        # A leaf: test its unfinished samples.
        n_open = 0
        for i in range(first, end):
            if flags[i] & FINISHED == FINISHED:
                continue
            if counts is not None:
                counts.sample_tests[w] += 1
                counts.heat[i] += 1
            x, y, r = coordinate[i, 0], coordinate[i, 1], coordinate[i, 2]
            answer = planes_test(planes, x, x, y, y, r, r, tie_light[i])
            if answer == ACCEPT:
                flags[i] = ALL_FLAGS
            elif answer == REJECT:
                n_open += 1
            elif _look_closer(tree, corners, frusta.facing, t, light, biases, work, w, i) & FINISHED != FINISHED:
                n_open += 1
        if n_open == 0:
            _finish(tree, finished, node)


@kernel
def _walk_work_node(tree, frusta, corners, space, biases, lists, ends, work, w, counts):
    """Walk the list of one work node until it ends or its pair buffer may overflow."""
    stack = np.empty(STACK_SIZE, np.int64)
    top = tree.work_nodes[0] + w
    face, n_samples = tree.face[top], tree.samples[top, 1] - tree.samples[top, 0]
    k, end = work.next_item[w], ends[w]
    while k < end and not work.finished[top]:
        # A triangle leaves at most one pair per sample.
        if work.n_pairs[w] + n_samples > work.pair_sample.shape[1]:
            break
        t = lists[k]
        planes = face_planes(frusta, t, space, face, biases)
        bound = triangle_box(corners, t, space, face, planes)
        stack[0] = top
        _walk(tree, frusta, corners, space.light, biases, t, planes, bound, stack, work, w, counts)
        k += 1
    work.next_item[w] = end if work.finished[top] else k


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
    (the others as in `count_reached`)
    """
    for w in prange(len(ends)):
        _walk_work_node(tree, frusta, corners, space, biases, lists, ends, work, w, counts)
