"""Cluster coordinates and keys of view samples (Sintorn et al. 2014, eq. 1 and Fig. 2).

A cluster is a tile of 8 x 8 samples cut into slices of depth that grow by a constant ratio, so that clusters are
about as deep as they are wide. Its key interleaves the bits of x', y' and z' from the lowest up, x' first; the bits
that z' has more than the others end up on top. Five bits at a time the key is the path through a tree: at 1024 x 1024
samples 7 + 7 + 9 bits, hence a root with 8 children (depth slices) and four levels of 32.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel

TILE = 8
"""Columns and rows of samples in a tile."""

TILE_SAMPLES = TILE * TILE
"""Samples of a tile, which is the width of a mask."""

CHILD_BITS = 5
"""Bits of the key per level: 32 children. The root has what is left over."""

MORE_DEPTH_BITS = 2
"""Bits of z' beyond those of x' and y': 9 against 7 at 1024 x 1024 (Sintorn et al. 2014, sec. 2)."""

LARGEST_TILE_BITS = 10
"""Bits of x' and y' at 8192 x 8192, where the key fills 32 bits."""

MANTISSA_BITS = 52
"""Bits of a float64 below its exponent."""


class KeyLayout(NamedTuple):
    """How cluster coordinates become keys, and keys a path through the tree.

    Attributes
    ----------
    level_bits : int64 (n_levels,), bits of the key that choose a child of a node, from the root down.
    shift : int64 (n_levels + 1,), bits of the key below each level's nodes; 0 for the clusters themselves.
    axis_shift : int64 (n_levels + 1, 3), how many of these are bits of x', y' and z'.
    key_x, key_y, key_z : uint64, the bits that each coordinate adds to the key.
    """

    level_bits: np.ndarray
    shift: np.ndarray
    axis_shift: np.ndarray
    key_x: np.ndarray
    key_y: np.ndarray
    key_z: np.ndarray


class Slices(NamedTuple):
    """The slices of depth.

    Attributes
    ----------
    start : float64 (n_slices + 1,), smallest depth of each slice; nearer samples belong to the first one. One
        more entry, not a number, ends the last slice: no depth reaches it.
    guide : int32 (n,), the slice that each of a row of ranges of depth begins in. A range is narrower than a slice.
    shift : bits of a depth, as an integer, that do not matter for its range.
    first : number of the first range: the depth's bits, shifted.
    """

    start: np.ndarray
    guide: np.ndarray
    shift: int
    first: int


@functools.lru_cache(maxsize=8)
def key_layout(n_columns, n_rows):
    """Lay out the keys for a grid of samples. The same arrays for the same grid: do not write to them.

    Raises
    ------
    ValueError
        If the grid has more than 8192 columns or rows.
    """
    n_tiles = -(-max(n_columns, n_rows) // TILE)
    tile_bits = (n_tiles - 1).bit_length()
    if tile_bits > LARGEST_TILE_BITS:
        raise ValueError(f"cluster keys reach to {TILE << LARGEST_TILE_BITS} samples in a row or column, not "
                         f"{max(n_columns, n_rows)}: use a smaller image or fewer samples per pixel")
    order = [axis for _ in range(tile_bits) for axis in range(3)] + [2] * MORE_DEPTH_BITS
    n_levels = -(-len(order) // CHILD_BITS)
    shift = np.arange(n_levels, -1, -1) * CHILD_BITS
    shift[0] = len(order)
    axis_shift = np.array([[order[:n].count(axis) for axis in range(3)] for n in shift])
    tables = []
    for axis in range(3):
        places = [place for place, of_axis in enumerate(order) if of_axis == axis]
        value = np.arange(1 << len(places), dtype=np.uint64)
        tables.append(sum(((value >> np.uint64(i) & np.uint64(1)) << np.uint64(place) for i, place in enumerate(places)),
                          np.zeros(len(value), np.uint64)))
    return KeyLayout(-np.diff(shift), shift, axis_shift, *tables)


def make_slices(start, tan_y, n_tile_rows, n_slices):
    """Find the slices of depth (Sintorn et al. 2014, eq. 1, with the half angle of the field of view).

    Parameters
    ----------
    start : depth at which the first slice starts, positive.
    tan_y : tangent of half the vertical field of view.
    n_tile_rows : S_y, number of tiles in the image's height.
    """
    step = 2.0 * tan_y / n_tile_rows
    boundaries = np.empty(n_slices + 1)
    _set_boundaries(boundaries, start, 1.0 + step)
    # A range is 2^-n of an octave, so that it holds at most one boundary
    shift = MANTISSA_BITS - max(0, 1 - math.frexp(step)[1])
    bits = boundaries.view(np.int64)
    first, last = int(bits[0]) >> shift, int(bits[-2]) >> shift
    guide = np.empty(last - first + 1, np.int32)
    _set_guide(bits, first, shift, guide)
    return Slices(boundaries, guide, shift, first)


@kernel
def _set_boundaries(boundaries, start, ratio):
    """Multiply again and again, without a logarithm: the same bits on every machine. The last entry is not a number."""
    for z in range(len(boundaries) - 1):
        # Far slices of a very flat image may begin at infinity
        boundaries[z] = start
        start *= ratio
    boundaries[-1] = np.nan


@kernel
def _set_guide(bits, first, shift, guide):
    """Find the last boundary at or before the beginning of each range of depth; positive numbers compare like their bits."""
    z, n_slices = 0, len(bits) - 1
    for i in range(len(guide)):
        while z + 1 < n_slices and bits[z + 1] <= (first + i) << shift:
            z += 1
        guide[i] = z
