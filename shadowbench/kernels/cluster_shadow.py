"""The hierarchical shadow buffer of the clusters, its merge, and the counts of the work."""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.cluster_keys import TILE, TILE_SAMPLES

N_WORKERS = 64
"""Bands of tile rows in the merge."""

_ONE = np.uint64(1)


class Leaves(NamedTuple):
    """What the sample test of each cluster reads.

    Attributes
    ----------
    x0, y0, r0 : int32 (n_clusters,), where the tile's coordinates start in `TileSamples`.
    own : uint64 (n_clusters,), the cluster's samples in its tile.
    """

    x0: np.ndarray
    y0: np.ndarray
    r0: np.ndarray
    own: np.ndarray


class Shadow(NamedTuple):
    """The hierarchical shadow buffer.

    Attributes
    ----------
    full : uint8 (n_nodes,), 1 for nodes that lie wholly in one shadow frustum.
    open : uint64 (n_inner,), a bit per child that still is to be tested: those that exist, less those in shadow if
        they are skipped.
    waiting : uint64 (n_clusters,), a bit per sample that still is to be tested.
    samples : uint64 (n_clusters,), a bit per sample found in shadow.
    """

    full: np.ndarray
    open: np.ndarray
    waiting: np.ndarray
    samples: np.ndarray


class Counts(NamedTuple):
    """Operation counts, by node: int64 (n_nodes,), and by job or part: no two workers write to one place.

    Attributes
    ----------
    visits : times that a node's children (or samples) were tested; tests : children or samples tested.
    group_tests : children tested against the bounding frusta of groups.
    accepts, rejects, refinements : a node's children wholly inside a frustum, outside one of its planes, and neither.
    retries : a cluster's samples tested again in float64.
    job_visits : int32 (n_jobs,), nodes visited; job_tests : int64 (n_jobs,), children or samples tested.
    """

    visits: np.ndarray
    tests: np.ndarray
    group_tests: np.ndarray
    accepts: np.ndarray
    rejects: np.ndarray
    refinements: np.ndarray
    retries: np.ndarray
    job_visits: np.ndarray
    job_tests: np.ndarray


def make_leaves(clusters):
    """Find what the sample tests read."""
    return Leaves(clusters.column * np.int32(TILE), clusters.row * np.int32(TILE_SAMPLES),
                  clusters.tile * np.int32(TILE_SAMPLES), clusters.samples)


def empty_shadow(nodes, clusters, n_tiles, whole_tiles):
    """Allocate a shadow buffer without shadow.

    Parameters
    ----------
    whole_tiles : True if a cluster tests all samples of its tile, False if it tests its own.
    """
    waiting = clusters.samples.copy()
    if whole_tiles:
        of_tile = np.zeros(n_tiles, np.uint64)
        np.bitwise_or.at(of_tile, clusters.tile, clusters.samples)
        waiting = of_tile[clusters.tile]
    return Shadow(np.zeros(len(nodes.parent), np.uint8), nodes.occupied.copy(), waiting, np.zeros_like(waiting))


def empty_counts(nodes):
    """Allocate counts of zero; the jobs are not known yet."""
    n_nodes = len(nodes.parent)
    return Counts(*(np.zeros(n_nodes, np.int64) for _ in range(7)), np.zeros(0, np.int32), np.zeros(0, np.int64))


@kernel
def spread(nodes, full, first, end):
    """Mark the nodes whose parents are marked."""
    for node in range(max(first, 1), end):
        full[node] |= full[nodes.parent[node]]


@kernel
def _join_tiles(nodes, tile, own, shadow, tile_bits):
    """Collect the shadow bits of each tile from its clusters."""
    n_inner = len(nodes.first_child)
    for cluster in range(len(tile)):
        bits = own[cluster] if shadow.full[n_inner + cluster] != 0 else np.uint64(0)
        tile_bits[tile[cluster]] |= bits | shadow.samples[cluster]


@kernel
def _write_rows(samples, tile_bits, worker, merged):
    """Write the samples of a band of tile rows."""
    n_columns = len(samples.plane_x)
    for row in range(samples.rows * worker // N_WORKERS, samples.rows * (worker + 1) // N_WORKERS):
        for iy in range(min(TILE, len(samples.plane_y) - row * TILE)):
            sample = (row * TILE + iy) * n_columns
            for column in range(samples.columns):
                bits = tile_bits[row * samples.columns + column] >> np.uint64(iy * TILE)
                for ix in range(min(TILE, n_columns - column * TILE)):
                    merged[sample + column * TILE + ix] = bits >> np.uint64(ix) & _ONE


@parallel_kernel
def _write(samples, tile_bits, merged):
    for worker in prange(N_WORKERS):
        _write_rows(samples, tile_bits, worker, merged)


def merge_clusters(nodes, clusters, samples, shadow):
    """Merge the levels downwards: float32 (n_samples,), 1 for samples of the hierarchy that are in shadow."""
    spread(nodes, shadow.full, 0, len(nodes.parent))
    tile_bits = np.zeros(samples.columns * samples.rows, np.uint64)
    _join_tiles(nodes, clusters.tile, clusters.samples, shadow, tile_bits)
    merged = np.empty(len(samples.plane_x) * len(samples.plane_y), np.float32)
    _write(samples, tile_bits, merged)
    return merged
