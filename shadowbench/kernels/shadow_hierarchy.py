"""The hierarchical shadow buffer that a traversal of the tile tree fills, its merge, and the counts of the work."""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange

N_WORKERS = 64
"""Parts that the rows of the merge are cut into."""


class Shadow(NamedTuple):
    """The hierarchical shadow buffer.

    Attributes
    ----------
    full : uint8 (n_nodes,), 1 for tiles that lie wholly in one shadow frustum.
    samples : uint64 (n_tiles of the last level,), a bit per sample found in shadow.
    open : uint64 (n_nodes,), a bit per child that still is to be tested: the occupied ones, less those in shadow if
        they are skipped.
    """

    full: np.ndarray
    samples: np.ndarray
    open: np.ndarray


class Counts(NamedTuple):
    """Operation counts. Arrays by worker have one row per root child: no two workers write to one row.

    Attributes
    ----------
    visits : int64 (n_nodes,), times that a node's children (or samples) were tested.
    frustum_visits : int32 (branching, n_frusta), visits below each root child.
    group_visits : int64 (n_nodes,), times that a node's children were tested against a group.
    unit_visits : int32 (branching, n_groups), visits of groups below each root child.
    accepts, rejects, refinements : int64 (branching, n_levels), children of each level's nodes wholly inside a
        frustum, outside one of its planes, and neither; only occupied children that are still to be tested.
    fruitful : int64 (branching, n_levels), of the refinements, those below which the frustum put something in shadow.
    retries : int64 (branching,), samples tested again in float64.
    """

    visits: np.ndarray
    frustum_visits: np.ndarray
    group_visits: np.ndarray
    unit_visits: np.ndarray
    accepts: np.ndarray
    rejects: np.ndarray
    refinements: np.ndarray
    fruitful: np.ndarray
    retries: np.ndarray


def empty_shadow(tree):
    """Allocate a shadow buffer without shadow."""
    n_tiles = tree.levels["columns"][-1] * tree.levels["rows"][-1]
    return Shadow(np.zeros(len(tree.occupied), np.uint8), np.zeros(n_tiles, np.uint64), tree.occupied.copy())


def empty_counts(tree, n_frusta, n_groups):
    """Allocate counts of zero."""
    branching = int(tree.levels["grid_x"][0] * tree.levels["grid_y"][0])
    levels = (branching, len(tree.levels))
    return Counts(np.zeros(len(tree.occupied), np.int64), np.zeros((branching, n_frusta), np.int32),
                  np.zeros(len(tree.occupied), np.int64), np.zeros((branching, n_groups), np.int32),
                  np.zeros(levels, np.int64), np.zeros(levels, np.int64), np.zeros(levels, np.int64),
                  np.zeros(levels, np.int64), np.zeros(branching, np.int64))


@kernel
def _tile_bits(tree, shadow, row, column):
    """Samples of a tile of the last level that are in shadow by themselves or with one of their tiles."""
    bits = shadow.samples[row * tree.levels[-1].columns + column]
    occupied = tree.occupied[tree.levels[-1].first + row * tree.levels[-1].columns + column]
    for index in range(len(tree.levels) - 1, 0, -1):
        level = tree.levels[index]
        node = level.first + row * level.columns + column
        if shadow.full[node] != 0:
            return occupied
        above = tree.levels[index - 1]
        row, column = row // above.grid_y, column // above.grid_x
    return bits


@kernel
def _merge_rows(tree, shadow, worker, merged):
    """Fill the samples of a band of tile rows from the tiles' bits and their ancestors'."""
    level, n_columns = tree.levels[-1], len(tree.plane_x)
    for row in range(level.rows * worker // N_WORKERS, level.rows * (worker + 1) // N_WORKERS):
        for column in range(level.columns):
            bits = _tile_bits(tree, shadow, row, column)
            for iy in range(min(level.grid_y, len(tree.plane_y) - row * level.grid_y)):
                sample = (row * level.grid_y + iy) * n_columns + column * level.grid_x
                for ix in range(min(level.grid_x, n_columns - column * level.grid_x)):
                    merged[sample + ix] = bits >> np.uint64(iy * level.grid_x + ix) & np.uint64(1)


@parallel_kernel
def _merge(tree, shadow, merged):
    for worker in prange(N_WORKERS):
        _merge_rows(tree, shadow, worker, merged)


def merge_shadow(tree, shadow):
    """Merge the levels downwards: float32 (n_samples,), 1 for samples of the tree that are in shadow."""
    merged = np.empty(len(tree.plane_x) * len(tree.plane_y), np.float32)
    _merge(tree, shadow, merged)
    return merged


def tests_per_sample(tree, visits):
    """Share out all tests over the samples: int64 (n_samples,), rounded, so that the sum is the number of tests.

    A visit of a node tests each of its children once; these tests are shared evenly by the samples of the grid that
    the node covers, as the overdraw pictures of Sintorn et al. 2011 (Fig. 5) add up to the number of operations.
    """
    row, column = np.arange(len(tree.plane_y)), np.arange(len(tree.plane_x))
    branching = int(tree.levels["grid_x"][0] * tree.levels["grid_y"][0])
    per_sample = np.zeros((len(row), len(column)))
    for level in tree.levels[::-1]:
        row, column = row // level["grid_y"], column // level["grid_x"]
        covered = np.bincount(row)[row][:, None] * np.bincount(column)[column]
        per_sample += visits[level["first"] + row[:, None] * level["columns"] + column] * branching / covered
    return np.rint(per_sample).astype(np.int64).reshape(-1)
