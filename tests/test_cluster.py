"""The cluster hierarchy: keys, tree and bounds, a twin that counts by the definitions, groups, limits."""

import json
import os
import subprocess
import sys
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench import accuracy
from shadowbench.algorithms.cluster import Cluster, Params
from shadowbench.algorithms.reference import reference_frame
from shadowbench.geometry import Frame, ImageSize, Mesh
from shadowbench.jit import set_threads
from shadowbench.kernels.cluster_counts import full_tree_nodes
from shadowbench.kernels.cluster_keys import key_layout, make_slices
from shadowbench.kernels.culling_planes import EYE_EDGES
from shadowbench.kernels.frustum_groups import group_triangles
from shadowbench.kernels.group_frustum import make_groups
from shadowbench.kernels.shadow_frustum import View, casting_triangles, find_facing, make_frusta
from shadowbench.probe import Probe
from shadowbench.scenes.loader import load_scene
from shadowbench.view_samples import SAMPLE_PATTERNS
from tests.cluster_twin import Twin
from tests.hard_cases import HARD_CASES, Case, soup

SEEDS = st.integers(0, 10**6)
KINDS = st.sampled_from(["random", "grid", "slivers"])
PLANES = tuple(EYE_EDGES)
OPTIONS = st.builds(
    Params, bounds=st.sampled_from(["explicit", "implicit"]), culling_planes=st.sampled_from(PLANES),
    passes=st.sampled_from(["one", "two"]), split_level=st.integers(1, 4), layout=st.sampled_from(["full", "compact"]),
    leaf=st.sampled_from(["tile", "cluster"]), depth_start=st.sampled_from(["nearest_sample", "near_plane"]),
    casters=st.sampled_from(["all", "back_faces"]), group=st.sampled_from([1, 1, 8, 16, 64]),
    remove_unlit=st.booleans(), skip_shadowed=st.booleans())


def frame_of(seed, kind="random", n_triangles=14, image=None):
    """A soup seen on an image of odd size."""
    rng = np.random.default_rng(seed)
    case = soup(seed, n_triangles, kind)
    image = image or ImageSize(int(rng.integers(1, 70)), int(rng.integers(1, 60)), int(rng.choice([1, 1, 4])))
    return Case(case.mesh, case.camera, case.light, image).frame()


def run(frame, params, counting=True):
    probe = Probe(counting=counting)
    return Cluster(params).shadows(frame, probe), probe


# Keys

@pytest.mark.parametrize(("size", "bits"), [(1, [2]), (9, [5]), (256, [2, 5, 5, 5]), (1024, [3, 5, 5, 5, 5]),
                                            (1025, [1, 5, 5, 5, 5, 5]), (4096, [4, 5, 5, 5, 5, 5]),
                                            (8192, [2, 5, 5, 5, 5, 5, 5])])
def test_levels_follow_from_the_resolution(size, bits):
    assert key_layout(size, 3).level_bits.tolist() == key_layout(3, size).level_bits.tolist() == bits


def test_keys_interleave_the_coordinates():
    layout = key_layout(1024, 1024)
    assert [len(table) for table in (layout.key_x, layout.key_y, layout.key_z)] == [128, 128, 512]
    x, y, z = 0b1011001, 0b0100111, 0b110101010
    expected, used = 0, [0, 0, 0]
    for position, axis in enumerate([0, 1, 2] * 7 + [2, 2]):
        expected |= ((x, y, z)[axis] >> used[axis] & 1) << position
        used[axis] += 1
    assert int(layout.key_x[x] | layout.key_y[y] | layout.key_z[z]) == expected
    assert int(layout.key_x[-1] | layout.key_y[-1] | layout.key_z[-1]) == 2**23 - 1


def test_size_of_the_full_tree_at_1024_is_the_published_one():
    nodes = full_tree_nodes(key_layout(1024, 1024))
    assert round(nodes / 1e6, 2) == 8.66 and round(24 * nodes / 2**20) == 198 and round(4 * nodes / 2**20) == 33


@settings(deadline=None, max_examples=60)
@given(st.floats(1e-3, 1e3), st.floats(0.05, 3.0), st.integers(1, 128), st.sampled_from([4, 16, 64, 512]),
       st.lists(st.floats(1e-6, 1e9), min_size=1))
