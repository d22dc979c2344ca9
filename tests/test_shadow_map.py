"""Shadow maps and the views of a light: against a slow twin, against ray tracing, and in awkward scenes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from shadowbench import jit
from shadowbench.algorithms import ALGORITHMS
from shadowbench.algorithms.base import Frame, Probe
from shadowbench.algorithms.shadow_map import Params, ShadowMap
from shadowbench.geometry import Camera, ImageSize, Light, Mesh
from shadowbench.kernels.light_maps import axes_along, fit_light_maps, locate, map_view, texel
from shadowbench.kernels.projection import N_WORKERS, View, screen_axis
from shadowbench.view_samples import render_view_samples
from tests.test_rasterizer import twin

GROUND = np.array([[-4, -1, -4], [4, -1, -4], [4, -1, 4], [-4, -1, 4]], float)
BOX = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
BOX_FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                      [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
ABOVE, AMONG, PARALLEL = Light.point(1, 3, 2), Light.point(0.1, 0.2, 0.1), Light.directional(0.3, -1, -0.2)


def scene(n=60, seed=1):
    """Random triangles above a ground quad."""
    rng = np.random.default_rng(seed)
    soup = (rng.uniform(-1.2, 1.2, (n, 1, 3)) + rng.normal(0, 0.3, (n, 3, 3))).reshape(-1, 3)
    return Mesh.from_arrays(np.concatenate([GROUND, soup]), [0, 1, 2, 0, 2, 3, *range(4, 4 + 3 * n)])


def make_frame(mesh, light, image=ImageSize(48, 36), camera=Camera((0.5, 2.5, 5), (0, -0.3, 0), fov_y=50)):  # noqa: B008
    samples = render_view_samples(mesh, camera, light, image)
    return Frame(mesh, light, camera.basis(image.width / image.height), image, samples, 1e-5 * mesh.diagonal())


def run(frame, **params):
    """Run the counting build and the timing build; they must agree."""
    for array in (frame.mesh.vertices, frame.mesh.triangles, *frame.samples[2:]):
        array.flags.writeable = False
    algorithm, counting, timing = ShadowMap(Params(**params)), Probe(counting=True), Probe()
    shadow = algorithm.shadows(frame, counting).shadow
    np.testing.assert_array_equal(shadow, algorithm.shadows(frame, timing).shadow)
    assert tuple(timing.stages) == ShadowMap.stages and not timing.counts
    assert shadow.dtype == np.float32 and np.all(shadow[~frame.samples.candidate] == 0)
    return shadow, counting


# --- The slow twin -------------------------------------------------------------------------------------------------


def twin_axes(forward):
    length = math.sqrt(forward[0] * forward[0] + forward[1] * forward[1] + forward[2] * forward[2])
    x, y, z = (v / length for v in forward)
    k = min(range(3), key=lambda i: abs((x, y, z)[i]))
    right = [(0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)][k]
    length = math.sqrt(right[0] * right[0] + right[1] * right[1] + right[2] * right[2])
    a, b, c = (v / length for v in right)
    return (a, b, c), (b * z - c * y, c * x - a * z, a * y - b * x), (x, y, z)


def inner(a, b):
    return float(b[0]) * a[0] + float(b[1]) * a[1] + float(b[2]) * a[2]


CUBE = [twin_axes(f) for f in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]


def twin_fit(frame, projection):
    """Faces as a list of (axes, half side), their eye and whether the first is a spot map."""
    points = frame.samples.position
    candidates = np.flatnonzero(frame.samples.candidate)
    light = frame.light.position
    if frame.light.is_directional:
        axes = twin_axes([-v for v in light[:3]])
        u, v = ([inner(a, points[i]) for i in candidates] for a in axes[:2])
        floor = 2.0**-24 * np.abs(points[candidates]).max()
        half = max(0.5 * (max(u) - min(u)), 0.5 * (max(v) - min(v)), floor) * (1 + 2.0**-20)
        u, v = 0.5 * (min(u) + max(u)), 0.5 * (min(v) + max(v))
        return [(axes, half)], [u * axes[0][k] + v * axes[1][k] for k in range(3)], False
    # The mean direction is added up in the order of the workers' shares
    total, n = [0.0] * 3, len(points)
    for worker in range(N_WORKERS):
        share = [0.0] * 3
        for i in candidates[(candidates >= worker * n // N_WORKERS) & (candidates < (worker + 1) * n // N_WORKERS)]:
            d = [float(points[i][k]) - light[k] for k in range(3)]
            length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            share = [share[k] + d[k] / length for k in range(3)]
        total = [total[k] + share[k] for k in range(3)]
    axes, half, all_fit = twin_axes(total), 2.0**-24, True
    for i in candidates:
        d = [float(points[i][k]) - light[k] for k in range(3)]
        u, v, z = (inner(a, d) for a in axes)
        if z > 0 and z >= 0.5 * math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]):
            half = max(half, abs(u / z), abs(v / z))
        else:
            all_fit = False
    spot = projection == "spot" or (projection == "auto" and all_fit)
    return [(axes, half)] + [(a, 1.0) for a in CUBE], list(light[:3]), spot


def twin_locate(faces, eye, spot, parallel, p):
    d = [float(p[k]) - eye[k] for k in range(3)]
    u, v, z = (inner(a, d) for a in faces[0][0])
    if parallel:
        return 0, u, v, z
    if spot and z > 0 and abs(u / z) <= faces[0][1] and abs(v / z) <= faces[0][1]:
        return 0, u / z, v / z, z
    k = max(range(3), key=lambda i: abs(d[i]))
    face = 1 + 2 * k + (d[k] <= 0)
    u, v, z = (inner(a, d) for a in faces[face][0])
    return face, u / z, v / z, z


def twin_shadow_map(frame, resolution, projection, pcf, bias, slope_bias):
    faces, eye, spot = twin_fit(frame, projection)
    parallel, radius = frame.light.is_directional, pcf // 2
    side = resolution + 2 * (radius + 1)
    candidates = np.flatnonzero(frame.samples.candidate)
    places = {i: twin_locate(faces, eye, spot, parallel, frame.samples.position[i]) for i in candidates}
    nearest = min((np.abs(frame.samples.position[i] - eye).max() for i in candidates), default=1.0)
    maps, fragments, written = {}, 0, 0
    for face in {p[0] for p in places.values()}:
        axes, half = faces[face]
        half = half * side / resolution
        near = -np.inf if parallel else 2.0**-200 * nearest
        view = View(np.array(eye), *np.array(axes), near, np.inf, not parallel,
                    *screen_axis(side, (0.5,), half), *screen_axis(side, (0.5,), -half))
        maps[face], _, f, w = twin(view, frame.mesh.vertices, frame.mesh.triangles)
        fragments, written = fragments + f.sum(), written + w.sum()
    shadow = np.zeros(len(frame.samples.candidate), np.float32)
    for i, (face, u, v, z) in places.items():
        axes, half = faces[face]
        right, up, forward = (inner(a, frame.samples.normal[i]) for a in axes)
        step = slope_bias * (radius + 0.5) * 2 * half / resolution
        if parallel:
            limit = z - (step * abs(right) + step * abs(up)) / abs(forward)
        else:
            limit = z / (1 + (step * abs(right) + step * abs(up)) / abs(forward + (u * right + v * up)))
        row = math.floor(side / 2 - v / half * (resolution / 2))
        column = math.floor(side / 2 + u / half * (resolution / 2))
        block = maps[face][row - radius:row + radius + 1, column - radius:column + radius + 1]
        assert block.shape == (pcf, pcf)
        shadow[i] = np.float32(np.sum(block < limit - bias * frame.bias) / pcf**2)
    return shadow, {"map_fragments": fragments, "map_texels_written": written,
                    "map_texels_read": len(candidates) * pcf**2}


@pytest.mark.parametrize(("light", "projection", "pcf"), [
    (ABOVE, "auto", 1), (ABOVE, "cube", 3), (AMONG, "auto", 3), (AMONG, "spot", 1), (PARALLEL, "auto", 1),
    (PARALLEL, "cube", 5), (Light.directional(0, -3, 0), "auto", 1)])
def test_equals_the_twin_number_for_number(light, projection, pcf):
    frame = make_frame(scene(16), light, ImageSize(24, 18))
    options = {"resolution": 13, "projection": projection, "pcf": pcf, "bias": 0.7, "slope_bias": 0.9}
    shadow, probe = run(frame, **options)
    expected, counts = twin_shadow_map(frame, **options)
    assert expected.any() and (expected < 1).any()
    np.testing.assert_array_equal(shadow, expected)
    assert probe.counts == counts
    np.testing.assert_array_equal(probe.heat, np.where(frame.samples.candidate, pcf**2, 0))


# --- Against ray tracing -------------------------------------------------------------------------------------------


def ray_traced(frame):
    """Moeller-Trumbore over all triangles but the sample's own."""
    corners, samples = frame.mesh.corners, frame.samples
    light = np.array(frame.light.position)
    shadow = np.zeros(len(samples.candidate), bool)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    for i in np.flatnonzero(samples.candidate):
        ray = light[:3] - light[3] * samples.position[i]
        h, s = np.cross(ray, v), samples.position[i] - corners[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1 / (u * h).sum(axis=1)
            q = np.cross(s, u)
            a, b, t = scale * (s * h).sum(axis=1), scale * (q * ray).sum(axis=1), scale * (v * q).sum(axis=1)
            hit = (a >= 0) & (b >= 0) & (a + b <= 1) & (t > 0) & ((t < 1) | frame.light.is_directional)
        hit[samples.triangle[i]] = False
        shadow[i] = hit.any()
    return shadow


@pytest.mark.parametrize("light", [ABOVE, AMONG, PARALLEL])
@pytest.mark.parametrize("projection", ["spot", "cube"])
def test_errors_shrink_with_the_resolution(light, projection):
    frame = make_frame(scene(), light, ImageSize(96, 72))
    truth = ray_traced(frame)
    assert 0.05 < truth.sum() / frame.samples.candidate.sum() < 1.0
    wrong = [np.mean((run(frame, resolution=n, projection=projection)[0] > 0.5) != truth) for n in (32, 256, 2048)]
    assert wrong[0] > wrong[1] > wrong[2] and wrong[2] < 2e-3, wrong


@pytest.mark.parametrize("light", [ABOVE, Light.point(3.5, -0.9, 0.2), PARALLEL, Light.directional(1, -0.05, 0.3)])
@pytest.mark.parametrize("pcf", [1, 5])
def test_a_plane_does_not_shadow_itself(light, pcf):
    frame = make_frame(Mesh.from_arrays(GROUND, [0, 1, 2, 0, 2, 3]), light)
    for projection in ("spot", "cube"):
        shadow, _ = run(frame, resolution=37, projection=projection, pcf=pcf)
        assert frame.samples.candidate.any() and not shadow.any()
    # Without the slope bias it does: the test above can fail
    shadow, _ = run(frame, resolution=37, projection="cube", pcf=pcf, slope_bias=0)
    assert shadow.any()


def test_percentage_closer_filtering_averages():
    frame = make_frame(scene(), ABOVE)
    shadow, _ = run(frame, resolution=64, pcf=3)
    assert set(np.unique(np.round(shadow * 9).astype(int))) == set(range(10))
    np.testing.assert_allclose(shadow, np.round(shadow * 9) / 9, rtol=1e-6)


# --- Views of the light --------------------------------------------------------------------------------------------


def test_auto_projection_is_spot_where_a_cone_of_120_degrees_suffices():
    for light, fitted in ((ABOVE, True), (AMONG, False)):
        frame = make_frame(scene(), light)
        maps = [fit_light_maps(light.xyzw(), frame.samples.position, frame.samples.candidate, p, 16, 1)
                for p in ("auto", "spot", "cube")]
        assert [m.fitted for m in maps] == [fitted, True, False]
        assert maps[0].n_layers == (1 if fitted else maps[2].n_layers)
        assert maps[2].layer[0] == -1 and maps[1].layer[0] == 0
    # Samples outside the spot map got faces of the cube
    assert np.any(maps[1].layer[1:] >= 0)


vector = st.tuples(*[st.one_of(st.floats(-1, 1), st.sampled_from([0.0, 1.0, -1.0, 0.5]))] * 3).filter(
    lambda v: max(map(abs, v)) > 1e-3)


@settings(deadline=None, max_examples=100)
@given(vector, st.booleans(), st.integers(1, 40), st.integers(0, 4))
def test_every_direction_has_a_texel_whose_filter_stays_inside(direction, fitted, resolution, radius):
    axes = np.stack([axes_along(np.array(f, float)) for f in
                     ((1, 2, 3), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))])
    np.testing.assert_allclose(np.einsum("fij,fkj->fik", axes, axes), np.broadcast_to(np.eye(3), (7, 3, 3)), atol=1e-15)
    half = np.array([1.7, 1, 1, 1, 1, 1, 1.0])
    face, u, v, depth = locate(axes, half, fitted, True, *direction)
    assert depth > 0 and abs(u) <= half[face] and abs(v) <= half[face] and (fitted or face > 0)
    np.testing.assert_allclose(depth * (axes[face, 2] + u * axes[face, 0] + v * axes[face, 1]), direction, atol=1e-12)
    border = radius + 1
    for p, q in ((u, v), (half[face], -half[face]), (-half[face], half[face])):
        for index in texel(p, q, half[face], resolution, border):
            assert index >= radius and index + radius < resolution + 2 * border


