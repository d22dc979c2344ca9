from fractions import Fraction
from types import SimpleNamespace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.geometry import Camera
from shadowbench.kernels.edges import edge_adjacency, edge_multiplicities
from shadowbench.kernels.eye_volumes import AROUND, TOUCHING, _eye_states
from shadowbench.kernels.shadow_volumes import find_casters
from shadowbench.kernels.volume_extrusion import VolumeKind, make_faces
from shadowbench.kernels.volume_faces import AT_INFINITY
from shadowbench.kernels.volume_polygons import MAX_CORNERS, clip_and_project, volume_view
from tests.stencil_twin import shadow_counts, shift_of

WIDTH, HEIGHT = 24, 16


def make_view(camera, nearest=0.05):
    """A view with a grid of WIDTH x HEIGHT samples."""
    basis = camera.basis(WIDTH / HEIGHT)
    x = (2 * (np.arange(WIDTH) + 0.5) / WIDTH - 1) * basis.tan_x
    y = -(2 * (np.arange(HEIGHT) + 0.5) / HEIGHT - 1) * basis.tan_y
    samples = SimpleNamespace(columns=WIDTH, rows=HEIGHT, plane_x=np.tile(x, HEIGHT), plane_y=np.repeat(y, WIDTH))
    return volume_view(basis, samples, nearest)


VIEW = make_view(Camera((0.5, 1.0, 6.0), (0.0, 0.3, 0.0)))


def exact_facing(triangle, light):
    """Sign of the light's height over a triangle in rational arithmetic."""
    (ax, ay, az), b, c = ([Fraction(float(x)) for x in p] for p in triangle)
    ux, uy, uz = b[0] - ax, b[1] - ay, b[2] - az
    vx, vy, vz = c[0] - ax, c[1] - ay, c[2] - az
    lx, ly, lz, w = (Fraction(float(x)) for x in light)
    height = ((uy * vz - uz * vy) * (lx - w * ax) + (uz * vx - ux * vz) * (ly - w * ay)
              + (ux * vy - uy * vx) * (lz - w * az))
    return int(height > 0) - int(height < 0)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32), st.booleans(), st.sampled_from([0.0, 1.0]))
def test_facing_is_the_exact_sign_or_nothing(seed, on_grid, w):
    rng = np.random.default_rng(seed)
    corners = rng.integers(-2, 3, (12, 3, 3)).astype(float) if on_grid else rng.normal(size=(12, 3, 3))
    light = np.append(rng.integers(-2, 3, 3) if on_grid else rng.normal(size=3), w)
    corners[0] = light[:3] + np.outer(rng.normal(size=3), [1.0, 2.0, 0.5])      # edge-on or close to it
    casters = find_casters(edge_adjacency(corners), light, None, 1e-3, VIEW)
    expected = np.array([exact_facing(t, light) for t in corners])
    assert np.array_equal(casters.facing[1:], expected[1:])
    assert casters.facing[0] in (0, expected[0])
    for t in np.flatnonzero(casters.facing):
        if t > 0:
            assert np.isclose(casters.shift[t], shift_of(corners[t], light, 1e-3), rtol=1e-9)


def test_biased_cap_lies_behind_by_the_bias_on_the_rays_of_its_vertices():
    corners = np.array([[[0.0, 1, 0], [2, 1.5, 0], [0, 1, 3]]])
    for light in (np.array([0.5, 6, 1, 1.0]), np.array([0.2, 1, 0.1, 0.0])):
        shift = find_casters(edge_adjacency(corners), light, None, 0.25, VIEW).shift[0]
        moved = corners[0] + shift * (light[3] * corners[0] - light[:3])
        normal = np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0])
        normal /= -np.linalg.norm(normal) * exact_facing(corners[0], light)
        assert np.allclose((moved - corners[0, 0]) @ normal, 0.25)


def test_triangles_left_out_or_moved_out_of_reach_cast_nothing():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 0, 1]]] * 2)
    light = np.array([0, 5, 0, 1.0])
    casters = find_casters(edge_adjacency(corners), light, np.array([True, False]), 1e-3, VIEW)
    assert list(np.abs(casters.facing)) == [1, 0]
    assert not find_casters(edge_adjacency(corners), light, None, 1e40, VIEW).facing.any()


