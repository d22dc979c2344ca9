"""The gate is worth having: a changed constant in a kernel makes it fail, an edit that changes nothing does not."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import shadowbench

pytestmark = pytest.mark.slow

PACKAGE = Path(shadowbench.__file__).parent
SUITE = """\
name: mutants
algorithms: [reference, shadow_map, silhouette_map, hybrid, z_fail, z_pass, ptsv, ray_traced, conservative_map,
             cluster: {group: 8, culling_planes: outline}]
scenes:
  - scene: cubes
    set: {image.width: 96, image.height: 96, geometry.0.triangles: 1200}
  - scene: sunlit_boxes
    set: {image.width: 96, image.height: 72}
"""

MUTATIONS = {
    "ptsv": ("kernels/culling_planes.py", "SLACK = 2.0**-27", "SLACK = 2.0**-2", "ptsv +node_tests"),
    "lanes": ("kernels/lanes.py", "UNDECIDED = 6.0e-8", "UNDECIDED = 6.0e-4", "ptsv +float64_sample_tests"),
    "cluster": ("kernels/frustum_groups.py", "ALONE_SIZE = 8.0", "ALONE_SIZE = 0.5", r"cluster\S* +group_tests"),
    "shadow_map": ("kernels/light_maps.py", "_MARGIN = 1.0 + 2.0**-20", "_MARGIN = 1.0 + 2.0**-2",
                   "sunlit_boxes frame 0 shadow_map +map_fragments"),
    "z_pass": ("kernels/stencil_volumes.py", "NEAREST_BEFORE = 2.0**-20", "NEAREST_BEFORE = 2.0**6",
               "z_pass +stencil_fragments"),
    "stencil": ("kernels/volume_polygons.py", "GUARD = 8.0", "GUARD = 0.5", "z_fail +stencil_fragments"),
    "kd_tree": ("kernels/kdtree_sweep.py", "EMPTY_BONUS = 0.8", "EMPTY_BONUS = 0.1", "ray_traced +kd_nodes"),
    "silhouettes": ("kernels/silhouette_points.py", "ENLARGEMENT = 2.0**-10", "ENLARGEMENT = 2.0**-2", "silhouette_map +"),
    "conservative": ("kernels/conservative_raster.py", "TEXEL_MARGIN = 2.0**-16", "TEXEL_MARGIN = 2.0**-1",
                     "conservative_map +"),
    "reference": ("reference/light_tree.py", "LEAF_SAMPLES = 16", "LEAF_SAMPLES = 8", "reference +sample_tests"),
}


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the package that may be edited, with a suite and its baseline; returns its folder."""
    folder = tmp_path_factory.mktemp("copy")
    shutil.copytree(PACKAGE, folder / "shadowbench", ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "suite.yaml").write_text(SUITE)
    done = check(folder, "--update")
    assert done.returncode == 0, done.stderr
    return folder


def check(folder: Path, *options: str) -> subprocess.CompletedProcess:
    environment = {key: value for key, value in os.environ.items() if key != "CI"}
    command = [sys.executable, "-m", "shadowbench", "check", "suite.yaml", "--baseline", "counts.lock", *options]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True,
                          env={**environment, "PYTHONPATH": str(folder)})


@pytest.mark.parametrize("case", MUTATIONS)
def test_a_changed_constant_makes_the_check_fail(case, copy):
    module, old, new, words = MUTATIONS[case]
    path = copy / "shadowbench" / module
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    try:
        done = check(copy)
    finally:
        path.write_text(text)
    assert done.returncode == 3, done.stdout + done.stderr
    assert re.search(words, done.stdout), done.stdout


def test_an_edit_that_changes_no_count_passes(copy):
    before = (copy / "counts.lock").read_bytes()
    for module, *_ in MUTATIONS.values():
        with (copy / "shadowbench" / module).open("a") as file:
            file.write("# a comment\n")
    assert check(copy).returncode == 0
    assert check(copy, "--update").returncode == 0 and (copy / "counts.lock").read_bytes() == before


def test_without_a_baseline_the_check_fails(copy):
    (copy / "counts.lock").rename(copy / "kept.lock")
    try:
        assert check(copy).returncode == 5
    finally:
        (copy / "kept.lock").rename(copy / "counts.lock")
