"""The reference behind the interface of algorithms."""

import numpy as np
import pytest

from shadowbench.algorithms import ALGORITHMS
from shadowbench.algorithms.base import Probe
from shadowbench.algorithms.reference import Params, Reference, reference_frame
from shadowbench.geometry import Camera, Frame, ImageSize, Light, Mesh, ViewSamples

FLOOR = [[-9.0, 0.0, -9.0], [9.0, 0.0, -9.0], [0.0, 0.0, 9.0]]
ROOF = [[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [0.0, 1.0, 1.0]]


@pytest.fixture
def frame():
    """A camera that looks down at a floor with a triangle above it; the last column of samples is
    background."""
    n = 24
    mesh = Mesh.from_arrays(FLOOR + ROOF, [[0, 1, 2], [3, 4, 5]])
    camera = Camera(eye=(0.0, 8.0, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0))
    x, z = (a.ravel() for a in np.meshgrid(np.linspace(-2, 2, n), np.linspace(-2, 2, n)))
    position = np.stack([x, np.zeros(n * n), z], axis=1)
    candidate = np.tile(np.arange(n) < n - 1, n)
    position[~candidate] = 0.0
    depth = np.where(candidate, 8.0, np.inf)
    samples = ViewSamples(n, n, position, np.tile([0.0, 1.0, 0.0], (n * n, 1)), depth,
                          np.where(candidate, 0, -1).astype(np.int32), candidate, x / 8, z / 8)
    return Frame(mesh, Light.point(0.0, 9.0, 0.0), camera.basis(1.0), ImageSize(n, n), samples, 1e-4)


def test_shadow_and_ambiguity_of_a_frame(frame):
    probe = Probe(counting=True)
    shadow, ambiguous = reference_frame(frame, probe)
    assert shadow.dtype == np.float32 and ambiguous.dtype == np.bool_
    assert shadow.shape == ambiguous.shape == frame.samples.candidate.shape
    # Seen from the light, the roof at height 1 grows by 9 / 8 on the floor.
    x, z = frame.samples.position[:, 0] * 8 / 9, frame.samples.position[:, 2] * 8 / 9
    inside = (z >= -1) & (z <= 1 - 2 * abs(x))
    assert np.array_equal(shadow == 1.0, inside & frame.samples.candidate)
    assert not ambiguous.any()
    assert tuple(probe.stages) == Reference.stages
    assert set(probe.counts) == set(Reference.counters)
    assert probe.counts["sample_tests"] == probe.heat.sum() > 0
    assert probe.memory_bytes["light_tree"] > 0


def test_a_wide_tie_distance_finds_ambiguous_samples(frame):
    _, ambiguous = reference_frame(frame, Probe(), tie_pixels=0.5)
    assert 0 < ambiguous.sum() < len(ambiguous) / 2
    assert not ambiguous[~frame.samples.candidate].any()


def test_only_casters_cast(frame):
    shadow, _ = reference_frame(frame, Probe(), np.array([True, False]))
    assert not shadow.any()


def test_the_class_matches_its_entry_and_its_function(frame):
    entry = ALGORITHMS["reference"]
    assert entry.load() is Reference
    assert (entry.name, entry.title, entry.paper, entry.exact) == (
        Reference.name, Reference.title, Reference.paper, Reference.exact)
    buffer = Reference(Params(tie_pixels=0.5)).shadows(frame, Probe())
    assert np.array_equal(buffer.shadow, reference_frame(frame, Probe())[0])
