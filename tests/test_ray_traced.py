"""Ray-traced shadows: the same bits as asking every triangle, wherever light, eye and scene are."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.algorithms.ptsv import Ptsv
from shadowbench.algorithms.ray_traced import Params, RayTraced
from shadowbench.geometry import Camera, Frame, ImageSize, Light
from shadowbench.kernels.shadow_rays import make_shadow_rays
from shadowbench.probe import Probe
from tests.hard_cases import HARD_CASES, Case, ground, mesh_of, soup

SEEDS = st.integers(0, 10**6)
TRAVERSALS = ("stack", "short_stack", "restart")


def rays_of(frame):
    return make_shadow_rays(frame.mesh.corners, frame.mesh.bounds(), frame.camera[:4], frame.light.xyzw(), frame.bias,
                            frame.samples)


def asked_of_every_triangle(frame):
    """The float64 test of each lit candidate with each triangle, float32 (n_samples,)."""
    rays = rays_of(frame)
    a, b, d, c = rays.rows.reshape(-1, 4, 4).transpose(1, 0, 2)
    shadow = np.zeros(len(rays.depth), np.float32)
    for i in np.flatnonzero(frame.samples.candidate):
        value = a * rays.plane_x[i] + (b * rays.plane_y[i] + d) + c * (1.0 / rays.depth[i])
        shadow[i] = ((value[:, :3] <= 0).all(axis=1) & (value[:, 3] < 0)).any()
    return shadow


@pytest.mark.parametrize("name", HARD_CASES)
def test_same_bits_as_per_triangle_shadow_volumes_on_hard_cases(name):
    frame = HARD_CASES[name].frame()
    expected = Ptsv().shadows(frame, Probe()).shadow
    for traversal in TRAVERSALS:
        assert np.array_equal(RayTraced(Params(traversal=traversal)).shadows(frame, Probe()).shadow, expected)


def place(case, scale, shift, farther):
    """Scale and move a case; put light and eye `farther` times as far away as they were."""
    def move(point, factor=1.0):
        return tuple(float(v) * factor * scale + shift for v in point)

    x, y, z, w = case.light.position
    light = Light((*move((x, y, z), farther), 1.0)) if w else case.light
    camera = Camera(move(case.camera.eye, farther), move(case.camera.target), fov_y=max(70.0 / farther, 1e-3),
                    near=0.05 * scale, far=1e9)
    return Case(mesh_of(case.mesh.corners * scale + shift), camera, light, ImageSize(24, 18))


@settings(deadline=None, max_examples=60)
@given(SEEDS, st.sampled_from(["random", "grid", "slivers"]), st.sampled_from(TRAVERSALS),
       st.sampled_from([(1.0, 0.0), (1e-3, 0.0), (1e5, 0.0), (1.0, 1e5), (1e-3, 1e5)]),
       st.sampled_from([1.0, 1.0, 100.0, 1e6]), st.sampled_from([1e-5, 0.0, 1e-8, 0.01]))
def test_same_bits_as_asking_every_triangle(seed, kind, traversal, moved, farther, bias):
    frame = place(soup(seed, kind=kind), *moved, farther).frame()
    frame = Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, bias * frame.mesh.diagonal())
    shadow = RayTraced(Params(traversal=traversal)).shadows(frame, Probe()).shadow
    assert np.array_equal(shadow, asked_of_every_triangle(frame))


def test_triangles_seen_edge_on_and_needles_are_loose():
    """Just those that the tree is no guide to: none of an ordinary scene."""
    needle = np.array([[[-2.0, 2, 0], [2, 2, 1e-9], [2, 2, 0]]])
    on_edge = np.array([[[-1.0, 1, 0], [1, 1, 1e-9], [0, 3, 0]]])
    for extra, n_loose in ((np.zeros((0, 3, 3)), 0), (needle, 1), (on_edge, 1)):
        case = Case(mesh_of(ground(), HARD_CASES["sun"].mesh.corners[2:], extra), HARD_CASES["sun"].camera,
                    Light.point(0.0, 8.0, 0.0))
        rays = rays_of(case.frame())
        assert len(rays.loose) == n_loose and (rays.loose >= case.mesh.n_triangles - n_loose).all()


def test_a_ray_that_ends_on_the_ground_does_not_test_it():
    """The bias draws the end of a ray back from the flat cells that most samples lie in."""
    quads = [ground(0.5) + [i, 0, k] for i in range(-6, 6) for k in range(-6, 6)]
    case = Case(mesh_of(*quads, HARD_CASES["sun"].mesh.corners[2:14]), HARD_CASES["sun"].camera, Light.point(3.0, 8.0, 2.0))
    probe = Probe(counting=True)
    RayTraced().shadows(case.frame(), probe)
    assert probe.counts["rays_cast"] > 500
    assert probe.counts["triangle_tests"] < 2 * probe.counts["rays_cast"]


def test_restarts_cost_steps_and_nothing_else():
    frame, found = soup(9, 200).frame(), {}
    for traversal in TRAVERSALS:
        probe = Probe(counting=True)
        shadow = RayTraced(Params(traversal=traversal)).shadows(frame, probe).shadow
        found[traversal] = (shadow.tolist(), probe.counts["kd_leaves"], probe.heat.tolist()), probe.counts["kd_nodes"]
    assert found["stack"][0] == found["short_stack"][0] == found["restart"][0]
    assert found["stack"][1] <= found["short_stack"][1] < found["restart"][1]


def test_tree_and_planes_are_reported_as_memory():
    probe = Probe()
    frame = soup(2).frame()
    RayTraced().shadows(frame, probe)
    assert probe.memory_bytes["frustum_planes"] == 128 * frame.mesh.n_triangles
    assert probe.memory_bytes["kd_tree"] > 0
    assert set(probe.stages) == set(RayTraced.stages)


def digest():
    """Shadows and counts of a few frames, as text."""
    results = []
    for seed, kind in ((1, "random"), (2, "grid"), (3, "slivers")):
        frame = soup(seed, 150, kind).frame()
        for traversal in TRAVERSALS:
            probe = Probe(counting=True)
            shadow = RayTraced(Params(traversal=traversal)).shadows(frame, probe).shadow
            results.append([np.packbits(shadow.astype(bool)).tobytes().hex(), probe.all_counts(),
                            int((probe.heat * np.arange(1, len(shadow) + 1)).sum())])
    return json.dumps(results)


@pytest.mark.slow
def test_same_results_on_a_generic_cpu_in_another_process(tmp_path):
    environment = dict(os.environ, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(tmp_path))
    root = os.path.dirname(os.path.dirname(__file__))
    code = f"import sys; sys.path.insert(0, {root!r}); from tests import test_ray_traced as t; print(t.digest())"
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert out.stdout.strip() == digest()