@pytest.mark.parametrize("light", [ABOVE, AMONG, PARALLEL])
def test_texel_agrees_with_the_rasterised_view(light):
    """A sample's texel is the one whose centre is nearest to its projection."""
    frame = make_frame(scene(), light)
    position = frame.samples.position[frame.samples.candidate]
    maps = fit_light_maps(light.xyzw(), frame.samples.position, frame.samples.candidate, "spot", 33, 2)
    for p in position[::7]:
        face, u, v, _ = locate(maps.axes, maps.half, maps.fitted, maps.perspective, *(p - maps.eye))
        view, (row, column) = map_view(maps, face), texel(u, v, maps.half[face], 33, 2)
        assert np.argmin(np.abs(view.x_plane - u)) == column and np.argmin(np.abs(view.y_plane - v)) == row


# --- Awkward scenes ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("light", [ABOVE, PARALLEL])
def test_no_candidates_and_no_triangles(light):
    for mesh in (Mesh.from_arrays(np.zeros((0, 3)), []), Mesh.from_arrays(GROUND[:, [0, 2, 1]], [0, 1, 2])):
        frame = make_frame(mesh, light)
        frame.samples.candidate[:] = False
        for projection in ("auto", "spot", "cube"):
            shadow, probe = run(frame, projection=projection)
            assert not shadow.any() and probe.counts.get("map_fragments", 0) == probe.counts["map_texels_read"] == 0


