"""Embree beside the reference on the built-in scenes: where they differ, the sample is at a boundary."""

import numpy as np
import pytest

from shadowbench import accuracy
from shadowbench.algorithms.embree import Embree
from shadowbench.algorithms.reference import reference_frame
from shadowbench.geometry import Frame
from shadowbench.probe import Probe
from shadowbench.scenes.loader import load_scene
from shadowbench.view_samples import render_view_samples

BOUNDARY_PIXELS = 1e-3


@pytest.mark.skipif(Embree().unsupported(None) is not None, reason="no Embree back end is installed")
@pytest.mark.parametrize("name", ["citadel", "gate", "cubes", "plane_box", "slit", "sunlit_boxes"])
def test_every_difference_is_ambiguous_or_within_a_thousandth_of_a_pixel_of_a_boundary(name):
    scene = load_scene(name, ["image.width=512", "image.height=512"])
    samples = render_view_samples(scene.mesh(0), scene.camera(0), scene.light(0), scene.image)
    frame = Frame(scene.mesh(0), scene.light(0), scene.camera(0).basis(1.0), scene.image, samples, scene.bias)
    truth, ambiguous = reference_frame(frame, Probe())
    shadow = Embree().shadows(frame, Probe()).shadow
    different = np.flatnonzero((shadow != truth) & samples.candidate & ~ambiguous)
    assert truth.any() and len(different) < 1e-4 * np.count_nonzero(samples.candidate)
    assert np.all(accuracy.boundary_distance(frame, different, truth) <= BOUNDARY_PIXELS)
