"""The view-sample cluster hierarchy: a tree over the clusters that hold samples (Sintorn et al. 2014, sec. 2 and 2.1).

Clusters, sorted by their keys, are grouped upwards, five bits of the key at a time. Only nodes
that hold samples are numbered: the root is node 0, then level by level in the order of the keys; the clusters come
last. A node's children are consecutive nodes.

**Layouts.** The boxes of a node's children stand together, coordinate by coordinate, for `shadowbench.kernels.lanes`.
In the *full* layout every possible node has its place and a child's lane is the part of its key, as the child masks of
the paper have it. In the *compact* layout the children that exist stand side by side.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.cluster_bounds import explicit_boxes, implicit_boxes
from shadowbench.kernels.cluster_links import N_WORKERS, count_part, link_nodes
from shadowbench.kernels.cluster_samples import BOX, SLOT_BITS, find_clusters, slot_of


class Nodes(NamedTuple):
    """The tree.

    Attributes
    ----------
    first : int64 (n_levels + 1,), first node of each level, the clusters' last.
    first_child : int32 (n_inner,); parent : int32 (n_nodes,).
    lane : int8 (n_nodes,), where a node's box stands among those of its siblings.
    occupied : uint64 (n_inner,), a bit per lane that holds a child.
    place : int64 (n_inner,), where the boxes of a node's children start in `x`, `y` and `r`.
    n_chunks : int8 (n_inner,), their chunks of lanes.
    x, y, r : float32, smallest, then largest coordinates of the children of each node.
    """

    first: np.ndarray
    first_child: np.ndarray
    parent: np.ndarray
    lane: np.ndarray
    occupied: np.ndarray
    place: np.ndarray
    n_chunks: np.ndarray
    x: np.ndarray
    y: np.ndarray
    r: np.ndarray


class Clusters(NamedTuple):
    """The clusters that hold samples, in the order of their keys.

    Attributes
    ----------
    key : uint64 (n_clusters,); slice, row, column : int32 (n_clusters,), z', y' and x'.
    tile : int32 (n_clusters,), number of its tile, row by row.
    samples : uint64 (n_clusters,), the bits of its samples in the tile.
    """

    key: np.ndarray
    slice: np.ndarray
    row: np.ndarray
    column: np.ndarray
    tile: np.ndarray
    samples: np.ndarray


@kernel
def _unpack_part(found, order, n_columns, clusters, boxes, worker):
    """Write a share of the clusters in the order of their keys."""
    n = len(order)
    for i in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        note = found.notes[slot_of(order[i])]
        clusters.key[i] = order[i] >> np.uint64(SLOT_BITS)
        clusters.samples[i], clusters.slice[i] = note.mask, note.slice
        row, column = np.int32(note.row), np.int32(note.column)
        clusters.row[i], clusters.column[i], clusters.tile[i] = row, column, row * n_columns + column
        boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3] = note.x0, note.x1, note.y0, note.y1
        boxes[i, 4], boxes[i, 5] = note.r0, note.r1


@parallel_kernel
def _unpack(found, order, n_columns, clusters, boxes, shift, starts):
    for worker in prange(N_WORKERS):
        _unpack_part(found, order, n_columns, clusters, boxes, worker)
        count_part(order, shift, starts, worker)


def build_cluster_tree(samples, depth, included, layout, slices, explicit, full):
    """Build the hierarchy over the samples of a frame.

    Parameters
    ----------
    samples : positions by tiles; its depths are filled in.
    depth : float64 (n_samples,), row by row; positive, inf allowed.
    included : bool (n_samples,), the samples that the hierarchy holds.
    layout, slices : how cluster coordinates become keys.
    explicit : True for the bounds of the samples, False for those that follow from the keys.
    full : True for the full layout of the boxes, False for the compact one.

    Returns
    -------
    Clusters, nodes, and the largest 1 / depth of a sample. If no sample is included, there are no nodes.
    """
    found, order = find_clusters(samples, depth, included, layout, slices, explicit)
    n_clusters = len(order)
    clusters = Clusters(np.empty(n_clusters, np.uint64), *(np.empty(n_clusters, np.int32) for _ in range(4)),
                        np.empty(n_clusters, np.uint64))
    if n_clusters == 0:
        return clusters, None, 0.0
    boxes = np.empty((n_clusters, len(BOX)), np.float32)
    starts = np.zeros((N_WORKERS, len(layout.level_bits)), np.int64)
    _unpack(found, order, samples.columns, clusters, boxes, layout.shift + SLOT_BITS, starts)
    n_nodes = starts.sum(axis=0)
    first = np.concatenate([[0], np.cumsum(n_nodes)])
    n_inner, n_all = int(first[-1]), int(first[-1]) + n_clusters
    empty = np.empty(0, np.float32)
    nodes = Nodes(np.append(first, n_all), np.empty(n_inner, np.int32), np.full(n_all, -1, np.int32),
                  np.zeros(n_all, np.int8), np.empty(n_inner, np.uint64), np.empty(n_inner, np.int64),
                  np.empty(n_inner, np.int8), empty, empty, empty)
    first_cluster, size = link_nodes(nodes, layout, clusters, starts, full)
    nodes = nodes._replace(x=np.empty(size, np.float32), y=np.empty(size, np.float32), r=np.empty(size, np.float32))
    if explicit:
        largest_r = explicit_boxes(nodes, boxes)
    else:
        largest_r = samples.r.max()
        implicit_boxes(nodes, clusters, first_cluster, samples, layout, slices, largest_r)
    return clusters, nodes, float(largest_r)
