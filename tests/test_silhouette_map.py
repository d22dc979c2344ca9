"""Silhouette maps: against a slow twin, against the shadow map that they fall back on."""

import hashlib
import json
import os
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from shadowbench import accuracy
from shadowbench.algorithms import ALGORITHMS
from shadowbench.algorithms.base import Frame, Probe
from shadowbench.algorithms.reference import reference_frame
from shadowbench.algorithms.shadow_map import ShadowMap
from shadowbench.algorithms.silhouette_map import SilhouetteMap, bandwidth_model
from shadowbench.geometry import ImageSize
from shadowbench.jit import set_threads
from shadowbench.kernels.depth_maps import CELL_BORDER, Receivers, compare_corners, render_depth
from shadowbench.kernels.light_maps import fit_light_maps
from shadowbench.kernels.projection import View, screen_axis
from shadowbench.kernels.silhouette_lookup import quadrant, shade
from shadowbench.kernels.silhouette_points import ENLARGEMENT, draw_silhouettes, pick_point
from shadowbench.scenes.loader import load_scene
from shadowbench.view_samples import render_view_samples
from tests.hard_cases import HARD_CASES
from tests.silhouette_twin import exact_quadrant, pick, twin_points, twin_silhouette_map
from tests.test_shadow_map import ABOVE, AMONG, PARALLEL, make_frame, ray_traced, scene


def run(frame, **params):
    """Run the counting build and the timing build; they must agree."""
    algorithm, counting, timing = SilhouetteMap(SilhouetteMap.Params(**params)), Probe(counting=True), Probe()
    buffer = algorithm.shadows(frame, counting)
    plain = algorithm.shadows(frame, timing)
    np.testing.assert_array_equal(buffer.shadow, plain.shadow)
    assert tuple(timing.stages) == SilhouetteMap.stages and not timing.counts and not plain.images
    assert buffer.shadow.dtype == np.float32 and np.all(buffer.shadow[~frame.samples.candidate] == 0)
    return buffer, counting


def scene_frame(name, size):
    loaded, image = load_scene(name), ImageSize(size, size)
    mesh, camera, light = loaded.mesh(0), loaded.camera(0), loaded.light(0)
    samples = render_view_samples(mesh, camera, light, image)
    return Frame(mesh, light, camera.basis(1.0), image, samples, 1e-5 * mesh.diagonal())


# --- The slow twin -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("light", "projection", "order", "casters"), [
    (ABOVE, "auto", "nearest", "all"), (ABOVE, "cube", "index", "back_faces"), (AMONG, "auto", "nearest", "all"),
    (AMONG, "spot", "index", "all"), (PARALLEL, "auto", "nearest", "all"), (PARALLEL, "auto", "index", "back_faces")])
def test_equals_the_twin_number_for_number(light, projection, order, casters):
    frame = make_frame(scene(12), light, ImageSize(24, 18))
    options = {"resolution": 13, "projection": projection, "bias": 0.7, "slope_bias": 0.9, "order": order,
               "casters": casters}
    buffer, probe = run(frame, **options)
    expected = twin_silhouette_map(frame, **options)
    assert probe.counts == expected.counts and probe.counts["silhouette_samples"] > 0
    assert 0 < probe.counts["silhouette_points_written"] < probe.counts["silhouette_fragments"]
    np.testing.assert_array_equal(buffer.shadow, expected.shadow)
    split = (expected.nearer > 0) & (expected.nearer < 15)
    np.testing.assert_array_equal(probe.heat, 4 * frame.samples.candidate + 5 * split)


coordinate = st.one_of(st.floats(-3, 4), st.sampled_from([0.0, 1.0, 0.5, -1.0, 2.0]))


def meets(x0, y0, x1, y1, low, high):
    """Tell in rational numbers whether a segment meets the closed square low..high."""
    first, last = Fraction(0), Fraction(1)
    for a, b in ((x0, x1), (y0, y1)):
        a, step = Fraction(a), Fraction(b) - Fraction(a)
        if step == 0:
            if not low <= a <= high:
                return False
        else:
            t0, t1 = sorted(((low - a) / step, (high - a) / step))
            first, last = max(first, t0), min(last, t1)
    return first <= last


@settings(deadline=None, max_examples=400)
@given(coordinate, coordinate, coordinate, coordinate)
def test_a_point_is_picked_where_the_segment_meets_the_cell(x0, y0, x1, y1):
    t, x, y = pick_point(x0, y0, x1, y1)
    assert (t >= 0) == (pick(x0, y0, x1, y1) is not None)
    margin = Fraction(ENLARGEMENT)
    if meets(x0, y0, x1, y1, 0, 1):
        assert t >= 0
    if not meets(x0, y0, x1, y1, -2 * margin, 1 + 2 * margin):
        assert t < 0
    if t >= 0:
        assert 0 <= t <= 1 and max(abs(x - 0.5), abs(y - 0.5)) <= 0.5 + ENLARGEMENT
        assert np.allclose([x, y], [x0 + t * (x1 - x0), y0 + t * (y1 - y0)], atol=1e-12)


