"""The tile tree of a frame: a full tree of screen tiles with the depth bounds of their view samples.

A node of level l has a grid of children (Sintorn et al. 2011, sec. 3.4: 8 x 4 and 4 x 8 in turn for branching 32); the
children of the last level are the samples. A tile's box spans the sample positions of its columns and rows, whether
occupied or not, and the 1 / depth of its occupied samples. So x and y follow from the tile's place, and are kept
once per column and row; only depth is kept per tile. Tiles that lie off the image are not stored.

All coordinates are float32 in proj space (x, y, 1 / depth), in the layout of `shadowbench.kernels.lanes`.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.lanes import LANES

TILE_GRIDS = {4: ((2, 2), (2, 2)), 8: ((4, 2), (2, 4)), 16: ((4, 4), (4, 4)), 32: ((8, 4), (4, 8)), 64: ((8, 8), (8, 8))}
"""Columns and rows of children per branching factor: of the last level, and of the one above; further up in turn."""

N_WORKERS = 32
"""Bands of rows that a level is cut into."""


class TileTree(NamedTuple):
    """The tree. Level 0 is the root; tile (column, row) of level l is node ``first[l] + row * columns[l] + column``.

    Attributes
    ----------
    grid_x, grid_y : int64 (n_levels,), columns and rows of children of a tile.
    columns, rows : int64 (n_levels,), size of a level in tiles.
    first : int64 (n_levels + 1,), first node of each level.
    first_x, first_y : int64 (n_levels,), where a level's coordinates start in `x` and `y`.
    x : float32, for each tile column the smallest, then the largest x of its columns of children, `LANES` each.
    y : float32, for each tile row the smallest, then the largest y of its children, one per child.
    r : float32, for each tile the smallest, then the largest 1 / depth of its children, one per child; for tiles of
        the last level only one, that of the sample.
    occupied : uint64 (n_nodes,), a bit for each child that has samples.
    n_chunks : chunks of lanes per tile.
    plane_x, plane_y : float64, position of each column and row of samples on the image plane.
    """

    grid_x: np.ndarray
    grid_y: np.ndarray
    columns: np.ndarray
    rows: np.ndarray
    first: np.ndarray
    first_x: np.ndarray
    first_y: np.ndarray
    x: np.ndarray
    y: np.ndarray
    r: np.ndarray
    occupied: np.ndarray
    n_chunks: int
    plane_x: np.ndarray
    plane_y: np.ndarray


class _Bounds(NamedTuple):
    """Smallest and largest 1 / depth of each node, float32 (n_nodes,)."""

    low: np.ndarray
    high: np.ndarray


def tile_levels(n_columns, n_rows, branching):
    """Find the shape of the tree.

    Returns
    -------
    int64 (n_levels, 4), from the root down: columns and rows of children of a tile, columns and rows of tiles. There
    are at least two levels, so that the root's children are tiles.
    """
    levels = []
    columns, rows = n_columns, n_rows
    while len(levels) < 2 or columns * rows > 1:
        grid_x, grid_y = TILE_GRIDS[branching][len(levels) % 2]
        columns, rows = -(-columns // grid_x), -(-rows // grid_y)
        levels.append((grid_x, grid_y, columns, rows))
    return np.array(levels[::-1], np.int64)


def _lane_bounds(positions, width, n_tiles, lane_of_child):
    """Bounds of children per tile and lane, float32 (n_tiles, 2, n_lanes); children off the image repeat the last one.

    Parameters
    ----------
    positions : float32 (n,), of the columns (or rows) of samples.
    width : columns of samples in a child.
    lane_of_child : int64 (n_lanes,), which of the tile's columns of children each lane shows.
    """
    starts = np.arange(0, len(positions), width)
    low, high = np.minimum.reduceat(positions, starts), np.maximum.reduceat(positions, starts)
    children = lane_of_child.max() + 1
    child = np.minimum(np.arange(n_tiles)[:, None] * children + lane_of_child, len(starts) - 1)
    return np.stack([low[child], high[child]], axis=1)


def _coordinate_tables(levels, plane_x, plane_y, n_chunks):
    """Lay out x and y of all levels; returns (x, first_x, y, first_y)."""
    lane = np.arange(n_chunks * LANES)
    tables_x, tables_y = [], []
    width = height = 1
    for grid_x, grid_y, columns, rows in levels[::-1]:
        tables_x.append(_lane_bounds(plane_x.astype(np.float32), width, columns, lane[:LANES] % grid_x).reshape(-1))
        # With fewer children than lanes the spare lanes repeat the last row
        row_lanes = np.minimum(lane // grid_x, grid_y - 1)
        tables_y.append(_lane_bounds(plane_y.astype(np.float32), height, rows, row_lanes).reshape(-1))
        width, height = width * grid_x, height * grid_y
    starts = [np.cumsum([0] + [len(t) for t in tables[::-1]])[:-1].astype(np.int64) for tables in (tables_x, tables_y)]
    return np.concatenate(tables_x[::-1]), starts[0], np.concatenate(tables_y[::-1]), starts[1]


def build_tile_tree(depth, included, plane_x, plane_y, branching):
    """Build the tree over the samples of a frame.

    Parameters
    ----------
    depth : float64 (n_samples,), row by row; positive, inf allowed.
    included : bool (n_samples,), the samples that the tree holds.
    plane_x, plane_y : float64 (n_columns,) and (n_rows,), positions on the image plane.
    branching : 4, 8, 16, 32 or 64 children per tile.

    Returns
    -------
    The tree, and the largest 1 / depth of a sample in it (0 if it holds none).
    """
    levels = tile_levels(len(plane_x), len(plane_y), branching)
    grid_x, grid_y, columns, rows = (np.ascontiguousarray(levels[:, k]) for k in range(4))
    n_chunks = max(branching // LANES, 1)
    first = np.concatenate([[0], np.cumsum(columns * rows)])
    x, first_x, y, first_y = _coordinate_tables(levels, plane_x, plane_y, n_chunks)
    n_lanes = n_chunks * LANES
    r = np.zeros(n_lanes * (2 * first[-2] + columns[-1] * rows[-1]), np.float32)
    tree = TileTree(grid_x, grid_y, columns, rows, first, first_x, first_y, x, y, r, np.zeros(first[-1], np.uint64),
                    n_chunks, plane_x, plane_y)
    bounds = _Bounds(np.empty(first[-1], np.float32), np.empty(first[-1], np.float32))
    _fill_samples(tree, depth, included, bounds)
    for level in range(len(levels) - 2, -1, -1):
        _fill_level(tree, level, bounds)
    return tree, float(bounds.high[0]) if tree.occupied[0] else 0.0


@kernel
def samples_offset(tree, tile):
    """Where the coordinates r of a tile's samples start in `TileTree.r`; `tile` counts within the last level."""
    return tree.n_chunks * LANES * (2 * tree.first[len(tree.columns) - 1] + tile)


