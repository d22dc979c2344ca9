"""Performance bars of the reference, warm, with two threads."""

import time

import numpy as np
import pytest

from shadowbench.reference import certified_shadows

RESOLUTION = 1024


def terrain_height(x, z):
    return 3 * np.sin(0.3 * x) * np.cos(0.25 * z)


def terrain(n):
    """A bumpy square of 2 n^2 triangles."""
    x, z = np.meshgrid(np.linspace(-50, 50, n + 1), np.linspace(-50, 50, n + 1))
    points = np.stack([x, terrain_height(x, z), z], axis=-1)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    return np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, c, b), (b, c, d))])


def scene(n_terrain, n_loose):
    """A terrain under loose triangles, with 1024 x 1024 samples on it."""
    rng = np.random.default_rng(1)
    centres = rng.uniform([-50, 4, -50], [50, 12, 50], (n_loose, 1, 3))
    loose = centres + 0.3 * rng.normal(size=(n_loose, 3, 3))
    axis = np.linspace(-49, 49, RESOLUTION)
    x, z = (a.ravel() for a in np.meshgrid(axis, axis))
    positions = np.stack([x, terrain_height(x, z) + 0.05, z], axis=1)
    return np.concatenate([terrain(n_terrain), loose]), positions


@pytest.mark.bench
@pytest.mark.parametrize("n_terrain, n_loose, seconds", [(160, 8800, 1.0), (400, 80000, 8.0)])
def test_a_million_samples_in_seconds(n_terrain, n_loose, seconds):
    corners, positions = scene(n_terrain, n_loose)
    light, ties = np.array([20.0, 60.0, 10.0, 1.0]), np.full(len(positions), 1e-6)
    times = []
    for _ in range(4):
        start = time.perf_counter()
        result = certified_shadows(corners, light, positions, 1e-3, ties)
        times.append(time.perf_counter() - start)
    assert 0.05 < result.shadow.mean() < 0.95
    assert min(times[1:]) < seconds, times
