"""Explanations against the kernels: as many tests are listed as the heat map or the triangle's count says."""

import re

import numpy as np
import pytest

from shadowbench.algorithms.cluster import Cluster
from shadowbench.algorithms.ptsv import Ptsv
from shadowbench.algorithms.ray_traced import RayTraced
from shadowbench.algorithms.z_fail import ZFail
from shadowbench.algorithms.z_pass import ZPass
from shadowbench.explain import cluster_walk, ray_walk, stencil_walk, tile_walk
from shadowbench.explain.command import _frame, listing
from shadowbench.explain.methods import BY_TRIANGLE, WALKS
from shadowbench.explain.trace import Shape, Trace, joined
from shadowbench.geometry import Mesh
from shadowbench.probe import Probe
from shadowbench.scenes.loader import load_scene
from tests.command_line import call

FIRST = [(tile_walk, Ptsv, {}), (cluster_walk, Cluster, {}), (ray_walk, RayTraced, {}), (stencil_walk, ZFail, {}),
         (stencil_walk, ZPass, {})]
OTHERS = [
    (tile_walk, Ptsv, {"branching": 8, "culling_planes": "none", "skip_shadowed": False}),
    (tile_walk, Ptsv, {"branching": 64, "culling_planes": "outline+wedge", "remove_unlit": False, "casters": "back_faces"}),
    (cluster_walk, Cluster, {"leaf": "cluster", "bounds": "implicit", "passes": "one"}),
    (cluster_walk, Cluster, {"culling_planes": "outline", "layout": "compact", "skip_shadowed": False,
                             "remove_unlit": False}),
    (ray_walk, RayTraced, {"traversal": "restart"}), (ray_walk, RayTraced, {"traversal": "short_stack"}),
    (stencil_walk, ZFail, {"extrude": "triangle", "scissor": True, "depth_bounds": True}),
    (stencil_walk, ZPass, {"eye_count": "off", "casters": "back_faces"})]


def variants(cases):
    """The methods' defaults, and their other parameters among the slow tests."""
    return [pytest.param(*case, id=f"{case[1].name}{n}", marks=() if case in FIRST else pytest.mark.slow)
            for n, case in enumerate(cases)]


EVERY = variants([*FIRST, *OTHERS])
SCENES = {"treads": ("treads", ["image.width=75", "image.height=53"]),
          "sunlit": ("sunlit_boxes", ["image.width=64", "image.height=40", "image.samples=2"]),
          "inside": ("plane_box", ["image.width=41", "image.height=33", "camera={eye: [0.1, 0.4, 0.2], target: [3, 0, 1]}"])}


@pytest.fixture(scope="module")
def scenes():
    return {name: load_scene(scene, overrides) for name, (scene, overrides) in SCENES.items()}


@pytest.fixture(scope="module")
def measured(scenes):
    """The method on a scene, its frame and what it counted; each made once."""
    known = {}

    def measure(cls, params, scene):
        key = cls.name, repr(params), scene
        if key not in known:
            algorithm = cls(cls.Params(**params))
            frame, probe = _frame(scenes[scene], algorithm, 0), Probe(counting=True)
            known[key] = algorithm, frame, probe, algorithm.shadows(frame, probe).shadow
        return known[key]

    return measure


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("walk, cls, params", EVERY)
def test_as_many_tests_are_numbered_as_the_heat_map_says(measured, walk, cls, params, scene):
    algorithm, frame, probe, shadow = measured(cls, params, scene)
    rng = np.random.default_rng(5)
    costly = np.argsort(-probe.heat)[:200]
    chosen = [int(costly[0]), *rng.choice(costly, 2), *rng.integers(0, len(probe.heat), 3), len(probe.heat) - 1]
    for sample in map(int, chosen):
        trace = walk.explain_sample(algorithm, frame, sample)
        numbers = [n for n in trace.numbers() if n]
        assert trace.value == probe.heat[sample]
        assert numbers == list(range(1, trace.value + 1))
        found = any("IN SHADOW" in test.outcome or test.outcome.startswith("accepted") for test in trace.tests)
        if cls is RayTraced or (cls is Ptsv and frame.samples.candidate[sample]):
            assert found == bool(shadow[sample])


