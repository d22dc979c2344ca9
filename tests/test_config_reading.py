from pathlib import Path

import pytest

from shadowbench import scene_models
from shadowbench.config import (
    AlgorithmSpec,
    ConfigErrors,
    load_config,
)
from tests import config_examples
from tests.config_examples import CAMERA, FULL, LIGHT, MESH, QUAD, errors, one_error

examples, folder = config_examples.examples, config_examples.folder      # fixtures


def test_everything_at_once(folder):
    config = load_config(folder / "s.yaml", text=FULL)
    mesh, quad = config.geometry
    assert isinstance(mesh, scene_models.MeshEntry) and isinstance(quad, scene_models.GenerateEntry)
    assert mesh.mesh == str(folder / "a.obj") and mesh.scale == (0.01, 0.01, 0.01) and mesh.rotate == (90, 0, 0)
    assert mesh.material.alpha_texture == str(folder / "leaf.png")
    assert [key.frame for key in mesh.animate.path] == [0, 3]
    assert quad.scale == (1, 2, 3) and quad.triangles == 60000 and quad.animate.path[1].rotate == (0, 360, 0)
    assert config.camera.fov_y == 60 and config.light.position == (0, 5, 0)
    assert (config.image.width, config.image.height, config.image.samples) == (1024, 512, 4)
    assert config.bias == 1e-4 and config.frames == 4 and config.name == "courtyard"
    assert config.algorithms[1] == AlgorithmSpec(name="sample", params={"branching": 16, "casters": "back_faces"})
    assert config.selections() == [("sample", {}), ("sample", {"branching": 16, "casters": "back_faces"})]
    assert config.matrix == {"sample.casters": ("all", "back_faces")}


def test_defaults(folder):
    config = load_config(folder / "my scene!.yaml", text=QUAD)
    assert config.name == "my_scene_" and config.bias == "auto" and config.frames == 1
    assert config.image == scene_models.ImageConfig(width=1024, height=1024, samples=1)
    assert config.camera is None and config.light is None and config.algorithms is None
    assert config.selections() == [] and config.matrix == {}


