"""View samples: positions on their planes, normals, candidates, sample patterns and pictures."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench import jit
from shadowbench.geometry import Camera, ImageSize, Light, Mesh
from shadowbench.view_samples import PLANE_ERROR, SAMPLE_PATTERNS, render_view_samples, resolve_to_pixels

CAMERA = Camera((0.3, 1.1, 4.0), (0.1, 0.0, 0.0), fov_y=50.0)
LIGHT = Light.point(1.0, 3.0, 2.0)


def soup(n=400, seed=1, scale=1.0, offset=(0.0, 0.0, 0.0)):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.5, 1.5, (n, 1, 3)) + rng.normal(0, 0.4, (n, 3, 3))
    return Mesh.from_arrays(corners.reshape(-1, 3) * scale + offset, np.arange(3 * n))


def moved(camera, light, scale=1.0, offset=(0.0, 0.0, 0.0)):
    at = lambda p: tuple(float(v) for v in np.array(p) * scale + offset)  # noqa: E731
    return (Camera(at(camera.eye), at(camera.target), camera.up, camera.fov_y, camera.near * scale, camera.far * scale),
            Light.point(*at(light.position[:3])))


def fractions(vector):
    return [Fraction(float(v)) for v in vector]


def exact_normal(corners):
    a, b, c = map(fractions, corners)
    u, v = [x - y for x, y in zip(b, a, strict=True)], [x - y for x, y in zip(c, a, strict=True)]
    return a, [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def plane_distance(point, corners):
    """Distance of a point from a triangle's plane, exact up to the last square root."""
    a, n = exact_normal(corners)
    height = sum(x * (y - z) for x, y, z in zip(n, fractions(point), a, strict=True))
    return abs(float(height)) / float(sum(x * x for x in n)) ** 0.5


def side(corners, point, w=1):
    a, n = exact_normal(corners)
    value = sum(x * (y - w * z) for x, y, z in zip(n, fractions(point), a, strict=True))
    return (value > 0) - (value < 0)


@pytest.mark.parametrize(("scale", "offset"), [(1.0, (0.0, 0.0, 0.0)), (1e-3, (0.0, 0.0, 0.0)), (1e5, (0.0, 0.0, 0.0)),
                                               (1.0, (1e5, -1e5, 1e5)), (1e-3, (1e5, 0.0, 0.0))])
def test_samples_lie_on_their_planes(scale, offset):
    mesh = soup(scale=scale, offset=offset)
    camera, light = moved(CAMERA, LIGHT, scale, offset)
    samples = render_view_samples(mesh, camera, light, ImageSize(40, 30))
    shown = np.flatnonzero(samples.triangle >= 0)
    assert len(shown) > 600
    largest = max(np.abs(mesh.vertices).max(), np.abs(camera.eye).max())
    worst = max(plane_distance(samples.position[i], mesh.corners[samples.triangle[i]]) for i in shown)
    assert worst < PLANE_ERROR * largest
    # The bias, 1e-5 of the diagonal, is far above even where the scene is small and far from the origin
    assert worst < 1e-2 * 1e-5 * mesh.diagonal()


def test_positions_are_where_the_rays_are():
    samples = render_view_samples(soup(), CAMERA, LIGHT, ImageSize(33, 20))
    basis = CAMERA.basis(33 / 20)
    rays = basis.forward + samples.plane_x[:, None] * basis.right + samples.plane_y[:, None] * basis.up
    shown = samples.triangle >= 0
    np.testing.assert_allclose(samples.position[shown], (basis.eye + samples.depth[:, None] * rays)[shown], rtol=1e-14)
    np.testing.assert_allclose(((samples.position - basis.eye) * basis.forward).sum(axis=1)[shown],
                               samples.depth[shown], rtol=1e-13)
    grid_x, grid_y = samples.plane_x.reshape(20, 33), samples.plane_y.reshape(20, 33)
    assert np.all(grid_x[:, 0] < 0) and np.all(grid_x[0] == grid_x[-1]) and np.all(np.diff(grid_x) > 0)
    assert np.all(grid_y[0] > 0) and np.all(np.diff(grid_y, axis=0) < 0)      # row 0 is the top
    assert grid_x[0, 0] == pytest.approx((1 / 33 - 1) * basis.tan_x) and grid_y[0, 0] == pytest.approx(
        (1 - 1 / 20) * basis.tan_y)