@pytest.mark.parametrize("walk, cls, params", variants([v for v in [*FIRST, *OTHERS] if v[1].name in BY_TRIANGLE]))
def test_a_triangle_lists_its_own_count(measured, walk, cls, params):
    algorithm, frame, probe, _ = measured(cls, params, "treads")
    counts = next(iter(probe.triangle_counts.values()))
    for triangle in (int(np.argmax(counts)), 0, frame.mesh.n_triangles - 1, int(np.argsort(counts)[len(counts) // 2])):
        trace = walk.explain_triangle(algorithm, frame, triangle)
        assert trace.value == counts[triangle] == len(trace.tests)
        assert {test.triangle for test in trace.tests} <= {triangle}


@pytest.mark.parametrize("walk, cls, params", variants(FIRST))
def test_a_scene_that_casts_nothing_has_an_empty_list(scenes, walk, cls, params):
    algorithm = cls(cls.Params(**params))
    whole = _frame(scenes["treads"], algorithm, 0)
    flat = Mesh.from_arrays(np.zeros((3, 3)), [[0, 1, 2]])
    frame = type(whole)(flat, whole.light, whole.camera, whole.image, whole.samples, whole.bias)
    trace = walk.explain_sample(algorithm, frame, 700)
    assert [test for test in trace.tests if test.share] == [] and trace.value == 0 and trace.numbers() == []


def test_shares_are_booked_in_order():
    trace = Trace("a sample", value=3)
    for share in (0.25, 0.25, 0.25, 2.5, 0.0, 0.0):
        trace.add(stencil_walk.Test(7, "somewhere", "something", share))
    assert [test.share for test in trace.tests] == [0.25, 0.25, 0.25, 1.0, 1.0, 0.5, 0.0, 0.0]
    assert trace.numbers() == [0, 1, 0, 2, 3, 0, 0, 0]
    text = listing(trace)
    assert text.count("something") == 2 and text.count("... ") == 3 and listing(trace, True).count("something") == 6
    assert joined([trace], "x") is trace and joined([trace, trace], "pixel").value == 6
    assert joined([trace, trace], "pixel").numbers() == [0, 1, 0, 2, 3, 0, 0, 0, 0, 4, 0, 5, 6, 0, 0, 0]
    assert [trace.add_shape(Shape(((0, 0), (1, 1)), "ray", title)) for title in ("a", "b", "a")] == [0, 1, 0]


@pytest.mark.parametrize("name", WALKS)
def test_command_lists_and_draws_a_pixel(name, tmp_path):
    page = tmp_path / "page.html"
    done = call("explain", "sunlit_boxes", "-D", "image.samples=2", "--size", "64x40", "-a", name, "--pixel", "30,20",
                "-o", page)
    assert done.code == 0, done.errors
    value = int(re.search(r"the heat map's value is ([\d,]+)", done.output)[1].replace(",", ""))
    numbered = re.findall(r"^ *(\d+) ", done.output, re.MULTILINE)
    assert numbered == [str(n) for n in range(1, value + 1)]
    text = page.read_text(encoding="utf-8")
    assert text.count('<tr class="booked">') == value and "<polygon" in text and "://" not in text
    assert f"picture: {page}" in done.output


def test_command_explains_a_triangle(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = call("explain", "treads", "--size", "48x32", "-a", "ptsv", "--triangle", "20", "--all")
    assert done.code == 0, done.errors
    listed = int(re.search(r"([\d,]+) listed", done.output)[1].replace(",", ""))
    assert listed > 0 and f"the method counted {listed:,}" in done.output
    assert (tmp_path / "explain-triangle-20.html").exists()


@pytest.mark.parametrize("arguments, words", [
    (["-a", "ptsv"], "either --pixel"), (["-a", "ptsv", "--pixel", "1,1", "--triangle", "1"], "either --pixel"),
    (["-a", "shadow_map", "--pixel", "1,1"], "shadow_map has no trace"),
    (["-a", "ray_traced", "--triangle", "1"], "no trace by triangle"),
    (["-a", "ptsv[group=8]", "--pixel", "1,1"], "group=1"),
    (["-a", "ptsv", "--pixel", "48,1"], "outside the image"), (["-a", "ptsv", "--triangle", "99999"], "has triangles 0 to"),
    (["-a", "ptsv", "--pixel", "1,1", "--frame", "3"], "frames 0 to 0"),
    (["-a", "ptsv", "--pixel", "1,1", "-o", "no/such/folder.html"], "is no folder"),
    (["-a", "ptsw", "--pixel", "1,1"], "ptsv")])
def test_bad_input_is_told(arguments, words):
    done = call("explain", "treads", "--size", "48x32", *arguments)
    assert done.code == 2 and words in done.errors


def test_transparent_casters_are_not_walked():
    scene = ["explain", "plane_box", "-D", "geometry.0.material={alpha: 0.5}", "--size", "16x12", "--pixel", "3,3"]
    done = call(*scene, "-a", "ptsv")
    assert done.code == 2 and "transparency=off" in done.errors
    done = call(*scene, "-a", "ptsv", "-D", "image.layers=2")
    assert done.code == 2 and "image.layers=1" in done.errors


def test_pixels_are_written_x_y():
    assert call("explain", "treads", "-a", "ptsv", "--pixel", "1;1").code == 2
