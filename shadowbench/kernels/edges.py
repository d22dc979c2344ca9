"""Edges of a triangle soup: which triangles share them, and how often the shadow volume's side passes through each.

Vertices are identified by position: two vertices are one where all three coordinates are equal, so meshes that store
a vertex once per triangle are connected as well as those that share it. Positions are numbered in lexicographic order
(x, then y, then z). An edge runs from its smaller position to its larger one, whichever way its triangles wind.

Each triangle that casts, turned to face the light, adds +1 to the edges that it runs along and -1 to those that it runs
against. The sum is the edge's *multiplicity*: the number of side quads that the shadow volume has there, and which way
they face. It is right for closed, open, non-manifold and inconsistently wound meshes alike (Sintorn et al. 2011, sec.
4, draws the quads of shared edges "twice"; this is the general rule).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.jit import kernel, parallel_kernel, prange

N_WORKERS = 64
"""Parts that the list of edges is cut into: a constant, so nothing depends on the number of threads."""


class EdgeAdjacency(NamedTuple):
    """Positions and edges of a mesh.

    Attributes
    ----------
    positions : float64 (n_positions, 3), world, in lexicographic order, each once.
    corners : int32 (n_triangles, 3), position of each vertex.
    ends : int32 (n_edges, 2), positions of each edge, smaller first.
    triangle_edges : int32 (n_triangles, 3), edge from corner k to corner k + 1.
    along : int8 (n_triangles, 3), +1 if the triangle's winding runs along that edge, -1 if against it.
    first_use : int64 (n_edges + 1,), where each edge's triangles start in `uses`.
    uses : int32 (3 n_triangles,), 3 * triangle + k, edge by edge, in increasing order within each.
    """

    positions: NDArray[np.float64]
    corners: NDArray[np.int32]
    ends: NDArray[np.int32]
    triangle_edges: NDArray[np.int32]
    along: NDArray[np.int8]
    first_use: NDArray[np.int64]
    uses: NDArray[np.int32]


def _number_positions(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the different points in lexicographic order, and the number of each point among them."""
    order = np.lexsort((points[:, 2], points[:, 1], points[:, 0]))
    ordered = points[order]
    is_new = np.ones(len(points), np.bool_)
    is_new[1:] = np.any(ordered[1:] != ordered[:-1], axis=1)
    number = np.empty(len(points), np.int64)
    number[order] = np.cumsum(is_new) - 1
    return np.ascontiguousarray(ordered[is_new]), number


def edge_adjacency(corners: NDArray[np.float64], part: NDArray[np.int32] | None = None) -> EdgeAdjacency:
    """Find the edges of a triangle soup.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.
    part : int32 (n_triangles,), triangles of different parts share no edge; None to let all share.
    """
    positions, number = _number_positions(corners.reshape(-1, 3))
    index = number.reshape(-1, 3)
    start, end = index.ravel(), np.roll(index, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    group = np.zeros(len(low), np.int64) if part is None else np.repeat(part.astype(np.int64), 3)
    # Sort the uses by edge; a stable sort keeps the triangles of each in order
    uses = np.lexsort((high, low, group))
    keys = np.stack([group, low, high], axis=1)[uses]
    is_new = np.ones(len(uses), np.bool_)
    is_new[1:] = np.any(keys[1:] != keys[:-1], axis=1)
    edge_of_use = np.empty(len(uses), np.int32)
    edge_of_use[uses] = np.cumsum(is_new) - 1
    first_use = np.append(np.flatnonzero(is_new), len(uses))
    return EdgeAdjacency(positions, index.astype(np.int32), np.ascontiguousarray(keys[is_new, 1:].astype(np.int32)),
                         edge_of_use.reshape(-1, 3), np.where(start < end, 1, -1).astype(np.int8).reshape(-1, 3),
                         first_use.astype(np.int64), uses.astype(np.int32))


@kernel
def _add_multiplicities(worker, adjacency, facing, multiplicity):
    """Sum up one worker's share of the edges."""
    n_edges = len(multiplicity)
    for edge in range(worker * n_edges // N_WORKERS, (worker + 1) * n_edges // N_WORKERS):
        total = 0
        for i in range(adjacency.first_use[edge], adjacency.first_use[edge + 1]):
            triangle, k = adjacency.uses[i] // 3, adjacency.uses[i] % 3
            total += facing[triangle] * adjacency.along[triangle, k]
        multiplicity[edge] = total


@parallel_kernel
def _add_all_multiplicities(adjacency, facing, multiplicity):
    for worker in prange(N_WORKERS):
        _add_multiplicities(np.int64(worker), adjacency, facing, multiplicity)


def edge_multiplicities(adjacency: EdgeAdjacency, facing: NDArray[np.int8]) -> NDArray[np.int32]:
    """Sum up the multiplicity of every edge.

    Parameters
    ----------
    adjacency : the mesh.
    facing : int8 (n_triangles,), +1 for a triangle whose winding normal faces the light, -1 for one that must be turned
        round to face it, 0 for one that casts nothing.

    Returns
    -------
    int32 (n_edges,) : positive where the volume's side runs along the edge, its inside on the left seen from the light.
    """
    multiplicity = np.zeros(len(adjacency.ends), np.int32)
    _add_all_multiplicities(adjacency, facing, multiplicity)
    return multiplicity
