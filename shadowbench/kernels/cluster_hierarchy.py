"""The view-sample cluster hierarchy: a tree over the clusters that hold samples (Sintorn et al. 2014, sec. 2 and 2.1).

Clusters are found tile by tile, sorted by their keys, and grouped upwards, five bits of the key at a time. Only nodes
that hold samples are numbered: the root is node 0, then level by level in the order of the keys; the clusters come
last. A node's children are consecutive nodes.

**Layouts.** The boxes of a node's children stand together, coordinate by coordinate, for `shadowbench.kernels.lanes`.
In the *full* layout every possible node has its place and a child's lane is the part of its key, as the child masks of
the paper have it. In the *compact* layout the children that exist stand side by side.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.cluster_bounds import box_clusters, implicit_boxes, join_boxes
from shadowbench.kernels.cluster_keys import TILE, TILE_SAMPLES
from shadowbench.kernels.cluster_links import count_nodes, link_nodes
from shadowbench.kernels.lanes import lowest_bit
from shadowbench.kernels.row_lanes import row_between, row_mask, store_reciprocals

N_WORKERS = 32
"""Bands that the rows of tiles are cut into."""

ROOM_PER_TILE = 8, TILE_SAMPLES
"""Clusters per tile, on average over a band, that there is room for at first, and if that is not enough."""

_INDEX_BITS = np.uint64(32)


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


class _Found(NamedTuple):
    """Clusters as they are found, one stretch of the arrays per band of tile rows."""

    key: np.ndarray
    place: np.ndarray       # slice, row and column of the tile, packed
    mask: np.ndarray
    count: np.ndarray       # clusters per band
    start: np.ndarray       # where each band's stretch begins, and where the last one ends


class Nodes(NamedTuple):
    """The tree.

    Attributes
    ----------
    first : int64 (n_levels + 1,), first node of each level, the clusters' last.
    first_child : int32 (n_inner,); parent : int32 (n_nodes,).
    lane : int8 (n_nodes,), where a node's box stands among those of its siblings.
    occupied : uint64 (n_inner,), a bit per lane that holds a child.
    place : int64 (n_inner,), where the boxes of a node's children start in `x`, `y` and `r`.
    n_chunks : int8 (n_inner,), their chunks of lanes.
    x, y, r : float32, smallest, then largest coordinates of the children of each node.
    """

    first: np.ndarray
    first_child: np.ndarray
    parent: np.ndarray
    lane: np.ndarray
    occupied: np.ndarray
    place: np.ndarray
    n_chunks: np.ndarray
    x: np.ndarray
    y: np.ndarray
    r: np.ndarray


class Clusters(NamedTuple):
    """The clusters that hold samples, in the order of their keys.

    Attributes
    ----------
    key : uint64 (n_clusters,); slice, row, column : int32 (n_clusters,), z', y' and x'.
    tile : int32 (n_clusters,), number of its tile, row by row.
    samples : uint64 (n_clusters,), the bits of its samples in the tile.
    """

    key: np.ndarray
    slice: np.ndarray
    row: np.ndarray
    column: np.ndarray
    tile: np.ndarray
    samples: np.ndarray


def tile_samples(plane_x, plane_y):
    """Lay out the positions of samples by tiles; the last column and row are repeated beyond the image."""
    columns, rows = -(-len(plane_x) // TILE), -(-len(plane_y) // TILE)
    x = plane_x.astype(np.float32)[np.minimum(np.arange(columns * TILE), len(plane_x) - 1)]
    y = plane_y.astype(np.float32)[np.minimum(np.arange(rows * TILE), len(plane_y) - 1)]
    r = np.empty(columns * rows * TILE_SAMPLES, np.float32)
    return TileSamples(x, np.repeat(y, TILE), r, columns, rows, plane_x, plane_y)


@allocating_kernel
def _find_in_band(worker, samples, depth, bits, included, layout, slices, found):
    """Find the clusters of a band of tile rows. Rows of samples are padded to whole tiles. -1: there is no room."""
    n_columns, n_rows = samples.columns * TILE, len(samples.plane_y)
    tile_r, starts, guide = samples.r, slices.start, slices.guide
    shift, first_range, last_range = slices.shift, slices.first, len(slices.guide) - 1
    keys, places, masks = found.key, found.place, found.mask
    slot_of_slice = np.full(len(starts) - 1, -1, np.int64)
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
                    masks[slot] |= taken << np.uint64(iy * TILE)
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
                    slot = slot_of_slice[z]
                    if slot < before:
                        if n == end:
                            found.count[worker] = -1
                            return
                        slot = n
                        slot_of_slice[z] = slot
                        keys[slot] = layout.key_x[tile_column] | layout.key_y[tile_row] | layout.key_z[z]
                        places[slot] = ((np.int64(z) << 16) + tile_row << 16) + tile_column
                        masks[slot] = 0
                        n += 1
                    masks[slot] |= taken << np.uint64(iy * TILE)
    found.count[worker] = n - found.start[worker]


@parallel_kernel
def _find(samples, depth, bits, included, layout, slices, found):
    for worker in prange(N_WORKERS):
        _find_in_band(worker, samples, depth, bits, included, layout, slices, found)


def find_clusters(samples, depth, included, layout, slices):
    """Group the included samples into clusters, and lay out their depths by tiles (filled in `samples`)."""
    n_columns, n_rows = len(samples.plane_x), len(samples.plane_y)
    if n_columns % TILE:
        padding = (0, 0), (0, -n_columns % TILE)
        depth = np.pad(depth.reshape(n_rows, -1), padding, constant_values=1.0).reshape(-1)
        included = np.pad(included.reshape(n_rows, -1), padding).reshape(-1)
    found = None
    for room in ROOM_PER_TILE:
        start = samples.rows * np.arange(N_WORKERS + 1) // N_WORKERS * samples.columns * room
        n = int(start[-1])
        found = _Found(np.empty(n, np.uint64), np.empty(n, np.int64), np.empty(n, np.uint64),
                       np.zeros(N_WORKERS, np.int64), start)
        _find(samples, depth, depth.view(np.int64), included, layout, slices, found)
        if found.count.min() >= 0:
            break
    n = int(found.count.sum())
    order = np.empty(n, np.uint64)
    _pack(found, order)
    order.sort()
    clusters = Clusters(np.empty(n, np.uint64), *(np.empty(n, np.int32) for _ in range(4)), np.empty(n, np.uint64))
    _unpack(found, order, samples.columns, clusters)
    return clusters


@kernel
def _pack(found, order):
    """Write each cluster's key and place in one number, by which the clusters are sorted."""
    n = 0
    for worker in range(N_WORKERS):
        for slot in range(found.start[worker], found.start[worker] + found.count[worker]):
            order[n] = found.key[slot] << _INDEX_BITS | np.uint64(slot)
            n += 1


