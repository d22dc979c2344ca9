"""All triangles that stand between each sample and the light: the walk of the reference without stopping early.

Work nodes own disjoint samples and buffers, and list the crossings of each triangle in turn, so the order does not
depend on threads.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, parallel_kernel, prange
from shadowbench.reference.face_planes import (
    ACCEPT,
    REJECT,
    face_frame,
    face_planes,
    outside_box,
    planes_test,
    triangle_box,
)
from shadowbench.reference.predicates import ALL_FLAGS, classify
from shadowbench.reference.traversal import STACK_SIZE


class Pairs(NamedTuple):
    """Samples and the triangles that they may be shadowed by, one row of the arrays per work node.

    Attributes
    ----------
    sample, triangle : int32 (n_work, capacity).
    certain, undecided : uint8 (n_work, capacity), flags that are certainly set, and those that exact arithmetic must
        settle.
    filled : int64 (n_work,), number of pairs.
    """

    sample: np.ndarray
    triangle: np.ndarray
    certain: np.ndarray
    undecided: np.ndarray
    filled: np.ndarray


@allocating_kernel
def _list_work_node(tree, frusta, corners, space, biases, lists, ends, next_item, pairs, w):
    """List the crossings of one work node until its triangles or its buffer end."""
    box, children, samples, coordinate = tree.box, tree.children, tree.samples, tree.coordinate
    tie_light, all_planes = tree.tie_light, frusta.planes
    pair_sample, pair_triangle, certain_flags, open_flags = pairs.sample, pairs.triangle, pairs.certain, pairs.undecided
    stack = np.empty(STACK_SIZE, np.int64)
    top = tree.work_nodes[0] + w
    frame = face_frame(space, tree.face[top], biases)
    # A triangle adds at most one pair per sample
    most_pairs = pair_sample.shape[1] - (samples[top, 1] - samples[top, 0])
    n_pairs, k, end = 0, next_item[w], ends[w]
    while k < end and n_pairs <= most_pairs:
        t = np.int64(lists[k])
        k += 1
        planes = face_planes(all_planes, t, frame)
        bound = triangle_box(corners, t, frame, planes)
        stack[0], depth = top, 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            x0, x1, y0, y1 = box[node, 0], box[node, 1], box[node, 2], box[node, 3]
            if outside_box(bound, x0, x1, y0, y1, box[node, 6]):
                continue
            answer = planes_test(planes, x0, x1, y0, y1, box[node, 4], box[node, 5], box[node, 6])
            if answer == REJECT:
                continue
            if answer != ACCEPT and children[node, 0] < children[node, 1]:
                for child in range(children[node, 0], children[node, 1]):
                    stack[depth] = child
                    depth += 1
                continue
            # A node inside the frustum, or a leaf whose samples are tested one by one
            for i in range(samples[node, 0], samples[node, 1]):
                certain, undecided = ALL_FLAGS, 0
                if answer != ACCEPT:
                    x, y, r = coordinate[i, 0], coordinate[i, 1], coordinate[i, 2]
                    here = planes_test(planes, x, x, y, y, r, r, tie_light[i])
                    if here == REJECT:
                        continue
                    if here != ACCEPT:
                        certain, undecided = classify(corners, t, frusta.facing[t], space.light, tree.position, i,
                                                      tree.tie[i], biases)
                if certain | undecided != 0:
                    pair_sample[w, n_pairs], pair_triangle[w, n_pairs] = i, t
                    certain_flags[w, n_pairs], open_flags[w, n_pairs] = certain, undecided
                    n_pairs += 1
    pairs.filled[w] = n_pairs
    next_item[w] = k


@parallel_kernel
def list_crossings(tree, frusta, corners, space, biases, lists, ends, next_item, pairs):
    """List crossings until all triangles are through or the buffers may overflow (see `next_item`).

    Parameters
    ----------
    corners : float64 (n, 3, 3), the batch's triangles, world.
    lists, ends : int32 triangles of each work node, and where they end.
    next_item : int64 (n_work,), where each work node goes on; moved on.
    pairs : filled anew.
    (the others as in `traversal.deal`)
    """
    for w in prange(len(ends)):
        _list_work_node(tree, frusta, corners, space, biases, lists, ends, next_item, pairs, w)