@kernel
def _fill_tile_row(tree, row, depth, included, bounds):
    """Fill one row of tiles of the last level."""
    last = len(tree.columns) - 1
    grid_x, grid_y, columns = tree.grid_x[last], tree.grid_y[last], tree.columns[last]
    n_columns = len(tree.plane_x)
    one = np.float32(1.0)
    for column in range(columns):
        tile = row * columns + column
        offset = samples_offset(tree, tile)
        occupied, low, high = np.uint64(0), np.float32(np.inf), np.float32(0.0)
        for iy in range(min(grid_y, len(tree.plane_y) - row * grid_y)):
            sample = (row * grid_y + iy) * n_columns + column * grid_x
            for ix in range(min(grid_x, n_columns - column * grid_x)):
                if included[sample + ix]:
                    # Two roundings, of the depth and of the quotient, as `lanes` assumes
                    r = one / np.float32(depth[sample + ix])
                    tree.r[offset + iy * grid_x + ix] = r
                    low, high = min(low, r), max(high, r)
                    occupied |= np.uint64(1) << np.uint64(iy * grid_x + ix)
        node = tree.first[last] + tile
        tree.occupied[node], bounds.low[node], bounds.high[node] = occupied, low, high


@kernel
def _fill_tile_rows(tree, worker, depth, included, bounds):
    rows = tree.rows[-1]
    for row in range(rows * worker // N_WORKERS, rows * (worker + 1) // N_WORKERS):
        _fill_tile_row(tree, row, depth, included, bounds)


@parallel_kernel
def _fill_samples(tree, depth, included, bounds):
    for worker in prange(N_WORKERS):
        _fill_tile_rows(tree, worker, depth, included, bounds)


@kernel
def _fill_node_rows(tree, level, worker, bounds):
    """Fill a band of rows of a level from the level below."""
    grid_x, grid_y, columns, rows = tree.grid_x[level], tree.grid_y[level], tree.columns[level], tree.rows[level]
    n_lanes = tree.n_chunks * LANES
    for row in range(rows * worker // N_WORKERS, rows * (worker + 1) // N_WORKERS):
        for column in range(columns):
            node = tree.first[level] + row * columns + column
            offset = 2 * n_lanes * node
            occupied, low, high = np.uint64(0), np.float32(np.inf), np.float32(0.0)
            for iy in range(min(grid_y, tree.rows[level + 1] - row * grid_y)):
                for ix in range(min(grid_x, tree.columns[level + 1] - column * grid_x)):
                    child = (tree.first[level + 1] + (row * grid_y + iy) * tree.columns[level + 1]
                             + column * grid_x + ix)
                    if tree.occupied[child] != 0:
                        lane = iy * grid_x + ix
                        occupied |= np.uint64(1) << np.uint64(lane)
                        tree.r[offset + lane] = bounds.low[child]
                        tree.r[offset + n_lanes + lane] = bounds.high[child]
                        low, high = min(low, bounds.low[child]), max(high, bounds.high[child])
            tree.occupied[node], bounds.low[node], bounds.high[node] = occupied, low, high


@parallel_kernel
def _fill_level(tree, level, bounds):
    for worker in prange(N_WORKERS):
        _fill_node_rows(tree, level, worker, bounds)
