"""The C library keeps freed arrays, so that a frame does not pay for fresh pages."""

import subprocess
import sys

import pytest

from shadowbench.allocator import keep_freed_memory

FAULTS = """
import resource, sys
import numpy as np
from shadowbench.allocator import keep_freed_memory

assert sys.argv[1] == "as ever" or keep_freed_memory()
for _ in range(3):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    arrays = [np.full(1 << 18, 1.0) for _ in range(16)]         # of 512 pages, too few for numpy to ask for huge ones
    del arrays
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(how):
    command = [sys.executable, "-c", FAULTS, how]
    return int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="mallopt is glibc's")
def test_pages_of_freed_arrays_are_used_again():
    if not keep_freed_memory():
        pytest.skip("the C library is not glibc")
    assert faults("kept") < 100 and faults("as ever") > 16 * 500


def test_other_systems_are_left_alone(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    assert keep_freed_memory.__wrapped__() is False