BAD = [
    # unknown keys, with a suggestion where one is near
    (QUAD + "imge: {}", "s.yaml:2:1 imge unknown key; did you mean 'image'?"),
    (QUAD + "xyzzy: 1", "s.yaml:2:1 xyzzy unknown key; known: name, geometry, camera, light, image, frames, bias, "
                        "algorithms, matrix"),
    (QUAD + "image: {widht: 3}", "s.yaml:2:9 image.widht unknown key; did you mean 'width'?"),
    (QUAD + "camera: {eye: [0, 0, 1], target: [0, 0, 0], fov: 3}",
     "s.yaml:2:45 camera.fov unknown key; did you mean 'fov_y'?"),
    (QUAD + "camera: {path: [{eye: [0, 0, 1], target: [0, 0, 0], ey: 3}]}",
     "s.yaml:2:53 camera.path[0].ey unknown key; did you mean 'eye'?"),
    ("geometry:\n  - generate: quad\n    triangle: 5", "s.yaml:3:5 geometry[0].triangle unknown key; did you mean "
                                                       "'triangles'?"),
    ("geometry:\n  - generate: quad\n    material: {colour: [1, 1, 1]}",
     "s.yaml:3:16 geometry[0].material.colour unknown key; did you mean 'color'?"),
    ("geometry: [{generate: quad, animate: [{frme: 1, frame: 2}]}]",
     "s.yaml:1:40 geometry[0].animate[0].frme unknown key; did you mean 'frame'?"),
    # duplicates
    (QUAD + "frames: 1\nframes: 2", "s.yaml:3:1 frames duplicate key: first given in line 2"),
    # types
    (QUAD + "frames: true", "s.yaml:2:9 frames must be a whole number, not true"),
    (QUAD + "frames: '3'", "s.yaml:2:9 frames must be a whole number, not the text '3'"),
    (QUAD + "frames: 2.0", "s.yaml:2:9 frames must be a whole number, not 2.0"),
    (QUAD + "frames:", "s.yaml:2:8 frames must be a whole number, not nothing"),
    (QUAD + "camera:", "s.yaml:2:8 camera must be a mapping, not nothing"),
    (QUAD + "image: 3", "s.yaml:2:8 image must be a mapping, not 3"),
    (QUAD + "camera: {eye: [0, yes, 1], target: [0, 0, 0]}",
     "s.yaml:2:19 camera.eye[1] must be a number, not the text 'yes'"),
    (QUAD + "camera: {eye: [0, true, 1], target: [0, 0, 0]}", "s.yaml:2:19 camera.eye[1] must be a number, not true"),
    (QUAD + "camera: {eye: [0, .nan, 1], target: [0, 0, 0]}",
     "s.yaml:2:19 camera.eye[1] must be a finite number, not .nan"),
    (QUAD + "camera: {eye: [0, 1e13, 1], target: [0, 0, 0]}",
     "s.yaml:2:19 camera.eye[1] must be at most 1e+12, not 10000000000000.0"),
    (QUAD + "camera: {eye: [0, 1], target: [0, 0, 0]}", "s.yaml:2:15 camera.eye must be a list of 3 numbers"),
    (QUAD + "bias: -1", "s.yaml:2:7 bias must be auto or a number from 0 up"),
    (QUAD + "bias: true", "s.yaml:2:7 bias must be auto or a number from 0 up"),
    (QUAD + "bias: .inf", "s.yaml:2:7 bias must be a finite number, not .inf"),
    (QUAD + "name: a/b", "s.yaml:2:7 name must be a word of letters, digits, '_', '-' and '.', not the text 'a/b'"),
    # image
    (QUAD + "image: {width: 0}", "s.yaml:2:16 image.width must be at least 1, not 0"),
    (QUAD + "image: {height: 8193}", "s.yaml:2:17 image.height must be at most 8192, not 8193"),
    (QUAD + "image: {samples: 3}", "s.yaml:2:18 image.samples must be 1, 2, 4, 8 or 16, not 3"),
    (QUAD + "frames: 0", "s.yaml:2:9 frames must be at least 1, not 0"),
    # geometry
    ("name: x\n" + CAMERA + LIGHT, "s.yaml:1:1 the scene has no geometry: add 'geometry:' with a 'mesh:' or "
                                   "'generate:' entry"),
    ("geometry: []\n" + CAMERA + LIGHT, "s.yaml:1:11 geometry the scene has no geometry: add a 'mesh:' or 'generate:' "
                                        "entry"),
    ("geometry: 3\n" + CAMERA + LIGHT, "s.yaml:1:11 geometry must be a list of 'mesh:' or 'generate:' entries, not 3"),
    ("geometry: [{generate: quad, mesh: a.obj}]", "s.yaml:1:12 geometry[0] needs exactly one of 'mesh' (a file) and "
                                                  "'generate' (a built-in scene)"),
    ("geometry: [{generate: citadle}]", "s.yaml:1:23 geometry[0].generate unknown scene 'citadle'; did you mean "
                                        "'citadel'?"),
    ("geometry: [{generate: 5}]", "s.yaml:1:23 geometry[0].generate must be text, not 5"),
    ("geometry: [{generate: quad, triangles: 0}]", "s.yaml:1:40 geometry[0].triangles must be at least 1, not 0"),
    ("geometry: [{generate: quad, seed: -1}]", "s.yaml:1:35 geometry[0].seed must be at least 0, not -1"),
    ("geometry: [{generate: quad, scale: 0}]", "s.yaml:1:36 geometry[0].scale must be greater than 0, not 0"),
    ("geometry: [{generate: quad, scale: [1, 0, 1]}]",
     "s.yaml:1:40 geometry[0].scale[1] must be greater than 0, not 0"),
    ("geometry: [{generate: quad, scale: big}]", "s.yaml:1:36 geometry[0].scale must be a number or a list of 3 "
                                                 "numbers"),
    ("geometry: [{generate: quad, material: {alpha: 1.5}}]",
     "s.yaml:1:47 geometry[0].material.alpha must be at most 1, not 1.5"),
    ("geometry: [{generate: quad, material: {color: [0, 0, -1]}}]",
     "s.yaml:1:54 geometry[0].material.color[2] must be at least 0, not -1"),
    ("geometry: [{mesh: b.obj}]\n" + CAMERA + LIGHT, "s.yaml:1:19 geometry[0].mesh no such mesh file: b.obj (relative "
                                                     "paths start from the scene file's folder)"),
    ("geometry: [{mesh: ''}]\n" + CAMERA + LIGHT,
     "s.yaml:1:19 geometry[0].mesh must be at least 1 character long, not the text ''"),
    ("geometry: [{generate: quad, material: {alpha_texture: no.png}}]",
     "s.yaml:1:55 geometry[0].material.alpha_texture no such texture file: no.png (relative paths start from the scene "
     "file's folder)"),
    # animation
    ("geometry: [{generate: quad, animate: [{rotate: [0, 0, 0]}]}]",
     "s.yaml:1:39 geometry[0].animate[0] needs exactly one of 'frame' and 'time'"),
    ("geometry: [{generate: quad, animate: {path: [{frame: 1, time: 1}]}}]",
     "s.yaml:1:46 geometry[0].animate.path[0] needs exactly one of 'frame' and 'time'"),
    ("geometry: [{generate: quad, animate: [{frame: 1}, {time: 1}]}]",
     "s.yaml:1:51 geometry[0].animate[1] needs 'frame' like the first key frame: don't mix frame and time"),
    ("geometry: [{generate: quad, animate: {path: [{time: 1}, {time: 0.5}]}}]",
     "s.yaml:1:64 geometry[0].animate.path[1].time must be later than the key frame before it"),
    ("geometry: [{generate: quad, animate: []}]",
     "s.yaml:1:38 geometry[0].animate must be a list with at least one item"),
    # camera
    (MESH + LIGHT, "s.yaml:1:1 the key 'camera' is missing: only a generated scene brings its own camera"),
    (MESH + CAMERA, "s.yaml:1:1 the key 'light' is missing: only a generated scene brings its own light"),
    (QUAD + "camera: {eye: [1, 1, 1]}", "s.yaml:2:9 camera needs 'eye' and 'target', or a 'path' of them"),
    (QUAD + "camera: {eye: [1, 1, 1], target: [1, 1, 1]}",
     "s.yaml:2:34 camera.target eye and target are the same point: move one of them"),
    (QUAD + "camera: {path: [{eye: [1, 1, 1], target: [1, 1, 1]}]}",
     "s.yaml:2:42 camera.path[0].target eye and target are the same point: move one of them"),
    (QUAD + "camera: {path: [{eye: [1, 1, 1]}]}", "s.yaml:2:17 camera.path[0] the key 'target' is missing"),
    (QUAD + "camera: {path: []}", "s.yaml:2:16 camera.path must be a list with at least one item"),
    (QUAD + "camera: {eye: [1, 1, 1], path: [{eye: [1, 1, 1], target: [0, 0, 0]}]}",
     "s.yaml:2:32 camera.path a camera has either 'eye' and 'target' or a 'path': remove one"),
    (QUAD + "camera: {eye: [1, 1, 1], target: [0, 0, 0], closed: true}",
     "s.yaml:2:53 camera.closed only a 'path' can be closed: remove it"),
    (QUAD + "camera: {eye: [0, 1, 0], target: [0, 0, 0]}",
     "s.yaml:2:34 camera.target up is parallel to the view direction: choose another 'up'"),
    (QUAD + "camera: {eye: [0, 0, 3], target: [0, 0, 0], up: [0, 0, -2]}",
     "s.yaml:2:49 camera.up up is parallel to the view direction: choose another 'up'"),
    (QUAD + "camera: {eye: [0, 0, 3], target: [0, 0, 0], up: [0, 0, 0]}", "s.yaml:2:49 camera.up must not be zero"),
    (QUAD + "camera: {eye: [0, 0, 3], target: [0, 0, 0], fov_y: 180}",
     "s.yaml:2:52 camera.fov_y must be less than 180, not 180"),
    (QUAD + "camera: {eye: [0, 0, 3], target: [0, 0, 0], near: 0}",
     "s.yaml:2:51 camera.near must be greater than 0, not 0"),
    (QUAD + "camera: {eye: [0, 0, 3], target: [0, 0, 0], near: 5, far: 5}",
     "s.yaml:2:59 camera.far far (5) must be greater than near (5)"),
    (QUAD + "camera: {eye: [0, 0, 3], target: [0, 0, 0], near: 2000}",
     "s.yaml:2:51 camera.near far (1000) must be greater than near (2000)"),
    # light
    (QUAD + "light: {}", "s.yaml:2:8 light needs exactly one of 'position', 'direction' and 'path'"),
    (QUAD + "light: {position: [0, 1, 2], direction: [0, 1, 0]}",
     "s.yaml:2:8 light needs exactly one of 'position', 'direction' and 'path'"),
    (QUAD + "light: {direction: [0, 0, 0]}",
     "s.yaml:2:20 light.direction must not be zero: give the direction in which the light travels"),
    (QUAD + "light: {position: [0, 0, 0], closed: true}",
     "s.yaml:2:38 light.closed only a 'path' can be closed: remove it"),
    (QUAD + "light: {path: [[0, 0]]}", "s.yaml:2:16 light.path[0] must be a list of 3 numbers"),
    (MESH + CAMERA + "light: {position: [0, 0, 5]}",
     "s.yaml:3:19 light.position light on the camera: the light stands at the camera's eye, from where no shadow can "
     "be seen; move one of them"),
    (MESH + "camera: {path: [{eye: [0, 0, 5], target: [0, 0, 0]}, {eye: [1, 0, 5], target: [0, 0, 0]}]}\n"
            "light: {position: [1, 0, 5]}",
     "s.yaml:3:19 light.position light on the camera: the light stands at the camera's eye at a key frame, from where "
     "no shadow can be seen; move one of them"),
    # algorithms
    (QUAD + "algorithms: [smaple]", "s.yaml:2:14 algorithms[0] unknown algorithm 'smaple'; did you mean 'sample'?"),
    (QUAD + "algorithms: [{smaple: {}}]",
     "s.yaml:2:15 algorithms[0].smaple unknown algorithm 'smaple'; did you mean 'sample'?"),
    (QUAD + "algorithms: []", "s.yaml:2:13 algorithms must be a list of algorithms, not an empty list; leave the key "
                              "out for all that support the scene"),
    (QUAD + "algorithms: sample", "s.yaml:2:13 algorithms must be a list of algorithms, not the text 'sample'; leave "
                                  "the key out for all that support the scene"),
    (QUAD + "algorithms: [{sample: {}, optional: {}}]",
     "s.yaml:2:14 algorithms[0] must be a name, or a mapping of one name to its parameters, such as "
     "'ptsv: {branching: 16}'"),
    (QUAD + "algorithms: [sample, sample: {}]",
     "s.yaml:2:22 algorithms[1] sample is listed twice with the same parameters"),
    (QUAD + "algorithms: [sample: 3]", "s.yaml:2:22 algorithms[0].sample the parameters must be a mapping, not 3"),
    (QUAD + "algorithms:\n  - sample: {branchng: 4}",
     "s.yaml:3:14 algorithms[0].sample.branchng unknown parameter of sample; did you mean 'branching'?"),
    (QUAD + "algorithms: [sample: {branching: true}]",
     "s.yaml:2:34 algorithms[0].sample.branching must be a whole number, not true"),
    (QUAD + "algorithms: [sample: {branching: '8'}]",
     "s.yaml:2:34 algorithms[0].sample.branching must be a whole number, not the text '8'"),
    (QUAD + "algorithms: [sample: {branching: 65}]",
     "s.yaml:2:34 algorithms[0].sample.branching must be at most 64, not 65"),
    (QUAD + "algorithms: [sample: {branching: 6}]", "s.yaml:2:22 algorithms[0].sample branching is no power of two"),
    (QUAD + "algorithms: [sample: {casters: backfaces}]",
     "s.yaml:2:32 algorithms[0].sample.casters must be 'all' or 'back_faces', not the text 'backfaces'; did you mean "
     "'back_faces'?"),
    (QUAD + "algorithms: [sample: {resolution: big}]",
     "s.yaml:2:35 algorithms[0].sample.resolution must be a whole number, not the text 'big' or must be 'auto', not "
     "the text 'big'"),
    (QUAD + "algorithms: [sample: {slopes: [1]}]", "s.yaml:2:31 algorithms[0].sample.slopes the key '1' is missing"),
    (QUAD + "algorithms: [broken: {a: 1}]", "s.yaml:2:22 algorithms[0].broken the algorithm can't be loaded: No module "
                                            "named 'tests.no_such_module'"),
    # matrix
    (QUAD + "matrix: [1]", "s.yaml:2:9 matrix must be a mapping such as 'cluster.bounds: [implicit, explicit]', not a "
                           "list"),
    (QUAD + "matrix: {casters: [1]}",
     "s.yaml:2:10 matrix.casters must be written as 'algorithm.parameter: [values]', or be a key of the scene such as "
     "'image.width'"),
    (QUAD + "matrix: {smaple.casters: [all]}",
     "s.yaml:2:10 matrix.smaple.casters unknown algorithm 'smaple'; did you mean 'sample'?"),
    (QUAD + "algorithms: [optional]\nmatrix: {sample.casters: [all]}",
     "s.yaml:3:10 matrix.sample.casters 'sample' is not under 'algorithms': add it there, or remove this axis"),
    (QUAD + "matrix: {sample.casters: all}", "s.yaml:2:26 matrix.sample.casters must be a list of values, not the text "
                                             "'all'"),
    (QUAD + "matrix: {sample.casters: []}",
     "s.yaml:2:26 matrix.sample.casters must be a list of values, not an empty list"),
    (QUAD + "matrix: {sample.caster: [all]}",
     "s.yaml:2:10 matrix.sample.caster unknown parameter of sample; did you mean 'casters'?"),
    (QUAD + "matrix: {sample.branching: [8, 1]}", "s.yaml:2:32 matrix.sample.branching[1] must be at least 2, not 1"),
    (QUAD + "matrix: {sample.branching: [8, 8]}", "s.yaml:2:32 matrix.sample.branching[1] 8 is listed twice"),
    # the file as a whole
    ("[1]", "s.yaml:1:1 a scene file is a mapping of keys such as 'geometry:', not a list"),
    ("", "s.yaml:1:1 the file is empty: it needs at least 'geometry'"),
    ("geometry: [", "s.yaml:1:12 YAML: expected the node content, but found '<stream end>'"),
]


