"""Shared fixtures."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def models() -> Path:
    """Folder of real meshes; the test is skipped where there is none."""
    folder = os.environ.get("SHADOWBENCH_MODELS")
    if not folder:
        pytest.skip("SHADOWBENCH_MODELS is not set: no real meshes to test with")
    return Path(folder)
