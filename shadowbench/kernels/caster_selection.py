"""Which triangles cast: all, those that face away from the light, or a choice per connected body.

Casting from back faces alone (Zioma 2003; Sintorn et al. 2011, sec. 3.5) gives the same shadows only where every ray
that enters a body also leaves it, hence on closed bodies that are wound alike and outwards.
"""

import numpy as np


def weld(corners):
    """Number the distinct positions of a mesh.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.

    Returns
    -------
    int64 (n_triangles, 3); equal numbers mean bit-equal positions (0 and -0 are one).
    """
    points = corners.reshape(-1, 3) + 0.0
    order = np.lexsort(points.T)
    points = points[order]
    number = np.zeros(len(points), np.int64)
    if len(points):
        number[order[1:]] = np.cumsum(np.any(points[1:] != points[:-1], axis=1))
    return number.reshape(-1, 3)


def closed_triangles(corners):
    """Find the triangles that belong to a closed body.

    A body is a set of triangles connected through common positions. It is closed if each of its edges runs as often in
    one direction as in the other, and if it encloses a positive volume, so that its front faces are outside.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.

    Returns
    -------
    bool (n_triangles,).
    """
    from scipy.sparse import coo_matrix  # a quarter of a second to import, and few runs ask for this
    from scipy.sparse.csgraph import connected_components

    if len(corners) == 0:
        return np.zeros(0, np.bool_)
    vertex = weld(corners)
    start, end = vertex.reshape(-1), np.roll(vertex, -1, axis=1).reshape(-1)
    n_vertices = int(vertex.max()) + 1
    links = coo_matrix((np.ones(len(start), np.int8), (start, end)), shape=(n_vertices, n_vertices))
    n_bodies, body_of_vertex = connected_components(links, directed=False)
    body = body_of_vertex[vertex[:, 0]]
    # Sum the signed uses of every undirected edge
    edge = np.minimum(start, end) * n_vertices + np.maximum(start, end)
    edges, which = np.unique(edge, return_inverse=True)
    balance = np.zeros(len(edges), np.int64)
    np.add.at(balance, which, np.sign(end - start))
    closed = np.ones(n_bodies, np.bool_)
    closed[body_of_vertex[edges[balance != 0] // n_vertices]] = False
    closed &= _volumes(corners, body, n_bodies) > 0.0
    return closed[body]


def _volumes(corners, body, n_bodies):
    """Six times the volume that each body encloses, summed in triangle order relative to the body's first vertex."""
    first = np.full(n_bodies, len(body))
    np.minimum.at(first, body, np.arange(len(body)))
    a, b, c = (corners[:, k] - corners[first[body], 0] for k in range(3))
    terms = (a[:, 0] * (b[:, 1] * c[:, 2] - b[:, 2] * c[:, 1]) + a[:, 1] * (b[:, 2] * c[:, 0] - b[:, 0] * c[:, 2])
             + a[:, 2] * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]))
    volumes = np.zeros(n_bodies)
    np.add.at(volumes, body, terms)
    return volumes


def select_casters(kind, sides, closed):
    """Choose the casters for one light.

    Parameters
    ----------
    kind : "all", "back_faces" or "auto".
    sides : int8 (n_triangles,), 1 where the light sees the counter-clockwise side, -1 the other, 0 neither.
    closed : bool (n_triangles,), from `closed_triangles`; read for "auto" alone.

    Returns
    -------
    bool (n_triangles,), or None for all.
    """
    if kind == "all":
        return None
    if kind == "back_faces":
        return sides < 0
    return (sides < 0) | ~closed
