"""Performance bars of the command line; run with ``make bench``."""

import json
import os
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.bench

HELP_SECONDS = 0.3
OVERHEAD_SECONDS = 2.0


def best_of(n, *arguments, cwd):
    """Shortest wall time of the command, seconds."""
    times = []
    for _ in range(n):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", "shadowbench", *arguments], cwd=cwd, check=True, capture_output=True)
        times.append(time.perf_counter() - start)
    return min(times)


@pytest.mark.parametrize("arguments", [("--help",), ("list", "algorithms"), ("list", "scenes")])
def test_help_and_list_answer_at_once(arguments, tmp_path):
    seconds = best_of(5, *arguments, cwd=tmp_path)
    print(f"\nshadowbench {' '.join(arguments)}: {seconds:.3f} s (bar {HELP_SECONDS} s)")
    assert seconds <= HELP_SECONDS


def test_second_run_of_the_demo_spends_little_outside_the_measured_work(tmp_path):
    configs = os.path.join(os.path.dirname(__file__), "..", "configs", "citadel.yaml")
    command = [sys.executable, "-m", "shadowbench", "run", os.path.abspath(configs)]
    overheads = []
    for i in range(3):
        start = time.perf_counter()
        subprocess.run([*command, "--out", f"run{i}"], cwd=tmp_path, check=True, capture_output=True)
        wall = time.perf_counter() - start
        measured = sum(json.loads((tmp_path / f"run{i}" / "run.json").read_text())["seconds"].values())
        overheads.append(wall - measured)
    print(f"\noutside the measured work: {min(overheads[1:]):.2f} s of {wall:.1f} s (bar {OVERHEAD_SECONDS} s)")
    assert min(overheads[1:]) <= OVERHEAD_SECONDS
