"""Stencil shadow volumes put together: what z-pass, z-fail and methods that mix them with others have in common."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.kernels import shadow_frustum
from shadowbench.kernels.caster_selection import closed_triangles, select_casters
from shadowbench.kernels.edges import EdgeAdjacency, edge_adjacency
from shadowbench.kernels.stencil import StencilCounts, StencilTarget, draw_faces
from shadowbench.kernels.volume_bins import VolumeLimits, bin_faces
from shadowbench.kernels.volume_faces import Faces

NEAREST_BEHIND = 0.5
"""z-fail draws faces from this share of the near depth on: they matter only behind samples, which lie beyond it."""

NEAREST_BEFORE = 2.0**-20
"""z-pass draws faces from this share of the near depth on. What lies between the eye and that depth is settled by the
eye count, so it is as small as the rounding of view space (2^-52 of the largest coordinate) lets it be."""

NO_MASK = np.zeros((0, 0), np.bool_)


class PreparedVolumes(NamedTuple):
    """What depends on neither light nor camera.

    Attributes
    ----------
    adjacency : EdgeAdjacency.
    closed : bool (n_triangles,), triangles of closed bodies; None unless the choice of casters depends on them.
    """

    adjacency: EdgeAdjacency
    closed: NDArray[np.bool_] | None


class Drawn(NamedTuple):
    """What drawing counted.

    Attributes
    ----------
    per_sample : StencilCounts.
    per_triangle : int64 (n_triangles,), stencil updates of the faces of each triangle, and of the edges that it is the
        first to use.
    """

    per_sample: StencilCounts
    per_triangle: NDArray[np.int64]


def prepare_volumes(mesh, casters: str, by_part: bool) -> PreparedVolumes:
    """Find edges and closed bodies.

    Parameters
    ----------
    mesh : Mesh.
    casters : "all", "back_faces" or "auto".
    by_part : True if parts must not share edges, so that each has a shadow volume of its own.
    """
    closed = closed_triangles(mesh.corners) if casters == "auto" else None
    return PreparedVolumes(edge_adjacency(mesh.corners, mesh.part if by_part else None), closed)


def choose_casters(corners, light: NDArray[np.float64], casters: str, closed) -> NDArray[np.bool_] | None:
    """Tell which triangles cast, bool (n_triangles,), or None for all."""
    if casters == "all":
        return None
    sides = np.empty(len(corners), np.int8)
    shadow_frustum.find_facing(corners, light, sides)
    return select_casters(casters, sides, closed)


def empty_stencil(samples) -> StencilTarget:
    """Make a stencil buffer that is all zero."""
    shape = (samples.rows, samples.columns)
    return StencilTarget(samples.depth.reshape(shape), np.zeros(shape, np.uint32))


def add_eye_volumes(target: StencilTarget, around: NDArray[np.int64], limits: VolumeLimits) -> None:
    """Start the count from the volumes that contain the eye, each within the limits of its part.

    Parameters
    ----------
    target : updated in place.
    around : int64 (n,), triangles whose frusta contain the eye.
    limits : VolumeLimits.
    """
    for part, n_around in zip(*np.unique(limits.part[around], return_counts=True), strict=True):
        inside = (slice(limits.rows[part, 0], limits.rows[part, 1] + 1),
                  slice(limits.columns[part, 0], limits.columns[part, 1] + 1))
        depth = target.depth[inside]
        within = (depth >= limits.depths[part, 0]) & (depth <= limits.depths[part, 1])
        target.stencil[inside] += within * np.uint32(n_around)


def draw_volumes(view, faces: Faces, z_fail: bool, target: StencilTarget, limits: VolumeLimits,
                 mask: NDArray[np.bool_] = NO_MASK, counting: bool = False) -> Drawn | None:
    """Draw faces into a stencil buffer, and count if `counting`; see `stencil.draw_faces`."""
    bins = bin_faces(len(view.down), faces, limits)
    if not counting:
        draw_faces(view, faces, bins, z_fail, target, limits, mask, None)
        return None
    counts = StencilCounts(*(np.zeros(target.stencil.shape, np.int64) for _ in range(3)),
                           np.zeros(len(bins.face), np.int64))
    draw_faces(view, faces, bins, z_fail, target, limits, mask, counts)
    per_triangle = np.zeros(len(limits.part), np.int64)
    np.add.at(per_triangle, faces.triangle[bins.face], counts.per_entry)
    return Drawn(counts, per_triangle)


def resolve_stencil(target: StencilTarget, bits: int, candidate: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Read the shadow off a stencil buffer of so many bits: float32 (n_samples,), 1 where its value is not zero."""
    value = target.stencil.reshape(-1) & np.uint32(2**bits - 1)
    return ((value != 0) & candidate).astype(np.float32)


def memory(faces: Faces, samples, bits: int) -> dict[str, int]:
    """Bytes of the stencil buffer and of the faces that were drawn."""
    n_faces = int((faces.end - faces.first[:-1]).sum())
    per_face = sum(array[:1].nbytes for array in faces[2:])
    return {"stencil": samples.rows * samples.columns * bits // 8, "volume_faces": n_faces * per_face}


def totals(drawn: Drawn, target: StencilTarget, bits: int, samples) -> dict[str, int]:
    """Counts of a frame by name."""
    counts = target.stencil.view(np.int32).astype(np.int64)
    surface = (samples.triangle >= 0).reshape(counts.shape)
    overflow = surface & (counts >= 2**bits)
    lost = overflow & (counts % 2**bits == 0) & samples.candidate.reshape(counts.shape)
    return {"stencil_fragments": int(drawn.per_sample.fragments.sum()),
            "depth_tests": int(drawn.per_sample.depth_tests.sum()),
            "stencil_updates": int(drawn.per_sample.updates.sum()),
            "peak_stencil": max(0, int(counts[surface].max(initial=0))),
            "stencil_overflows": int(np.count_nonzero(overflow)),
            "stencil_overflows_lit": int(np.count_nonzero(lost))}
