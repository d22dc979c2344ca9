"""Conservative rasterisation: every texel that a triangle touches, with a lower bound of the triangle's depth there.

Two ways, which differ in the texels that they look at and mark:

``polygon``  Hasselgren, Akenine-Möller, Ohlsson: "Conservative Rasterization" (GPU Gems 2, 2005): the triangle grown by a
             texel, a polygon of up to nine corners. A texel's square touches a triangle iff neither an edge
             nor the box of one lies outside the other, so the polygon is drawn without making its corners.
``discard``  Hertel, Hormann, Westermann 2009, sec. 4.1: move the edges outwards by the diagonal of a texel, look at all
             texels whose centre is inside the grown triangle, and discard those whose centre is farther from the
             triangle than the diagonal.

The paper takes the least of the distances to three corners and three *lines*. Beyond a sharp corner the lines'
distances are always less than the diagonal and nothing would be discarded, unlike in its figure 2: an edge's distance
counts here only where the centre's foot point lies on the edge. Distances come from the edge functions, which are the
paper's barycentric coordinates times twice the area, and so need no division by it.

Rows are dealt to a constant number of bands, each drawn in the order of the triangles, so nothing depends on the number of
threads.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.conservative_setup import (
    BEHIND,
    BOUNDED,
    BOX,
    N_VALUES,
    POINTS,
    Face,
    Values,
    nearest_depth,
    set_up,
)
from shadowbench.kernels.elements import get

__all__ = ["ConservativeMap", "Face", "RasterCounts", "empty_map", "rasterize_conservatively"]

N_BANDS = 64
N_WORKERS = 64

_DIAGONAL = 2.0**0.5
"""Diagonal of a texel, texels."""

TEXEL_MARGIN = 2.0**-16
"""Texels by which squares are widened: against the rounding of columns and rows (2^-35 texels at 16,384) and of a sample's
own place, 8 u W over its depth (see `shadow_rays`)."""

FAR_AWAY = 2.0**30
"""Corners farther than this from the map's centre, in texels, are too far to measure distances from."""


class ConservativeMap(NamedTuple):
    """A stack of conservative maps, (n_layers, side, side) each.

    Attributes
    ----------
    depth : float64, lower bound of the depth of everything in the texel; inf where there is nothing.
    triangle : int32, the triangle that has this bound, -1 for none; the first of them where bounds are equal.
    next_depth : float64, the same bound over all other triangles.
    covered : bool, True if that triangle certainly covers the whole texel.
    """

    depth: np.ndarray
    triangle: np.ndarray
    next_depth: np.ndarray
    covered: np.ndarray


class RasterCounts(NamedTuple):
    """Counts, int64 (N_BANDS,).

    Attributes
    ----------
    fragments : texels looked at.
    discarded : those found too far from the triangle.
    written : texels that took a nearer depth.
    """

    fragments: np.ndarray
    discarded: np.ndarray
    written: np.ndarray


def empty_map(n_layers, side):
    """Make maps without any triangle."""
    shape = (n_layers, side, side)
    return ConservativeMap(np.full(shape, np.inf), np.full(shape, -1, np.int32), np.full(shape, np.inf),
                           np.zeros(shape, np.bool_))


def empty_counts():
    """Make counts that are all zero."""
    return RasterCounts(*(np.zeros(N_BANDS, np.int64) for _ in range(3)))


def rasterize_conservatively(corners, casting, origin, face, layer, discard, target, counts=None):
    """Draw the casting triangles into one layer of a map.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.
    casting : int8 (n_triangles,), zero for triangles that cast nothing.
    origin : float64 (3,), world, what the face is relative to.
    face : `Face`.
    layer : which of the maps.
    discard : True for the paper's way, False for the polygon.
    target : `ConservativeMap`, updated.
    counts : `RasterCounts`, increased, or None.
    """
    rows = np.empty((len(corners), 2), np.int32)
    _find_rows(corners, casting, origin, face, discard, rows)
    _draw_all(corners, rows, origin, face, layer, discard, target, counts)


