import numpy as np
import pytest

from shadowbench import accuracy
from shadowbench.accuracy import ErrorClass
from shadowbench.geometry import Camera, Frame, ImageSize, Light, Mesh, ViewSamples


def test_every_class_of_error():
    #                 right       false shadow  false light  ties        not a candidate  penumbra
    shadow = np.array([0, 1,      1,            0,           1, 0,       1,               0.5], np.float32)
    truth = np.array([0, 1,       0,            1,           0, 1,       0,               1], np.float32)
    ambiguous = np.array([1, 0,   0,            0,           1, 1,       0,               0], bool)
    candidate = np.array([1, 1,   1,            1,           1, 1,       0,               1], bool)
    errors = accuracy.classify(shadow, truth, ambiguous, candidate)
    assert errors.tolist() == [ErrorClass.OK, ErrorClass.OK, ErrorClass.FALSE_SHADOW, ErrorClass.FALSE_LIGHT,
                               ErrorClass.EDGE_TIE, ErrorClass.EDGE_TIE, ErrorClass.OK, ErrorClass.OK]
    measured = accuracy.measure(shadow, errors, ambiguous, candidate)
    assert measured == accuracy.Accuracy(samples=8, lit_candidates=7, shadowed=4, ambiguous=3, false_shadow=1,
                                         false_light=1, edge_tie=2)
    assert measured.wrong == 2


@pytest.fixture
def frame():
    """A right triangle with legs of 2 at height 1 under a light from straight above; samples on the ground."""
    mesh = Mesh.from_arrays([[0, 1, 0], [2, 1, 0], [0, 1, 2]], [[0, 1, 2]])
    position = np.array([[0.5, 0, 0.5], [0.25, 0, 0.75], [-0.5, 0, 0.5], [2.0, 0, 2.0]])
    n = len(position)
    samples = ViewSamples(1, n, position, np.tile([0.0, 1, 0], (n, 1)), np.full(n, 10.0), np.zeros(n, np.int32),
                          np.ones(n, bool), np.zeros(n), np.zeros(n))
    camera = Camera((0, 10, 0), (0, 0, 0), (0, 0, 1), fov_y=90).basis(1.0)
    return Frame(mesh, Light.directional(0, -1, 0), camera, ImageSize(n, 20), samples, bias=0.01)


def test_boundary_distance_is_measured_in_pixel_footprints(frame):
    truth = np.array([1, 1, 0, 0], np.float32)
    footprint = frame.pixel_footprint * 10.0
    assert footprint == pytest.approx(1.0)
    distances = accuracy.boundary_distance(frame, np.arange(4), truth)
    assert distances == pytest.approx([0.5, 0.25, 0.5, np.sqrt(2.0)])


def test_boundary_distance_for_a_point_light_is_taken_to_planes_through_the_light(frame):
    moved = Frame(frame.mesh, Light.point(0, 2, 0), frame.camera, frame.image, frame.samples, frame.bias)
    position = np.array([[1.0, 0, 1.0]])             # twice as far from the light as the caster at (0.5, 1, 0.5)
    samples = frame.samples._replace(columns=1, position=position, depth=np.array([10.0]))
    moved = Frame(moved.mesh, moved.light, moved.camera, moved.image, samples, moved.bias)
    distance = accuracy.boundary_distance(moved, np.array([0]), np.array([1], np.float32))
    assert distance[0] == pytest.approx(2 / np.sqrt(6))     # to the plane x + 2 y + z = 4 through the long side


def test_boundary_distance_without_casters_is_infinite(frame):
    empty = Frame(Mesh.from_arrays(np.zeros((0, 3)), np.zeros((0, 3))), frame.light, frame.camera, frame.image,
                  frame.samples, frame.bias)
    assert np.isinf(accuracy.boundary_distance(empty, np.array([2]), np.zeros(4, np.float32))).all()


def test_differences_are_listed_with_their_distance(frame):
    truth = np.array([1, 1, 0, 0], np.float32)
    text = accuracy.list_differences(frame, np.array([1, 0, 0, 1], np.float32), truth, np.zeros(4, bool))
    assert text.splitlines() == ["column,row,shadow,reference,ambiguous,distance_pixels", "1,0,0,1,0,0.25",
                                 "3,0,1,0,0,1.41"]