def test_background_is_empty():
    samples = render_view_samples(Mesh.from_arrays(np.zeros((0, 3)), []), CAMERA, LIGHT, ImageSize(5, 4, 2))
    assert (samples.rows, samples.columns) == (4, 10)
    assert np.all(samples.triangle == -1) and np.all(np.isinf(samples.depth)) and not samples.candidate.any()
    assert not samples.position.any() and not samples.normal.any() and samples.plane_x.any()


def test_record_has_the_promised_types():
    samples = render_view_samples(soup(), CAMERA, LIGHT, ImageSize(6, 5))
    expected = {"position": (np.float64, (30, 3)), "normal": (np.float64, (30, 3)), "depth": (np.float64, (30,)),
                "triangle": (np.int32, (30,)), "candidate": (np.bool_, (30,)), "plane_x": (np.float64, (30,)),
                "plane_y": (np.float64, (30,))}
    for name, (dtype, shape) in expected.items():
        array = getattr(samples, name)
        assert (array.dtype, array.shape, array.flags.c_contiguous) == (dtype, shape, True), name


@pytest.mark.parametrize("light", [LIGHT, Light.point(0.2, 0.1, -0.3), Light.directional(0.3, -1.0, -0.2)])
def test_normals_and_candidates(light):
    mesh = soup()
    samples = render_view_samples(mesh, CAMERA, light, ImageSize(60, 50))
    shown = samples.triangle >= 0
    normal, to_eye = samples.normal[shown], np.array(CAMERA.eye) - samples.position[shown]
    np.testing.assert_allclose((normal**2).sum(axis=1), 1.0, rtol=1e-14)
    assert np.all((normal * to_eye).sum(axis=1) > 0)
    expected = np.array([side(c, CAMERA.eye) == side(c, light.position[:3], light.position[3]) for c in mesh.corners])
    assert 0.2 < samples.candidate[shown].mean() < 0.95
    np.testing.assert_array_equal(samples.candidate[shown], expected[samples.triangle[shown]])
    assert not samples.candidate[~shown].any()


def test_light_in_the_plane_of_a_triangle_makes_no_candidates():
    rng = np.random.default_rng(7)
    for _ in range(20):
        corners = rng.normal(size=(3, 3)) * [2, 2, 0.3]
        weights = rng.normal(size=3)
        in_plane = (weights / weights.sum()) @ corners         # but for rounding
        for light in (Light.point(*in_plane), Light.point(*corners[0]), Light.directional(*(corners[1] - corners[0]))):
            samples = render_view_samples(Mesh.from_arrays(corners, [0, 1, 2]), CAMERA, light, ImageSize(30, 30))
            assert np.any(samples.triangle == 0) and not samples.candidate.any()


def test_far_light_still_makes_candidates_of_tiny_triangles():
    """The error bound of a side must follow the triangle's size, not the distance of the light."""
    mesh = soup(scale=1e-3)
    camera, _ = moved(CAMERA, LIGHT, 1e-3)
    near = render_view_samples(mesh, camera, Light.directional(-1, -3, -2), ImageSize(40, 40))
    far = render_view_samples(mesh, camera, Light.point(1e7, 3e7, 2e7), ImageSize(40, 40))
    assert near.candidate.any() and np.mean(near.candidate != far.candidate) < 1e-3


@pytest.mark.parametrize("size", [(16, 12), (7, 9), (1, 1)])
def test_four_samples_are_the_image_of_twice_the_size(size):
    width, height = size
    four = render_view_samples(soup(), CAMERA, LIGHT, ImageSize(width, height, 4))
    twice = render_view_samples(soup(), CAMERA, LIGHT, ImageSize(2 * width, 2 * height))
    for name, value in four._asdict().items():
        np.testing.assert_array_equal(value, getattr(twice, name), err_msg=name)