@kernel
def _clamped(value, low, high):
    """A whole number at or below a value, kept within a range."""
    if not value > low:
        return low
    return high if value >= high else int(np.floor(value))


@kernel
def _row_range(kind, discard, face, values):
    """First and last row of a triangle's fragments; empty if last < first."""
    low, high = -np.inf, np.inf
    if kind == BOUNDED:
        low, high = values[BOX + 2], values[BOX + 3]
        if discard:
            grown_low, grown_high = _grown_range(face.texel * _DIAGONAL, values)
            low, high = min(low - face.texel, grown_low), max(high + face.texel, grown_high)
    low, high = low - face.pad, high + face.pad
    first = _clamped(face.middle - high / face.texel - TEXEL_MARGIN, -1, face.side)
    last = _clamped(face.middle - low / face.texel + TEXEL_MARGIN, -1, face.side)
    return max(first, 0), min(last, face.side - 1)


@kernel
def _grown_range(distance, values):
    """Smallest and largest v of the corners of the triangle whose edges are moved outwards (the paper's v'_i)."""
    low, high = np.inf, -np.inf
    for i in range(3):
        j = (i + 2) % 3
        a, b, c = values[4 * i], values[4 * i + 1], values[4 * i + 2]
        d, e, f = values[4 * j], values[4 * j + 1], values[4 * j + 2]
        c += distance * np.sqrt(a * a + b * b)
        f += distance * np.sqrt(d * d + e * e)
        v = (c * d - a * f) / (a * e - b * d)
        if np.isnan(v):
            return -np.inf, np.inf
        low, high = min(low, v), max(high, v)
    return low, high


@allocating_kernel
def _rows_part(corners, casting, origin, face, discard, rows, worker):
    values, n = np.empty(N_VALUES), len(corners)
    for t in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        kind = BEHIND
        if casting[t] != 0:
            kind = set_up(corners, t, origin, face, values)
        rows[t, 0], rows[t, 1] = (0, -1) if kind == BEHIND else _row_range(kind, discard, face, values)


@parallel_kernel
def _find_rows(corners, casting, origin, face, discard, rows):
    for worker in prange(N_WORKERS):
        _rows_part(corners, casting, origin, face, discard, rows, worker)


@parallel_kernel
def _draw_all(corners, rows, origin, face, layer, discard, target, counts):
    for band in prange(N_BANDS):
        _draw_band(corners, rows, origin, face, layer, discard, target, counts, band)


@allocating_kernel
def _draw_band(corners, rows, origin, face, layer, discard, target, counts, band):
    """Draw all triangles of one band of rows."""
    values = np.empty(N_VALUES)
    first_row, end_row = face.side * band // N_BANDS, face.side * (band + 1) // N_BANDS
    for t in range(len(rows)):
        if rows[t, 0] < end_row and rows[t, 1] >= first_row:
            kind = set_up(corners, t, origin, face, values)
            _draw(t, kind, max(rows[t, 0], first_row), min(rows[t, 1], end_row - 1), face, layer, discard, Values(values),
                  target, counts, band)


@kernel
def _columns(row, kind, discard, face, values):
    """First and last column of a triangle's fragments in a row."""
    texel, pad, grow = face.texel, face.pad, _DIAGONAL if discard else 0.0
    v_low, v_high = (face.middle - row - 1) * texel - pad, (face.middle - row) * texel + pad
    before, after = 1.0 + TEXEL_MARGIN + pad / texel, TEXEL_MARGIN + pad / texel
    if discard:
        v_low = v_high = (face.middle - row - 0.5) * texel
        before, after = 0.5, -0.5
    first, last = 0, face.side - 1
    if kind == BOUNDED and not discard:
        first = max(first, _clamped(np.ceil(get(values, "data", BOX) / texel + face.middle - before), 0, face.side))
        last = min(last, _clamped(get(values, "data", BOX + 1) / texel + face.middle + after, -1, last))
    for i in range(3):
        a, b = get(values, "data", 4 * i), get(values, "data", 4 * i + 1)
        rest = max(b * v_low, b * v_high) + get(values, "data", 4 * i + 2) + get(values, "data", 4 * i + 3)
        rest += grow * texel * np.sqrt(a * a + b * b)
        # The edge's value is largest at the right side of a texel if a > 0, else at its left side
        if a > 0.0:
            first = max(first, _clamped(np.ceil(-rest / a / texel + face.middle - before), 0, face.side))
        elif a < 0.0:
            last = min(last, _clamped(-rest / a / texel + face.middle + after, -1, last))
        elif rest < 0.0:
            return 0, -1
    return first, last


