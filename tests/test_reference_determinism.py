"""The same results and counts for any number of threads and any processor."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parent


def digests(*threads, **environment):
    """Run reference_digest.py with up to four threads and return the line of each number of threads."""
    variables = os.environ | {"PYTHONPATH": str(TESTS.parent)} | environment
    command = [sys.executable, str(TESTS / "reference_digest.py"), *map(str, threads)]
    run = subprocess.run(command, env=variables, capture_output=True, text=True, check=True, timeout=600)
    return run.stdout.splitlines()


def test_threads_change_neither_results_nor_counts():
    one, two, four = digests(1, 2, 4)
    assert one == two == four
    assert "(0, 0" not in one


@pytest.mark.slow
def test_the_processor_changes_neither_results_nor_counts():
    assert digests(2, NUMBA_CPU_NAME="generic") == digests(2)
