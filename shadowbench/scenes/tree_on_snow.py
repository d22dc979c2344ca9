"""A bare tree on snow in a low sun (a stand-in for "tree on snow" of Hertel et al. 2009): fine branches, long shadows.

Lengths are metres.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import FloatArray, Light
from shadowbench.scenes.bare_trees import Growth, bark, grow, stem
from shadowbench.scenes.grounds import Height, ground
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, SmoothNoise, require_triangles
from shadowbench.scenes.props import conifer, scatter_rocks
from shadowbench.scenes.shapes import box, copies
from shadowbench.scenes.tubes import tube

MINIMUM = 60_000
"""Fewest triangles: all branches but few twigs, and the snow."""

_BOUGHS = Growth(17, 4.2, 8, 10, along=0.45, up=0.42)
_BRANCHES = Growth(7, 2.1, 6, 6, along=0.65, up=0.3)
_SMALL = Growth(7, 1.05, 4, 5)
_TWIGS = Growth(3, 0.46, 3, 3)
_HALF = 34.0            # half the side of the land
_SNOW = 9_000
"""Triangles of the snow, about."""

_COLORS = {"bark": (0.2, 0.15, 0.11), "snow": (0.86, 0.88, 0.93), "wood": (0.34, 0.26, 0.19), "fir": (0.1, 0.17, 0.13),
           "rock": (0.4, 0.4, 0.42)}


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the tree with exactly `triangles` triangles: more of them make more twigs.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("tree_on_snow", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    builder, noise = MeshBuilder(_COLORS), SmoothNoise(rng, 15.0)

    def height(x: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(1.1 * noise(x, z) + 0.0022 * (x * x + z * z))

    foot = float(height(np.zeros(1), np.zeros(1))[0])
    trunk = stem((0.0, foot, 0.0), 6.2, 0.42, rng)
    builder.add(bark(trunk, 20), "bark")
    boughs = grow(rng, trunk, _BOUGHS, low=0.5)
    branches = grow(rng, boughs, _BRANCHES, low=0.35)
    small = grow(rng, branches, _SMALL)
    for generation, growth in ((boughs, _BOUGHS), (branches, _BRANCHES), (small, _SMALL)):
        builder.add(bark(generation, growth.sides), "bark")
    _add_surroundings(builder, rng, height)
    # Twigs take what is left but for the snow
    n = (triangles - _SNOW - builder.n_triangles) // _TWIGS.triangles
    builder.add(bark(grow(rng, small, _TWIGS, n), _TWIGS.sides), "bark")
    builder.add(ground((-_HALF, _HALF), (-_HALF, _HALF), triangles - builder.n_triangles, height), "snow")
    eyes = [(9.5, foot + 5.4, 13.0), (-1.5, foot + 2.6, 12.0), (-11.5, foot + 5.0, 7.0), (-11.0, foot + 3.0, -6.5),
            (1.0, foot + 7.0, -12.5), (12.0, foot + 4.0, -2.0)]
    targets = [(-0.6, foot + 3.4, 0.0)] * 6
    return ProceduralScene(builder.mesh(), eyes, targets, closed=True, fov_y=50.0, near=0.1, far=200.0,
                           light=Light.point(-33.0, 29.0, 12.0))


def _add_surroundings(builder: MeshBuilder, rng: np.random.Generator, height: Height) -> None:
    """A fence, firs and stones on the snow."""
    x = np.linspace(-20.0, 20.0, 15)
    z = -9.0 + 0.02 * x * x
    y = height(x, z)
    builder.add(copies(box((-0.07, -0.6, -0.07), (0.07, 1.15, 0.07)), np.stack([x, y, z], axis=1)), "wood")
    for k in range(14):
        ends = np.array([[x[k], y[k], z[k]], [x[k + 1], y[k + 1], z[k + 1]]])
        for rail in (0.5, 0.95):
            builder.add(tube(ends + np.array([0.0, rail, 0.0]), (0.05, 0.05), 5), "wood")
    n = 22
    place_x = rng.uniform(-30.0, 30.0, n)
    place_z = np.where(rng.uniform(0.0, 1.0, n) < 0.7, rng.uniform(-31.0, -15.0, n), rng.uniform(-15.0, 30.0, n))
    place_x = np.where((place_z > -14.0) & (np.abs(place_x) < 17.0), np.where(place_x < 0, -24.0, 24.0), place_x)
    feet = np.stack([place_x, height(place_x, place_z) - 0.4, place_z], axis=1)
    builder.add(copies(conifer(5, 9), feet, rng.integers(0, 360, n), rng.uniform(3.5, 7.5, (n, 1))), "fir")
    rock_x, rock_z = rng.uniform(-14.0, 14.0, 26), rng.uniform(-7.0, 12.0, 26)
    builder.add(scatter_rocks(rng, np.stack([rock_x, height(rock_x, rock_z), rock_z], axis=1), 0.5), "rock")
