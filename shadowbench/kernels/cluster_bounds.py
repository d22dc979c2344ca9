"""Bounds of clusters and of the nodes above them: explicit, or implied by the key (Sintorn et al. 2014, sec. 2, 2.1).

Bounds are float32 in proj space (x, y, 1 / depth), of the same float32 coordinates that the samples are tested with.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel
from shadowbench.kernels.cluster_keys import TILE
from shadowbench.kernels.lanes import LANES, lowest_bit

_ONE = np.uint64(1)


class Bounds(NamedTuple):
    """Smallest and largest x, y and 1 / depth of each node, float32 (n_nodes, 3)."""

    low: np.ndarray
    high: np.ndarray


@kernel
def bound_clusters(clusters, samples, bounds, first):
    """Write the explicit bounds of the clusters, nodes `first` on: those of their samples (Sec. 2.1)."""
    low, high, x, y, n_columns = bounds.low, bounds.high, samples.x, samples.y, samples.columns
    tiles, masks, r_low, r_high = clusters.tile, clusters.samples, clusters.r_low, clusters.r_high
    for i in range(len(tiles)):
        row, column = tiles[i] // n_columns, tiles[i] % n_columns
        # Join the rows of the mask, then find the first and the last row and column
        bits, columns = masks[i], masks[i]
        for shift in (32, 16, 8):
            columns |= columns >> np.uint64(shift)
        columns &= np.uint64(255)
        first_x, last_x, first_y, last_y = lowest_bit(columns), 7, lowest_bit(bits) // TILE, 7
        while columns >> np.uint64(last_x) == 0:
            last_x -= 1
        while bits >> np.uint64(last_y * TILE) == 0:
            last_y -= 1
        x0, x1 = x[column * TILE + first_x], x[column * TILE + last_x]
        y0, y1 = y[(row * TILE + first_y) * TILE], y[(row * TILE + last_y) * TILE]
        k = first + i
        low[k, 0], high[k, 0] = min(x0, x1), max(x0, x1)
        low[k, 1], high[k, 1] = min(y0, y1), max(y0, y1)
        low[k, 2], high[k, 2] = r_low[i], r_high[i]


@kernel
def _bound_by_key(node, level, cluster, clusters, samples, layout, slices, largest_r, bounds):
    """Bounds that follow from a node's key alone (Sec. 2): its tiles, and its slices of depth."""
    one = np.float32(1.0)
    shift_x, shift_y, shift_z = layout.axis_shift[level, 0], layout.axis_shift[level, 1], layout.axis_shift[level, 2]
    row, column = clusters.tile[cluster] // samples.columns, clusters.tile[cluster] % samples.columns
    first_x, first_y = (column >> shift_x << shift_x) * TILE, (row >> shift_y << shift_y) * TILE
    last_x = min(first_x + (TILE << shift_x), len(samples.plane_x)) - 1
    last_y = min(first_y + (TILE << shift_y), len(samples.plane_y)) - 1
    x0, x1 = samples.x[first_x], samples.x[last_x]
    y0, y1 = samples.y[first_y * TILE], samples.y[last_y * TILE]
    bounds.low[node, 0], bounds.high[node, 0] = min(x0, x1), max(x0, x1)
    bounds.low[node, 1], bounds.high[node, 1] = min(y0, y1), max(y0, y1)
    # The first slice holds everything nearer too, the last everything farther
    first_z = clusters.slice[cluster] >> shift_z << shift_z
    last_z = first_z + (1 << shift_z)
    bounds.high[node, 2] = largest_r if first_z == 0 else one / np.float32(slices.start[first_z])
    bounds.low[node, 2] = 0.0 if last_z + 1 >= len(slices.start) else one / np.float32(slices.start[last_z])


@kernel
def implicit_bounds(nodes, clusters, first_cluster, samples, layout, slices, bounds):
    """Write the bounds of all nodes that follow from their keys; `first_cluster` is a cluster of each node."""
    largest_r = clusters.r_high[0]
    for i in range(len(clusters.r_high)):
        largest_r = max(largest_r, clusters.r_high[i])
    for level in range(len(layout.shift)):
        for node in range(nodes.first[level], nodes.first[level + 1]):
            _bound_by_key(node, level, first_cluster[node], clusters, samples, layout, slices, largest_r, bounds)


@kernel
def join_bounds(nodes, bounds):
    """Write the bounds of all nodes above the clusters from those of their children, from the bottom up."""
    low, high, parent = bounds.low, bounds.high, nodes.parent
    for child in range(len(parent) - 1, 0, -1):
        node = parent[child]
        # The last child of a node comes first
        last = child + 1 == len(parent) or parent[child + 1] != node
        for axis in range(3):
            if last or low[child, axis] < low[node, axis]:
                low[node, axis] = low[child, axis]
            if last or high[child, axis] > high[node, axis]:
                high[node, axis] = high[child, axis]


@kernel
def write_boxes(nodes, bounds):
    """Put the boxes of all nodes but the root where their parents' tests read them."""
    low, high, parent, lane, n_chunks, place = bounds.low, bounds.high, nodes.parent, nodes.lane, nodes.n_chunks, nodes.place
    x, y, r = nodes.x, nodes.y, nodes.r
    for child in range(1, len(parent)):
        node = parent[child]
        at = place[node] + lane[child]
        end = at + LANES * n_chunks[node]
        x[at], x[end] = low[child, 0], high[child, 0]
        y[at], y[end] = low[child, 1], high[child, 1]
        r[at], r[end] = low[child, 2], high[child, 2]
