"""Light space and the tree of boxes over the samples.

**Light space.** Planes stay planes and the three side planes of a shadow frustum have no depth term. With
``C = p - o`` (see `frusta`), the *face* is the axis of largest magnitude (of C for a point light, of the direction d
towards the light for a directional one) with its sign s, the other two axes follow cyclically:

* point light: ``z = s C_axis > 0``, ``x = C_1 / z``, ``y = C_2 / z``, ``r = 1 / z``. Three, three and two roundings. |x|
  and |y| are at most 1, since z is the largest component and rounding is monotone;
* directional: ``z = s C_axis``, ``x = C_1 - z q_1``, ``y = C_2 - z q_2``, ``r = z`` with ``q = d / (s d_axis)``, |q| <= 1: a shear along
  d. With S the largest component of a C, x is off by ``u S`` (C_1), ``4 u S`` (z, q, their product) and ``2 u S`` (the
  subtraction), less than 12 u S.

Where a coordinate overflows, or the reciprocal may underflow, the sample gets NaN coordinates; every test then answers "not decided",
so nothing is lost. A sample at the light itself has C = 0: it is in front of every cap, and is dropped here.

**Boxes.** A node's box holds the computed coordinates of its samples. Rounding is monotone: evaluated with the same
operations in the same order, a plane's computed value at the box's extreme corner bounds the computed values at all
samples inside. So whatever a node's test decides, each sample's own test would have decided: boxes need no margin,
and correctness does not depend on how samples are sorted.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange

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
LARGEST_COORDINATE = 2.0**1000
"""Largest component along the face's axis: its reciprocal is far from underflow."""
N_WORKERS = 64
"""Blocks of samples that `map_to_light_space` deals out."""


class LightSpace(NamedTuple):
    """The light and the map from world to light space.

    Attributes
    ----------
    light : float64 (4,), homogeneous, world.
    origin : float64 (3,), world.
    shear : float64 (2,), q of the module's text; zero for a point light.
    face : face of a directional light, 2 * axis + (1 if the axis is negative).
    extent : largest |component| of a sample relative to the origin.
    """

    light: np.ndarray
    origin: np.ndarray
    shear: np.ndarray
    face: int
    extent: float


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


def make_light_space(light, positions):
    """Choose origin and axes of light space for a light and float64 (n, 3) samples, n > 0."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    if light[3] != 0.0:
        origin, shear, face = light[:3].copy(), np.zeros(2), 0
    else:
        origin = 0.5 * low + 0.5 * high
        axis = int(np.argmax(np.abs(light[:3])))
        face = 2 * axis + int(light[axis] < 0)
        shear = light[[(axis + 1) % 3, (axis + 2) % 3]] / abs(light[axis])
    with np.errstate(over="ignore"):
        extent = float(np.maximum(np.abs(low - origin), np.abs(high - origin)).max())
    return LightSpace(light, origin, shear, face, extent)


@kernel
def _map_block(positions, space, coordinate, faces, block, n_blocks):
    """Map one block of samples; see `map_to_light_space`."""
    is_point = space.light[3] != 0.0
    n = len(positions)
    for i in range(block * n // n_blocks, (block + 1) * n // n_blocks):
        c0, c1, c2 = (positions[i, 0] - space.origin[0], positions[i, 1] - space.origin[1],
                      positions[i, 2] - space.origin[2])
        face = space.face
        if is_point:
            if c0 == 0.0 and c1 == 0.0 and c2 == 0.0:
                faces[i] = -1
                continue
            face = 0 if abs(c0) >= abs(c1) and abs(c0) >= abs(c2) else (2 if abs(c1) >= abs(c2) else 4)
        # Bring the face's axis to the front, the other two after it in cyclic order.
        if face // 2 == 1:
            c0, c1, c2 = c1, c2, c0
        elif face // 2 == 2:
            c0, c1, c2 = c2, c0, c1
        if is_point:
            face += 1 if c0 < 0.0 else 0
            x, y, r = c1 / abs(c0), c2 / abs(c0), 1.0 / abs(c0)
        else:
            r = -c0 if face % 2 == 1 else c0
            x, y = c1 - r * space.shear[0], c2 - r * space.shear[1]
        if not (abs(x) < np.inf and abs(y) < np.inf and abs(r) < np.inf and abs(c0) < LARGEST_COORDINATE):
            x = y = r = np.nan
        coordinate[i, 0], coordinate[i, 1], coordinate[i, 2] = x, y, r
        faces[i] = face


@parallel_kernel
def map_to_light_space(positions, space, coordinate, faces):
    """Map samples to light space.

    Parameters
    ----------
    positions : float64 (n, 3), world.
    space : `LightSpace`.
    coordinate : float64 (n, 3), written: x, y and r.
    faces : int64 (n,), written: the face, or -1 for a sample at the light itself.
    """
    for block in prange(N_WORKERS):
        _map_block(positions, space, coordinate, faces, block, N_WORKERS)


@kernel
def _spread(bits):
    """Insert a zero above each of the lowest 16 bits."""
    bits = (bits | (bits << 8)) & 0x00FF00FF
    bits = (bits | (bits << 4)) & 0x0F0F0F0F
    bits = (bits | (bits << 2)) & 0x33333333
    return (bits | (bits << 1)) & 0x55555555


@kernel
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


@kernel
def _sort_keys(coordinate, faces, low, scale):
    """Sort key of each kept sample: face, then Morton code of x and y quantised in the face's box; and its index."""
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


@kernel
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
    """Return the start of each group of `size` consecutive items, none across two faces, and groups per face."""
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
