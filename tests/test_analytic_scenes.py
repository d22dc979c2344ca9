"""The certified reference against shadows that are known in closed form."""

import numpy as np
import pytest

from shadowbench.algorithms.reference import reference_frame
from shadowbench.errors import InputError
from shadowbench.geometry import Camera, Frame, ImageSize
from shadowbench.probe import Probe
from shadowbench.scenes import SCENES
from shadowbench.scenes.analytic import ANALYTIC_SCENES
from shadowbench.view_samples import render_view_samples


def render(name: str, size: ImageSize) -> Frame:
    """First frame of an analytic scene."""
    entry = SCENES[name]
    scene = entry.load()(entry.triangles, 1)
    camera = Camera(scene.eyes[0], scene.targets[0], fov_y=scene.fov_y, near=scene.near, far=scene.far)
    samples = render_view_samples(scene.mesh, camera, scene.light, size)
    return Frame(scene.mesh, scene.light, camera.basis(size.width / size.height), size, samples,
                 1e-5 * scene.mesh.diagonal())


@pytest.mark.parametrize("name", ANALYTIC_SCENES)
def test_reference_equals_the_closed_form(name):
    frame = render(name, ImageSize(320, 240))
    truth, ambiguous = reference_frame(frame, Probe())
    known = frame.samples.candidate & ~ambiguous
    expected = ANALYTIC_SCENES[name](frame.samples.position[known])
    assert np.array_equal(truth[known] == 1, expected)
    assert 0.005 < expected.mean() < 0.9, "the scene shows a shadow"
    assert np.count_nonzero(ambiguous) <= 1e-3 * np.count_nonzero(frame.samples.candidate)


@pytest.mark.parametrize("name", ANALYTIC_SCENES)
def test_analytic_scenes_have_their_own_count(name):
    with pytest.raises(InputError, match=f"{name} always has {SCENES[name].triangles} triangles"):
        SCENES[name].load()(SCENES[name].triangles + 1, 1)


@pytest.mark.parametrize("name", ANALYTIC_SCENES)
def test_vertices_are_on_the_grid(name):
    vertices = SCENES[name].load()(SCENES[name].triangles, 1).mesh.vertices
    assert np.array_equal(np.rint(vertices * 65536), vertices * 65536)


def test_closed_form_of_a_box_against_a_hand_made_one():
    """A point right under the box, straight below the lamp's shadow, and three that are clear of it."""
    points = np.array([[0.0, 0.0, 0.0], [-1.0, 0, -0.9], [6.0, 0, 3.0], [3.2, 0, 2.3], [0.0, 2.5625, 0.0]])
    assert ANALYTIC_SCENES["plane_box"](points).tolist() == [True, True, False, False, False]