def test_the_four_cases_of_figure_4():
    assert pick_point(0.2, 0.3, 5.0, 5.0)[1:] == (0.2, 0.3)                            # (A) an end inside
    assert pick_point(5.0, 5.0, 0.2, 0.3)[1:] == (0.2, 0.3)
    np.testing.assert_allclose(pick_point(-1.0, 1.5, 1.5, -1.0)[1:], [0.25, 0.25])      # (B) one diagonal
    np.testing.assert_allclose(pick_point(-1.0, 0.25, 2.0, 0.25)[1:], [0.5, 0.25])      # (C) both: the middle
    assert pick_point(-1.0, 0.5, 0.5, -1.0)[0] < 0                                      # (D) past the corner


def flat_view(side):
    """Parallel view along z whose cells are the unit squares, x to the right and y downwards from (0.5, 0.5)."""
    middle = side / 2
    eye = np.array([middle, -middle, 0.0])
    return View(eye, np.array([1.0, 0, 0]), np.array([0.0, 1, 0]), np.array([0.0, 0, 1]), -np.inf, np.inf, False,
                *screen_axis(side, (0.5,), middle), *screen_axis(side, (0.5,), -middle))


def edge(x0, y0, x1, y1, depth=1.0):
    """Edge between two places of a flat view, columns and rows in cells."""
    return np.array([[[x0 + 0.5, -y0 - 0.5, depth], [x1 + 0.5, -y1 - 0.5, depth]]])


place = st.one_of(st.floats(-40, 60), st.integers(0, 10).map(float))


@settings(deadline=None, max_examples=60)
@given(place, place, place, place)
def test_points_of_an_edge_are_4_connected(x0, y0, x1, y1):
    """Also through corners and along sides of cells, and for edges that leave the map and are cut."""
    assume((x0, y0) != (x1, y1))
    side, points = 12, np.zeros((11, 11, 2), np.float32)
    n_fragments, n_written = draw_silhouettes(flat_view(side), edge(x0, y0, x1, y1), np.full((side, side), np.inf), points,
                                              True)
    expected = np.array([[meets(x0 - c, y0 - r, x1 - c, y1 - r, 0, 1) for c in range(11)] for r in range(11)])
    touched = np.any(points != 0, axis=2)
    # A point at the very centre of its cell looks like none
    centred = np.array([[meets(x0 - c, y0 - r, x1 - c, y1 - r, Fraction(1, 2), Fraction(1, 2)) for c in range(11)]
                        for r in range(11)])
    assert np.all(touched | centred | ~expected) and n_fragments == n_written >= touched.sum()
    reached = np.zeros((13, 13), bool)
    cells = np.pad(touched | (centred & expected), 1)
    if cells.any():
        reached[tuple(np.argwhere(cells)[0])] = True
        for _ in range(60):
            grown = reached.copy()
            for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
                grown |= np.roll(reached, step, axis)
            reached = grown & cells
        assert np.array_equal(reached, cells)


def test_hidden_points_are_dropped_and_the_last_one_wins():
    view, depth = flat_view(8), np.full((8, 8), 2.0)
    points = np.zeros((7, 7, 2), np.float32)
    assert draw_silhouettes(view, edge(0.2, 3.3, 6.8, 3.3, 2.5), depth, points, True) == (7, 0)
    assert not points.any()
    depth[3, 4] = 3.0                                           # one corner of two cells lies farther
    assert draw_silhouettes(view, edge(0.2, 3.3, 6.8, 3.3, 2.5), depth, points, True) == (7, 2)
    two = np.concatenate([edge(0.2, 3.3, 6.8, 3.3), edge(0.2, 3.75, 6.8, 3.75)])
    draw_silhouettes(view, two, depth, points)
    np.testing.assert_array_equal(points[3, :, 1], np.float32(0.25))
    draw_silhouettes(view, two[::-1].copy(), depth, points)
    np.testing.assert_allclose(points[3, :, 1], 0.3 - 0.5, atol=1e-6)


