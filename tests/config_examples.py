"""Scene files, fixtures and helpers that the tests of configuration share."""

from pathlib import Path

import pytest

from shadowbench.algorithms import ALGORITHMS
from shadowbench.config import ConfigErrors, load_config
from shadowbench.scenes import SCENES
from tests.scene_examples import ALGORITHM_ENTRIES, SCENE_ENTRIES

MESH = "geometry: [{mesh: a.obj}]\n"
CAMERA = "camera: {eye: [0, 0, 5], target: [0, 0, 0]}\n"
LIGHT = "light: {position: [0, 5, 0]}\n"
QUAD = "geometry: [{generate: quad}]\n"

FULL = """\
name: courtyard
geometry:
  - mesh: a.obj
    scale: 0.01
    rotate: [90, 0, 0]
    translate: [0, 0, 0]
    material: {alpha: 1.0, color: [1, 1, 1], alpha_texture: leaf.png, alpha_cutoff: 0.5}
    animate: {path: [{frame: 0}, {frame: 3, rotate: [0, 90, 0], translate: [1, 2, 3]}]}
  - generate: quad
    scale: [1, 2, 3]
    triangles: 60000
    seed: 1
    animate: [{time: 0}, {time: 1, rotate: [0, 360, 0]}]
camera: {eye: [0, 0, 5], target: [0, 0, 0], up: [0, 1, 0], fov_y: 60, near: 0.1, far: 1000}
light: {position: [0, 5, 0]}
image: {width: 1024, height: 512, samples: 4}
frames: 4
bias: 1e-4
algorithms:
  - sample
  - sample: {branching: 16, casters: back_faces}
matrix: {sample.casters: [all, back_faces]}
"""


@pytest.fixture(autouse=True)
def examples(monkeypatch):
    for scene in SCENE_ENTRIES:
        monkeypatch.setitem(SCENES, scene.name, scene)
    for algorithm in ALGORITHM_ENTRIES:
        monkeypatch.setitem(ALGORITHMS, algorithm.name, algorithm)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("scene")
    (folder / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (folder / "leaf.png").write_bytes(b"")
    return folder


def errors(text: str, folder: Path, overrides=()) -> list[str]:
    """Problems of a scene file, without the folder in their names."""
    with pytest.raises(ConfigErrors) as caught:
        load_config(folder / "s.yaml", overrides, text=text)
    assert str(caught.value) == "\n".join(caught.value.lines)
    return [line.replace(f"{folder}/", "") for line in caught.value.lines]


def one_error(text: str, folder: Path, overrides=()) -> str:
    found = errors(text, folder, overrides)
    assert len(found) == 1, found
    return found[0]
