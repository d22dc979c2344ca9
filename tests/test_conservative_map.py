"""Conservative shadow maps: classes that are right by themselves, counts of a slow twin, rays that get shorter."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.algorithms.conservative_map import LIT, SHADOWED, UNCERTAIN, UNLIT, ConservativeMapMethod, Params
from shadowbench.algorithms.ptsv import Ptsv
from shadowbench.algorithms.ray_traced import RayTraced
from shadowbench.geometry import Frame, ImageSize, Light
from shadowbench.jit import set_threads
from shadowbench.kernels.kdtree_build import build_kdtree
from shadowbench.kernels.kdtree_traversal import Start, empty_counts, parallel_length, trace
from shadowbench.kernels.light_maps import locate, texel
from shadowbench.kernels.shadow_rays import make_shadow_rays
from shadowbench.probe import Probe
from shadowbench.scenes.loader import load_scene
from shadowbench.view_samples import render_view_samples
from tests.hard_cases import HARD_CASES, Case, ground, mesh_of, soup
from tests.kdtree_twin import Ray

SEEDS = st.integers(0, 10**6)
KINDS = st.sampled_from(["random", "grid", "slivers"])
OPTIONS = st.builds(Params, resolution=st.sampled_from([1, 7, 64, 200]),
                    projection=st.sampled_from(["auto", "spot", "cube"]),
                    raster=st.sampled_from(["discard", "polygon"]), layers=st.sampled_from([1, 2]),
                    self_shadow=st.sampled_from(["bias", "id"]))


def with_tree(frame):
    return Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, frame.bias,
                 build_kdtree(frame.mesh.corners))


def rays_of(frame):
    return make_shadow_rays(frame.mesh.corners, frame.mesh.bounds(), frame.camera[:4], frame.light.xyzw(), frame.bias,
                            frame.samples)


def classify(frame, params):
    """Classes and where rays start, by the map alone."""
    frame = with_tree(frame)
    samples, _, _ = ConservativeMapMethod(params).classified(frame, rays_of(frame), frame.prepared, Probe())
    return samples


def wrong_classes(frame, params):
    """Samples that the map alone calls lit or shadowed, and that are not."""
    kind, shadow = classify(frame, params).kind, Ptsv().shadows(frame, Probe()).shadow
    assert np.array_equal(kind == UNLIT, ~frame.samples.candidate)
    return int(np.count_nonzero((kind == LIT) & (shadow == 1)) + np.count_nonzero((kind == SHADOWED) & (shadow == 0)))


@pytest.mark.parametrize("raster", ["discard", "polygon"])
@pytest.mark.parametrize("layers", [1, 2])
def test_no_class_is_wrong_on_hard_cases(raster, layers):
    wrong = {name: wrong_classes(case.frame(), Params(resolution=80, raster=raster, layers=layers))
             for name, case in HARD_CASES.items()}
    assert {name: n for name, n in wrong.items() if n} == {}


@settings(deadline=None, max_examples=60)
@given(SEEDS, KINDS, OPTIONS, st.sampled_from([1e-5, 0.0, 1e-8, 0.01]))
def test_no_class_is_wrong_on_soups(seed, kind, params, bias):
    frame = soup(seed, kind=kind).frame()
    if params.self_shadow == "id":      # with a bias of zero, a surface's own rounding decides
        bias = max(bias, 1e-8)
    frame = Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, bias * frame.mesh.diagonal())
    assert wrong_classes(frame, params) == 0


def test_classes_are_used():
    """Each class holds a fair part of the samples, and the second layer and the finer map decide more."""
    frame = HARD_CASES["sun"].frame()
    uncertain = {}
    for options in ((256, 2, "polygon"), (256, 1, "polygon"), (256, 2, "discard"), (32, 2, "polygon")):
        kind = classify(frame, Params(resolution=options[0], layers=options[1], raster=options[2])).kind
        uncertain[options] = np.count_nonzero(kind == UNCERTAIN)
        if options == (256, 2, "polygon"):
            shares = np.bincount(kind, minlength=4)[1:] / np.count_nonzero(kind)
            assert shares[LIT - 1] > 0.5 and shares[SHADOWED - 1] > 0.01 and shares[UNCERTAIN - 1] < 0.35
    assert uncertain[256, 2, "polygon"] == min(uncertain.values()) < uncertain[32, 2, "polygon"]
    assert uncertain[256, 2, "discard"] < uncertain[256, 1, "polygon"]


@settings(deadline=None, max_examples=12)
@given(SEEDS, KINDS, OPTIONS, st.booleans(), st.booleans())
def test_classes_counts_and_rays_equal_the_twin(seed, kind, params, shorten, classify):
    frame = with_tree(soup(seed, 30, kind).frame())
    params = params.model_copy(update={"shorten": shorten, "classify": classify})
    rays, algorithm = rays_of(frame), ConservativeMapMethod(params)
    found, maps, target = algorithm.classified(frame, rays, frame.prepared, Probe())
    probe = Probe(counting=True)
    shadow = algorithm.shadows(frame, probe).shadow
    totals = dict.fromkeys(("kd_nodes", "kd_leaves", "triangle_tests", "stored_triangle_tests", "lit_by_map",
                            "shadowed_by_map", "rays_cast"), 0)
    for i in np.flatnonzero(frame.samples.candidate):
        face, u, v, here = locate(maps.axes, maps.half, maps.fitted, maps.perspective, *(rays.target[i] - maps.eye))
        place = (maps.layer[face], *texel(u, v, maps.half[face], maps.resolution, maps.border))
        bound, t = target.depth[place], int(target.triangle[place])
        asked, kind_here = 0, UNCERTAIN
        ray = Ray(frame.prepared, rays, i)
        if classify and here <= bound:
            kind_here = LIT
        elif classify:
            if params.self_shadow == "bias" or t != frame.samples.triangle[i]:
                asked = 1
                kind_here = SHADOWED if ray.test(t) else UNCERTAIN
            bound = target.next_depth[place]
            if kind_here != SHADOWED and here <= bound:
                kind_here = LIT
        if kind_here == LIT:
            for other in rays.loose:
                asked += 1
                if ray.test(other):
                    kind_here = SHADOWED
                    break
        assert found.kind[i] == kind_here
        totals["stored_triangle_tests"] += asked
        totals["lit_by_map"] += kind_here == LIT
        totals["shadowed_by_map"] += kind_here == SHADOWED
        hit, tests = kind_here == SHADOWED, asked
        if kind_here == UNCERTAIN:
            share = bound / here if maps.perspective else 1.0 - (here - bound) / parallel_length(rays)
            ray = Ray(frame.prepared, rays, i, max(share, 0.0) if shorten else 0.0).run("stack")
            totals["rays_cast"] += 1
            totals["kd_nodes"] += ray.nodes
            totals["kd_leaves"] += ray.leaves
            totals["triangle_tests"] += ray.tests
            hit, tests = ray.hit, tests + ray.tests
        assert bool(shadow[i]) == hit and probe.heat[i] == tests
    assert {name: probe.counts[name] for name in totals} == totals
    assert probe.counts["map_texels_read"] == np.count_nonzero(frame.samples.candidate)


def counts_of_rays(frame, rays, traced, start, traversal):
    """Shadows of the traced samples, and what each ray did."""
    shadow, counts = np.zeros(len(traced), np.float32), empty_counts(len(traced))
    trace(frame.prepared, rays, traced, start, traversal, frame.samples.columns, shadow, counts)
    return shadow, counts


def assert_shortened_rays_never_visit_more(frame, resolution):
    """Every ray, whatever it hits, with each way to keep the far children; returns how many the map shortens."""
    rays, samples = rays_of(frame), classify(frame, Params(resolution=resolution, classify=False))
    start = Start(samples.share)
    for traversal in ("stack", "short_stack", "restart"):
        whole_shadow, whole = counts_of_rays(frame, rays, samples.candidate, None, traversal)
        shadow, short = counts_of_rays(frame, rays, samples.candidate, start, traversal)
        assert np.array_equal(shadow, whole_shadow)
        assert (short.nodes <= whole.nodes).all() and (short.leaves <= whole.leaves).all()
        # A whole ray may meet a loose triangle on its way, and need not ask all of them at its end
        assert (short.tests <= whole.tests + len(rays.loose)).all()
    return np.count_nonzero(short.nodes < whole.nodes)


@settings(deadline=None, max_examples=60)
@given(SEEDS, KINDS, st.sampled_from([16, 64, 200]), st.sampled_from([1e-5, 0.0, 1e-8, 0.01]))
def test_shortened_rays_never_visit_more_nodes(seed, kind, resolution, bias):
    frame = soup(seed, 120, kind).frame()
    frame = with_tree(Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, bias * frame.mesh.diagonal()))
    assert_shortened_rays_never_visit_more(frame, resolution)


def test_shortened_rays_never_visit_more_nodes_in_a_scene():
    scene, image = load_scene("citadel", ["geometry.0.triangles=10000"]), ImageSize(192, 192)
    mesh, camera, light = scene.mesh(0), scene.camera(0), scene.light(0)
    samples = render_view_samples(mesh, camera, light, image)
    frame = Frame(mesh, light, camera.basis(1.0), image, samples, 1e-5 * mesh.diagonal(), build_kdtree(mesh.corners))
    n_rays = np.count_nonzero(samples.candidate)
    assert n_rays > 10000 and assert_shortened_rays_never_visit_more(frame, 256) > n_rays // 2


def test_each_switch_saves_work():
    frame = with_tree(HARD_CASES["axis-aligned grid"].frame())
    counts = {}
    for name, algorithm in (("all", RayTraced()), ("short", ConservativeMapMethod(Params(classify=False))),
                            ("uncertain", ConservativeMapMethod(Params(shorten=False))), ("both", ConservativeMapMethod())):
        probe = Probe(counting=True)
        algorithm.shadows(frame, probe)
        counts[name] = probe.counts
    assert counts["all"]["rays_cast"] == counts["short"]["rays_cast"] > counts["uncertain"]["rays_cast"]
    assert counts["uncertain"]["rays_cast"] == counts["both"]["rays_cast"]
    assert counts["both"]["kd_nodes"] < min(counts["uncertain"]["kd_nodes"], counts["short"]["kd_nodes"])
    assert max(counts["uncertain"]["kd_nodes"], counts["short"]["kd_nodes"]) < counts["all"]["kd_nodes"]


def test_a_gap_thinner_than_a_texel_is_found():
    """The paper's figure 5: two boards with a gap between them that a map of this size cannot resolve."""
    board = ground(1.0, 2.0)
    case = Case(mesh_of(ground(), board - [1.003, 0, 0], board + [1.003, 0, 0]), HARD_CASES["sun"].camera,
                Light.point(0.0, 9.0, 0.0))
    frame = case.frame()
    shadow = ConservativeMapMethod(Params(resolution=16)).shadows(frame, Probe()).shadow
    assert np.array_equal(shadow, Ptsv().shadows(frame, Probe()).shadow)


