import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.kernels.edges import edge_adjacency, edge_multiplicities
from tests.stencil_twin import facing, multiplicities


def soup(seed, n_triangles, n_points):
    """Triangles over few points, so edges are shared by any number of triangles, wound at random."""
    rng = np.random.default_rng(seed)
    points = rng.integers(-3, 4, (n_points, 3)).astype(np.float64)
    return points[rng.integers(0, n_points, (n_triangles, 3))]


def keyed(adjacency, values):
    """Values per edge, keyed by the edge's positions."""
    keys = [tuple(tuple(adjacency.positions[i].tolist()) for i in ends) for ends in adjacency.ends]
    assert len(set(keys)) == len(keys)
    return dict(zip(keys, values.tolist(), strict=True))


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32), st.integers(1, 30), st.integers(3, 9), st.booleans())
def test_multiplicities_agree_with_a_dictionary(seed, n_triangles, n_points, directional):
    corners = soup(seed, n_triangles, n_points)
    light = np.array([0.3, 5.2, -1.1, 0.0 if directional else 1.0])
    casting = np.random.default_rng(seed).random(n_triangles) < 0.8
    adjacency = edge_adjacency(corners)
    sides = np.array([facing(t, light) if casts else 0 for t, casts in zip(corners, casting, strict=True)], np.int8)
    expected = multiplicities(corners, light, casting)
    assert keyed(adjacency, edge_multiplicities(adjacency, sides)) == dict(expected)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32), st.integers(1, 30), st.integers(3, 9))
def test_every_use_of_an_edge_is_listed_once_and_in_order(seed, n_triangles, n_points):
    corners = soup(seed, n_triangles, n_points)
    adjacency = edge_adjacency(corners)
    assert np.array_equal(adjacency.positions[adjacency.corners], corners)
    assert sorted(adjacency.uses.tolist()) == list(range(3 * n_triangles))
    for edge, ends in enumerate(adjacency.ends):
        uses = adjacency.uses[adjacency.first_use[edge]:adjacency.first_use[edge + 1]]
        assert len(uses) > 0 and np.all(np.diff(uses) > 0)
        for triangle, k in zip(uses // 3, uses % 3, strict=True):
            run = adjacency.corners[triangle, [k, (k + 1) % 3]]
            assert adjacency.triangle_edges[triangle, k] == edge
            assert list(ends) == sorted(run)
            assert adjacency.along[triangle, k] == (1 if run[0] < run[1] else -1)


def test_positions_are_lexicographic_and_zero_has_one_sign():
    corners = np.array([[[0.0, 1, 2], [-0.0, 1, 3], [-1, 5, 5]], [[-0.0, 1, 2], [0.0, 1, 3], [4, 0, 0]]])
    adjacency = edge_adjacency(corners)
    assert [tuple(p) for p in adjacency.positions] == sorted({tuple(p) for p in corners.reshape(-1, 3)})
    assert len(adjacency.positions) == 4 and len(adjacency.ends) == 5


def test_parts_share_positions_but_no_edges():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1.0, 0, 0], [0, 0, 0], [0, -1, 0]]])
    both = edge_adjacency(corners)
    apart = edge_adjacency(corners, np.array([0, 1], np.int32))
    assert (len(both.ends), len(apart.ends)) == (5, 6)
    assert len(both.positions) == len(apart.positions) == 4
    sides = np.array([1, 1], np.int8)
    assert np.count_nonzero(edge_multiplicities(both, sides)) == 4
    assert np.count_nonzero(edge_multiplicities(apart, sides)) == 6


def test_no_triangles():
    adjacency = edge_adjacency(np.zeros((0, 3, 3)))
    assert len(adjacency.ends) == len(adjacency.positions) == 0
    assert len(edge_multiplicities(adjacency, np.zeros(0, np.int8))) == 0
