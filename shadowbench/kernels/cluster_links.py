"""Links between the nodes of the cluster hierarchy: clusters, sorted by their keys, are grouped upwards, level by level.

Almost all nodes are clusters, so their links are set by several workers, each for the nodes that start in its share of
the clusters; the levels above follow one after the other.
"""

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.lanes import LANES

N_WORKERS = 32
"""Parts that the clusters are cut into."""

_ONE = np.uint64(1)


@kernel
def count_part(keys, shift, starts, worker):
    """Count the prefixes of the sorted keys, on every level, that start in a share of them.

    Parameters
    ----------
    keys : uint64, in order; shift : int64 (n_levels + 1,), bits below the prefixes of each level.
    starts : int64 (N_WORKERS, n_levels), counted up.
    """
    first, end = len(keys) * worker // N_WORKERS, len(keys) * (worker + 1) // N_WORKERS
    lowest = starts.shape[1] - 1
    for i in range(first, end):
        level = lowest
        while level >= 0 and (i == 0 or keys[i] >> np.uint64(shift[level]) != keys[i - 1] >> np.uint64(shift[level])):
            starts[worker, level] += 1
            level -= 1


@kernel
def _link(nodes, level, layout, clusters, first_cluster, full, first, end, node):
    """Group children, from `first` to before `end`, all those of their parents; these are numbered from `node` on.

    `first_cluster` is int64 (n_nodes,), a cluster of each node: those of the children are known, those of the nodes set.
    """
    bits, shift = np.uint64(layout.level_bits[level]), np.uint64(layout.shift[level + 1])
    lanes, occupied, above, first_child = (_ONE << bits) - _ONE, np.uint64(0), np.uint64(0), first
    node -= 1
    for child in range(first, end):
        key = clusters.key[first_cluster[child]] >> shift
        if child == first or key >> bits != above:
            if child != first:
                nodes.occupied[node] = occupied
            node, first_child, occupied, above = node + 1, child, np.uint64(0), key >> bits
            nodes.first_child[node], first_cluster[node] = child, first_cluster[child]
        lane = np.int64(key & lanes) if full else child - first_child
        nodes.parent[child], nodes.lane[child] = node, lane
        occupied |= _ONE << np.uint64(lane)
    if first < end:
        nodes.occupied[node] = occupied


@kernel
def _link_share(nodes, layout, clusters, first_cluster, full, starts, worker):
    """Group the clusters whose parents start in one worker's share."""
    keys, level = clusters.key, len(layout.level_bits) - 1
    node = nodes.first[level]
    for before in range(worker):
        node += starts[before, level]
    shift, n = np.uint64(layout.shift[level]), len(keys)
    first, end = n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS
    while 0 < first < n and keys[first] >> shift == keys[first - 1] >> shift:
        first += 1
    while 0 < end < n and keys[end] >> shift == keys[end - 1] >> shift:
        end += 1
    base = nodes.first[level + 1]
    for i in range(first, end):
        first_cluster[base + i] = i
    _link(nodes, level, layout, clusters, first_cluster, full, base + first, base + end, node)


@parallel_kernel
def _link_clusters(nodes, layout, clusters, first_cluster, full, starts):
    for worker in prange(N_WORKERS):
        _link_share(nodes, layout, clusters, first_cluster, full, starts, worker)


@kernel
def _make_room(nodes, level, layout, clusters, first_cluster, base, full):
    """Give each node of a level room for its children's boxes, from `base` on.

    Returns
    -------
    Where the places of the next level down start, in the compact layout.
    """
    bits, shift = np.uint64(layout.level_bits[level]), np.uint64(layout.shift[level + 1])
    block = 2 * LANES * -(-(1 << layout.level_bits[level]) // LANES)
    for node in range(nodes.first[level], nodes.first[level + 1]):
        last = nodes.first_child[node + 1] if node + 1 < nodes.first[level + 1] else nodes.first[level + 2]
        n_lanes = 1 << layout.level_bits[level] if full else last - nodes.first_child[node]
        nodes.n_chunks[node] = -(-n_lanes // LANES)
        if full:
            nodes.place[node] = base + block * np.int64(clusters.key[first_cluster[node]] >> shift >> bits)
        else:
            nodes.place[node] = base
            base += 2 * LANES * nodes.n_chunks[node]
    return base


def link_nodes(nodes, layout, clusters, starts, full):
    """Link all levels, and give the boxes their places.

    Parameters
    ----------
    nodes : its `first` is known, the rest but the boxes is set.
    starts : what `count_part` found.
    full : True for the full layout.

    Returns
    -------
    A cluster of each node, int64 (n_nodes,), and the size of the arrays of coordinates.
    """
    first_cluster = np.empty(len(nodes.parent), np.int64)
    _link_clusters(nodes, layout, clusters, first_cluster, full, starts)
    blocks = 2 * LANES * -(-(1 << layout.level_bits) // LANES)
    places = np.concatenate([[0], np.cumsum(blocks << (layout.shift[0] - layout.shift[:-1]))])
    end = _link_upwards(nodes, layout, clusters, first_cluster, places, full)
    return first_cluster, int(places[-1]) if full else end


@kernel
def _link_upwards(nodes, layout, clusters, first_cluster, places, full):
    """Link all levels but the clusters', which are linked, and give all boxes their places, from the bottom up."""
    first, end, n_levels = nodes.first, 0, len(layout.level_bits)
    for level in range(n_levels - 1, -1, -1):
        if level < n_levels - 1:
            _link(nodes, level, layout, clusters, first_cluster, full, first[level + 1], first[level + 2], first[level])
        end = _make_room(nodes, level, layout, clusters, first_cluster, places[level] if full else end, full)
    return end