def test_pictures_show_classes_and_tests():
    frame = HARD_CASES["odd image"].frame()
    buffer = ConservativeMapMethod().shadows(frame, Probe(counting=True))
    assert set(buffer.images) == {"classes", "triangle_tests"}
    assert all(image.shape == (33, 67, 3) and image.dtype == np.uint8 for image in buffer.images.values())
    unlit = ~frame.samples.candidate.reshape(33, 67)
    assert not buffer.images["triangle_tests"][unlit].any()
    assert len(np.unique(buffer.images["classes"].reshape(-1, 3), axis=0)) == 4
    assert ConservativeMapMethod().shadows(frame, Probe()).images == {}


def digest():
    """Shadows and counts of a few frames, as text."""
    results = []
    for seed, kind in ((1, "random"), (2, "grid"), (4, "slivers")):
        frame = soup(seed, 100, kind).frame()
        for raster in ("discard", "polygon"):
            probe = Probe(counting=True)
            shadow = ConservativeMapMethod(Params(resolution=100, raster=raster)).shadows(frame, probe).shadow
            results.append([np.packbits(shadow.astype(bool)).tobytes().hex(), probe.all_counts(),
                            int((probe.heat * np.arange(1, len(shadow) + 1)).sum())])
    return json.dumps(results)


def test_same_results_for_any_number_of_threads():
    expected = digest()
    for n_threads in (1, 3):
        set_threads(n_threads)
        assert digest() == expected


@pytest.mark.slow
def test_same_results_on_a_generic_cpu_in_another_process(tmp_path):
    environment = dict(os.environ, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(tmp_path))
    root = os.path.dirname(os.path.dirname(__file__))
    code = f"import sys; sys.path.insert(0, {root!r}); from tests import test_conservative_map as t; print(t.digest())"
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert out.stdout.strip() == digest()
