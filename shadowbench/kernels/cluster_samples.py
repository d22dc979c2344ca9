"""Clusters of view samples: those of a tile that lie in the same slice of depth (Sintorn et al. 2014, sec. 2, eq. 1).

They are found tile by tile, and boxed there and then, while the tile's samples are in the cache; then they are sorted by
their keys. What is sorted is one number for each, its key and, in the lowest bits, the slot where it was noted.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.cluster_keys import TILE, TILE_SAMPLES
from shadowbench.kernels.lanes import LANES, lowest_bit
from shadowbench.kernels.row_lanes import highest_bit, masked_bounds, row_between, row_mask, store_reciprocals

N_WORKERS = 32
"""Bands that the rows of tiles are cut into."""

ROOM_PER_TILE = 8, TILE_SAMPLES
"""Clusters per tile, on average over a band, that there is room for at first, and if that is not enough."""

BOX = "x0", "x1", "y0", "y1", "r0", "r1"
"""Smallest and largest coordinates of a box in proj space."""

NEAREST_STEP = 2 * TILE
"""Step between the columns, and rows, of the samples that decide where the slices of depth start. Taking all of them changes
the operations by less than 1 % on the built-in scenes, and takes a tenth of the time of building the hierarchy."""

SLOT_BITS = 32
"""Bits of the slot below a cluster's key."""


class TileSamples(NamedTuple):
    """The view samples tile by tile, in the layout of `shadowbench.kernels.lanes`: a chunk is a row of the tile.

    Attributes
    ----------
    x : float32, position of the 8 columns of each tile column on the image plane.
    y : float32, position of the 64 samples of each tile row.
    r : float32, 1 / depth of the 64 samples of each tile, tile by tile; 0 for those that are not included.
    columns, rows : number of tile columns and rows.
    plane_x, plane_y : float64, position of every column and row of samples.
    """

    x: np.ndarray
    y: np.ndarray
    r: np.ndarray
    columns: int
    rows: int
    plane_x: np.ndarray
    plane_y: np.ndarray


NOTE = np.dtype([("mask", np.uint64), ("slice", np.int32), ("row", np.int16), ("column", np.int16),
                 *((name, np.float32) for name in BOX)])
"""What is noted of a cluster: its samples in the tile, slice, row and column of the tile, and its explicit box."""


class Found(NamedTuple):
    """Clusters as they are found, one stretch of the keys and notes per band of tile rows.

    Attributes
    ----------
    key : uint64; notes : `NOTE`.
    count : int64 (n_bands,), clusters per band.
    start : int64 (n_bands + 1,), where each band's stretch begins, and where the last one ends.
    slot_of_slice : int32 (n_bands, n_slices), the cluster that a band has met last in a slice; -1 at first.
    """

    key: np.ndarray
    notes: np.ndarray
    count: np.ndarray
    start: np.ndarray
    slot_of_slice: np.ndarray


