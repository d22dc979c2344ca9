"""Sorted events of a kd-tree node: sifting them into those of its children (see `kdtree_build`)."""

import numpy as np

from shadowbench.jit import allocating_kernel, kernel
from shadowbench.kernels.kdtree_sweep import END, PIECE_BITS, PIECE_MASK, PLANAR, START, event

_LEFT, _RIGHT, _BOTH = 0, 1, 2
_GAPS = (1750, 701, 301, 132, 57, 23, 10, 4, 1)


@allocating_kernel
def room(array, n_used, n_more):
    """Return the array, or a copy with room for more values."""
    if n_used + n_more <= len(array):
        return array
    larger = np.empty(2 * (n_used + n_more), array.dtype)
    for i in range(n_used):
        larger[i] = array[i]
    return larger


@kernel
def find_sides(events, first, end, position, planar_left, side, straddling):
    """Mark the side of every piece of a node; list those on both. Returns how many are left, right and both."""
    n_left = n_right = n_both = 0
    for i in range(first, end):
        key = events[i]
        piece, kind, here = key & PIECE_MASK, (key >> PIECE_BITS) & 3, key >> 32
        if kind == START:
            # A piece that ends at or before the plane is found at its end
            side[piece] = _RIGHT if here >= position else _BOTH
            n_right += here >= position
        elif kind == END:
            if here <= position:
                side[piece] = _LEFT
                n_left += 1
            elif side[piece] == _BOTH:
                straddling[n_both] = piece
                n_both += 1
        elif here < position or (here == position and planar_left):
            side[piece] = _LEFT
            n_left += 1
        else:
            side[piece] = _RIGHT
            n_right += 1
    return n_left, n_right, n_both


@kernel
def add_events(new, n_new, bounds, piece):
    """Append the events of a clipped piece on each axis; `new` is int64 (3, room), `n_new` int64 (3,)."""
    for axis in range(3):
        low, high, n = bounds[axis], bounds[3 + axis], n_new[axis]
        if low == high:
            new[axis, n] = event(low, PLANAR, piece)
            n_new[axis] = n + 1
        else:
            new[axis, n] = event(low, START, piece)
            new[axis, n + 1] = event(high, END, piece)
            n_new[axis] = n + 2


@kernel
def _sort(values, n):
    """Sort the first values of an array (Shell 1959, gaps of Ciura 2001): mostly there are only a few."""
    for gap in _GAPS:
        for i in range(gap, n):
            value, k = values[i], i
            while k >= gap and values[k - gap] > value:
                values[k] = values[k - gap]
                k -= gap
            values[k] = value


@kernel
def split_axis(events, first, end, side, new_left, new_right, n_new, left, right):
    """Replace a node's events at the top of one axis' stack by those of its right child, then those of its left one.

    Parameters
    ----------
    new_left, new_right, n_new : events of clipped pieces, to be sorted and merged in, and their numbers.
    left, right : scratch.

    Returns
    -------
    The stack, which may have grown, and the first event and the one after the last of the left child.
    """
    n_new_left, n_new_right = n_new
    events = room(events, end, n_new_left + n_new_right)
    _sort(new_left, n_new_left)
    _sort(new_right, n_new_right)
    n_left = n_right = i_left = i_right = 0
    for i in range(first, end):
        key = events[i]
        where = side[key & PIECE_MASK]
        if where == _LEFT:
            while i_left < n_new_left and new_left[i_left] < key:
                left[n_left] = new_left[i_left]
                n_left += 1
                i_left += 1
            left[n_left] = key
            n_left += 1
        elif where == _RIGHT:
            while i_right < n_new_right and new_right[i_right] < key:
                right[n_right] = new_right[i_right]
                n_right += 1
                i_right += 1
            right[n_right] = key
            n_right += 1
    for i in range(i_left, n_new_left):
        left[n_left] = new_left[i]
        n_left += 1
    for i in range(i_right, n_new_right):
        right[n_right] = new_right[i]
        n_right += 1
    for i in range(n_right):
        events[first + i] = right[i]
    for i in range(n_left):
        events[first + n_right + i] = left[i]
    return events, first + n_right, first + n_right + n_left
