"""A bare tree in a walled court (a stand-in for the "tree" scene of Chan and Durand 2004): thin closed branches.

Lengths are metres. Branches overlap all over, seen from the light and from the eye.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import Light
from shadowbench.scenes.bare_trees import Growth, bark, grow, stem
from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, require_triangles
from shadowbench.scenes.shapes import box

MINIMUM = 24_000
"""Fewest triangles: all branches but few twigs."""

_DEFAULT = 40_000
_BOUGHS = Growth(15, 2.7, 7, 8, along=0.55, up=0.35)
_BRANCHES = Growth(6, 1.35, 5, 6, along=0.7)
_SMALL = Growth(5, 0.75, 4, 5)
_TWIGS = Growth(3, 0.36, 3, 3)
_HALF, _HIGH = 8.0, 3.4         # half the side of the court, height of its walls
_SHARE_OF_FLOOR = 0.012

_COLORS = {"bark": (0.32, 0.23, 0.15), "floor": (0.62, 0.57, 0.48), "wall": (0.66, 0.5, 0.38), "stone": (0.48, 0.46, 0.43)}


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the tree with exactly `triangles` triangles: more of them make more twigs.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("tree", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    builder = MeshBuilder(_COLORS)
    _add_court(builder)
    trunk = stem((0.0, 0.0, 0.0), 4.6, 0.26, rng)
    builder.add(bark(trunk, rounds(1.0, 16)), "bark")
    boughs = grow(rng, trunk, _BOUGHS, low=0.38)
    branches = grow(rng, boughs, _BRANCHES)
    small = grow(rng, branches, _SMALL)
    for generation, growth in ((boughs, _BOUGHS), (branches, _BRANCHES), (small, _SMALL)):
        builder.add(bark(generation, growth.sides), "bark")
    # Twigs take what is left but for the floor
    n = int(((1.0 - _SHARE_OF_FLOOR) * triangles - builder.n_triangles) / _TWIGS.triangles)
    builder.add(bark(grow(rng, small, _TWIGS, n), _TWIGS.sides), "bark")
    builder.add(ground((-_HALF, _HALF), (-_HALF, _HALF), triangles - builder.n_triangles), "floor")
    eyes = [(6.4, 5.2, 7.4), (0.5, 2.0, 7.2), (-6.6, 3.4, 6.6), (-7.0, 6.4, -1.0), (-2.0, 3.0, -7.2), (6.6, 2.2, -5.8),
            (7.2, 4.0, 1.0)]
    targets = [(-0.4, 2.0, -0.6), (0.0, 2.6, 0.0), (0.0, 2.2, 0.0), (0.6, 1.6, 0.0), (0.0, 2.6, 0.0), (0.0, 2.4, 0.0),
               (-0.6, 2.2, 0.0)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=True, fov_y=52.0, near=0.1, far=100.0,
                           light=Light.point(3.8, 11.5, 4.6))


def _add_court(builder: MeshBuilder) -> None:
    """Two walls with copings, and a kerb round the tree's foot."""
    for low, high in (((-_HALF, 0.0, -_HALF - 0.3), (_HALF, _HIGH, -_HALF)),
                      ((-_HALF - 0.3, 0.0, -_HALF), (-_HALF, _HIGH, _HALF))):
        builder.add(box(low, high), "wall")
        builder.add(box((low[0] - 0.06, _HIGH, low[2] - 0.06), (high[0] + 0.06, _HIGH + 0.14, high[2] + 0.06)), "stone")
    for low, high in (((-0.9, 0.0, -0.9), (0.9, 0.16, -0.75)), ((-0.9, 0.0, 0.75), (0.9, 0.16, 0.9)),
                      ((-0.9, 0.0, -0.75), (-0.75, 0.16, 0.75)), ((0.75, 0.0, -0.75), (0.9, 0.16, 0.75))):
        builder.add(box(low, high), "stone")
