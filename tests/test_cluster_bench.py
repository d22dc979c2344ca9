"""Performance bars: exact shadows of a whole frame against Embree on the same samples, in one run, one and two threads."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from shadowbench.algorithms.cluster import Cluster, Params
from shadowbench.allocator import keep_freed_memory
from shadowbench.geometry import Camera, Frame, ImageSize, Light, Mesh
from shadowbench.jit import set_threads
from shadowbench.probe import Probe
from shadowbench.scenes.loader import load_scene
from shadowbench.scenes.meshes import load_mesh
from shadowbench.view_samples import render_view_samples

REPEATS = 9
IMAGE = ImageSize(1024, 1024)
FAST = {"culling_planes": "outline", "casters": "back_faces", "leaf": "cluster", "layout": "compact"}
LARGEST_RATIO = 0.5
LARGEST_BUILD_SHARE = 0.2


def best_of(action):
    """Smallest wall time in seconds of several calls."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


class Embree:
    """Embree through embreex: builds and traces the shadow rays of a frame, in as many pieces as threads."""

    def __init__(self, frame, n_threads):
        self.construction = pytest.importorskip("embreex.mesh_construction")
        self.scene = pytest.importorskip("embreex.rtcore_scene")
        self.corners = frame.mesh.corners.astype(np.float32)
        targets, light = frame.samples.position[frame.samples.candidate], np.array(frame.light.position[:3])
        pieces = np.array_split(targets, n_threads)
        self.rays = [(np.ascontiguousarray(np.broadcast_to(light, piece.shape), np.float32),
                      (piece - light).astype(np.float32), np.full(len(piece), 0.999, np.float32)) for piece in pieces]
        self.pool = ThreadPoolExecutor(n_threads)

    def build(self):
        built = self.scene.EmbreeScene()
        self.construction.TriangleMesh(built, self.corners)
        origins, directions, reach = self.rays[0]
        built.run(origins[:1], directions[:1], dists=reach[:1], query="OCCLUDED")     # the first query builds
        return built

    def trace(self, built):
        list(self.pool.map(lambda ray: built.run(ray[0], ray[1], dists=ray[2], query="OCCLUDED"), self.rays))


def frame_of(mesh, camera, light):
    samples = render_view_samples(mesh, camera, light, IMAGE)
    return Frame(mesh, light, camera.basis(1.0), IMAGE, samples, 1e-5 * mesh.diagonal())


def game_frame(name):
    scene = load_scene(name)
    return frame_of(scene.mesh(0), scene.camera(0), scene.light(0))


def scan_frame(models):
    """A closed scan, each triangle cut in four, above a ground: 301,634 triangles."""
    import trimesh

    loaded = load_mesh(models / "scans/bunny00.off").mesh
    scan = trimesh.Trimesh(loaded.vertices, loaded.triangles, process=True).subdivide()
    assert scan.is_watertight
    vertices = np.asarray(scan.vertices) - scan.vertices.mean(axis=0)
    vertices /= np.abs(vertices).max()
    low = vertices[:, 1].min() - 1e-3
    ground = np.array([[-4, low, -4], [-4, low, 4], [4, low, 4], [4, low, -4]])
    triangles = np.concatenate([scan.faces, len(vertices) + np.array([[0, 1, 2], [0, 2, 3]])])
    return frame_of(Mesh.from_arrays(np.concatenate([vertices, ground]), triangles),
                    Camera((1.2, 0.9, 2.2), (0, -0.1, 0), fov_y=55.0), Light.point(2.5, 3.5, 2.0))


def measure(frame, params, n_threads):
    """Seconds of the whole frame and per stage, from the fastest of several calls."""
    set_threads(n_threads)
    algorithm, best, stages = Cluster(Params(**params)), np.inf, {}
    algorithm.shadows(frame, Probe())
    for _ in range(REPEATS):
        probe, start = Probe(), time.perf_counter()
        algorithm.shadows(frame, probe)
        if time.perf_counter() - start < best:
            best, stages = time.perf_counter() - start, probe.stages
    return best, stages


def compare(frame, params, n_threads, with_build, name, capsys):
    keep_freed_memory()
    embree = Embree(frame, n_threads)
    built = embree.build()
    trace, build = best_of(lambda: embree.trace(built)), best_of(embree.build) if with_build else 0.0
    seconds, stages = measure(frame, params, n_threads)
    with capsys.disabled():
        split = ", ".join(f"{stage} {1e3 * value:.1f}" for stage, value in stages.items())
        print(f"\n{name}, {n_threads} thread(s): cluster {1e3 * seconds:.1f} ms ({split}), Embree trace {1e3 * trace:.1f} ms"
              + (f" + build {1e3 * build:.1f} ms" if with_build else "") + f", ratio {seconds / (trace + build):.2f}")
    return seconds / (trace + build), stages["hierarchy"] / seconds


@pytest.mark.bench
@pytest.mark.parametrize("n_threads", [1, 2])
@pytest.mark.parametrize("name", ["citadel", "gate"])
def test_half_the_time_that_embree_traces_a_game_scene(name, n_threads, capsys):
    ratio, share = compare(game_frame(name), FAST, n_threads, False, name, capsys)
    assert ratio <= LARGEST_RATIO and share <= LARGEST_BUILD_SHARE


@pytest.mark.bench
@pytest.mark.parametrize("n_threads", [1, 2])
def test_half_the_time_that_embree_builds_and_traces_a_dense_scan(models, n_threads, capsys):
    ratio, share = compare(scan_frame(models), {**FAST, "group": 32}, n_threads, True, "dense scan", capsys)
    assert ratio <= LARGEST_RATIO and share <= LARGEST_BUILD_SHARE
