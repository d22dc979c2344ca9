"""Computation masks as runs of samples: spans of a face are cut to the samples that the mask lets through.

Chan and Durand (2004, sec. 4) rely on hardware that rejects masked samples early. Here a span costs as many steps as it
meets runs of the mask, not as many as it has samples.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import allocating_kernel, kernel


class MaskRuns(NamedTuple):
    """The runs of one band of rows.

    Attributes
    ----------
    first_row : of the band.
    first_run : int64 (n_rows + 1,), where each row's runs start in `runs`.
    runs : int64 (n, 2), first column and one past the last, from left to right.
    pieces : int64 (n, 4), room for the spans of one face after cutting.
    """

    first_row: int
    first_run: NDArray[np.int64]
    runs: NDArray[np.int64]
    pieces: NDArray[np.int64]


@allocating_kernel
def find_runs(mask, first_row, last_row, spans_per_row):
    """List the runs of some rows of a mask; bool (0, 0) has none.

    Parameters
    ----------
    mask : bool (rows, columns).
    first_row, last_row : of the band; it may have no rows.
    spans_per_row : most spans of a face in one row.
    """
    n_rows, n_columns = (max(0, last_row - first_row + 1), mask.shape[1]) if len(mask) > 0 else (0, 0)
    first_run = np.zeros(n_rows + 1, np.int64)
    runs = np.empty((n_rows * ((n_columns + 1) // 2), 2), np.int64)
    n = 0
    for i in range(n_rows):
        for column in range(n_columns):
            if mask[first_row + i, column]:
                if column == 0 or not mask[first_row + i, column - 1]:
                    runs[n, 0] = column
                    n += 1
                runs[n - 1, 1] = column + 1
        first_run[i + 1] = n
    # The spans of a row are disjoint, so each adds at most one piece to the row's runs
    return MaskRuns(first_row, first_run, runs, np.empty((n + n_rows * spans_per_row, 4), np.int64))


@kernel
def cut_spans(spans, n_spans, masked):
    """Cut spans (row, first column, one past the last, winding number) to the runs of a mask; return their number."""
    runs, pieces = masked.runs, masked.pieces
    n = 0
    for i in range(n_spans):
        row, first, end = spans[i, 0], spans[i, 1], spans[i, 2]
        low, last = masked.first_run[row - masked.first_row], masked.first_run[row - masked.first_row + 1]
        # Find the first run that ends after the span's start
        high = last
        while low < high:
            middle = (low + high) // 2
            if runs[middle, 1] > first:
                high = middle
            else:
                low = middle + 1
        while low < last and runs[low, 0] < end:
            pieces[n, 0], pieces[n, 3] = row, spans[i, 3]
            pieces[n, 1], pieces[n, 2] = max(first, runs[low, 0]), min(end, runs[low, 1])
            n += 1
            low += 1
    return n
