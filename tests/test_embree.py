"""Embree as a peer: against ray tracing in float64, and the calls that Open3D gets."""

from types import SimpleNamespace

import numpy as np
import pytest

from shadowbench.algorithms import ALGORITHMS, embree
from shadowbench.algorithms.base import Probe
from shadowbench.algorithms.embree import Embree, Params
from shadowbench.geometry import ImageSize, Light, Mesh
from tests.test_shadow_map import ABOVE, AMONG, PARALLEL, make_frame, ray_traced, scene

needs_embreex = pytest.mark.skipif(embree.import_error("embreex") is not None, reason="embreex is not installed")
needs_open3d = pytest.mark.skipif(embree.import_error("open3d") is not None, reason="Open3D is not installed")
BACKENDS = [pytest.param("embreex", marks=needs_embreex), pytest.param("open3d", marks=needs_open3d)]


def run(frame, backend):
    probe = Probe(counting=True)
    shadow = Embree(Params(backend=backend)).shadows(frame, probe).shadow
    assert tuple(probe.stages) == Embree.stages and shadow.dtype == np.float32
    assert probe.counts == {"rays_cast": frame.samples.candidate.sum()}
    assert not shadow[~frame.samples.candidate].any() and set(np.unique(shadow)) <= {0.0, 1.0}
    return shadow


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("light", [ABOVE, AMONG, PARALLEL])
@pytest.mark.parametrize("offset", [0.0, 1e5])
def test_agrees_with_float64_but_for_the_bias(backend, light, offset):
    mesh = scene()
    frame = make_frame(mesh, light, ImageSize(96, 72))
    truth = ray_traced(frame)
    if offset:
        # The same frame far from the origin: float32 would keep 0.01 of it without the translation
        samples = frame.samples._replace(position=frame.samples.position + offset)
        moved = [v + offset * light.position[3] for v in light.position[:3]]
        frame = make_frame(mesh, light, ImageSize(96, 72)).__class__(
            Mesh.from_arrays(mesh.vertices + offset, mesh.triangles), Light((*moved, light.position[3])),
            frame.camera._replace(eye=frame.camera.eye + offset), frame.image, samples, frame.bias)
    shadow = run(frame, backend)
    assert truth.any() and np.mean((shadow == 1) != truth) < 2e-3


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_end_at_the_light(backend):
    """A sheet above the light casts nothing below it, one that the light lies in neither, one beneath it does."""
    ground = [[-4, -1, -4], [4, -1, -4], [0, -1, 4]]
    for height, expected in ((3.1, False), (3.0, False), (2.9, True)):
        sheet = [[-9, height, -9], [9, height, -9], [0, height, 9]]
        frame = make_frame(Mesh.from_arrays(ground + sheet, [[0, 1, 2], [3, 4, 5]]), Light.point(0, 3, 0))
        below = frame.samples.candidate & (frame.samples.triangle == 0)
        assert below.any() and np.all((run(frame, backend) == 1)[below] == expected), height


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_to_trace(backend):
    assert not run(make_frame(Mesh.from_arrays(np.zeros((0, 3)), []), ABOVE), backend).any()


def test_missing_back_ends_are_explained(monkeypatch):
    monkeypatch.setattr(embree, "import_error", lambda backend: f"no {backend} here")
    assert Embree().unsupported(None) == "embreex cannot be imported (no embreex here): install shadowbench[peers]"
    assert "no open3d here): install open3d" in Embree(Params(backend="open3d")).unsupported(None)
    with pytest.raises(RuntimeError, match="install shadowbench"):
        Embree().shadows(make_frame(scene(), ABOVE), Probe())


def test_auto_prefers_open3d(monkeypatch):
    monkeypatch.setattr(embree, "import_error", lambda backend: None)
    assert Embree().unsupported(None) is None and Embree()._backend() == "open3d"
    monkeypatch.setattr(embree, "import_error", lambda backend: "no" if backend == "open3d" else None)
    assert Embree().unsupported(None) is None and Embree()._backend() == "embreex"


def test_import_errors_are_told():
    embree._MODULES["nowhere"] = "shadowbench_has_no_such_module"
    try:
        assert "shadowbench_has_no_such_module" in embree.import_error("nowhere")
    finally:
        del embree._MODULES["nowhere"]


class Scene:
    """The part of Open3D's RaycastingScene that is used, in NumPy: a brute-force occlusion test."""

    def __init__(self, nthreads):
        assert nthreads >= 1

    def add_triangles(self, vertices, triangles):
        assert vertices.value.dtype == np.float32 and triangles.value.dtype == np.uint32
        self.corners = vertices.value[triangles.value].astype(float)

    def test_occlusions(self, rays, tnear, tfar, nthreads):
        assert rays.value.dtype == np.float32 and rays.value.shape[1] == 6 and tnear == 0.0 and nthreads >= 1
        u, v = self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        hit = np.zeros(len(rays.value), bool)
        for i, ray in enumerate(rays.value.astype(float)):
            h, s = np.cross(ray[3:], v), ray[:3] - self.corners[:, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                scale = 1 / (u * h).sum(axis=1)
                q = np.cross(s, u)
                a, b, t = scale * (s * h).sum(axis=1), scale * (q * ray[3:]).sum(axis=1), scale * (v * q).sum(axis=1)
                hit[i] = np.any((a >= 0) & (b >= 0) & (a + b <= 1) & (t > tnear) & (t < tfar))
        return SimpleNamespace(numpy=lambda: hit)


@pytest.mark.parametrize("light", [ABOVE, PARALLEL])
def test_open3d_gets_the_right_rays(light, monkeypatch):
    fake = SimpleNamespace(core=SimpleNamespace(Tensor=lambda array: SimpleNamespace(value=np.array(array))),
                           t=SimpleNamespace(geometry=SimpleNamespace(RaycastingScene=Scene)))
    monkeypatch.setattr(embree, "import_module", lambda name: fake)
    monkeypatch.setattr(embree, "import_error", lambda backend: None)
    frame = make_frame(scene(), light)
    assert np.mean((run(frame, "open3d") == 1) != ray_traced(frame)) < 2e-3


def test_entry_tells_the_same_as_the_class():
    entry = ALGORITHMS["embree"]
    assert entry.load() is Embree and entry.extra == "peers"
    assert (entry.title, entry.paper, entry.exact) == (Embree.title, Embree.paper, Embree.exact)