@pytest.mark.parametrize("n", SAMPLE_PATTERNS)
def test_patterns_fill_the_pixel_evenly(n):
    pattern = SAMPLE_PATTERNS[n]
    assert len(pattern.x) * len(pattern.y) == n
    for offsets in pattern:
        assert offsets == tuple((k + 0.5) / len(offsets) for k in range(len(offsets)))
    samples = render_view_samples(soup(), CAMERA, LIGHT, ImageSize(10, 8, n))
    assert (samples.rows, samples.columns) == (8 * len(pattern.y), 10 * len(pattern.x))
    assert len(samples.depth) == 80 * n
    # The mean of a pixel's sample positions is the pixel's centre
    centre = render_view_samples(soup(), CAMERA, LIGHT, ImageSize(10, 8))
    np.testing.assert_allclose(resolve_to_pixels(samples.plane_x, ImageSize(10, 8, n)).ravel(), centre.plane_x,
                               atol=1e-15)
    np.testing.assert_allclose(resolve_to_pixels(samples.plane_y, ImageSize(10, 8, n)).ravel(), centre.plane_y,
                               atol=1e-15)


@settings(deadline=None, max_examples=30)
@given(st.sampled_from(sorted(SAMPLE_PATTERNS)), st.integers(1, 5), st.integers(1, 5), st.integers(0, 100))
def test_resolving_sums_integers_and_averages_floats(n, width, height, seed):
    image, pattern = ImageSize(width, height, n), SAMPLE_PATTERNS[n]
    rows, columns = height * len(pattern.y), width * len(pattern.x)
    values = np.random.default_rng(seed).integers(0, 50, (rows * columns, 2))
    summed, mean = resolve_to_pixels(values, image), resolve_to_pixels(values.astype(np.float32), image)
    assert summed.dtype == np.int64 and mean.dtype == np.float64
    for y in range(height):
        for x in range(width):
            cells = [values[r * columns + c] for r in range(rows) for c in range(columns)
                     if r // len(pattern.y) == y and c // len(pattern.x) == x]
            assert np.array_equal(summed[y, x], np.sum(cells, axis=0))
            np.testing.assert_allclose(mean[y, x], np.mean(cells, axis=0))
    assert resolve_to_pixels(values[:, 0] > 20, image).max() <= n


@pytest.mark.parametrize(("image", "message"), [(ImageSize(4, 4, 3), "1, 2, 4, 8, 16"), (ImageSize(4, 0), "one pixel")])
def test_bad_images_are_refused(image, message):
    with pytest.raises(ValueError, match=message):
        render_view_samples(soup(), CAMERA, LIGHT, image)


@pytest.mark.parametrize(("near", "far"), [(0.0, 1.0), (-1.0, 1.0), (2.0, 1.0)])
def test_bad_depth_ranges_are_refused(near, far):
    with pytest.raises(ValueError, match="0 < near < far"):
        render_view_samples(soup(), Camera((0, 0, 1), (0, 0, 0), near=near, far=far), LIGHT, ImageSize(4, 4))


def test_camera_inside_the_geometry_sees_its_inside():
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
             [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    camera = Camera((0.1, 0.2, 0.3), (1, 0.4, 0.2), fov_y=150.0, near=1e-3)
    samples = render_view_samples(Mesh.from_arrays(box, faces), camera, Light.point(0, 0, 0), ImageSize(101, 77))
    assert np.all(samples.triangle >= 0) and samples.candidate.all()
    np.testing.assert_allclose(np.abs(samples.position).max(axis=1), 1.0, rtol=1e-13)


def test_threads_change_nothing():
    before, results = jit.n_threads(), []
    try:
        for n_threads in (1, 2, 4):
            jit.set_threads(n_threads)
            results.append(render_view_samples(soup(5000), CAMERA, LIGHT, ImageSize(200, 150, 2)))
    finally:
        jit.set_threads(before)
    assert np.any(results[0].triangle >= 0)
    for samples in results[1:]:
        for name, value in samples._asdict().items():
            np.testing.assert_array_equal(value, getattr(results[0], name), err_msg=name)
