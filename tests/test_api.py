"""The Python interface, and the examples that use it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import shadowbench as sb
from shadowbench import image_io
from shadowbench.errors import InputError

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return sb.run("plane_box", ["ptsv", ("shadow_map", {"resolution": 64})], size=(48, 32), repeats=2, threads=1,
                  overrides=["frames=2"], out=tmp_path_factory.mktemp("api") / "run")


def test_results_are_those_of_the_run_folder(results):
    again = sb.load(results.path)
    assert again.labels == results.labels == ["ptsv", "shadow_map+resolution=64"]
    assert results.frames == [0, 1] and len(results.cells) == 4
    assert again.records() == results.records()
    assert results.document["argv"] == ["shadowbench", "run", "plane_box", "-D", "frames=2", "-D", "image.width=48",
                                        "-D", "image.height=32"]
    assert json.loads((results.path / "run.json").read_text())["threads"] == 1
    assert results.warnings == [] and "ptsv" in repr(results) and "test_and_set" in results._repr_html_()


def test_records_are_flat(results):
    record = results.records()[0]
    cell = results.cell("ptsv")
    assert record["param.branching"] == 32 and record["test_and_set"] == cell.counts["test_and_set"]
    assert record["false_light"] == 0 and record["seconds"] == np.median(cell.total_seconds)
    assert record["stage.traversal"] > 0 and record["memory_bytes"] > 0
    assert all(isinstance(value, str | int | float | bool) for value in record.values())


def test_arrays_have_the_shape_of_the_sample_grid(results):
    shadow, tests, errors = results.shadow("ptsv"), results.tests("ptsv", 1), results.errors("shadow_map+resolution=64")
    assert shadow.shape == tests.shape == errors.shape == (32, 48) and shadow.dtype == np.float32
    assert set(np.unique(shadow)) == {0.0, 1.0} and tests.dtype == np.uint32 and tests.sum() > 0
    accuracy = results.cell("shadow_map+resolution=64").accuracy
    assert np.count_nonzero(errors) == accuracy.false_shadow + accuracy.false_light + accuracy.edge_tie > 0
    assert results.gbuffer()["candidate"].sum() == accuracy.lit_candidates
    assert np.count_nonzero(shadow) == results.cell("ptsv").accuracy.shadowed
    assert np.array_equal(results.picture("ptsv"), image_io.read_png(results.path / "frames/0000/ptsv/shaded.png"))


def test_what_is_not_there_is_told(results, tmp_path):
    with pytest.raises(KeyError, match="there are ptsv, shadow_map"):
        results.shadow("cluster")
    with pytest.raises(KeyError, match="there are shaded"):
        results.picture("ptsv", "levels")
    with pytest.raises(InputError, match="holds no run"):
        sb.load(tmp_path)
    counted = sb.run("plane_box", ["ptsv"], size=(16, 8), pictures=False, timings=False, out=tmp_path / "counts")
    assert "seconds" not in counted.records()[0] and counted.cell("ptsv").accuracy.false_shadow == 0
    with pytest.raises(KeyError, match="without pictures"):
        counted.gbuffer()
    with pytest.raises(KeyError, match="pictures=True"):
        counted.tests("ptsv")


@pytest.mark.parametrize("arguments, words", [
    ({"scene": "plane_bx"}, "plane_b"), ({"algorithms": ["ptsw"]}, "ptsv"), ({"algorithms": []}, "empty"),
    ({"algorithms": ["ptsv[branching=7]"]}, "branching"), ({"frames": [3]}, "frames 0 to 0"),
    ({"overrides": ["image.width=0"]}, "image.width"), ({"overrides": ["matrix={image.width: [8, 16]}"]}, "matrix"),
])
def test_bad_input_is_told(tmp_path, arguments, words):
    with pytest.raises(InputError, match=words):
        sb.run(**{"scene": "plane_box", "out": tmp_path / "run", **arguments})
    assert not (tmp_path / "run").exists()


def test_kernels_do_not_depend_on_the_interface():
    from shadowbench import source_digest

    reached, waiting = set(), [source_digest.PACKAGE / "kernels" / "vectors.py"]
    while waiting:
        waiting += [file for file in source_digest._imported(waiting.pop()) if file not in reached]
        reached.update(waiting)
    names = {file.relative_to(source_digest.PACKAGE).as_posix() for file in reached}
    assert "__init__.py" in names and not names & {"api.py", "cli.py", "run_command.py", "report/html.py"}


def test_names_of_the_package():
    assert {"run", "load", "Results"} <= set(dir(sb))
    with pytest.raises(AttributeError, match="no attribute 'walk'"):
        _ = sb.walk
    quick = subprocess.run([sys.executable, "-c", "import sys, shadowbench; print('numba' in sys.modules)"],
                           capture_output=True, text=True, check=True)
    assert quick.stdout == "False\n"


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_examples_print_what_the_manual_shows(example, tmp_path):
    assert len(EXAMPLES) >= 2
    done = subprocess.run([sys.executable, str(example)], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert done.stdout == example.with_suffix(".txt").read_text(encoding="utf-8")
