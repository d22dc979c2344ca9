"""What a digest of sources must notice, and what it need not."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import shadowbench

PACKAGE = Path(shadowbench.__file__).parent
PROGRAM = ("import sys; from pathlib import Path; from shadowbench.source_digest import PACKAGE, source_digest; "
           "print(source_digest(PACKAGE / sys.argv[1]))")


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A copy of the package that may be edited."""
    copy = tmp_path_factory.mktemp("copy") / "shadowbench"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


def digest(package: Path, module: str) -> str:
    done = subprocess.run([sys.executable, "-c", PROGRAM, module], cwd=package.parent, capture_output=True, text=True,
                          check=True, env={**os.environ, "PYTHONPATH": str(package.parent)})
    return done.stdout.strip()


def edited(package: Path, module: str, old: str, new: str) -> str:
    """Digest of kernels/tile_traversal.py after an edit of `module`, which is then undone."""
    path = package / module
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    try:
        return digest(package, "kernels/tile_traversal.py")
    finally:
        path.write_text(text)


@pytest.mark.parametrize(("module", "old", "new"), [
    ("kernels/tile_traversal.py", "STACK_SIZE = 1024", "STACK_SIZE = 1025"),
    ("kernels/culling_planes.py", "SLACK = 2.0**-27", "SLACK = 2.0**-26"),
    ("jit.py", '"fastmath": False', '"fastmath": True'),
], ids=["itself", "imported by an import", "the compile options"])
def test_digest_follows_what_a_module_imports(package, module, old, new):
    assert edited(package, module, old, new) != digest(package, "kernels/tile_traversal.py")


def test_digest_follows_the_fields_of_records_that_it_does_not_import(package):
    """A compiled kernel reads a field by its place."""
    swapped = edited(package, "kernels/depth_hierarchy.py", "    plane_x: np.ndarray\n    plane_y: np.ndarray\n",
                     "    plane_y: np.ndarray\n    plane_x: np.ndarray\n")
    assert swapped != digest(package, "kernels/tile_traversal.py")


def test_digest_does_not_follow_what_a_module_does_not_use(package):
    same = edited(package, "kernels/stencil.py", "import numpy as np", "import numpy as np  # nothing else")
    assert same == digest(package, "kernels/tile_traversal.py")


def test_digest_leaves_out_imports_for_types(package):
    """Editing the scene loader recompiles no kernel of an algorithm."""
    before = digest(package, "algorithms/shadow_map.py")
    with open(package / "scenes" / "loader.py", "a") as file:
        file.write("# nothing\n")
    assert digest(package, "algorithms/shadow_map.py") == before


def test_every_import_in_the_package_is_absolute():
    """Relative imports would be missed."""
    files = list(PACKAGE.rglob("*.py"))
    assert len(files) > 50
    assert [file for file in files if any(line.lstrip().startswith(("from .", "import ."))
                                          for line in file.read_text().splitlines())] == []