@pytest.mark.parametrize(("text", "expected"), BAD, ids=[expected.split(" ", 1)[1][:60] for _, expected in BAD])
def test_each_bad_input(text, expected, folder):
    assert one_error(text, folder) == expected


def test_all_problems_come_at_once_in_the_order_of_the_file(folder):
    text = ("geometry:\n  - mehs: a.obj\n  - generate: quad\n    seed: 1.5\n    seed: 2\nimage: {width: 0, widht: 1}\n"
            "algorithms: [smaple]\nmatrix: {sample.caster: [1]}\nbogus: 1\nbias: .nan\n")
    assert [line.split(" ")[0] + " " + line.split(" ")[1] for line in errors(text, folder, ["frames=0"])] == [
        "s.yaml:2:5 geometry[0]", "s.yaml:2:5 geometry[0].mehs", "s.yaml:4:11 geometry[1].seed",
        "s.yaml:5:5 geometry[1].seed", "s.yaml:6:16 image.width", "s.yaml:6:19 image.widht",
        "s.yaml:7:14 algorithms[0]", "s.yaml:8:10 matrix.sample.caster", "s.yaml:9:1 bogus", "s.yaml:10:7 bias",
        "-D frames=0:"]


def test_one_bad_key_hides_nothing_in_its_section(folder):
    text = QUAD + ("camera: {eye: [1, 1, 1], target: [1, 1, 1], fov_y: 180, near: 5, far: 2, closed: true, fra: 2}\n"
                   "light: {path: [[0, 0]], direction: [0, 0, 0], closed: 1}\n")
    assert [line.removeprefix("s.yaml:") for line in errors(text, folder)] == [
        "2:34 camera.target eye and target are the same point: move one of them",
        "2:52 camera.fov_y must be less than 180, not 180",
        "2:71 camera.far far (2) must be greater than near (5)",
        "2:82 camera.closed only a 'path' can be closed: remove it",
        "2:88 camera.fra unknown key; did you mean 'far'?",
        "3:8 light needs exactly one of 'position', 'direction' and 'path'",
        "3:16 light.path[0] must be a list of 3 numbers",
        "3:36 light.direction must not be zero: give the direction in which the light travels",
        "3:55 light.closed must be true or false, not 1"]


