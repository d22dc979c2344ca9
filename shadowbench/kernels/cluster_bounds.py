"""Boxes of clusters and of the nodes above them: explicit, or implied by the key (Sintorn et al. 2014, sec. 2, 2.1).

Boxes are float32 in proj space (x, y, 1 / depth), of the same float32 coordinates that the samples are tested with. The
boxes of a node's children stand together, where its tests read them: smallest coordinates, then largest.
"""

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.cluster_keys import TILE
from shadowbench.kernels.lanes import LANES
from shadowbench.kernels.row_lanes import masked_bounds

N_WORKERS = 32
"""Parts that the clusters are cut into."""


@kernel
def _clear_rooms(nodes, first, end):
    """Write zeros where the boxes of the children of some nodes will stand: lanes without a child are computed with, too."""
    box_x, box_y, box_r, places, n_chunks = nodes.x, nodes.y, nodes.r, nodes.place, nodes.n_chunks
    for node in range(first, end):
        here, after = places[node], places[node] + 2 * LANES * n_chunks[node]
        box_x[here:after], box_y[here:after], box_r[here:after] = 0.0, 0.0, 0.0


@kernel
def _place_part(nodes, boxes, worker):
    """Write the boxes of a share of the clusters' parents, and of their clusters."""
    parent, lane, n_chunks, places, first_child = nodes.parent, nodes.lane, nodes.n_chunks, nodes.place, nodes.first_child
    box_x, box_y, box_r = nodes.x, nodes.y, nodes.r
    top, n_inner, n_all, far = nodes.first[-3], nodes.first[-2], nodes.first[-1], np.float32(np.inf)
    first, end = top + (n_inner - top) * worker // N_WORKERS, top + (n_inner - top) * (worker + 1) // N_WORKERS
    _clear_rooms(nodes, first, end)
    for node in range(first, end):
        low_x, low_y, low_r, high_x, high_y, high_r = far, far, far, -far, -far, -far
        for child in range(first_child[node], first_child[node + 1] if node + 1 < n_inner else n_all):
            cluster = child - n_inner
            low = places[node] + lane[child]
            high = low + LANES * n_chunks[node]
            # Sec. 2.1: the box of the cluster's samples
            x0, x1, y0, y1 = boxes[cluster, 0], boxes[cluster, 1], boxes[cluster, 2], boxes[cluster, 3]
            r0, r1 = boxes[cluster, 4], boxes[cluster, 5]
            box_x[low], box_x[high], box_y[low], box_y[high], box_r[low], box_r[high] = x0, x1, y0, y1, r0, r1
            low_x, low_y, low_r = min(low_x, x0), min(low_y, y0), min(low_r, r0)
            high_x, high_y, high_r = max(high_x, x1), max(high_y, y1), max(high_r, r1)
        if node > 0:
            low = places[parent[node]] + lane[node]
            high = low + LANES * n_chunks[parent[node]]
            box_x[low], box_x[high], box_y[low], box_y[high], box_r[low], box_r[high] = (
                low_x, high_x, low_y, high_y, low_r, high_r)


@parallel_kernel
def _place(nodes, boxes):
    for worker in prange(N_WORKERS):
        _place_part(nodes, boxes, worker)


def explicit_boxes(nodes, boxes):
    """Write the explicit boxes of all nodes: those of their samples (Sec. 2.1); returns the root's largest 1 / depth.

    Parameters
    ----------
    boxes : float32 (n_clusters, 6), of the clusters, by key.
    """
    _clear_rooms(nodes, 0, nodes.first[-3])
    _place(nodes, boxes)
    return _join_boxes(nodes)


@kernel
def _join_boxes(nodes):
    """Write the boxes of the nodes above the clusters' parents, from the bottom up; returns the root's largest 1 / depth."""
    parent, lane, n_chunks, places, occupied = nodes.parent, nodes.lane, nodes.n_chunks, nodes.place, nodes.occupied
    box_x, box_y, box_r = nodes.x, nodes.y, nodes.r
    for node in range(nodes.first[-3] - 1, 0, -1):
        here, mask, chunks, above = places[node], occupied[node], n_chunks[node], parent[node]
        end = here + LANES * chunks
        low = places[above] + lane[node]
        high = low + LANES * n_chunks[above]
        box_x[low], box_x[high] = masked_bounds(box_x, here, mask, chunks)[0], masked_bounds(box_x, end, mask, chunks)[1]
        box_y[low], box_y[high] = masked_bounds(box_y, here, mask, chunks)[0], masked_bounds(box_y, end, mask, chunks)[1]
        box_r[low], box_r[high] = masked_bounds(box_r, here, mask, chunks)[0], masked_bounds(box_r, end, mask, chunks)[1]
    return masked_bounds(box_r, places[0] + LANES * n_chunks[0], occupied[0], n_chunks[0])[1]


@kernel
def implicit_boxes(nodes, clusters, first_cluster, samples, layout, slices, largest_r):
    """Write the boxes of all nodes that follow from their keys (Sec. 2): their tiles, and their slices of depth.

    Parameters
    ----------
    first_cluster : int64 (n_nodes,), a cluster of each node.
    largest_r : largest 1 / depth of a sample.
    """
    one, n_columns, n_rows = np.float32(1.0), len(samples.plane_x), len(samples.plane_y)
    _clear_rooms(nodes, 0, nodes.first[-2])
    for level in range(1, len(layout.shift)):
        shift_x, shift_y, shift_z = layout.axis_shift[level, 0], layout.axis_shift[level, 1], layout.axis_shift[level, 2]
        for node in range(nodes.first[level], nodes.first[level + 1]):
            cluster, parent = first_cluster[node], nodes.parent[node]
            low = nodes.place[parent] + nodes.lane[node]
            high = low + LANES * nodes.n_chunks[parent]
            row, column = clusters.row[cluster], clusters.column[cluster]
            first_x, first_y = (column >> shift_x << shift_x) * TILE, (row >> shift_y << shift_y) * TILE
            last_x, last_y = min(first_x + (TILE << shift_x), n_columns) - 1, min(first_y + (TILE << shift_y), n_rows) - 1
            x0, x1 = samples.x[first_x], samples.x[last_x]
            y0, y1 = samples.y[first_y * TILE], samples.y[last_y * TILE]
            nodes.x[low], nodes.x[high] = min(x0, x1), max(x0, x1)
            nodes.y[low], nodes.y[high] = min(y0, y1), max(y0, y1)
            # The first slice holds everything nearer too, the last everything farther
            first_z = clusters.slice[cluster] >> shift_z << shift_z
            last_z = first_z + (1 << shift_z)
            nodes.r[high] = largest_r if first_z == 0 else one / np.float32(slices.start[first_z])
            nodes.r[low] = 0.0 if last_z + 1 >= len(slices.start) else one / np.float32(slices.start[last_z])