@pytest.mark.parametrize("light", [ABOVE, PARALLEL])
def test_single_candidate(light):
    frame = make_frame(scene(), light)
    keep = np.flatnonzero(frame.samples.candidate)[5]
    frame.samples.candidate[:] = False
    frame.samples.candidate[keep] = True
    truth = ray_traced(frame)[keep]
    for projection in ("auto", "cube"):
        assert run(frame, projection=projection, resolution=512)[0][keep] == truth


def test_light_inside_a_closed_box_lights_its_inside_and_nothing_else():
    camera = Camera((0.1, 0.2, 0.9), (0.1, 0.2, -1), fov_y=120, near=1e-3)
    frame = make_frame(Mesh.from_arrays(BOX, BOX_FACES), Light.point(0.3, -0.2, 0.1), camera=camera)
    assert frame.samples.candidate.all() and not run(frame, resolution=64)[0].any()
    around = Mesh.from_arrays(np.concatenate([BOX * 0.2, BOX]), np.concatenate([BOX_FACES, BOX_FACES + 8]))
    frame = make_frame(around, Light.point(0.05, -0.02, 0.01), camera=camera)
    assert np.all(run(frame, resolution=64)[0] == frame.samples.candidate) and frame.samples.candidate.any()


def test_casters_very_close_to_the_light_still_cast():
    """A sheet a millionth of the distance below the light, and one that the light's plane of depth 0 cuts."""
    light = Light.point(0, 1, 0)
    sheet = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], float)
    for casters in (sheet * 1e-6 + [0, 1 - 1e-6, 0], sheet * 1e-300 * [1, 0, 1] + [0, 1 - 1e-15, 0],
                    sheet * 50 + sheet[:, [2, 0, 1]] * [0, 40, 0] + [0, 0.9, 0]):
        mesh = Mesh.from_arrays(np.concatenate([GROUND, casters]), [0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7])
        frame = make_frame(mesh, light)
        frame.samples.candidate[frame.samples.triangle > 1] = False
        truth = ray_traced(frame)
        shadow = run(frame, resolution=256)[0]
        assert frame.samples.candidate.sum() > 100 and np.mean((shadow > 0.5) != truth) < 0.01