def test_sections_hold_on_their_own_too():
    with pytest.raises(ValueError, match=r"far \(1\) must be greater than near"):
        scene_models.CameraConfig(eye=[0, 0, 1], target=[0, 0, 0], far=1, near=2)


def test_files_that_cannot_be_read(tmp_path):
    def message(path: Path) -> str:
        with pytest.raises(ConfigErrors) as caught:
            load_config(path)
        [line] = caught.value.lines
        return line.removeprefix(f"{tmp_path}/")

    (tmp_path / "scene.yaml").write_text("x")
    assert message(tmp_path / "scnee.yaml") == \
        "scnee.yaml: no such file or built-in scene; did you mean 'scene.yaml'?"
    assert message(tmp_path / "zzz" / "qqq") == "zzz/qqq: no such file or built-in scene"
    (tmp_path / "dir").mkdir()
    assert message(tmp_path / "dir") == "dir: is a folder: give the scene file in it"
    (tmp_path / "latin.yaml").write_bytes("name: x\nb: caf\xe9".encode("latin-1"))
    assert message(tmp_path / "latin.yaml") == "latin.yaml:2:7 not UTF-8 text (byte 0xe9): save the file as UTF-8"
    (tmp_path / "big.yaml").write_bytes(b"#" * 1_000_001)
    assert message(tmp_path / "big.yaml") == "big.yaml: larger than 1,000,000 bytes: this is no scene file"
    assert "can't be read" in message(tmp_path / ("x" * 300))
    assert "can't be read" in message(Path("a\0b"))


def test_a_byte_order_mark_shifts_no_column(tmp_path):
    file = tmp_path / "bom.yaml"
    file.write_bytes(b"\xef\xbb\xbfgeometry: 3")
    with pytest.raises(ConfigErrors) as caught:
        load_config(file)
    assert ":1:11 geometry must be a list" in str(caught.value)


def test_anchors_and_aliases(folder):
    config = load_config(folder / "s.yaml", text="geometry: [{generate: quad, translate: &v [1, 2, 3]}]\n"
                                                 "light: {position: *v}\n")
    assert config.light.position == config.geometry[0].translate == (1, 2, 3)
