"""Performance bar: per-triangle shadow volumes against Embree on the same samples, one thread, in one run."""

import time

import numpy as np
import pytest

from shadowbench.algorithms.ptsv import Params, Ptsv
from shadowbench.geometry import Frame, ImageSize
from shadowbench.jit import set_threads
from shadowbench.probe import Probe
from shadowbench.scenes.loader import load_scene
from shadowbench.view_samples import render_view_samples

REPEATS = 15
LARGEST_RATIO = 0.5


def best_of(action):
    """Smallest wall time in seconds of several calls."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


@pytest.mark.bench
def test_half_the_time_of_embree(capsys):
    mesh_construction = pytest.importorskip("embreex.mesh_construction")
    rtcore_scene = pytest.importorskip("embreex.rtcore_scene")
    scene, image = load_scene("citadel"), ImageSize(1024, 1024)
    mesh, camera, light = scene.mesh(0), scene.camera(0), scene.light(0)
    samples = render_view_samples(mesh, camera, light, image)
    frame = Frame(mesh, light, camera.basis(1.0), image, samples, 1e-5 * mesh.diagonal())
    targets = samples.position[samples.candidate]
    origin = np.array(light.position[:3])
    origins = np.ascontiguousarray(np.broadcast_to(origin, targets.shape), np.float32)
    directions, reach = (targets - origin).astype(np.float32), np.full(len(targets), 0.999, np.float32)

    def embree():
        built = rtcore_scene.EmbreeScene()
        mesh_construction.TriangleMesh(built, mesh.corners.astype(np.float32))
        built.run(origins, directions, dists=reach, query="OCCLUDED")

    algorithm = Ptsv(Params(culling_planes="outline", casters="back_faces"))
    set_threads(1)
    counting = Probe(counting=True)
    algorithm.shadows(frame, counting)
    ratio = best_of(lambda: algorithm.shadows(frame, Probe())) / best_of(embree)
    counts = counting.all_counts()
    with capsys.disabled():
        print(f"\nptsv / Embree: {ratio:.2f}; {counts['node_tests']} node tests, {counts['sample_tests']} sample tests")
    assert ratio <= LARGEST_RATIO