@pytest.mark.parametrize("light", [Light.point(*GROUND[2]), Light.point(0.5, -1.0, 0.5), Light.point(0, 50, 0)])
def test_light_on_a_vertex_in_a_plane_or_far_away(light):
    shadow, _ = run(make_frame(scene(), light), resolution=64)
    assert np.all((shadow == 0) | (shadow == 1))


@pytest.mark.parametrize(("scale", "offset"), [(1e-3, 0.0), (1e5, 0.0), (1.0, 1e5)])
def test_scaled_and_moved_scenes_have_the_same_shadows(scale, offset):
    at = lambda p: tuple(float(v) * scale + offset for v in p)  # noqa: E731
    mesh, camera = scene(), Camera((0.5, 2.5, 5), (0, -0.3, 0), fov_y=50)
    moved = Camera(at(camera.eye), at(camera.target), camera.up, 50.0, 0.1 * scale, 1000 * scale)
    plain = run(make_frame(mesh, ABOVE))[0]
    frame = make_frame(Mesh.from_arrays(mesh.vertices * scale + offset, mesh.triangles),
                       Light.point(*at(ABOVE.position[:3])), camera=moved)
    assert plain.any() and np.mean(plain != run(frame)[0]) < 2e-3


@pytest.mark.parametrize("light", [ABOVE, AMONG, PARALLEL])
def test_threads_change_nothing(light):
    frame, before = make_frame(scene(), light), jit.n_threads()
    try:
        jit.set_threads(1)
        one = run(frame, resolution=128, pcf=3)
    finally:
        jit.set_threads(before)
    all_threads = run(frame, resolution=128, pcf=3)
    np.testing.assert_array_equal(one[0], all_threads[0])
    assert one[1].counts == all_threads[1].counts


def test_memory_is_told():
    shadow, probe = run(make_frame(scene(), ABOVE), resolution=100, pcf=3)
    assert shadow.any() and probe.memory_bytes == {"maps": 104 * 104 * (8 + 4)}


def test_parameters():
    assert Params().model_dump() == {"resolution": 1024, "projection": "auto", "pcf": 1, "bias": 1.0,
                                     "slope_bias": 1.0}
    for bad in ({"pcf": 2}, {"pcf": 0}, {"resolution": 0}, {"resolution": 20000}, {"projection": "dual"},
                {"bias": -1.0}, {"pfc": 3}):
        with pytest.raises(ValidationError):
            Params(**bad)
    with pytest.raises(ValidationError, match="pcf must be odd"):
        Params(pcf=4)
    entry = ALGORITHMS["shadow_map"]
    assert entry.load() is ShadowMap
    assert (entry.title, entry.paper, entry.exact) == (ShadowMap.title, ShadowMap.paper, ShadowMap.exact)
