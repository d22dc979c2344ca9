"""Shared fixtures."""

import os
from pathlib import Path

import pytest

from shadowbench import jit

if "PYTEST_XDIST_WORKER" in os.environ:
    jit.set_threads(1)      # the processes share the processors; no result depends on the number of threads


@pytest.fixture(scope="session")
def models() -> Path:
    """Folder of real meshes; the test is skipped where there is none."""
    folder = os.environ.get("SHADOWBENCH_MODELS")
    if not folder:
        pytest.skip("SHADOWBENCH_MODELS is not set: no real meshes to test with")
    return Path(folder)


@pytest.fixture(autouse=True)
def _same_threads_afterwards():
    """Leave the number of threads as it was."""
    before = jit.n_threads()
    yield
    jit.set_threads(before)