def test_slices_equal_a_search(start, tan_y, n_tile_rows, n_slices, depths):
    slices = make_slices(start, tan_y, n_tile_rows, n_slices)
    boundaries = slices.start[:-1]
    depth = np.array([*depths, *boundaries, *np.nextafter(boundaries, 0), np.inf])
    guessed = slices.guide[np.clip((depth.view(np.int64) >> slices.shift) - slices.first, 0, len(slices.guide) - 1)]
    found = guessed + (depth >= slices.start[guessed + 1])
    assert np.array_equal(found, np.maximum(np.searchsorted(boundaries, depth, side="right") - 1, 0))
    assert np.allclose(boundaries[1:] / boundaries[:-1], 1 + 2 * tan_y / n_tile_rows)


@pytest.mark.parametrize("samples", SAMPLE_PATTERNS)
def test_image_size_knows_its_sample_grid(samples):
    pattern, image = SAMPLE_PATTERNS[samples], ImageSize(5, 7, samples)
    assert (image.columns, image.rows) == (5 * len(pattern.x), 7 * len(pattern.y))


def test_too_large_an_image_is_refused_with_the_remedy():
    scene = load_scene("cubes", ["image.width=4096", "image.height=64"])
    assert Cluster(Params(layout="compact")).unsupported(scene) is None
    assert "use layout=compact" in Cluster(Params(layout="full")).unsupported(scene)
    scene = load_scene("cubes", ["image.width=8192", "image.height=8", "image.samples=4"])
    assert "smaller image" in Cluster(Params(layout="compact")).unsupported(scene)


# Twin

def units_of(frame, params):
    """Frusta and groups as the method sets them up."""
    samples = frame.samples
    included = samples.candidate | (not params.remove_unlit)
    r = np.float32(1) / samples.depth[included].astype(np.float32)
    reach = np.array([np.abs(samples.plane_x).max(), np.abs(samples.plane_y).max(), r.max(initial=0)])
    corners, sides, light = frame.mesh.corners, np.empty(frame.mesh.n_triangles, np.int8), frame.light.xyzw()
    find_facing(corners, light, sides)
    view = View(*frame.camera[:4], light, frame.bias, reach)
    triangles, groups = casting_triangles(sides, Cluster(params).casters(frame)), None
    if params.group > 1:
        units, faces = group_triangles(corners, triangles, light, params.group)
        groups, triangles = make_groups(corners, units, faces, view), units.order
    frusta = make_frusta(corners, sides, triangles, view, EYE_EDGES[params.culling_planes],
                         "wedge" in params.culling_planes)
    return frusta, None if groups is None else (groups.rows, groups.first)


def check_against_twin(seed, kind, params):
    frame = frame_of(seed, kind)
    buffer, probe = run(frame, params)
    twin = Twin(frame, params, *units_of(frame, params)).run()
    assert np.array_equal(buffer.shadow.astype(bool), twin.in_shadow)
    if not twin.included.any():
        assert probe.counts == {}
        return
    for name, values in twin.counts.items():
        assert probe.levels[name] == values.tolist(), name
    assert probe.levels["iterations"] == twin.iterations.tolist()
    assert probe.levels["occupied_nodes"] == [len(nodes) for nodes in twin.by_level]
    assert probe.counts["sample_tests"] == twin.sample_tests
    assert probe.counts["float64_sample_tests"] == twin.retries
    assert np.array_equal(probe.triangle_counts["test_and_set"], twin.per_triangle())
    assert np.abs(probe.heat - twin.heat()).max() <= 0.5 + 1e-9
    assert probe.largest["iterations"] == twin.all_iterations()
    assert probe.all_counts()["test_and_set"] == sum(twin.unit_tests.values())


@settings(deadline=None, max_examples=25)
@given(SEEDS, KINDS, OPTIONS)
def test_all_counts_equal_the_twins(seed, kind, params):
    check_against_twin(seed, kind, params)


@pytest.mark.slow
@settings(deadline=None, max_examples=1500)
@given(SEEDS, KINDS, OPTIONS)
def test_all_counts_equal_the_twins_at_length(seed, kind, params):
    check_against_twin(seed, kind, params)


# Any combination of options against the reference

def wrong_samples(frame, params):
    """Samples whose answer differs from the reference's and is not ambiguous."""
    shadow = run(frame, params, counting=False)[0].shadow
    truth, ambiguous = reference_frame(frame, Probe(), Cluster(params).casters(frame))
    errors = accuracy.classify(shadow, truth, ambiguous, frame.samples.candidate)
    return accuracy.measure(shadow, errors, ambiguous, frame.samples.candidate).wrong


@settings(deadline=None, max_examples=20)
@given(SEEDS, KINDS, OPTIONS)
def test_no_sample_is_wrong_with_any_combination_of_options(seed, kind, params):
    assert wrong_samples(frame_of(seed, kind, 60), params) == 0