def test_edges_cut_at_the_light_and_far_outside_leave_the_same_points():
    """A perspective view: edges that run far past the map, or to behind the light, and the part of them that shows."""
    x, y = screen_axis(10, (0.5,), 1.0), screen_axis(10, (0.5,), -1.0)
    view = View(np.zeros(3), *np.eye(3), 2.0**-60, np.inf, True, *x, *y)
    rng, depth, n_shared = np.random.default_rng(4), np.full((10, 10), np.inf), 0
    for _ in range(20):
        start = rng.uniform(-0.9, 0.9, 3) * [2, 2, 0] + [0, 0, 2]
        way = rng.normal(size=3) - [0, 0, 3]
        found = []
        for end in (start + rng.uniform(3, 1e6) * way, start + 0.6 * way / np.abs(way).max()):
            points = np.zeros((9, 9, 2), np.float32)
            draw_silhouettes(view, np.array([[start, end]]), depth, points)
            np.testing.assert_array_equal(points, twin_points(view, [(start, end)], depth)[0])
            found.append(points)
        # Beside the shorter edge's end, both leave the same points but for rounding
        same = np.all(np.abs(found[0] - found[1]) < 1e-4, axis=2)
        assert np.count_nonzero(~same & np.any(found[1] != 0, axis=2)) <= 2
        n_shared += np.count_nonzero(same & np.any(found[1] != 0, axis=2))
    assert n_shared > 30


offset = st.one_of(st.floats(-0.5, 0.5, width=32), st.sampled_from([0.0, 0.5, -0.5, 0.25]))
offsets = st.tuples(offset, offset)


@settings(deadline=None, max_examples=400)
@given(st.one_of(st.floats(0, 1), st.just(0.5)), st.floats(0, 1), offsets, offsets, offsets, offsets, offsets)
def test_quadrant_equals_exact_geometry(x, y, own, left, right, above, below):
    """The eight pies against rational numbers, points on the border of their cells included."""
    expected = exact_quadrant(x, y, own, left, right, above, below)
    found = quadrant(x, y, own, left, right, above, below)
    assert found in (1, 2, 4, 8)
    assume(expected is not None)
    px, py = own[0] + 0.5, own[1] + 0.5
    rays = [(-0.5 + left[0] - px, left[1] + 0.5 - py), (right[0] + 1.5 - px, right[1] + 0.5 - py),
            (above[0] + 0.5 - px, above[1] - 0.5 - py), (below[0] + 0.5 - px, below[1] + 1.5 - py)]
    turns = [abs(a * (y - py) - b * (x - px)) for a, b in rays]
    assume(min(turns) > 1e-9)                       # farther from all lines than rounding
    assert found == 1 << expected


@given(st.floats(0, 1, exclude_max=True), st.floats(0, 1, exclude_max=True))
def test_default_points_give_the_nearest_corner(x, y):
    centre = (0.0, 0.0)
    assert quadrant(x, y, centre, centre, centre, centre, centre) == 1 << (2 * (y >= 0.5) + (x >= 0.5))


# --- Against the shadow map ----------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10**6), st.sampled_from([ABOVE, AMONG, PARALLEL]), st.integers(3, 200),
       st.sampled_from(["auto", "cube"]), st.floats(0, 2), st.floats(0, 2))
def test_unanimous_corners_and_default_points_give_the_shadow_map(seed, light, resolution, projection, bias, slope_bias):
    frame = make_frame(scene(40, seed), light)
    options = {"resolution": resolution, "projection": projection, "bias": bias, "slope_bias": slope_bias}
    plain = ShadowMap(ShadowMap.Params(**options)).shadows(frame, Probe()).shadow
    samples = frame.samples
    maps = fit_light_maps(light.xyzw(), samples.position, samples.candidate, projection, resolution, CELL_BORDER)
    depth = render_depth(maps, frame.mesh.vertices, frame.mesh.triangles).depth
    nearer = compare_corners(maps, depth, Receivers(samples.position, samples.normal, samples.candidate,
                                                    bias * frame.bias, slope_bias))
    unanimous = (nearer == 0) | (nearer == 15)
    assert unanimous.any()
    shadow = SilhouetteMap(SilhouetteMap.Params(**options)).shadows(frame, Probe()).shadow
    np.testing.assert_array_equal(shadow[unanimous], plain[unanimous])
    default = np.zeros((maps.n_layers, maps.side - 1, maps.side - 1, 2), np.float32)
    np.testing.assert_array_equal(shade(maps, default, samples.position, nearer), plain)


@pytest.mark.parametrize("light", [ABOVE, AMONG, PARALLEL])
@pytest.mark.parametrize("projection", ["spot", "cube"])
def test_samples_outside_a_spot_map_are_resolved(light, projection):
    """The spot map of the light among the triangles leaves most samples to the cube: none is silently lit."""
    frame = make_frame(scene(), light, ImageSize(96, 72))
    truth = ray_traced(frame)
    assert 0.05 < truth.sum() / frame.samples.candidate.sum() < 1.0
    wrong = [np.mean((run(frame, resolution=n, projection=projection)[0].shadow > 0.5) != truth) for n in (32, 1024)]
    assert wrong[1] < 0.1 * wrong[0] and wrong[1] < 2e-3, wrong