@kernel
def _is_far(u, v, limit, values):
    """True if a point is farther than `limit` from the triangle (sec. 4.1, with distances to edges, not lines)."""
    outside, near = False, limit * limit
    for i in range(3):
        a, b = get(values, "data", 4 * i), get(values, "data", 4 * i + 1)
        value, squared = a * u + b * v + get(values, "data", 4 * i + 2), a * a + b * b
        du, dv = u - get(values, "data", POINTS + 2 * i), v - get(values, "data", POINTS + 2 * i + 1)
        if du * du + dv * dv <= near:
            return False
        if value < 0.0:
            outside = True
            # The foot point lies on the edge if it is past its start and before its end
            j = (i + 1) % 3
            along_u = get(values, "data", POINTS + 2 * j) - get(values, "data", POINTS + 2 * i)
            along_v = get(values, "data", POINTS + 2 * j + 1) - get(values, "data", POINTS + 2 * i + 1)
            foot = du * along_u + dv * along_v
            if 0.0 <= foot <= along_u * along_u + along_v * along_v and value * value <= near * squared:
                return False
    return outside


@kernel
def _covers(u_low, u_high, v_low, v_high, grow, values):
    """True if a rectangle lies inside all edges, by more than `grow` and the slack of each."""
    for i in range(3):
        a, b = get(values, "data", 4 * i), get(values, "data", 4 * i + 1)
        least = min(a * u_low, a * u_high) + min(b * v_low, b * v_high) + get(values, "data", 4 * i + 2)
        if not least - get(values, "data", 4 * i + 3) - grow * np.sqrt(a * a + b * b) > 0.0:
            return False
    return True


@kernel
def _draw(t, kind, first_row, last_row, face, layer, discard, values, target, counts, band):
    """Draw the rows of one triangle that lie in a band."""
    texel, middle, pad, perspective, depth_pad = face.texel, face.middle, face.pad, face.perspective, face.depth_pad
    depths, triangles, next_depths, covered = target.depth, target.triangle, target.next_depth, target.covered
    widen, diagonal = pad + TEXEL_MARGIN * texel, _DIAGONAL * texel
    measured = discard and kind == BOUNDED
    if measured:
        for k in range(6):
            measured = measured and abs(get(values, "data", POINTS + k)) < FAR_AWAY * texel
    for row in range(first_row, last_row + 1):
        first, last = _columns(row, kind, discard, face, values)
        v_low, v_high = (middle - row - 1) * texel - widen, (middle - row) * texel + widen
        v_middle = 0.5 * (v_low + v_high)
        for column in range(first, last + 1):
            u_low, u_high = (column - middle) * texel - widen, (column - middle + 1) * texel + widen
            u_middle = 0.5 * (u_low + u_high)
            if counts is not None:
                counts.fragments[band] += 1
            if measured and _is_far(u_middle, v_middle, diagonal, values):
                if counts is not None:
                    counts.discarded[band] += 1
                continue
            depth = nearest_depth(perspective, values, u_low, u_high, v_low, v_high) - depth_pad
            if depth < depths[layer, row, column]:
                next_depths[layer, row, column] = depths[layer, row, column]
                depths[layer, row, column], triangles[layer, row, column] = depth, t
                if discard:     # the paper's flag: the centre is inside every edge by more than the diagonal
                    covered[layer, row, column] = _covers(u_middle, u_middle, v_middle, v_middle, diagonal, values)
                else:
                    covered[layer, row, column] = _covers(u_low, u_high, v_low, v_high, 0.0, values)
                if counts is not None:
                    counts.written[band] += 1
            elif depth < next_depths[layer, row, column]:
                next_depths[layer, row, column] = depth