def clip(corners):
    """Clip and project homogeneous corners."""
    room = np.empty((2, MAX_CORNERS, 4))
    room[0, :len(corners)] = corners
    out = np.empty((1, MAX_CORNERS, 2))
    n = clip_and_project(VIEW, room, len(corners), out, 0)
    return out[0, :n].copy()


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32), st.integers(3, 4))
def test_clipping_keeps_what_samples_see(seed, n_corners):
    """A ray inside the guard planes hits the clipped polygon if it hits the unclipped one beyond the nearest depth."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(3, 3)) * 3
    if n_corners == 4:                                                      # planar: a parallelogram
        points = np.vstack([points, points[0] + points[2] - points[1]])
    polygon = clip(np.column_stack([points, np.ones(n_corners)]))
    a, u, v = points[0], points[1] - points[0], points[-1] - points[0]
    for _ in range(20):
        ray = np.array([*(rng.uniform(-1, 1, 2) * [VIEW.guard_x, VIEW.guard_y] * 0.9), 1.0])
        depth, r, s = np.linalg.solve(np.column_stack([ray, -u, -v]), a)
        inside = (r > 0) & (s > 0) & (((r < 1) & (s < 1)) if n_corners == 4 else r + s < 1)
        if min(abs(np.array([r, s, 1 - r, 1 - s, 1 - r - s]))) < 1e-6 or abs(depth - VIEW.nearest) < 1e-6:
            continue
        assert (winding(polygon, ray[0], -ray[1]) != 0) == (inside and depth > VIEW.nearest)


def winding(polygon, x, down):
    """Winding number of a polygon around a point."""
    total = 0.0
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        p, q = a - [x, down], b - [x, down]
        total += np.arctan2(p[0] * q[1] - p[1] * q[0], p @ q)
    return round(total / (2 * np.pi))


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32))
def test_neighbours_share_the_points_where_their_edge_is_cut(seed):
    rng = np.random.default_rng(seed)
    a, b, c, d = np.column_stack([rng.normal(size=(4, 3)) * [4, 4, 2], rng.integers(0, 2, 4)])
    one, other = clip([a, b, c]), clip([b, a, d])
    inner = np.array([VIEW.guard_x, VIEW.guard_y]) * (1 - 1e-9)
    edge = np.cross(a[:3], b[:3])                                           # the plane through the eye and the edge
    edge = edge / np.linalg.norm(edge)

    def on_edge(polygon):
        return {(x, down) for x, down in polygon
                if max(abs(x) / inner[0], abs(down) / inner[1]) < 1 and abs(np.array([x, -down, 1]) @ edge) < 1e-12}
    assert on_edge(one) ^ on_edge(other) <= {tuple(p) for q in (c, d) for p in clip([q, q, q])}


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32), st.booleans(), st.booleans())
def test_volumes_are_closed_on_the_image(seed, per_triangle, directional):
    """With the eye outside of every volume, the windings of all faces cancel around every point of the image."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(6, 3, 3))
    corners[1, :2] = corners[0, [1, 0]]
    light = np.append(rng.normal(size=3) * 3, 0.0 if directional else 1.0)
    adjacency = edge_adjacency(corners)
    casters = find_casters(adjacency, light, None, 1e-2, VIEW)
    if shadow_counts(corners, light, 0.0, VIEW.eye[None])[0]:
        return
    multiplicity = edge_multiplicities(adjacency, casters.facing)
    faces = make_faces(VIEW, adjacency, light, casters, multiplicity, 1e-2, VolumeKind(per_triangle, not directional))
    listed = np.concatenate([np.arange(*pair) for pair in zip(faces.first, faces.end, strict=False)])
    for column, row in rng.integers(0, [WIDTH, HEIGHT], (20, 2)):
        total = 0
        for face in listed:
            polygon = faces.polygon[face, :faces.n_corners[face]]
            total += faces.multiplicity[face] * winding(polygon, VIEW.x[column], VIEW.down[row])
        assert total == 0
    assert not directional or not np.any(faces.eye_side[listed] == AT_INFINITY)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32), st.booleans(), st.sampled_from([0.0, 1.0]))
def test_eye_count_is_the_definition_unless_a_frustum_touches(seed, on_grid, w):
    rng = np.random.default_rng(seed)
    corners = rng.integers(-3, 4, (20, 3, 3)).astype(float) if on_grid else rng.normal(size=(20, 3, 3)) * 2
    light = np.append(rng.integers(-4, 5, 3), w).astype(float)
    eye = rng.integers(-3, 4, 3).astype(float) if on_grid else rng.normal(size=3) * 2
    view = make_view(Camera(tuple(eye), tuple(eye + [1.0, 0.25, 2.0])), 1e-7)
    adjacency = edge_adjacency(corners)
    casters = find_casters(adjacency, light, None, 1e-4, view)
    state = _eye_states(adjacency, light, casters, 1e-4, view)
    for t, triangle in enumerate(corners):
        if state[t] != TOUCHING:
            assert shadow_counts(triangle[None], light, 1e-4, eye[None])[0] == (state[t] == AROUND)


def test_eye_on_a_side_plane_touches():
    corners = np.array([[[-1.0, 2, -1], [1, 2, -1], [0, 2, 2]]])
    light = np.array([0.0, 4, -1, 1])
    view = make_view(Camera((0.0, 0.0, -1.0), (0.0, 0.5, 3.0)), 1e-7)      # straight below the edge z = -1
    adjacency = edge_adjacency(corners)
    casters = find_casters(adjacency, light, None, 1e-4, view)
    assert list(_eye_states(adjacency, light, casters, 1e-4, view)) == [TOUCHING]