@pytest.mark.slow
@settings(deadline=None, max_examples=1000)
@given(SEEDS, KINDS, OPTIONS, st.sampled_from([1, 2, 4]))
def test_no_sample_is_wrong_with_any_combination_of_options_at_length(seed, kind, params, n_threads):
    set_threads(n_threads)
    assert wrong_samples(frame_of(seed, kind, 60), params) == 0


@pytest.mark.slow
@pytest.mark.parametrize("case", HARD_CASES)
@settings(deadline=None, max_examples=25)
@given(params=OPTIONS)
def test_no_sample_of_a_hard_case_is_wrong_with_any_combination_of_options(case, params):
    assert wrong_samples(HARD_CASES[case].frame(), params) == 0


# Determinism and sameness

def digest():
    """Results of a few frames under several options, as text."""
    results = []
    for seed, kind in product(range(2), ("random", "grid")):
        frame = frame_of(seed, kind, 80, ImageSize(90, 70))
        for params in (Params(culling_planes="outline+wedge", leaf="cluster"), Params(bounds="implicit", passes="one"),
                       Params(group=8, layout="compact", culling_planes="outline")):
            buffer, probe = run(frame, params)
            results += [np.packbits(buffer.shadow.astype(bool)).tobytes().hex(), probe.all_counts(), probe.levels,
                        probe.largest, int((probe.heat * np.arange(1, len(buffer.shadow) + 1)).sum())]
    return json.dumps(results)


def test_same_results_for_any_number_of_threads():
    expected = digest()
    for n_threads in (1, 2, 3, 4):
        set_threads(n_threads)
        assert digest() == expected


@pytest.mark.slow
def test_same_results_on_a_generic_cpu_in_another_process(tmp_path):
    environment = dict(os.environ, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(tmp_path))
    root = os.path.dirname(os.path.dirname(__file__))
    code = f"import sys; sys.path.insert(0, {root!r}); from tests import test_cluster; print(test_cluster.digest())"
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert out.stdout.strip() == digest()


@settings(deadline=None, max_examples=20)
@given(SEEDS, KINDS, OPTIONS)
def test_layouts_differ_in_nothing_but_memory(seed, kind, params):
    frame, results = frame_of(seed, kind, 40), []
    for layout in ("full", "compact"):
        buffer, probe = run(frame, params.model_copy(update={"layout": layout}))
        results.append((buffer.shadow.tolist(), probe.all_counts(), probe.levels, probe.largest))
    assert results[0] == results[1]


@settings(deadline=None, max_examples=15)
@given(SEEDS, OPTIONS)
def test_order_and_winding_do_not_matter(seed, params):
    frame = frame_of(seed, "random", 40)
    params, mesh = params.model_copy(update={"casters": "all"}), frame.mesh
    rng = np.random.default_rng(seed)
    triangles = mesh.triangles[rng.permutation(mesh.n_triangles)].copy()
    flip = rng.random(len(triangles)) < 0.5
    triangles[flip] = triangles[flip][:, ::-1]
    changed = Frame(Mesh.from_arrays(mesh.vertices, triangles), frame.light, frame.camera, frame.image, frame.samples,
                    frame.bias)
    assert np.array_equal(run(frame, params)[0].shadow, run(changed, params)[0].shadow)


def test_explicit_bounds_and_own_samples_take_fewer_tests():
    frame = load_scene_frame("gate", ImageSize(160, 160))
    tests = {name: run(frame, params)[1].all_counts()["test_and_set"] for name, params in {
        "whole tiles": Params(), "implicit": Params(bounds="implicit", leaf="cluster"),
        "explicit": Params(leaf="cluster")}.items()}
    assert tests["whole tiles"] > tests["explicit"] < tests["implicit"]


def load_scene_frame(name, image):
    scene = load_scene(name)
    return Case(scene.mesh(0), scene.camera(0), scene.light(0), image).frame()


def test_picture_of_the_levels_shows_the_occupied_samples():
    frame = load_scene_frame("gate", ImageSize(64, 64))
    picture = run(frame, Params())[0].images["levels"]
    assert picture.shape == (64, 64, 3)
    shown = frame.samples.candidate.reshape(64, 64)[::2, ::2]
    for top, left in product((0, 32), (0, 32)):
        assert np.array_equal(picture[top:top + 32, left:left + 32].any(axis=2), shown)
    colors = [len(np.unique(picture[t:t + 32, x:x + 32].reshape(-1, 3), axis=0)) for t, x in ((0, 0), (0, 32), (32, 32))]
    assert colors == sorted(colors) and colors[0] < colors[-1]
