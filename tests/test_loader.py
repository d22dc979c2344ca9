import hashlib

import numpy as np
import pytest

from shadowbench.config import ConfigErrors
from shadowbench.errors import InputError
from shadowbench.geometry import Light, Material
from shadowbench.scenes import SCENES
from shadowbench.scenes.loader import load_scene
from tests.scene_examples import GROUND, SCENE_ENTRIES
from tests.texture_examples import texels, write_image

TRIANGLE_OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture(autouse=True)
def examples(monkeypatch):
    for scene in SCENE_ENTRIES:
        monkeypatch.setitem(SCENES, scene.name, scene)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a.obj").write_text(TRIANGLE_OBJ)
    return tmp_path


FIXED = "camera: {eye: [0, 0, 5], target: [0, 0, 0]}\nlight: {position: [0, 5, 0]}\n"


def load(folder, text, *overrides, **options):
    return load_scene(folder / "s.yaml", overrides, text=text, **options)


def test_a_built_in_scene_by_name():
    scene = load_scene("quad", ["frames=3", "image.width=64"])
    assert scene.name == "quad" and scene.path is None and scene.n_frames == 3 and scene.image.width == 64
    assert scene.text == "name: quad\ngeometry:\n  - generate: quad\n"
    np.testing.assert_array_equal(scene.mesh(0).vertices, GROUND)
    np.testing.assert_array_equal(scene.mesh(0).part, [0, 1])
    assert [scene.camera(i).eye for i in range(3)] == [(0, 5, 10), (10, 5, 0), (0, 6, -10)]
    assert scene.camera(0).fov_y == 50 and scene.camera(0).far == 100 and scene.light(2) == Light.point(1, 8, 1)
    assert scene.bias == 1e-5 * np.sqrt(200.0)
    label = "quad[triangles=2,seed=1]"
    assert scene.digests == {label: hashlib.sha256(label.encode()).hexdigest()}


def test_a_file_comes_before_a_built_in_scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quad").write_text("name: mine\ngeometry: [{generate: quad}]\n")
    assert load_scene("quad").name == "mine"


def test_a_still_scene_has_one_mesh_and_nothing_can_be_written_to(folder):
    scene = load(folder, "frames: 5\ngeometry: [{mesh: a.obj}, {generate: quad}]\n")
    mesh = scene.mesh(0)
    assert scene.mesh(4) is mesh
    for array in (mesh.vertices, mesh.triangles, mesh.part, mesh.material):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    np.testing.assert_array_equal(mesh.part, [0, 1, 2])
    np.testing.assert_array_equal(mesh.triangles, [[0, 1, 2], [3, 5, 4], [3, 6, 5]])
    np.testing.assert_array_equal(mesh.material, [0, 1, 1])
    assert [m.name for m in mesh.materials] == ["default", "ground"]
    assert list(scene.digests) == ["a.obj", "quad[triangles=2,seed=1]"]


def test_scale_then_rotate_then_translate(folder):
    text = ("geometry: [{mesh: a.obj, scale: [2, 3, 1], rotate: [90, 0, 90], translate: [10, 0, 0]}]\n" + FIXED)
    # (1, 0, 0) -> (2, 0, 0) -> about x: same -> about z: (0, 2, 0); (0, 1, 0) -> (0, 3, 0) -> (0, 0, 3) -> same
    np.testing.assert_array_equal(load(folder, text).mesh().corners[0], [[10, 0, 0], [10, 2, 0], [10, 0, 3]])


def test_material_overrides_keep_the_rest(folder):
    text = "geometry: [{generate: quad, material: {alpha: 0.5, alpha_cutoff: 0.25}}]\n"
    [material] = load(folder, text).mesh().materials
    assert material == Material("ground", (0.5, 0.5, 0.5), 0.5, None, 0.25)


def test_animation_moves_one_entry(folder):
    text = ("frames: 3\ngeometry:\n  - mesh: a.obj\n    translate: [1, 0, 0]\n"
            "    animate: [{time: 0}, {time: 1, rotate: [0, 0, 180], translate: [0, 0, 4]}]\n"
            "  - {mesh: a.obj}\n" + FIXED)
    scene = load(folder, text)
    first, middle, last = (scene.mesh(i) for i in range(3))
    np.testing.assert_array_equal(first.corners[0], [[1, 0, 0], [2, 0, 0], [1, 1, 0]])
    np.testing.assert_array_equal(middle.corners[0], [[1, 0, 2], [1, 1, 2], [0, 0, 2]])
    np.testing.assert_array_equal(last.corners[0], [[1, 0, 4], [0, 0, 4], [1, -1, 4]])
    np.testing.assert_array_equal(last.corners[1], first.corners[1])
    assert scene.mesh(2) is last and scene.mesh(0) is first and middle.triangles is first.triangles
    np.testing.assert_array_equal(scene.mesh(1).vertices, middle.vertices)
    assert scene.bias == 1e-5 * first.diagonal()
    assert list(scene.digests) == ["a.obj"]


