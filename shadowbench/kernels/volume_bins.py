"""Faces of shadow volumes sorted by the rows that they cover, within the limits of their part of the scene.

Rows are dealt to a constant number of bands. A band owns its rows and draws its faces in their order, so results are
the same for every number of threads.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import allocating_kernel, kernel, parallel_kernel, prange
from shadowbench.kernels.shadow_volumes import N_WORKERS
from shadowbench.kernels.volume_faces import Faces

N_BANDS = 64
"""Groups of rows: a constant, so no result depends on the number of threads."""

BAND_STRIDE = 27
"""Coprime to N_BANDS: neighbouring workers get bands far apart, so each thread sees all parts of the screen."""


class VolumeLimits(NamedTuple):
    """Where the volumes of each part of the scene can reach a sample; see `volume_limits`.

    Attributes
    ----------
    part : int32 (n_triangles,).
    rows, columns : int32 (n_parts, 2), first and last that are drawn: the scissor.
    depths : float64 (n_parts, 2), nearest and farthest sample that is drawn: the depth bounds.
    """

    part: NDArray[np.int32]
    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    depths: NDArray[np.float64]


class Bins(NamedTuple):
    """Faces per band.

    Attributes
    ----------
    offset : int64 (N_BANDS, N_WORKERS + 1), where the faces of each band and worker start.
    face : int64 (n_entries,), band by band, in increasing order within each.
    """

    offset: NDArray[np.int64]
    face: NDArray[np.int64]


@kernel
def band_rows(n_rows):
    """Rows in each band."""
    return (n_rows + N_BANDS - 1) // N_BANDS


@kernel
def face_rows(faces, face, limits):
    """First and last row of a face, within its scissor."""
    first, last = np.int64(faces.rows[face, 0]), np.int64(faces.rows[face, 1])
    part = limits.part[faces.triangle[face]]
    return max(first, np.int64(limits.rows[part, 0])), min(last, np.int64(limits.rows[part, 1]))


@kernel
def _count_chunk(worker, n_rows, faces, limits, counted):
    """Count one worker's faces per band."""
    rows_per_band = band_rows(n_rows)
    for face in range(faces.first[worker], faces.end[worker]):
        first, last = face_rows(faces, face, limits)
        if first <= last:
            for band in range(first // rows_per_band, last // rows_per_band + 1):
                counted[band, worker] += 1


@allocating_kernel
def _scatter_chunk(worker, n_rows, faces, limits, bins):
    """Write one worker's faces into the bands."""
    rows_per_band = band_rows(n_rows)
    place = bins.offset[:, worker].copy()
    for face in range(faces.first[worker], faces.end[worker]):
        first, last = face_rows(faces, face, limits)
        if first <= last:
            for band in range(first // rows_per_band, last // rows_per_band + 1):
                bins.face[place[band]] = face
                place[band] += 1


@parallel_kernel
def _count_all(n_rows, faces, limits, counted):
    for worker in prange(N_WORKERS):
        _count_chunk(np.int64(worker), n_rows, faces, limits, counted)


@parallel_kernel
def _scatter_all(n_rows, faces, limits, bins):
    for worker in prange(N_WORKERS):
        _scatter_chunk(np.int64(worker), n_rows, faces, limits, bins)


def bin_faces(n_rows: int, faces: Faces, limits: VolumeLimits) -> Bins:
    """Sort faces into bands by counting: count per worker and band, add up, scatter."""
    counted = np.zeros((N_BANDS, N_WORKERS), np.int64)
    _count_all(n_rows, faces, limits, counted)
    ends = np.cumsum(counted.ravel()).reshape(N_BANDS, N_WORKERS)
    offset = np.zeros((N_BANDS, N_WORKERS + 1), np.int64)
    offset[:, 1:] = ends
    offset[1:, 0] = ends[:-1, -1]
    bins = Bins(offset, np.empty(int(ends[-1, -1]), np.int64))
    _scatter_all(n_rows, faces, limits, bins)
    return bins
