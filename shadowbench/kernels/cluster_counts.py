"""Attribution of what the cluster traversal counted to samples, and the picture of the tree."""

import numpy as np

from shadowbench.kernels.cluster_keys import TILE


def node_of_cluster(nodes, level):
    """Find each cluster's node of a level: int64 (n_clusters,)."""
    node = np.arange(len(nodes.first_child), len(nodes.parent))
    for _ in range(len(nodes.first) - 2 - level):
        node = nodes.parent[node]
    return node


def samples_of_clusters(clusters, samples):
    """Find the samples that the clusters hold.

    Returns
    -------
    int64 (n,) each: the cluster, and the place of the sample in the image, row by row.
    """
    bits = np.unpackbits(clusters.samples.astype("<u8").view(np.uint8).reshape(-1, 8), axis=1, bitorder="little")
    cluster, lane = np.nonzero(bits)
    row, column = clusters.row[cluster] * TILE + lane // TILE, clusters.column[cluster] * TILE + lane % TILE
    return cluster, row * len(samples.plane_x) + column


def tests_per_sample(nodes, clusters, samples, counts, whole_tiles):
    """Share out all tests over the samples: int64 (n_samples,), rounded.

    The tests of a node are shared evenly by the samples that it holds, as the heat maps of Sintorn et al. 2011 (Fig. 5) and
    2014 (Fig. 3) add up to the number of tests; those of a leaf that tests its whole tile, by the samples of the tile.
    """
    n_inner, tests = len(nodes.first_child), counts.tests + counts.group_tests
    held = np.zeros(len(nodes.parent))
    held[n_inner:] = np.bitwise_count(clusters.samples)
    for level in range(len(nodes.first) - 2, 0, -1):
        child = np.arange(nodes.first[level], nodes.first[level + 1])
        np.add.at(held, nodes.parent[child], held[child])
    share = tests / held
    if whole_tiles:
        share[n_inner:] = 0.0
    for level in range(1, len(nodes.first) - 1):
        child = np.arange(nodes.first[level], nodes.first[level + 1])
        share[child] += share[nodes.parent[child]]
    cluster, sample = samples_of_clusters(clusters, samples)
    per_sample = np.zeros(len(samples.plane_x) * len(samples.plane_y))
    per_sample[sample] = share[n_inner + cluster]
    if whole_tiles:
        per_tile = np.bincount(clusters.tile, tests[n_inner:], samples.columns * samples.rows)
        row, column = np.arange(len(samples.plane_y)) // TILE, np.arange(len(samples.plane_x)) // TILE
        covered = np.bincount(row)[row][:, None] * np.bincount(column)[column]
        per_sample += (per_tile[row[:, None] * samples.columns + column] / covered).reshape(-1)
    return np.rint(per_sample).astype(np.int64)


def picture_levels(nodes, clusters, samples, n_shown=4):
    """Picture the last levels of the tree, as Fig. 1b of Sintorn et al. 2014: a colour per node, four quarters.

    Returns
    -------
    uint8 (rows, columns, 3): the clusters at the bottom right, each level above before them; black where the hierarchy
    holds no sample.
    """
    n_columns, n_rows = len(samples.plane_x), len(samples.plane_y)
    cluster, sample = samples_of_clusters(clusters, samples)
    picture = np.zeros((n_rows, n_columns, 3), np.uint8)
    last = len(nodes.first) - 2
    for quarter in range(n_shown):
        level = max(last - n_shown + 1 + quarter, 0)
        # A colour from the bits of the node's number, bright enough to be told from black
        node = node_of_cluster(nodes, level).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        color = np.stack([node >> np.uint64(shift) & np.uint64(255) for shift in (40, 48, 56)], axis=1) // 4 * 3 + 64
        whole = np.zeros((n_rows * n_columns, 3), np.uint8)
        whole[sample] = color[cluster]
        part = whole.reshape(n_rows, n_columns, 3)[::2, ::2]
        top, left = quarter // 2 * (n_rows // 2), quarter % 2 * (n_columns // 2)
        target = picture[top:top + part.shape[0], left:left + part.shape[1]]
        target[:] = part[:target.shape[0], :target.shape[1]]
    return picture


def full_tree_nodes(layout):
    """Number of nodes of the full tree, leaves included (8.66 million at 1024 x 1024)."""
    return int(sum(1 << int(layout.shift[0] - shift) for shift in layout.shift[1:]))