def test_paths_of_camera_and_light(folder):
    text = ("frames: 4\ngeometry: [{mesh: a.obj}]\n"
            "camera: {path: [{eye: [0, 0, 5], target: [0, 0, 0]}, {eye: [5, 0, 0], target: [0, 0, 0]}], closed: true,"
            " fov_y: 30}\nlight: {path: [[0, 9, 0], [3, 9, 0]]}\nbias: 0.25\n")
    scene = load(folder, text)
    assert scene.camera(0).eye == (0, 0, 5) and scene.camera(2).eye == (5, 0, 0) and scene.camera(1).fov_y == 30
    assert scene.light(0) == Light.point(0, 9, 0) and scene.light(1) == Light.point(1, 9, 0)
    assert scene.light(3) == Light.point(3, 9, 0) and scene.bias == 0.25
    with pytest.raises(IndexError, match="frames 0 to 3, not 4"):
        scene.camera(4)


def test_a_directional_light(folder):
    text = "geometry: [{mesh: a.obj}]\ncamera: {eye: [0, 0, 5], target: [0, 0, 0]}\nlight: {direction: [1, -2, 3]}\n"
    assert load(folder, text).light().position == (-1, 2, -3, 0)


def test_quick_runs_shrink_the_image(folder):
    text = "geometry: [{generate: quad}]\nimage: {width: 1000, height: 500}\n"
    scene = load(folder, text, quick_height=250)
    assert (scene.image.width, scene.image.height) == (500, 250) and scene.config.image.height == 250
    assert load(folder, text, quick_height=500).image.height == 500


@pytest.mark.parametrize(("text", "expected"), [
    ("geometry: [{generate: nothing}]\n", "the scene has no triangles: add geometry"),
    ("geometry: [{generate: quad, triangles: 1}]\n", "geometry[0]: quad needs at least 2 triangles"),
    ("geometry: [{mesh: bad.obj}]\n" + FIXED, "geometry[0]: {folder}/bad.obj: no triangles"),
    ("geometry: [{mesh: far.obj, scale: 1e12}]\n" + FIXED, "frame 0: after scaling and moving: vertex 1"),
    ("geometry: [{mesh: a.obj, material: {alpha_texture: a.obj}}]\n" + FIXED,
     "geometry[0]: the texture {folder}/a.obj is not a readable image"),
    ("geometry: [{mesh: a.obj, material: {alpha_texture: leaf.png}}]\n" + FIXED,
     "geometry[0]: the geometry: the material 'default' has a texture, but the mesh has no texture coordinates"),
    ("geometry: [{mesh: a.obj, material: {alpha_texture: rgb.png}}]\n" + FIXED,
     "geometry[0]: the texture {folder}/rgb.png has no alpha channel: save it as RGBA, or as a grey image"),
    ("frames: 3\ngeometry: [{mesh: a.obj}]\nlight: {position: [0, 9, 0]}\ncamera: {path: "
     "[{eye: [0, 0, 1], target: [0, 0, 0]}, {eye: [0, 0, -1], target: [0, 0, 0]}]}\n",
     "frame 1: camera eye and target are the same point"),
    ("frames: 3\ngeometry: [{mesh: a.obj}]\ncamera: {eye: [0, 1, 1], target: [0, 0, 0]}\n"
     "light: {path: [[0, 0, 1], [0, 2, 1]]}\n", "frame 1: light on the camera: the light stands at the camera's eye"),
])
def test_bad_scenes(text, expected, folder):
    (folder / "bad.obj").write_text("v 0 0 0\n")
    write_image(folder / "leaf.png", texels(2, 2))
    write_image(folder / "rgb.png", texels(2, 2)[..., :3])
    (folder / "far.obj").write_text("v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InputError) as caught:
        load(folder, text)
    assert str(caught.value).startswith(f"{folder}/s.yaml: " + expected.format(folder=folder))


def test_config_errors_pass_through(folder):
    with pytest.raises(ConfigErrors, match=r"s\.yaml:1:11 geometry must be a list"):
        load(folder, "geometry: 1")
    with pytest.raises(ConfigErrors, match="did you mean 'citadel'"):
        load_scene("citadell")
