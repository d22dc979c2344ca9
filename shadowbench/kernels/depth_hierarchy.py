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

TILE_GRIDS = {4: ((2, 2), (2, 2)), 8: ((4, 2), (2, 4)), 16: ((4, 4), (4, 4)), 32: ((8, 4), (4, 8)),
              64: ((8, 8), (8, 8))}
"""Columns and rows of children per branching factor: of the last level, and of the one above; further up in turn."""

N_WORKERS = 32
"""Bands of rows that a level is cut into."""


LEVEL = np.dtype([(field, np.int64) for field in
                  ("grid_x", "grid_y", "columns", "rows", "first", "first_x", "first_y")])
"""Shape of one level: columns and rows of children of a tile, columns and rows of tiles, the level's first node, and
where its coordinates start in `TileTree.x` and `TileTree.y`."""


class TileTree(NamedTuple):
    """The tree. Level 0 is the root; tile (column, row) of a level is node ``first + row * columns + column``.

    Attributes
    ----------
    levels : `LEVEL` (n_levels,), from the root down.
    x : float32, for each tile column the smallest, then the largest x of its columns of children, `LANES` each.
    y : float32, for each tile row the smallest, then the largest y of its children, one per child.
    r : float32, for each tile the smallest, then the largest 1 / depth of its children, one per child; for tiles of
        the last level only one, that of the sample.
    occupied : uint64 (n_nodes,), a bit for each child that has samples.
    n_chunks : chunks of lanes per tile.
    plane_x, plane_y : float64, position of each column and row of samples on the image plane.
    """

    levels: np.ndarray
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
    """Find the shape of the tree, `LEVEL` (n_levels,), without the places of coordinates.

    There are at least two levels, so that the root's children are tiles.
    """
    shapes = []
    columns, rows = n_columns, n_rows
    while len(shapes) < 2 or columns * rows > 1:
        grid_x, grid_y = TILE_GRIDS[branching][len(shapes) % 2]
        columns, rows = -(-columns // grid_x), -(-rows // grid_y)
        shapes.append((grid_x, grid_y, columns, rows, 0, 0, 0))
    levels = np.array(shapes[::-1], LEVEL)
    levels["first"][1:] = np.cumsum(levels["columns"] * levels["rows"])[:-1]
    return levels


def _lane_bounds(positions, width, n_tiles, lane_of_child):
    """Bounds of children, float32, by tile, smallest and largest, lane; children off the image repeat the last one.

    Parameters
    ----------
    positions : float64 (n,), of the columns (or rows) of samples.
    width : columns of samples in a child.
    lane_of_child : int64 (n_lanes,), which of the tile's columns of children each lane shows.
    """
    positions, starts = positions.astype(np.float32), np.arange(0, len(positions), width)
    low, high = np.minimum.reduceat(positions, starts), np.maximum.reduceat(positions, starts)
    children = lane_of_child.max() + 1
    child = np.minimum(np.arange(n_tiles)[:, None] * children + lane_of_child, len(starts) - 1)
    return np.stack([low[child], high[child]], axis=1).reshape(-1)


def _coordinate_tables(levels, plane_x, plane_y, n_chunks):
    """Lay out x and y of all levels, and note in `levels` where each level starts."""
    lane = np.arange(n_chunks * LANES)
    tables_x, tables_y = [], []
    width = height = 1
    for level in levels[::-1]:
        tables_x.insert(0, _lane_bounds(plane_x, width, level["columns"], lane[:LANES] % level["grid_x"]))
        # With fewer children than lanes the spare lanes repeat the last row
        row_lanes = np.minimum(lane // level["grid_x"], level["grid_y"] - 1)
        tables_y.insert(0, _lane_bounds(plane_y, height, level["rows"], row_lanes))
        width, height = width * level["grid_x"], height * level["grid_y"]
    levels["first_x"][1:] = np.cumsum([len(table) for table in tables_x])[:-1]
    levels["first_y"][1:] = np.cumsum([len(table) for table in tables_y])[:-1]
    return np.concatenate(tables_x), np.concatenate(tables_y)


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
    n_chunks = max(branching // LANES, 1)
    x, y = _coordinate_tables(levels, plane_x, plane_y, n_chunks)
    n_tiles = levels["columns"][-1] * levels["rows"][-1]
    n_nodes = levels["first"][-1] + n_tiles
    r = np.zeros(n_chunks * LANES * (2 * levels["first"][-1] + n_tiles), np.float32)
    tree = TileTree(levels, x, y, r, np.zeros(n_nodes, np.uint64), n_chunks, plane_x, plane_y)
    bounds = _Bounds(np.empty(n_nodes, np.float32), np.empty(n_nodes, np.float32))
    _fill_samples(tree, depth, included, bounds)
    for level in range(len(levels) - 2, -1, -1):
        _fill_level(tree, level, bounds)
    return tree, float(bounds.high[0]) if tree.occupied[0] else 0.0


@kernel
def _fill_tile_row(tree, row, depth, included, bounds):
    """Fill one row of tiles of the last level."""
    level = tree.levels[-1]
    grid_x, grid_y, n_columns = level.grid_x, level.grid_y, len(tree.plane_x)
    one, n_lanes = np.float32(1.0), tree.n_chunks * LANES
    for column in range(level.columns):
        tile = row * level.columns + column
        offset = n_lanes * (2 * level.first + tile)
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
        node = level.first + tile
        tree.occupied[node], bounds.low[node], bounds.high[node] = occupied, low, high


@kernel
def _fill_tile_rows(tree, worker, depth, included, bounds):
    rows = tree.levels[-1].rows
    for row in range(rows * worker // N_WORKERS, rows * (worker + 1) // N_WORKERS):
        _fill_tile_row(tree, row, depth, included, bounds)


@parallel_kernel
def _fill_samples(tree, depth, included, bounds):
    for worker in prange(N_WORKERS):
        _fill_tile_rows(tree, worker, depth, included, bounds)


@kernel
def _fill_level(tree, index, bounds):
    """Fill a level from the level below."""
    level, below = tree.levels[index], tree.levels[index + 1]
    n_lanes = tree.n_chunks * LANES
    for row in range(level.rows):
        for column in range(level.columns):
            node = level.first + row * level.columns + column
            offset = 2 * n_lanes * node
            occupied, low, high = np.uint64(0), np.float32(np.inf), np.float32(0.0)
            for iy in range(min(level.grid_y, below.rows - row * level.grid_y)):
                child = below.first + (row * level.grid_y + iy) * below.columns + column * level.grid_x
                for ix in range(min(level.grid_x, below.columns - column * level.grid_x)):
                    if tree.occupied[child + ix] != 0:
                        lane = iy * level.grid_x + ix
                        occupied |= np.uint64(1) << np.uint64(lane)
                        tree.r[offset + lane] = bounds.low[child + ix]
                        tree.r[offset + n_lanes + lane] = bounds.high[child + ix]
                        low, high = min(low, bounds.low[child + ix]), max(high, bounds.high[child + ix])
            tree.occupied[node], bounds.low[node], bounds.high[node] = occupied, low, high
