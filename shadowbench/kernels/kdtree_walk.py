"""The way of one shadow ray through a kd-tree: from leaf to leaf, until a triangle shadows the sample.

`kdtree_traversal` says which ways there are, and why a ray misses nothing. Records are read through `elements`, which
costs no reference counts.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel
from shadowbench.kernels.elements import get, increment, put
from shadowbench.kernels.kdtree_build import LEAF
from shadowbench.kernels.shadow_rays import crossing, is_shadowed_by

SHORT_STACK = 4
"""Entries of the short stack (Horn et al. 2007 find 3 to 5 enough)."""

NO_HIT, DEFERRED, HIT = 0, 1, 2
"""What a leaf yields: nothing, a triangle that the ray meets beyond the leaf, or one that ends the ray."""

_ROOT_BIT = np.int64(1) << np.int64(62)


class RayCounts(NamedTuple):
    """What each ray did, int32 (n_samples,).

    Attributes
    ----------
    nodes : inner nodes visited, repeated visits included.
    leaves : leaves visited.
    tests : ray-triangle tests.
    """

    nodes: np.ndarray
    leaves: np.ndarray
    tests: np.ndarray


class Ray(NamedTuple):
    """Scratch of one worker.

    Attributes
    ----------
    axis : float64 (9,), per axis: origin, 1 / direction, margin / direction.
    node, near, far : int64 and float64 (MAX_DEPTH + 1,), the stack: nodes and the ends of their intervals.
    bit : int64 (MAX_DEPTH + 1,), bits of the levels of the nodes on the stack.
    """

    axis: np.ndarray
    node: np.ndarray
    near: np.ndarray
    far: np.ndarray
    bit: np.ndarray


@kernel
def _hits_leaf(tree, rays, node, end, x, y, r, i, counts):
    """Test a sample against the triangles of a leaf, until one shadows it whose plane the ray meets before `end`."""
    found = NO_HIT
    first = np.int64(get(tree, "nodes", 2 * node))
    for k in range(first, first + (get(tree, "nodes", 2 * node + 1) >> 2)):
        if counts is not None:
            increment(counts, "tests", i)
        t = np.int64(get(tree, "references", k))
        if is_shadowed_by(rays, t, x, y, r):
            if crossing(rays, t, x, y, r) <= end:
                return HIT
            found = DEFERRED
    return found


@kernel
def walk(tree, rays, ray, begin, end, x, y, r, i, counts):
    """Visit the leaves along a ray with a stack, until a triangle ends it; True if any shadows the sample."""
    if begin > end:
        return False
    node = n_stack = 0
    found = NO_HIT
    while True:
        link = np.int64(get(tree, "nodes", 2 * node + 1))
        axis = link & 3
        while axis != LEAF:
            if counts is not None:
                increment(counts, "nodes", i)
            inverse, slack = get(ray, "axis", 3 + axis), get(ray, "axis", 6 + axis)
            t = (get(tree, "planes", 2 * node) - get(ray, "axis", axis)) * inverse
            near, far = node + 1, link >> 2
            if inverse < 0.0:
                near, far = far, near
            if begin <= t + slack:
                if t - slack <= end:
                    put(ray, "node", n_stack, far)
                    put(ray, "near", n_stack, max(begin, t - slack))
                    put(ray, "far", n_stack, end)
                    n_stack += 1
                node, end = near, min(end, t + slack)
            else:
                node, begin = far, max(begin, t - slack)
            link = np.int64(get(tree, "nodes", 2 * node + 1))
            axis = link & 3
        if counts is not None:
            increment(counts, "leaves", i)
        found = max(found, _hits_leaf(tree, rays, node, end, x, y, r, i, counts))
        if found == HIT:
            return True
        if n_stack == 0:
            return found == DEFERRED
        n_stack -= 1
        node, begin, end = get(ray, "node", n_stack), get(ray, "near", n_stack), get(ray, "far", n_stack)


@kernel
def walk_again(tree, rays, ray, room, begin, end, x, y, r, i, counts):
    """Visit the same leaves with a stack of `room` entries, or none, and restarts."""
    if begin > end:
        return False
    # Bits of the levels where the far child is still to be visited, and where it is being visited; the root's is highest
    waiting = going_far = np.int64(0)
    n_stack = top = 0
    found = NO_HIT
    node, bit = 0, _ROOT_BIT
    root, root_bit, root_begin, root_end, alone = node, bit, begin, end, room > 0
    while True:
        link = np.int64(get(tree, "nodes", 2 * node + 1))
        axis = link & 3
        while axis != LEAF:
            if counts is not None:
                increment(counts, "nodes", i)
            inverse, slack = get(ray, "axis", 3 + axis), get(ray, "axis", 6 + axis)
            t = (get(tree, "planes", 2 * node) - get(ray, "axis", axis)) * inverse
            near, far = node + 1, link >> 2
            if inverse < 0.0:
                near, far = far, near
            if begin > t + slack or (going_far & bit) != 0:
                node, begin = far, max(begin, t - slack)
            else:
                if t - slack <= end:
                    waiting |= bit
                    alone = False
                    if room > 0:
                        put(ray, "node", top, far)
                        put(ray, "near", top, max(begin, t - slack))
                        put(ray, "far", top, end)
                        put(ray, "bit", top, bit >> 1)
                        top, n_stack = (top + 1) % room, min(n_stack + 1, room)
                node, end = near, min(end, t + slack)
            bit >>= 1
            if alone:
                root, root_bit, root_begin, root_end = node, bit, begin, end
            link = np.int64(get(tree, "nodes", 2 * node + 1))
            axis = link & 3
        if counts is not None:
            increment(counts, "leaves", i)
        found = max(found, _hits_leaf(tree, rays, node, end, x, y, r, i, counts))
        if found == HIT:
            return True
        if waiting == 0:
            return found == DEFERRED
        # The deepest far child that waits is next
        bit = waiting & -waiting
        waiting ^= bit
        going_far = (going_far & -bit) | bit
        if n_stack > 0:
            top, n_stack = (top + room - 1) % room, n_stack - 1
            node, begin, end, bit = get(ray, "node", top), get(ray, "near", top), get(ray, "far", top), get(ray, "bit", top)
        else:
            node, bit, begin, end, alone = root, root_bit, root_begin, root_end, room > 0