@kernel
def _unpack_part(found, order, n_columns, clusters, worker):
    """Write a share of the clusters in the order of their keys."""
    n = len(order)
    for i in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        slot = np.int64(order[i] & np.uint64(0xFFFFFFFF))
        place = found.place[slot]
        row, column = place >> 16 & 0xFFFF, place & 0xFFFF
        clusters.key[i], clusters.slice[i] = order[i] >> _INDEX_BITS, place >> 32
        clusters.row[i], clusters.column[i], clusters.tile[i] = row, column, row * n_columns + column
        clusters.samples[i] = found.mask[slot]


@parallel_kernel
def _unpack(found, order, n_columns, clusters):
    for worker in prange(N_WORKERS):
        _unpack_part(found, order, n_columns, clusters, worker)


@kernel
def _nearest_part(bits, nearest, worker):
    """Find the smallest of a share of the numbers."""
    part = bits[len(bits) * worker // N_WORKERS:len(bits) * (worker + 1) // N_WORKERS]
    a = b = c = d = nearest[worker]
    # Four chains of comparisons, because each waits for its last one
    for i in range(len(part) // 4):
        a, b = min(a, part[4 * i]), min(b, part[4 * i + 1])
        c, d = min(c, part[4 * i + 2]), min(d, part[4 * i + 3])
    for i in range(len(part) // 4 * 4, len(part)):
        a = min(a, part[i])
    nearest[worker] = min(min(a, b), min(c, d))


@parallel_kernel
def _find_nearest(bits, nearest):
    for worker in prange(N_WORKERS):
        _nearest_part(bits, nearest, worker)


def nearest_depth(depth):
    """Smallest of the depths: float64 (n_samples,), positive, whose bits compare like integers; inf if there is none."""
    nearest = np.full(N_WORKERS, np.inf)
    _find_nearest(depth.view(np.int64), nearest.view(np.int64))
    return float(nearest.min())


def build_cluster_tree(samples, depth, included, layout, slices, explicit, full):
    """Build the hierarchy over the samples of a frame.

    Parameters
    ----------
    samples : positions by tiles; its depths are filled in.
    depth : float64 (n_samples,), row by row; positive, inf allowed.
    included : bool (n_samples,), the samples that the hierarchy holds.
    layout, slices : how cluster coordinates become keys.
    explicit : True for the bounds of the samples, False for those that follow from the keys.
    full : True for the full layout of the boxes, False for the compact one.

    Returns
    -------
    Clusters, nodes, and the largest 1 / depth of a sample. If no sample is included, there are no nodes.
    """
    clusters = find_clusters(samples, depth, included, layout, slices)
    n_clusters = len(clusters.key)
    if n_clusters == 0:
        return clusters, None, 0.0
    starts = count_nodes(clusters.key, layout)
    n_nodes = starts.sum(axis=0)
    first = np.concatenate([[0], np.cumsum(n_nodes)])
    n_inner, n_all = int(first[-1]), int(first[-1]) + n_clusters
    empty = np.empty(0, np.float32)
    nodes = Nodes(np.append(first, n_all), np.empty(n_inner, np.int32), np.full(n_all, -1, np.int32),
                  np.zeros(n_all, np.int8), np.empty(n_inner, np.uint64), np.empty(n_inner, np.int64),
                  np.empty(n_inner, np.int8), empty, empty, empty)
    first_cluster, size = link_nodes(nodes, layout, clusters, starts, full)
    nodes = nodes._replace(x=np.zeros(size, np.float32), y=np.zeros(size, np.float32), r=np.zeros(size, np.float32))
    if explicit:
        box_clusters(nodes, clusters, samples)
        largest_r = join_boxes(nodes)
    else:
        largest_r = samples.r.max()
        implicit_boxes(nodes, clusters, first_cluster, samples, layout, slices, largest_r)
    return clusters, nodes, float(largest_r)
