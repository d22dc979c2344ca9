"""The tree of boxes over the samples in light space.

A node's box holds the computed coordinates of its samples. Rounding is monotone: evaluated with the same
operations in the same order, a plane's computed value at the box's extreme corner bounds the computed values
at all samples inside. So whatever the planes decide for a node, they would have decided for each of its
samples: boxes need no margin, and correctness does not depend on how samples are sorted.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.reference.light_space import map_to_light_space

LEAF_SAMPLES = 16
"""Samples per leaf."""
BRANCHING = 4
"""Children per node."""
WORK_LEVEL = 4
"""Level (0: leaves) whose nodes are the units of parallel work: 16 * 4**4 = 4096 samples."""
MORTON_BITS = 12
"""Bits per axis of the sort key: 4096 cells across, finer than the samples of a large frame are dense."""
RADIX_BITS = 9
"""Bits per pass of the sort: three passes for two axes and three bits of face."""
N_WORKERS = 64
"""Blocks of leaves that `fill_leaf_boxes` deals out."""


class LightTree(NamedTuple):
    """Samples sorted by light-space position, and the boxes over them, leaves first, roots last.

    Attributes
    ----------
    order : int64 (n,), the caller's index of each sorted sample.
    position : float64 (n, 3), world.
    coordinate : float64 (n, 3), x, y and r.
    tie : float64 (n,), tie distance, world units.
    tie_light : float64 (n,), the same in light-space values: times r for a point light.
    box : float64 (n_nodes, 7), smallest and largest x, y, r, largest `tie_light`.
    samples : int64 (n_nodes, 2), range of sorted samples.
    children : int64 (n_nodes, 2), range of child nodes; empty for leaves.
    parent : int64 (n_nodes,), -1 for roots.
    face : int64 (n_nodes,).
    work_nodes : int64 (2,), range of the nodes that are units of work.
    roots : int64 (2,), range of the roots, one per face.
    """

    order: np.ndarray
    position: np.ndarray
    coordinate: np.ndarray
    tie: np.ndarray
    tie_light: np.ndarray
    box: np.ndarray
    samples: np.ndarray
    children: np.ndarray
    parent: np.ndarray
    face: np.ndarray
    work_nodes: np.ndarray
    roots: np.ndarray


@kernel
def _spread(bits):
    """Insert a zero above each of the lowest 16 bits."""
    bits = (bits | (bits << 8)) & 0x00FF00FF
    bits = (bits | (bits << 4)) & 0x0F0F0F0F
    bits = (bits | (bits << 2)) & 0x33333333
    return (bits | (bits << 1)) & 0x55555555


@allocating_kernel
def _face_bounds(coordinate, faces):
    """Smallest and largest x and y per face, float64 (6, 2) each, and samples per face, int64 (6,)."""
    low, high, count = np.full((6, 2), np.inf), np.full((6, 2), -np.inf), np.zeros(6, np.int64)
    for i in range(len(faces)):
        face = faces[i]
        if face >= 0:
            count[face] += 1
            for k in range(2):
                # NaN fails both comparisons.
                if coordinate[i, k] < low[face, k]:
                    low[face, k] = coordinate[i, k]
                if coordinate[i, k] > high[face, k]:
                    high[face, k] = coordinate[i, k]
    return low, high, count


@allocating_kernel
def _sort_keys(coordinate, faces, low, scale):
    """Sort key of each kept sample: face, then Morton code of x and y quantised in the face's box; and its
    index."""
    n = 0
    for i in range(len(faces)):
        n += faces[i] >= 0
    keys, indices = np.empty(n, np.int64), np.empty(n, np.int64)
    top, n = (1 << MORTON_BITS) - 1, 0
    for i in range(len(faces)):
        face = faces[i]
        if face < 0:
            continue
        key = face << (2 * MORTON_BITS)
        x, y = coordinate[i, 0], coordinate[i, 1]
        if x == x:
            column = min(np.int64((x - low[face, 0]) * scale[face, 0]), top)
            row = min(np.int64((y - low[face, 1]) * scale[face, 1]), top)
            key |= _spread(column) | (_spread(row) << 1)
        keys[n], indices[n] = key, i
        n += 1
    return keys, indices


@allocating_kernel
def _radix_pass(keys, indices, shift):
    """Sort stably by `RADIX_BITS` bits of the keys; return sorted copies of both."""
    mask = (1 << RADIX_BITS) - 1
    place = np.zeros((1 << RADIX_BITS) + 1, np.int64)
    for i in range(len(keys)):
        place[((keys[i] >> shift) & mask) + 1] += 1
    for k in range(1 << RADIX_BITS):
        place[k + 1] += place[k]
    sorted_keys, sorted_indices = np.empty_like(keys), np.empty_like(indices)
    for i in range(len(keys)):
        digit = (keys[i] >> shift) & mask
        sorted_keys[place[digit]], sorted_indices[place[digit]] = keys[i], indices[i]
        place[digit] += 1
    return sorted_keys, sorted_indices


def _sort(coordinate, faces):
    """Return the order of the kept samples by face and Morton code (ties as given), and samples per face."""
    low, high, counts = _face_bounds(coordinate, faces)
    with np.errstate(over="ignore", invalid="ignore"):
        size = high - low
        # A size that overflows, or whose reciprocal does, sorts nothing on that axis.
        fits = (size > 2.0**-1000) & (size < np.inf)
        scale = np.where(fits, 2.0**MORTON_BITS / np.where(fits, size, 1.0), 0.0)
    keys, indices = _sort_keys(coordinate, faces, low, scale)
    for shift in range(0, 2 * MORTON_BITS + 3, RADIX_BITS):
        keys, indices = _radix_pass(keys, indices, shift)
    return indices, counts


@kernel
def _leaf_boxes(coordinate, tie, starts, box, block, n_blocks):
    """Fill one block of leaf boxes; see `fill_leaf_boxes`."""
    n = len(starts)
    for leaf in range(block * n // n_blocks, (block + 1) * n // n_blocks):
        first, end = starts[leaf], starts[leaf + 1] if leaf + 1 < n else len(tie)
        for k in range(3):
            low = high = coordinate[first, k]
            for i in range(first + 1, end):
                low, high = np.minimum(low, coordinate[i, k]), np.maximum(high, coordinate[i, k])
            box[leaf, 2 * k], box[leaf, 2 * k + 1] = low, high
        largest = tie[first]
        for i in range(first + 1, end):
            largest = np.maximum(largest, tie[i])
        box[leaf, 6] = largest


@parallel_kernel
def fill_leaf_boxes(coordinate, tie, starts, box):
    """Bound the samples of each leaf; NaN spreads to the box.

    Parameters
    ----------
    coordinate, tie : float64 (n, 3) and (n,), `LightTree.coordinate` and `tie_light`.
    starts : int64 (n_leaves,), first sample of each leaf.
    box : float64 (n_leaves, 7), written.
    """
    for block in prange(N_WORKERS):
        _leaf_boxes(coordinate, tie, starts, box, block, N_WORKERS)


def _group_starts(face_counts, size):
    """Return the start of each group of `size` consecutive items, none across two faces, and groups per
    face."""
    firsts = np.concatenate([[0], np.cumsum(face_counts)])
    starts = [np.arange(firsts[k], firsts[k + 1], size) for k in range(len(face_counts))]
    return np.concatenate(starts), np.array([len(s) for s in starts])


def build_light_tree(space, positions, tie):
    """Sort samples in light space and build the boxes over them.

    Parameters
    ----------
    space : `LightSpace`.
    positions : float64 (n, 3), world, n > 0.
    tie : float64 (n,), tie distances, world units.

    Returns
    -------
    LightTree, or None if no sample is left (all are at the light).
    """
    coordinate, faces = np.empty((len(positions), 3)), np.empty(len(positions), np.int64)
    map_to_light_space(positions, space, coordinate, faces)
    order, face_counts = _sort(coordinate, faces)
    if len(order) == 0:
        return None
    coordinate, tie = coordinate[order], tie[order]
    tie_light = tie * coordinate[:, 2] if space.light[3] != 0.0 else tie
    return LightTree(order, positions[order], coordinate, tie, tie_light,
                     *_build_levels(coordinate, tie_light, face_counts))


def _reduce_boxes(values, starts):
    """Merge rows [low x, high x, low y, high y, low r, high r, tie] of each group; NaN spreads."""
    merged = np.empty((len(starts), 7))
    for k, function in enumerate((np.minimum, np.maximum) * 3 + (np.maximum,)):
        merged[:, k] = function.reduceat(values[:, k], starts)
    return merged


def _build_levels(coordinate, tie, face_counts):
    """Build all nodes, level by level from the leaves; return the node fields of `LightTree`."""
    starts, counts = _group_starts(face_counts, LEAF_SAMPLES)
    boxes = [np.empty((len(starts), 7))]
    fill_leaf_boxes(coordinate, tie, starts, boxes[0])
    samples = [np.column_stack([starts, np.append(starts[1:], len(tie))])]
    children = [np.zeros((len(starts), 2), np.int64)]
    faces, parents = [np.repeat(np.arange(6), counts)], []
    base = 0
    while len(boxes) <= WORK_LEVEL or counts.max() > 1:
        starts, counts = _group_starts(counts, BRANCHING)
        ends = np.append(starts[1:], len(boxes[-1]))
        parents.append(base + len(boxes[-1]) + np.repeat(np.arange(len(starts)), ends - starts))
        children.append(base + np.column_stack([starts, ends]))
        base += len(boxes[-1])
        boxes.append(_reduce_boxes(boxes[-1], starts))
        samples.append(np.column_stack([samples[-1][starts, 0], samples[-1][ends - 1, 1]]))
        faces.append(np.repeat(np.arange(6), counts))
    parents.append(np.full(len(boxes[-1]), -1))
    first_work = sum(len(box) for box in boxes[:WORK_LEVEL])
    work_nodes = np.array([first_work, first_work + len(boxes[WORK_LEVEL])])
    roots = np.array([base, base + len(boxes[-1])])
    return (np.concatenate(boxes), np.concatenate(samples), np.concatenate(children), np.concatenate(parents),
            np.concatenate(faces), work_nodes, roots)