def wrong_samples(frame, truth, shadow):
    errors = accuracy.classify(shadow, *truth, frame.samples.candidate)
    return accuracy.measure(shadow, errors, truth[1], frame.samples.candidate).wrong


@pytest.mark.parametrize(("name", "size", "resolutions"), [
    ("strike", 256, (128, 512)), ("cubes", 256, (128, 512)),
    *[pytest.param(name, 1024, (128, 256, 512, 1024, 2048, 4096), marks=pytest.mark.slow)
      for name in ("strike", "cubes", "citadel")]])
def test_fewer_wrong_samples_than_the_shadow_map(name, size, resolutions):
    frame = scene_frame(name, size)
    truth = reference_frame(frame, Probe())
    table = []
    for resolution in resolutions:
        counts = [wrong_samples(frame, truth, method(method.Params(resolution=resolution)).shadows(frame, Probe()).shadow)
                  for method in (SilhouetteMap, ShadowMap)]
        table.append((resolution, *counts))
    print(name, table)
    assert all(silhouette < plain for _, silhouette, plain in table), table


# --- Awkward scenes, threads, machines -----------------------------------------------------------------------------


def test_hard_cases_run():
    """That the answer is that of a shadow map where corners agree is tested above; here, that there is one."""
    for i, (name, case) in enumerate(HARD_CASES.items()):
        frame = case.frame()
        shadow = run(frame, resolution=32, projection=("auto", "cube")[i % 2])[0].shadow
        truth, _ = reference_frame(frame, Probe())
        assert set(np.unique(shadow)) <= {0.0, 1.0}, name
        assert np.count_nonzero(shadow != truth) <= 0.5 * np.count_nonzero(frame.samples.candidate), name


def test_bandwidth_model():
    """Sec. 4: less than twice a shadow map below P = 1 / 6; volumes cost more above O = 4 / 5.5."""
    assert bandwidth_model(600, 100, 0)[:2] == (2400.0, 4800.0)
    assert bandwidth_model(600, 99, 0).silhouette_map < 2 * bandwidth_model(600, 99, 0).shadow_map
    assert bandwidth_model(11, 0, 8) == (44.0, 44.0, 44.0)
    crowd = bandwidth_model(148_900, 19_800, 22_960_000)
    assert crowd.silhouette_map / crowd.shadow_map == pytest.approx(1 + 6 * 0.133, abs=1e-3)
    assert crowd.shadow_volumes / crowd.shadow_map == pytest.approx(154.2 * 5.5 / 4, rel=1e-3)


def fingerprint():
    """Digest of shadows, points, heat maps and counts on a few frames, at several thread counts."""
    digest = hashlib.sha256()
    for threads in (1, 2, 4):
        set_threads(threads)
        part = hashlib.sha256()
        for light in (ABOVE, AMONG, PARALLEL):
            frame = make_frame(scene(), light)
            for order in ("nearest", "index"):
                buffer, probe = run(frame, resolution=64, casters="auto", order=order)
                part.update(buffer.shadow.tobytes() + probe.heat.tobytes())
                part.update(b"".join(picture.tobytes() for picture in buffer.images.values()))
                part.update(json.dumps(probe.all_counts()).encode())
        digest.update(part.digest())
        print(part.hexdigest())
    set_threads(1)
    return digest.hexdigest()


def test_same_bits_at_any_thread_count(capsys):
    fingerprint()
    assert len(set(capsys.readouterr().out.split())) == 1


@pytest.mark.slow
@pytest.mark.slow
def test_same_bits_with_generic_code(capsys):
    own = fingerprint()
    capsys.readouterr()
    environment = {**os.environ, "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    script = "from tests.test_silhouette_map import fingerprint; print(fingerprint())"
    other = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert other.stdout.split()[-1] == own


def test_parameters_and_memory():
    for bad in ({"resolution": 0}, {"projection": "dual"}, {"order": "first"}, {"bias": -1.0}, {"pcf": 3}):
        with pytest.raises(ValidationError):
            SilhouetteMap.Params(**bad)
    entry = ALGORITHMS["silhouette_map"]
    assert entry.load() is SilhouetteMap
    assert (entry.title, entry.paper, entry.exact) == (SilhouetteMap.title, SilhouetteMap.paper, SilhouetteMap.exact)
    probe = run(make_frame(scene(), ABOVE), resolution=100)[1]
    assert probe.memory_bytes == {"maps": 104 * 104 * (8 + 4), "silhouette_maps": 103 * 103 * 8}
    assert set(probe.counts) == set(SilhouetteMap.counters)
