"""Sweeps over the scene: resolutions, frames and lights."""

from pathlib import Path

import pytest

from shadowbench.config import ConfigErrors, load_config
from shadowbench.results import read_run
from shadowbench.scene_sweep import scene_variants, variant_name
from tests.command_line import call

SCENE = "geometry: [{generate: plane_box}]\nimage: {width: 32, height: 32}\nalgorithms: [ptsv]\n"


def config(matrix: str, tmp_path: Path):
    (tmp_path / "s.yaml").write_text(SCENE + f"matrix: {matrix}\n")
    return load_config(tmp_path / "s.yaml")


def test_variants_are_all_combinations(tmp_path):
    swept = config("{image.width: [16, 32], ptsv.branching: [8], frames: [1, 2, 3]}", tmp_path)
    variants = scene_variants(swept)
    assert len(variants) == 6 and len({tuple(v) for v in variants}) == 6
    assert variants[0] == ["image.width=16", "frames=1", 'name="s-image.width_16-frames_1"',
                           'matrix={"ptsv.branching": [8]}']
    assert scene_variants(config("{ptsv.branching: [8]}", tmp_path)) == []


def test_names_of_variants_are_names_of_scenes():
    assert variant_name("a", [("light.position", [0, 9.5, -1]), ("bias", "auto")]) == "a-light.position_0_9.5_-1-bias_auto"
    assert len(variant_name("a", [("light.position", [1 / 3] * 9)])) == 100


def test_resolutions_and_lights_run_as_scenes_of_their_own(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENE + "matrix: {image.width: [16, 24], light.position: [[0, 9, 1], [3, 9, 1]], "
                                             "ptsv.branching: [8, 32]}\n")
    done = call("run", tmp_path / "s.yaml", "--only", "counts", "--out", tmp_path / "out")
    assert done.code == 0
    cells = [cell for folder in sorted((tmp_path / "out").iterdir()) for cell in read_run(folder)[1]]
    assert len(cells) == 8 and len({cell.scene for cell in cells}) == 4
    assert sorted({cell.accuracy.samples for cell in cells}) == [16 * 32, 24 * 32]
    assert len({(cell.accuracy.samples, cell.accuracy.shadowed) for cell in cells}) == 4
    assert len({cell.key for cell in cells}) == 8


@pytest.mark.parametrize(("matrix", "words"), [
    ("{image.width: 3}", "image.width must be a list"), ("{image.width: []}", "not an empty list"),
    ("{widht: [1]}", "or be a key of the scene such as 'image.width'")])
def test_bad_axes_are_told_with_their_place(matrix, words, tmp_path):
    with pytest.raises(ConfigErrors) as caught:
        config(matrix, tmp_path)
    assert words in str(caught.value) and "s.yaml:4:" in str(caught.value)


def test_bad_values_of_an_axis_name_the_variant(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENE + "matrix: {image.widht: [16]}\n")
    done = call("run", tmp_path / "s.yaml", "--out", tmp_path / "out")
    assert done.code == 2 and "-D image.widht=16" in done.errors and "did you mean 'width'" in done.errors