def tile_samples(plane_x, plane_y):
    """Lay out the positions of samples by tiles; the last column and row are repeated beyond the image."""
    columns, rows = -(-len(plane_x) // TILE), -(-len(plane_y) // TILE)
    x, y = np.full(columns * TILE, plane_x[-1], np.float32), np.full(rows * TILE, plane_y[-1], np.float32)
    x[:len(plane_x)], y[:len(plane_y)] = plane_x, plane_y
    r = np.empty(columns * rows * TILE_SAMPLES, np.float32)
    return TileSamples(x, np.repeat(y, TILE), r, columns, rows, plane_x, plane_y)


def nearest_depth(depth, n_columns):
    """Smallest of the depths of every 16th sample in every 16th row: float64 (n_samples,) row by row, positive."""
    return float(depth.reshape(-1, n_columns)[::NEAREST_STEP, ::NEAREST_STEP].min())


@kernel
def _box_cluster(note, samples, tile_row, tile_column):
    """Write the explicit box of a cluster: of those samples of its tile that its mask holds."""
    x, y, mask, joined = samples.x, samples.y, note.mask, note.mask
    # Join the rows of the mask, then find its first and last columns and rows
    for shift in (32, 16, 8):
        joined |= joined >> np.uint64(shift)
    joined &= np.uint64(255)
    x0, x1 = x[tile_column * TILE + lowest_bit(joined)], x[tile_column * TILE + highest_bit(joined)]
    y0, y1 = y[tile_row * TILE_SAMPLES + lowest_bit(mask)], y[tile_row * TILE_SAMPLES + highest_bit(mask)]
    note.x0, note.x1, note.y0, note.y1 = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
    first = lowest_bit(mask) // LANES * LANES
    place = (tile_row * samples.columns + tile_column) * TILE_SAMPLES + first
    note.r0, note.r1 = masked_bounds(samples.r, place, mask >> np.uint64(first), (highest_bit(mask) - first) // LANES + 1)


@kernel
def _find_in_band(worker, samples, depth, bits, included, layout, slices, explicit, found):
    """Find the clusters of a band of tile rows. Rows of samples are padded to whole tiles. -1: there is no room."""
    n_columns, n_rows = samples.columns * TILE, len(samples.plane_y)
    tile_r, starts, guide = samples.r, slices.start, slices.guide
    shift, first_range, last_range = slices.shift, slices.first, len(slices.guide) - 1
    keys, notes, slot_of_slice = found.key, found.notes, found.slot_of_slice[worker]
    n, end = found.start[worker], found.start[worker + 1]
    for tile_row in range(samples.rows * worker // N_WORKERS, samples.rows * (worker + 1) // N_WORKERS):
        height = min(TILE, n_rows - tile_row * TILE)
        for tile_column in range(samples.columns):
            tile = tile_row * samples.columns + tile_column
            before, offset, slot, low, high = n, tile * TILE_SAMPLES, np.int64(-1), 0.0, 0.0
            for iy in range(TILE):
                sample, place = (tile_row * TILE + iy) * n_columns + tile_column * TILE, offset + iy * TILE
                if iy >= height:
                    tile_r[place:place + TILE] = 0.0
                    continue
                waiting = row_mask(included, sample)
                store_reciprocals(depth, sample, waiting, tile_r, place)
                # The cluster that was met last goes on in most rows
                if slot >= before:
                    taken = waiting & row_between(depth, sample, low, high)
                    waiting ^= taken
                    notes[slot].mask |= taken << np.uint64(iy * TILE)
                while waiting != 0:
                    # Eq. 1: the slice that the depth's range begins in, or the next
                    first = sample + lowest_bit(waiting)
                    z = guide[min(max((bits[first] >> shift) - first_range, 0), last_range)]
                    z += depth[first] >= starts[z + 1]
                    # Take all samples of the row that lie in it
                    low, high = starts[z] if z > 0 else 0.0, starts[z + 1]
                    taken = waiting & row_between(depth, sample, low, high)
                    waiting ^= taken
                    # The cluster last noted for the slice, if it is of this tile
                    slot = np.int64(slot_of_slice[z])
                    if slot < before:
                        if n == end:
                            found.count[worker] = -1
                            return
                        slot = n
                        slot_of_slice[z] = slot
                        keys[slot] = layout.key_x[tile_column] | layout.key_y[tile_row] | layout.key_z[z]
                        notes[slot].slice, notes[slot].row, notes[slot].column = z, tile_row, tile_column
                        notes[slot].mask = 0
                        n += 1
                    notes[slot].mask |= taken << np.uint64(iy * TILE)
            # Sec. 2.1: the boxes of the tile's clusters, while its samples are at hand
            if explicit:
                for slot in range(before, n):
                    _box_cluster(notes[slot], samples, tile_row, tile_column)
    found.count[worker] = n - found.start[worker]


@parallel_kernel
def _find(samples, depth, bits, included, layout, slices, explicit, found):
    for worker in prange(N_WORKERS):
        _find_in_band(worker, samples, depth, bits, included, layout, slices, explicit, found)


def find_clusters(samples, depth, included, layout, slices, explicit):
    """Group the included samples into clusters, and lay out their depths by tiles (filled in `samples`).

    Returns
    -------
    Clusters as they are found, in the room for them, and uint64 (n_clusters,), by key, where each of them is.
    """
    n_columns, n_rows = len(samples.plane_x), len(samples.plane_y)
    if n_columns % TILE:
        padding = (0, 0), (0, -n_columns % TILE)
        depth = np.pad(depth.reshape(n_rows, -1), padding, constant_values=1.0).reshape(-1)
        included = np.pad(included.reshape(n_rows, -1), padding).reshape(-1)
    for room in ROOM_PER_TILE:
        start = samples.rows * np.arange(N_WORKERS + 1) // N_WORKERS * samples.columns * room
        found = Found(np.empty(start[-1], np.uint64), np.empty(start[-1], NOTE), np.zeros(N_WORKERS, np.int64), start,
                      np.full((N_WORKERS, len(slices.start) - 1), -1, np.int32))
        _find(samples, depth, depth.view(np.int64), included, layout, slices, explicit, found)
        if found.count.min() >= 0:
            break
    order = np.empty(int(found.count.sum()), np.uint64)
    _pack(found, order)
    order.sort()
    return found, order


@kernel
def _pack(found, order):
    """Write each cluster's key and place in one number, by which the clusters are sorted."""
    n = 0
    for worker in range(N_WORKERS):
        for slot in range(found.start[worker], found.start[worker] + found.count[worker]):
            order[n] = found.key[slot] << np.uint64(SLOT_BITS) | np.uint64(slot)
            n += 1


@kernel
def slot_of(entry):
    """Return the slot of a cluster, from its number in `order`."""
    return np.int64(entry & np.uint64((1 << SLOT_BITS) - 1))
