import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shadowbench.scenes.paths import Pose, curve_position, pose_at
from shadowbench.scenes.transforms import (
    IDENTITY,
    determinant,
    from_columns,
    from_quaternion,
    multiply,
    rotation,
    scaling,
    transform_points,
    translation,
)

coordinate = st.floats(-1e6, 1e6)
vectors = st.tuples(coordinate, coordinate, coordinate)
angles = st.tuples(*[st.floats(-720, 720)] * 3)
matrices = st.tuples(*[st.tuples(*[st.floats(-10, 10)] * 4)] * 3)


def naive_curve(keys, frame, n_frames, closed):
    """Catmull-Rom as the matrix form of the textbook, over a padded list of keys."""
    keys = np.array(keys, float)
    if closed:
        padded, where = np.concatenate([keys[-1:], keys, keys[:2]]), frame * len(keys) / n_frames
    else:
        padded = np.concatenate([[2 * keys[0] - keys[1]], keys, [2 * keys[-1] - keys[-2]]])
        where = frame * (len(keys) - 1) / (n_frames - 1)
    i = min(int(where), len(padded) - 4)
    t = where - i
    basis = 0.5 * np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]])
    return np.array([1, t, t * t, t**3]) @ basis @ padded[i:i + 4]


@given(st.lists(vectors, min_size=2, max_size=6), st.integers(2, 50), st.booleans(), st.data())
@settings(deadline=None, max_examples=200)
def test_curve_agrees_with_the_matrix_form(keys, n_frames, closed, data):
    frame = data.draw(st.integers(0, n_frames - 1))
    # The twin rounds its parameter, so it may be off by an ulp of the parameter times the curve's speed.
    np.testing.assert_allclose(curve_position(keys, frame, n_frames, closed),
                               naive_curve(keys, frame, n_frames, closed), rtol=1e-9, atol=1e-4)


@given(st.lists(vectors, min_size=1, max_size=6), st.integers(1, 20))
@settings(deadline=None, max_examples=100)
def test_keys_are_met_exactly(keys, step):
    n_open = (len(keys) - 1) * step + 1
    assert [curve_position(keys, i * step, n_open) for i in range(len(keys))] == keys
    n_closed = len(keys) * step
    assert [curve_position(keys, i * step, n_closed, True) for i in range(len(keys))] == keys


def test_ends_of_an_open_curve():
    keys = [(0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (5.0, 5.0, 5.0)]
    assert curve_position(keys, 0, 8) == keys[0] and curve_position(keys, 7, 8) == keys[2]
    assert curve_position(keys, 0, 1) == keys[0]
    assert curve_position(keys[:2], 1, 5) == (0.25, 0.5, 0.75)        # two keys: a straight line at even speed


def test_a_closed_curve_goes_all_the_way_round():
    square = [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)]
    points = np.array([curve_position(square, i, 8, True) for i in range(8)])
    np.testing.assert_array_equal(points[::2], square)
    # Half way between keys the weights are -1, 9, 9, -1 sixteenths.
    np.testing.assert_array_equal(points[1], [0.625, 0.0, 0.625])
    np.testing.assert_array_equal(points[7], [0.625, 0.0, -0.625])


def test_poses():
    poses = [Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), Pose((0.0, 360.0, 0.0), (4.0, 0.0, 0.0)),
             Pose((0.0, 360.0, 90.0), (4.0, 8.0, 0.0))]
    moments = (2.0, 4.0, 8.0)
    assert pose_at(moments, poses, 0) == pose_at(moments, poses, 2) == poses[0]
    assert pose_at(moments, poses, 3) == Pose((0.0, 180.0, 0.0), (2.0, 0.0, 0.0))
    assert pose_at(moments, poses, 4) == poses[1]
    assert pose_at(moments, poses, 5) == Pose((0.0, 360.0, 22.5), (4.0, 2.0, 0.0))
    assert pose_at(moments, poses, 8) == pose_at(moments, poses, 100) == poses[2]
    assert pose_at((1.0,), poses[1:2], 0) == poses[1]


@given(angles)
@settings(deadline=None, max_examples=100)
def test_rotation_turns_about_x_then_y_then_z(degrees):
    expected = Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()
    np.testing.assert_allclose(np.array(rotation(degrees))[:, :3], expected, atol=1e-12)


def test_right_angles_are_exact():
    assert rotation((90.0, 0.0, 0.0)) == ((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0))
    assert rotation((0.0, 180.0, 0.0)) == ((-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 0))
    assert rotation((0.0, 0.0, 0.0)) == IDENTITY


@given(st.tuples(*[st.floats(-2, 2)] * 4).filter(lambda q: sum(v * v for v in q) > 1e-3))
@settings(deadline=None, max_examples=100)
def test_quaternions(q):
    np.testing.assert_allclose(np.array(from_quaternion(*q))[:, :3], Rotation.from_quat(q).as_matrix(), atol=1e-12)


def test_the_zero_quaternion_turns_nothing():
    assert from_quaternion(0.0, 0.0, 0.0, 0.0) == IDENTITY


@given(matrices, matrices, st.lists(st.tuples(*[st.floats(-10, 10)] * 3), min_size=1, max_size=4))
@settings(deadline=None, max_examples=100)
def test_products_and_points(a, b, points):
    points = np.array(points)
    full = [np.vstack([m, [0, 0, 0, 1]]) for m in (a, b)]
    np.testing.assert_allclose(np.array(multiply(a, b)), (full[0] @ full[1])[:3], atol=1e-10)
    np.testing.assert_allclose(transform_points(a, points), points @ np.array(a)[:, :3].T + np.array(a)[:, 3],
                               atol=1e-10)
    np.testing.assert_allclose(determinant(a), np.linalg.det(np.array(a)[:, :3]), atol=1e-9)


def test_simple_transforms():
    points = np.array([[1.0, 2.0, 3.0]])
    moved = multiply(translation((10.0, 0.0, 0.0)), scaling((2.0, 3.0, 4.0)))
    np.testing.assert_array_equal(transform_points(moved, points), [[12.0, 6.0, 12.0]])
    assert from_columns([1, 4, 7, 0, 2, 5, 8, 0, 3, 6, 9, 0, 10, 11, 12, 1]) == (
        (1, 2, 3, 10), (4, 5, 6, 11), (7, 8, 9, 12))


def test_overflow_gives_infinity_without_a_warning():
    assert np.isinf(transform_points(scaling((1e300, 1.0, 1.0)), np.array([[1e300, 0.0, 0.0]]))[0, 0])
