"""The fast stage: each triangle's shadow frustum walks the light tree.

A batch of triangles is first dealt out to the work nodes it may reach (`count_reached`, `list_reached`), then each
work node walks its own list in triangle order. Work nodes own disjoint samples, flags and pair buffers, and skip what
is finished, so results and counts depend on neither threads nor timing.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.reference.predicates import ALL_FLAGS, FINISHED, classify

REJECT, REFINE, ACCEPT = 0, 1, 2
"""Answers of a node test: no sample gets any flag; undecided; every sample gets all flags."""

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
def _load(frusta, t, space, face, biases, lines, caps):
    """Write triangle t's planes in the light-space coordinates of one face.

    ``lines[k]`` is (x, y, constant, error, tie factor) of a side plane; ``caps[0]`` and ``caps[1]`` are (x, y, constant, r,
    constant error, error per r) of the cap plane moved by the rounding floor and by the doubled bias.
    """
    i0 = face // 2
    i1, i2 = (i0 + 1) % 3, (i0 + 2) % 3
    sign = -1.0 if face % 2 == 1 else 1.0
    is_point = space.light[3] != 0.0
    for k in range(3):
        lines[k, 0], lines[k, 1] = frusta.side[t, k, i1], frusta.side[t, k, i2]
        lines[k, 2] = sign * frusta.side[t, k, i0] if is_point else frusta.side_offset[t, k]
        lines[k, 3], lines[k, 4] = frusta.side_error[t, k], frusta.tie_factor[t, k]
    x, y, z = frusta.cap[t, i1], frusta.cap[t, i2], sign * frusta.cap[t, i0]
    for k in range(2):
        bias = biases[0] if k == 0 else biases[2]
        caps[k, 0], caps[k, 1] = x, y
        if is_point:
            caps[k, 2], caps[k, 3] = z, frusta.cap_offset[t] - bias
        else:
            caps[k, 2] = frusta.cap_offset[t] - bias
            caps[k, 3] = z + x * space.shear[0] + y * space.shear[1]
        caps[k, 4], caps[k, 5] = frusta.cap_error[t, 0], frusta.cap_error[t, 1]


@kernel
def _extreme(box, node, x, y, largest):
    """Largest (or smallest) value of x X + y Y over a box."""
    if (x > 0.0) == largest:
        first = x * box[node, 1]
    else:
        first = x * box[node, 0]
    if (y > 0.0) == largest:
        return first + y * box[node, 3]
    return first + y * box[node, 2]


@kernel
def _extreme_cap(box, node, cap, largest):
    """Largest (or smallest) value of a cap plane over a box, in the order of operations of `_sample_test`."""
    r = box[node, 5] if (cap[3] > 0.0) == largest else box[node, 4]
    return _extreme(box, node, cap[0], cap[1], largest) + cap[2] + cap[3] * r


@kernel
def _node_test(box, node, lines, caps):
    """Test a box against a frustum: REJECT, REFINE or ACCEPT."""
    accept = True
    for k in range(3):
        margin = lines[k, 3] + lines[k, 4] * box[node, 6]
        if _extreme(box, node, lines[k, 0], lines[k, 1], True) + lines[k, 2] < -margin:
            return REJECT
        if accept and not _extreme(box, node, lines[k, 0], lines[k, 1], False) + lines[k, 2] > margin:
            accept = False
    margin = caps[0, 4] + caps[0, 5] * box[node, 5]
    if _extreme_cap(box, node, caps[0], True) < -margin:
        return REJECT
    if accept and _extreme_cap(box, node, caps[1], False) > margin:
        return ACCEPT
    return REFINE


@kernel
def _sample_test(coordinate, tie_light, i, lines, caps):
    """Test sample i against a frustum: REJECT (no flag), ACCEPT (all flags) or REFINE (look closer)."""
    x, y, r = coordinate[i, 0], coordinate[i, 1], coordinate[i, 2]
    accept = True
    for k in range(3):
        value = lines[k, 0] * x + lines[k, 1] * y + lines[k, 2]
        margin = lines[k, 3] + lines[k, 4] * tie_light[i]
        if value < -margin:
            return REJECT
        accept = accept and value > margin
    margin = caps[0, 4] + caps[0, 5] * r
    if caps[0, 0] * x + caps[0, 1] * y + caps[0, 2] + caps[0, 3] * r < -margin:
        return REJECT
    if accept and caps[1, 0] * x + caps[1, 1] * y + caps[1, 2] + caps[1, 3] * r > margin:
        return ACCEPT
    return REFINE


@kernel
def _deal_block(tree, frusta, space, biases, finished, reached, lists, block, counts):
    """Find the work nodes that one block of triangles may reach; see `count_reached` and `list_reached`."""
    lines, caps = np.empty((3, 5)), np.empty((2, 6))
    stack = np.empty(STACK_SIZE, np.int64)
    first_work, end_work = tree.work_nodes[0], tree.work_nodes[1]
    n = len(frusta.facing)
    n_tests = 0
    for t in range(block * n // N_BLOCKS, (block + 1) * n // N_BLOCKS):
        if frusta.facing[t] == 0:
            continue
        for root in range(tree.roots[0], tree.roots[1]):
            _load(frusta, t, space, tree.face[root], biases, lines, caps)
            stack[0], depth = root, 1
            while depth > 0:
                depth -= 1
                node = stack[depth]
                if finished[node]:
                    continue
                n_tests += 1
                if _node_test(tree.box, node, lines, caps) == REJECT:
                    continue
                if node >= end_work:
                    for child in range(tree.children[node, 0], tree.children[node, 1]):
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
def count_reached(tree, frusta, space, biases, finished, reached):
    """Count the triangles of each block that may reach each work node.

    Parameters
    ----------
    tree, frusta, space : records.
    biases : float64 (3,), rounding floor, bias, twice the bias; world units.
    finished : bool (n_nodes,), nodes to leave out.
    reached : int64 (N_BLOCKS, n_work), zero; written.
    """
    for block in prange(N_BLOCKS):
        _deal_block(tree, frusta, space, biases, finished, reached, None, block, None)


@parallel_kernel
def list_reached(tree, frusta, space, biases, finished, reached, lists, counts):
    """List the triangles that may reach each work node, in ascending order.

    Parameters
    ----------
    reached : int64 (N_BLOCKS, n_work), where each block starts to write for each work node; moved on.
    lists : int32, written.
    counts : `WalkCounts` or None.
    (the others as in `count_reached`)
    """
    for block in prange(N_BLOCKS):
        _deal_block(tree, frusta, space, biases, finished, reached, lists, block, counts)


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
def _visit_leaf(tree, corners, facing, t, space, biases, lines, caps, leaf, work, w, counts):
    """Test the unfinished samples of a leaf; undecided pairs go to the buffer of work node w."""
    n_open = 0
    for i in range(tree.samples[leaf, 0], tree.samples[leaf, 1]):
        if work.flags[i] & FINISHED == FINISHED:
            continue
        if counts is not None:
            counts.sample_tests[w] += 1
            counts.heat[i] += 1
        answer = _sample_test(tree.coordinate, tree.tie_light, i, lines, caps)
        if answer == ACCEPT:
            work.flags[i] = ALL_FLAGS
            continue
        if answer == REFINE:
            certain, undecided = classify(corners, t, facing[t], space.light, tree.position, i, tree.tie[i], biases)
            work.flags[i] |= certain
            undecided &= ~work.flags[i]
            if undecided != 0:
                k = work.n_pairs[w]
                work.pair_sample[w, k], work.pair_triangle[w, k], work.pair_flags[w, k] = i, t, undecided
                work.n_pairs[w] = k + 1
        if work.flags[i] & FINISHED != FINISHED:
            n_open += 1
    if n_open == 0:
        _finish(tree, work.finished, leaf)


@kernel
def _walk(tree, corners, facing, t, space, biases, lines, caps, top, stack, work, w, counts):
    """Walk triangle t's frustum down from the work node `top`."""
    stack[0], depth = top, 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if work.finished[node]:
            continue
        if counts is not None:
            counts.node_tests[w] += 1
        answer = _node_test(tree.box, node, lines, caps)
        if answer == ACCEPT:
            work.flags[tree.samples[node, 0]:tree.samples[node, 1]] = ALL_FLAGS
            _finish(tree, work.finished, node)
        elif answer == REFINE:
            first, end = tree.children[node, 0], tree.children[node, 1]
            if first == end:
                _visit_leaf(tree, corners, facing, t, space, biases, lines, caps, node, work, w, counts)
            for child in range(first, end):
                stack[depth] = child
                depth += 1


@kernel
def _walk_work_node(tree, frusta, corners, space, biases, lists, ends, work, w, counts):
    """Walk the list of one work node until it ends or its pair buffer may overflow."""
    lines, caps = np.empty((3, 5)), np.empty((2, 6))
    stack = np.empty(STACK_SIZE, np.int64)
    top = tree.work_nodes[0] + w
    n_samples = tree.samples[top, 1] - tree.samples[top, 0]
    k, end = work.next_item[w], ends[w]
    while k < end and not work.finished[top]:
        # A triangle leaves at most one pair per sample.
        if work.n_pairs[w] + n_samples > work.pair_sample.shape[1]:
            break
        t = lists[k]
        _load(frusta, t, space, tree.face[top], biases, lines, caps)
        _walk(tree, corners, frusta.facing, t, space, biases, lines, caps, top, stack, work, w, counts)
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
