"""Performance bars: the kd-tree's construction, and shadow rays against Embree's, one thread, in one run."""

import time

import numpy as np
import pytest

from shadowbench.algorithms.conservative_map import Params
from shadowbench.algorithms.ray_traced import RayTraced
from shadowbench.geometry import Frame, ImageSize
from shadowbench.jit import set_threads
from shadowbench.kernels.kdtree_build import build_kdtree
from shadowbench.kernels.kdtree_traversal import Start
from shadowbench.probe import Probe
from shadowbench.scenes.loader import load_scene
from shadowbench.view_samples import render_view_samples
from tests.test_conservative_map import classify, counts_of_rays, rays_of

REPEATS = 10
LARGEST_RATIO = 3.0
BUILD_SECONDS = 4.0


@pytest.mark.bench
def test_a_tree_of_250000_triangles_within_4_seconds(capsys):
    mesh = load_scene("citadel", ["geometry.0.triangles=250000"]).mesh(0)
    build_kdtree(mesh.corners[:10])
    start = time.perf_counter()
    tree = build_kdtree(mesh.corners)
    seconds = time.perf_counter() - start
    with capsys.disabled():
        print(f"\n{mesh.n_triangles} triangles: {seconds:.2f} s, {len(tree.nodes) // 2} nodes, "
              f"{len(tree.references)} references")
    assert mesh.n_triangles >= 250000 and seconds <= BUILD_SECONDS


@pytest.mark.bench
def test_a_ray_within_three_times_embrees(capsys):
    mesh_construction = pytest.importorskip("embreex.mesh_construction")
    rtcore_scene = pytest.importorskip("embreex.rtcore_scene")
    scene, image = load_scene("citadel"), ImageSize(1024, 1024)
    mesh, camera, light = scene.mesh(0), scene.camera(0), scene.light(0)
    samples = render_view_samples(mesh, camera, light, image)
    algorithm = RayTraced()
    frame = Frame(mesh, light, camera.basis(1.0), image, samples, 1e-5 * mesh.diagonal(), algorithm.prepare(mesh))
    targets, origin = samples.position[samples.candidate], np.array(light.position[:3])
    origins = np.ascontiguousarray(np.broadcast_to(origin, targets.shape), np.float32)
    directions, reach = (targets - origin).astype(np.float32), np.full(len(targets), 0.999, np.float32)
    built = rtcore_scene.EmbreeScene()
    mesh_construction.TriangleMesh(built, mesh.corners.astype(np.float32))
    set_threads(1)
    times = np.empty((REPEATS, 3))
    for k in range(REPEATS):
        probe = Probe()
        algorithm.shadows(frame, probe)
        start = time.perf_counter()
        built.run(origins, directions, dists=reach, query="OCCLUDED")
        times[k] = probe.stages["rays"], probe.stages["trace"], time.perf_counter() - start
    rays, trace, embree = times.min(axis=0) * 1e9 / len(targets)
    with capsys.disabled():
        print(f"\nper ray: planes {rays:.0f} ns, trace {trace:.0f} ns; Embree {embree:.0f} ns; "
              f"ratio {trace / embree:.2f}, planes included {(rays + trace) / embree:.2f}")
    assert rays + trace <= LARGEST_RATIO * embree


@pytest.mark.bench
@pytest.mark.parametrize("name", ["citadel", "gate"])
def test_shortened_rays_visit_no_more_nodes_at_full_size(name, capsys):
    scene, image = load_scene(name), ImageSize(1024, 1024)
    mesh, camera, light = scene.mesh(0), scene.camera(0), scene.light(0)
    samples = render_view_samples(mesh, camera, light, image)
    frame = Frame(mesh, light, camera.basis(1.0), image, samples, 1e-5 * mesh.diagonal(), build_kdtree(mesh.corners))
    rays = rays_of(frame)
    share = classify(frame, Params(resolution=1024, classify=False)).share
    whole, short = (counts_of_rays(frame, rays, samples.candidate, start, "stack")[1].nodes
                    for start in (None, Start(share)))
    with capsys.disabled():
        print(f"\n{name}: {samples.candidate.sum()} rays, kd nodes {whole.sum()} whole, {short.sum()} shortened, "
              f"{(short > whole).sum()} rays with more")
    assert (short <= whole).all()
