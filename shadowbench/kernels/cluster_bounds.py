"""Boxes of clusters and of the nodes above them: explicit, or implied by the key (Sintorn et al. 2014, sec. 2, 2.1).

Boxes are float32 in proj space (x, y, 1 / depth), of the same float32 coordinates that the samples are tested with. The
boxes of a node's children stand together, where its tests read them: smallest coordinates, then largest.
"""

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.cluster_keys import TILE, TILE_SAMPLES
from shadowbench.kernels.lanes import LANES, lowest_bit
from shadowbench.kernels.row_lanes import highest_bit, masked_bounds

N_WORKERS = 32
"""Parts that the clusters are cut into."""

_TILE_CHUNKS = TILE_SAMPLES // LANES


@kernel
def _box_part(nodes, clusters, samples, worker):
    """Write the explicit boxes of a share of the clusters."""
    parent, lane, n_chunks, places = nodes.parent, nodes.lane, nodes.n_chunks, nodes.place
    box_x, box_y, box_r, x, y, r = nodes.x, nodes.y, nodes.r, samples.x, samples.y, samples.r
    rows, columns, tiles, masks, n = clusters.row, clusters.column, clusters.tile, clusters.samples, len(clusters.tile)
    first = len(nodes.first_child)
    for i in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        row, column, node = rows[i], columns[i], parent[first + i]
        # Join the rows of the mask, then find its first and last columns and rows
        bits, joined = masks[i], masks[i]
        for shift in (32, 16, 8):
            joined |= joined >> np.uint64(shift)
        joined &= np.uint64(255)
        x0, x1 = x[column * TILE + lowest_bit(joined)], x[column * TILE + highest_bit(joined)]
        y0, y1 = y[row * TILE_SAMPLES + lowest_bit(bits)], y[row * TILE_SAMPLES + highest_bit(bits)]
        low = places[node] + lane[first + i]
        high = low + LANES * n_chunks[node]
        box_x[low], box_x[high] = min(x0, x1), max(x0, x1)
        box_y[low], box_y[high] = min(y0, y1), max(y0, y1)
        box_r[low], box_r[high] = masked_bounds(r, tiles[i] * TILE_SAMPLES, bits, _TILE_CHUNKS)


@parallel_kernel
def box_clusters(nodes, clusters, samples):
    """Write the explicit boxes of the clusters: those of their samples (Sec. 2.1)."""
    for worker in prange(N_WORKERS):
        _box_part(nodes, clusters, samples, worker)


@kernel
def join_boxes(nodes):
    """Write the boxes of all nodes above the clusters, from the bottom up; returns the root's largest 1 / depth."""
    parent, lane, n_chunks, places, occupied = nodes.parent, nodes.lane, nodes.n_chunks, nodes.place, nodes.occupied
    box_x, box_y, box_r = nodes.x, nodes.y, nodes.r
    for node in range(len(n_chunks) - 1, 0, -1):
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
