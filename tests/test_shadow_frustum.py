"""Planes of shadow frusta against their definitions."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from shadowbench.geometry import Camera, Light
from shadowbench.kernels.culling_planes import OUTLINE_EDGES, SILHOUETTE_EDGES
from shadowbench.kernels.lanes import A_WEIGHT, B_WEIGHT, C_WEIGHT, D_WEIGHT
from shadowbench.kernels.shadow_frustum import (
    CAP_ROW,
    EYE_ROW,
    N_ROWS,
    WEDGE_ROW,
    View,
    casting_triangles,
    find_facing,
    make_frusta,
)

UNUSED = np.array([0, 0, 0, -1], np.float32)
SEEDS = st.integers(0, 10**6)


def make_view(rng, light, near=0.5, origin=0.0):
    eye = rng.normal(size=3) * 4 + origin
    camera = Camera(tuple(eye), tuple(eye + rng.normal(size=3)), tuple(rng.normal(size=3)), 70.0).basis(1.5)
    reach = np.array([camera.tan_x, camera.tan_y, 1.0 / near])
    return camera, View(*camera[:4], light.xyzw(), 1e-4, reach)


def make_light(rng, origin=0.0):
    position = rng.normal(size=3) * 3
    return Light.point(*(position + origin)) if rng.random() < 0.6 else Light.directional(*position)


def set_up(corners, light, view, eye_edges=OUTLINE_EDGES, wedge=True, casters=None):
    sides = np.empty(len(corners), np.int8)
    find_facing(corners, light.xyzw(), sides)
    return make_frusta(corners, sides, casting_triangles(sides, casters), view, eye_edges, wedge), sides


def soup(rng, n=40, origin=0.0):
    centre = rng.normal(size=(n, 1, 3)) * 3
    return centre + rng.normal(size=(n, 3, 3)) * np.exp(rng.uniform(-5, 1, (n, 1, 1))) + origin


def to_proj(camera, points):
    """(x, y, r) and depth of world points."""
    q = points - camera.eye
    depth = q @ camera.forward
    return np.stack([q @ camera.right / depth, q @ camera.up / depth, 1 / depth], axis=-1), depth


def points_inside(rng, corners, light, n=400):
    """World points behind a triangle, as seen from the light, at all distances."""
    weights = rng.dirichlet([0.4] * 3, n)
    on_triangle = weights @ corners
    rays = light.position[3] * on_triangle - np.array(light.position[:3])
    return on_triangle + np.exp(rng.uniform(-7, 7, (n, 1))) * rays


def values(rows, proj):
    return proj @ rows[:, :3].T + rows[:, 3]


@settings(deadline=None, max_examples=40)
@given(SEEDS)
def test_side_and_cap_planes_follow_the_definition(seed):
    rng = np.random.default_rng(seed)
    light = make_light(rng)
    camera, view = make_view(rng, light)
    corners = soup(rng)
    frusta, sides = set_up(corners, light, view)
    points = rng.normal(size=(200, 3)) * 6
    proj, depth = to_proj(camera, points)
    xyz, w = np.array(light.position[:3]), light.position[3]
    for k, t in enumerate(frusta.triangle):
        a, b, c = corners[t]
        normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a)) * sides[t]
        wanted = [np.cross(w * u - xyz, v - u) / np.linalg.norm(np.cross(w * u - xyz, v - u)) * sides[t]
                  for u, v in ((a, b), (b, c), (c, a))]
        distance = np.stack([(points - u) @ m for m, u in zip(wanted, (a, b, c), strict=True)]
                            + [(points - a) @ normal + view.bias], axis=1)
        # Rows are scaled by a positive factor, and values divided by the depth
        found = values(frusta.exact_rows[k], proj) * depth[:, None]
        clear = np.abs(distance) > 1e-8
        np.testing.assert_array_equal(np.sign(found)[clear], np.sign(distance)[clear])


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.sampled_from([0.0, 0.0, 1e5]))
def test_culling_planes_keep_the_whole_frustum(seed, origin):
    rng = np.random.default_rng(seed)
    light = make_light(rng, origin)
    near = 10.0 ** rng.uniform(-3, 0)
    camera, view = make_view(rng, light, near, origin)
    corners = soup(rng, origin=origin)
    frusta, _ = set_up(corners, light, view)
    rows = frusta.rows.reshape(-1, N_ROWS, 4).astype(np.float64)
    for k, t in enumerate(frusta.triangle):
        points = points_inside(rng, corners[t], light)
        proj, depth = to_proj(camera, points)
        seen = (depth > near) & (np.abs(proj[:, 0]) < camera.tan_x) & (np.abs(proj[:, 1]) < camera.tan_y)
        # The margin that the lanes leave to float32
        assert values(rows[k, WEDGE_ROW:], proj[seen]).max(initial=-1) <= 6e-8


def test_rows_are_scaled():
    rng = np.random.default_rng(5)
    light = Light.point(1, 2, 3)
    _, view = make_view(rng, light)
    frusta, _ = set_up(soup(rng), light, view)
    rows = frusta.rows.reshape(-1, N_ROWS, 4)
    weights = np.array([A_WEIGHT * view.reach[0], B_WEIGHT * view.reach[1], C_WEIGHT * view.reach[2], D_WEIGHT])
    used = np.any(rows != UNUSED, axis=2)
    np.testing.assert_allclose((np.abs(rows) @ weights)[used], 1, rtol=1e-5)
    assert used[:, :WEDGE_ROW].all() and used[:, WEDGE_ROW:].any(axis=0).all()


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.permutations(range(3)), st.permutations(range(3)), st.sampled_from([1.0, 1e-3, 1e5]))
def test_shared_edges_get_opposite_planes(seed, order_a, order_b, scale):
    rng = np.random.default_rng(seed)
    light = make_light(rng)
    _, view = make_view(rng, light)
    p, q, a, b = rng.normal(size=(4, 3)) * scale
    corners = np.array([np.array([p, q, a])[list(order_a)], np.array([p, q, b])[list(order_b)]])
    frusta, _ = set_up(corners, light, view)
    planes = []
    for k, order in enumerate((order_a, order_b)):
        edge = next(i for i in range(3) if {order[i], order[(i + 1) % 3]} == {0, 1})
        planes.append(frusta.exact_rows[k, edge])
    assert np.array_equal(planes[0], planes[1]) or np.array_equal(planes[0], -planes[1])


def test_outline_has_four_to_six_planes_and_silhouette_two():
    rng = np.random.default_rng(3)
    light = Light.point(2, 9, 1)
    _, view = make_view(rng, light)
    corners = soup(rng, 300)
    for edges, allowed in ((OUTLINE_EDGES, {0, 3, 4, 5, 6}), (SILHOUETTE_EDGES, {0, 2})):
        frusta, _ = set_up(corners, light, view, edges, wedge=False)
        rows = frusta.rows.reshape(-1, N_ROWS, 4)
        n_planes = np.any(rows[:, EYE_ROW:] != UNUSED, axis=2).sum(axis=1)
        assert set(n_planes.tolist()) <= allowed
        assert n_planes.max() == max(allowed)
        assert (rows[:, WEDGE_ROW:EYE_ROW] == UNUSED).all()
        assert (rows[:, EYE_ROW:, 2] == 0).all()


def test_outline_is_tight():
    """A direction that leaves the cone of sight over the frustum is outside one of the planes."""
    light = Light.point(0, 0, 10)
    camera = Camera((0, -10, 5), (0, 0, 0), (0, 0, 1)).basis(1.0)
    view = View(*camera[:4], light.xyzw(), 1e-4, np.array([camera.tan_x, camera.tan_y, 1.0]))
    corners = np.array([[[-1, 0, 2], [1, 0, 2], [0, 1, 2.0]]])
    frusta, _ = set_up(corners, light, view)
    rows = frusta.rows.reshape(-1, N_ROWS, 4)[0, EYE_ROW:]
    directions = np.random.default_rng(1).uniform(-1, 1, (20000, 2)) * [camera.tan_x, camera.tan_y]
    outside = (directions @ rows[:, :2].T + rows[:, 3] > 0).any(axis=1)
    # Seen from the eye, sample the frustum densely and compare with the convex hull
    seen, _ = to_proj(camera, points_inside(np.random.default_rng(2), corners[0], light, 20000))
    hull = ConvexHull(seen[:, :2])
    distance = (directions @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=1)
    assert not outside[distance < 0].any()
    assert outside[distance > 0.02].all()


def exact_side(corners, light):
    """Sign of (b - a) x (c - a) . (L - w a), in rational arithmetic."""
    a, b, c = ([Fraction(float(v)) for v in p] for p in corners)
    xyz, w = [Fraction(v) for v in light.position[:3]], Fraction(light.position[3])
    u, v, ray = ([q - p for p, q in zip(a, b, strict=True)], [q - p for p, q in zip(a, c, strict=True)],
               [q - w * p for p, q in zip(a, xyz, strict=True)])
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    value = sum(p * q for p, q in zip(n, ray, strict=True))
    return (value > 0) - (value < 0)


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.sampled_from(["random", "grid", "sliver"]))
def test_facing_is_exact_or_zero(seed, kind):
    rng = np.random.default_rng(seed)
    corners = soup(rng, 30)
    light = make_light(rng)
    if kind == "grid":
        corners, light = rng.integers(-2, 3, (30, 3, 3)).astype(float), Light.point(*rng.integers(-2, 3, 3))
    elif kind == "sliver":
        corners[:, 2] = corners[:, 0] + (corners[:, 1] - corners[:, 0]) * rng.random((30, 1))
    sides = np.empty(30, np.int8)
    find_facing(corners, light.xyzw(), sides)
    exact = np.array([exact_side(c, light) for c in corners])
    assert ((sides == exact) | (sides == 0)).all()
    if kind != "sliver":
        assert (sides == exact).all()


def test_only_casters_get_frusta():
    rng = np.random.default_rng(9)
    light = Light.point(0, 5, 0)
    _, view = make_view(rng, light)
    corners = soup(rng)
    corners[7, 2] = corners[7, 1]
    casters = rng.random(len(corners)) < 0.5
    casters[7] = True
    frusta, sides = set_up(corners, light, view, casters=casters)
    assert sides[7] == 0
    assert frusta.triangle.tolist() == [t for t in np.flatnonzero(casters) if t != 7]


@pytest.mark.parametrize("edges", [0, SILHOUETTE_EDGES, OUTLINE_EDGES])
def test_options_do_not_touch_side_and_cap_rows(edges):
    rng = np.random.default_rng(2)
    light = Light.directional(1, -3, 2)
    _, view = make_view(rng, light)
    corners = soup(rng)
    plain, _ = set_up(corners, light, view, 0, wedge=False)
    other, _ = set_up(corners, light, view, edges, wedge=True)
    assert np.array_equal(plain.exact_rows, other.exact_rows)
    assert (plain.rows.reshape(-1, N_ROWS, 4)[:, WEDGE_ROW:] == UNUSED).all()
    np.testing.assert_allclose(plain.rows.reshape(-1, N_ROWS, 4)[:, :CAP_ROW + 1], plain.exact_rows, rtol=1e-6)
