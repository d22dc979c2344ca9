"""Print a digest of the reference's results and counts on fixed scenes, for each number of threads in the
arguments.

Run by test_reference_determinism.py in a process of its own, so that Numba can be told which processor to
compile for.
"""

import hashlib
import sys

import numpy as np

from shadowbench.jit import set_threads
from shadowbench.reference import certified_shadows


def scene_digest(light):
    rng = np.random.default_rng(3)
    corners = rng.uniform(-3, 3, (4000, 1, 3)) + rng.normal(size=(4000, 3, 3)) * 0.1
    corners = np.round(corners * 64) / 64
    positions = np.round(rng.uniform(-3, 3, (20000, 3)) * 1024) / 1024
    result = certified_shadows(corners, np.array(light), positions, 0.0, np.full(20000, 1e-4), counting=True)
    digest = hashlib.sha256(result.flags.tobytes() + result.heat.tobytes()).hexdigest()[:16]
    return f"{digest} {tuple(result.statistics)}"


if __name__ == "__main__":
    for n_threads in sys.argv[1:]:
        set_threads(int(n_threads))
        print(scene_digest((0.5, 0.25, -0.125, 1.0)), scene_digest((0.25, 1.0, -0.5, 0.0)))
