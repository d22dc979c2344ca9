"""What the camera sees beyond the nearest surface: several samples per pixel, clear texels, peeled layers."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shadowbench import image_io
from shadowbench.algorithms.cluster import Cluster
from shadowbench.algorithms.ptsv import Params, Ptsv
from shadowbench.algorithms.z_fail import ZFail
from shadowbench.geometry import Camera, Frame, ImageSize, Light, Material, Texture
from shadowbench.judge import antialiasing_difference, find_truth
from shadowbench.probe import Probe
from shadowbench.report.pictures import shaded
from shadowbench.run_command import run
from shadowbench.view_samples import render_frame, render_layers, render_view_samples, resolve_to_pixels
from tests.texture_examples import write_image
from tests.transparent_examples import frame_of, transparent_mesh, transparent_soup

ALGORITHMS = (Ptsv(), Cluster(), ZFail(), Ptsv(Params(transparency="color")))


def soup_view(seed, image):
    """The same soup, camera and light in another image."""
    frame = transparent_soup(seed, 40, ImageSize(8, 6))
    camera = Camera((1.0, -2.0, 7.0), (0.2, 0.1, -3.0), (0.1, 1, 0.2), 60, 0.05)
    return frame_of(frame.mesh, frame.light, camera, image)


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: f"{a.name}-{a.params.transparency}")
@pytest.mark.parametrize("samples", [4, 16])
def test_supersampling_is_a_larger_target_resolved_by_averaging(samples, algorithm):
    side = 2 if samples == 4 else 4
    many, large = (soup_view(3, image) for image in (ImageSize(24, 18, samples), ImageSize(24 * side, 18 * side)))
    (a, counted), (b, counted_large) = ((algorithm.shadows(frame, probe), probe)
                                        for frame, probe in ((many, Probe(True)), (large, Probe(True))))
    np.testing.assert_array_equal(a.shadow, b.shadow)
    assert counted.all_counts() == counted_large.all_counts()
    blocks = b.shadow.astype(np.float64).reshape(18, side, 24, side).transpose(0, 2, 1, 3)
    np.testing.assert_array_equal(resolve_to_pixels(a.shadow, many.image), blocks.mean(axis=(2, 3)))
    assert len(np.unique(blocks.mean(axis=(2, 3)))) > side


def floor_frame(image, tilt=0.0):
    """A floor alone in sight; casters of all kinds hang between it and the light, behind the camera."""
    rng = np.random.default_rng(8)
    soup = transparent_soup(8, 30).mesh
    corners = rng.normal(size=(30, 1, 3)) * [3, 3, 0.4] + rng.normal(size=(30, 3, 3)) + [0, 0, 9]
    floor = np.array([[[-60, -60, 0], [60, -60, 0], [60, 60, 60 * tilt]], [[-60, -60, 0], [60, 60, 60 * tilt],
                                                                          [-60, 60, 60 * tilt]]])
    mesh = transparent_mesh([*corners, *floor], np.append(soup.material[:30], [0, 0]), soup.materials,
                            rng.uniform(-1, 2, (32, 3, 2)))
    camera = Camera((0, -3, 4), (0.5, 0.5, 0), (0, 0, 1), 60, 0.05)
    return render_frame(mesh, camera, Light.point(1, 2, 20), image, 1e-5 * mesh.diagonal(), compared=True)


@pytest.mark.parametrize("samples", [2, 4, 8, 16])
def test_derivatives_give_what_supersampling_gives_on_a_plane(samples):
    frame = floor_frame(ImageSize(40, 30, samples, "derivative"))
    assert frame.samples.candidate.all() and frame.samples.rows == frame.image.rows
    for name in ("position", "depth", "normal"):
        np.testing.assert_allclose(getattr(frame.samples, name), getattr(frame.supersampled, name), rtol=0, atol=1e-12)
    truths = [find_truth(f, None, "alpha") for f in (frame, replace(frame, samples=frame.supersampled))]
    answers = [Ptsv().shadows(f, Probe()).shadow for f in (frame, replace(frame, samples=frame.supersampled))]
    sure = ~truths[0].ambiguous & ~truths[1].ambiguous
    assert np.count_nonzero(~sure) < 5 and 0.1 < truths[0].shadow.mean() < 0.9
    np.testing.assert_allclose(answers[0][sure], answers[1][sure], rtol=0, atol=1e-6)
    assert np.count_nonzero(antialiasing_difference(frame, *truths)) <= np.count_nonzero(~sure)


def test_one_derivative_sample_is_the_pixel_centre():
    a, b = (floor_frame(ImageSize(20, 15, 1, sampling), 0.3) for sampling in ("derivative", "surface"))
    np.testing.assert_allclose(a.samples.position, b.samples.position, rtol=0, atol=1e-12)
    assert b.supersampled is None


def test_spread_samples_stay_finite_where_a_plane_is_seen_edge_on():
    frame = transparent_soup(12, 60)
    camera = Camera((0, -8, -2.999), (0, 0, -2.99), (0, 0, 1), 60, 0.05)
    samples = render_view_samples(frame.mesh, camera, frame.light, ImageSize(40, 30, 16, "derivative"))
    seen = samples.triangle >= 0
    assert 0 < seen.sum() < len(seen) and np.isfinite(samples.position).all()
    assert np.isfinite(samples.depth[seen]).all() and (samples.depth > 0).all() and np.isinf(samples.depth[~seen]).all()
    shares = Cluster().shadows(Frame(frame.mesh, frame.light, camera.basis(4 / 3), ImageSize(40, 30, 16), samples,
                                     frame.bias), Probe()).shadow
    assert np.isfinite(shares).all()


def test_derivatives_err_where_a_pixel_sees_two_surfaces(tmp_path):
    scene = {"geometry": [{"generate": "sunlit_boxes"}], "image": {"width": 48, "height": 36, "samples": 4,
                                                                   "sampling": "derivative"}}
    code, [line] = run_scene(tmp_path, scene, "ptsv")
    assert code == 0 and line["accuracy"]["false_shadow"] == line["accuracy"]["false_light"] == 0
    assert 0 < line["accuracy"]["antialiasing_difference"] < 0.1 * 48 * 36
    picture = image_io.read_png(tmp_path / "out" / line["files"]["antialiasing_png"])[:36]
    assert picture.shape == (36, 48, 3) and (np.ptp(picture.astype(int), axis=2) > 20).any()


def run_scene(folder, scene, *specs):
    """Run a scene file; returns the exit code and the results."""
    (folder / "scene.yaml").write_text(json.dumps(scene))
    code = run(["test"], scenes=(str(folder / "scene.yaml"),), specs=specs, overrides=(), frames=None, size=None, repeats=1,
               threads=1, timeout=None, out=folder / "out", only=None, quick=False, resume=False, dry_run=False,
               keep_going=True)
    return code, [json.loads(line) for line in (folder / "out" / "results.jsonl").read_text().splitlines()]


def stack(surfaces, uv=None):
    """Squares one behind the other, seen from the front, each of its own material."""
    corners, texture_corners = [], []
    for k in range(len(surfaces)):
        square = np.array([[-2, -2, -k], [2, -2, -k], [2, 2, -k], [-2, 2, -k]], float)
        corners += [square[[0, 1, 2]], square[[0, 2, 3]]]
        texture_corners += [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]
    mesh = transparent_mesh(corners, np.repeat(np.arange(len(surfaces)), 2), tuple(surfaces), texture_corners)
    return mesh, Camera((0.1, 0.2, 5), (0.1, 0.2, 0), (0, 1, 0), 30, 0.1), Light.point(0, 1, 9)


def test_layers_are_peeled_until_something_opaque():
    glass, wall = Material("glass", (1.0, 0.2, 0.2), 0.4), Material("wall")
    mesh, camera, light = stack([glass, glass, wall, glass])
    image = ImageSize(16, 16, layers=8)
    layers = render_layers(mesh, camera, light, image, 8)
    assert [sorted(set(s.triangle // 2)) for s in layers] == [[0], [1], [2]]
    assert len(render_layers(mesh, camera, light, image, 2)) == 2
    frame = render_frame(mesh, camera, light, image, 1e-4)
    assert len(frame.layers) == 3 and frame.layers[1].samples is frame.deeper[0].samples
    # Two panes let 0.36 of the light through to the wall, which is seen through both
    buffers = [Ptsv().shadows(layer, Probe()) for layer in frame.layers]
    assert np.allclose([b.shadow.mean() for b in buffers], [0.0, 0.4, 0.64], atol=1e-6)
    picture = shaded(frame, buffers)
    assert picture.shape == (16, 16, 3) and picture[8, 8, 0] > picture[8, 8, 1] + 10


def test_surfaces_at_the_same_place_are_peeled_one_by_one():
    glass = Material("glass", alpha=0.5)
    mesh, camera, light = stack([glass, glass, glass])
    mesh = replace(mesh, vertices=mesh.vertices * [1, 1, 0])
    layers = render_layers(mesh, camera, light, ImageSize(9, 9), 8)
    assert [sorted(set(s.triangle // 2)) for s in layers] == [[0], [1], [2]]


def test_clear_texels_are_seen_through():
    pixels = np.ones((2, 2, 4), np.float32)
    pixels[:, 0, 3] = 0.0           # the left half is clear
    leaf = Material("leaf", alpha_texture=Texture("half", pixels, ("clamp", "clamp")))
    mesh, _, light = stack([leaf, leaf, Material("wall")])
    camera = Camera((-0.6, 0.2, 5), (0, 0.2, -0.5), (0, 1, 0), 24, 0.1)
    samples = render_view_samples(mesh, camera, light, ImageSize(64, 64))
    shown, x, z = samples.triangle // 2, samples.position[:, 0], samples.position[:, 2]
    # Where the ray crosses the first square, and the second
    first, second = (-0.6 + (x + 0.6) * (5 + k) / (5 - z) for k in (0, 1))
    expected = np.where(first >= 0, 0, np.where(second >= 0, 1, 2))
    np.testing.assert_array_equal(shown, expected)
    assert set(shown) == {0, 1, 2}


def test_a_run_with_layers_adds_them_up(tmp_path):
    write_image(tmp_path / "leaf.png", np.full((4, 4, 4), 128, np.uint8))
    (tmp_path / "m.obj").write_text("v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
                                    "f 1/1 3/3 2/2\nf 1/1 4/4 3/3\n")
    pane = {"mesh": "m.obj", "material": {"alpha": 0.5, "color": [1, 0.2, 0.1], "alpha_texture": "leaf.png"}}
    scene = {"geometry": [{**pane, "translate": [0, 1, 0]}, {**pane, "translate": [0.3, 0.5, 0]},
                          {"mesh": "m.obj", "scale": 4}],
             "camera": {"eye": [0, 4, 3], "target": [0, 0, 0]}, "light": {"position": [1, 6, 0.5]},
             "image": {"width": 40, "height": 30, "layers": 4}}
    specs = ("reference", "ptsv", "cluster[transparency=color]", "ptsv[transparency=stochastic]",
             "z_fail[transparency=constant]", "shadow_map")
    code, lines = run_scene(tmp_path, scene, *specs)
    assert code == 0 and [line["status"] for line in lines] == ["done"] * len(specs)
    for line in lines[:-1]:
        assert line["accuracy"]["false_shadow"] == line["accuracy"]["false_light"] == 0
        assert line["accuracy"]["samples"] == 3 * 40 * 30
    assert [line["accuracy"]["transparency_difference"] is None for line in lines] == [True] * 5 + [False]
    assert lines[-1]["accuracy"]["transparency_difference"] > 100
