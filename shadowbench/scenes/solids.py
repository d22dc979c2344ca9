"""A few round bodies on a plane: what the first figures of Chan and Durand 2004 explain the hybrid on."""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import Light
from shadowbench.scenes.buildings import rounds
from shadowbench.scenes.country_house import ball
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, fit_detail, require_triangles
from shadowbench.scenes.shapes import lathe
from shadowbench.scenes.tubes import ring

MINIMUM = 700
"""Fewest triangles: the bodies in their coarsest form, and a little ground."""

_DEFAULT = 2_400
_FEWEST_GROUND = 32
_HALF = 9.0

_COLORS = {"ground": (0.62, 0.6, 0.56), "cylinder": (0.7, 0.33, 0.2), "ball": (0.2, 0.36, 0.62), "cone": (0.76, 0.58, 0.2),
           "ring": (0.3, 0.52, 0.33)}


def _build(detail: float) -> MeshBuilder:
    """Build the bodies."""
    builder = MeshBuilder(_COLORS)
    sides = rounds(detail, 32, 12)
    builder.add(lathe([(0.55, 0.0), (0.55, 2.6)], sides, bottom=True, top=True).moved(-2.0, 0.0, 0.2), "cylinder")
    builder.add(ball(0.9, sides).moved(1.3, 1.5, 1.3), "ball")
    builder.add(lathe([(0.8, 0.0), (0.0, 2.0)], sides, bottom=True).moved(0.3, 0.0, -2.4), "cone")
    builder.add(ring(0.8, 0.22, sides, rounds(detail, 12)).moved(3.3, 0.3, -2.9), "ring")
    return builder


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the bodies with exactly `triangles` triangles; `seed` makes the ground a little uneven away from them.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("solids", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    builder = fit_detail(_build, triangles - _FEWEST_GROUND, (triangles / _DEFAULT) ** 0.5)
    plane = ground((-_HALF, _HALF), (-_HALF, _HALF), triangles - builder.n_triangles)
    rim = np.maximum(np.abs(plane.vertices[:, 0]), np.abs(plane.vertices[:, 2])) > _HALF - 0.01
    plane.vertices[rim, 1] += rng.uniform(-0.1, 0.1, int(rim.sum()))
    builder.add(plane, "ground")
    eyes = [(1.0, 5.4, 7.8), (-4.6, 3.4, 6.4), (5.6, 4.2, 5.2), (0.5, 7.0, 3.4)]
    targets = [(0.4, 0.6, 0.0), (-0.6, 0.6, 0.0), (0.6, 0.4, 0.0), (0.4, 0.0, 0.0)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=False, fov_y=52.0, near=0.1, far=60.0,
                           light=Light.point(-4.6, 6.2, 4.4))
