"""Closed cubes floating in a room around the light (a stand-in for the "cubes" scene of Chan and Durand 2004)."""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import FloatArray, Light
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, require_triangles, whole_degrees
from shadowbench.scenes.shapes import Shape, box, subdivided_box, zigzag
from shadowbench.trigonometry import cos_degrees, sin_degrees

N_CUBES = 60
WALL_TRIANGLES = 8
FLOOR_TRIANGLES = 16
"""Fewest triangles of the floor; it takes what the cubes leave over."""
MINIMUM = 12 * N_CUBES + WALL_TRIANGLES + FLOOR_TRIANGLES

HALF = 10.0
"""Half the side of the room, world units; it is open towards the camera."""

_APART = 2.6
"""Least distance of the cubes' centres: twice the half diagonal of the largest, whose half side is 0.75."""

_COLORS = {"wall": (0.62, 0.60, 0.56), "floor": (0.45, 0.43, 0.42), "red": (0.72, 0.24, 0.18),
           "blue": (0.20, 0.36, 0.62), "ochre": (0.78, 0.58, 0.22)}


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the room with exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("cubes", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    cells = 1
    while 12 * N_CUBES * (cells + 1) ** 2 + WALL_TRIANGLES + FLOOR_TRIANGLES <= triangles:
        cells += 1
    builder = MeshBuilder(_COLORS)
    builder.add(box((-HALF, 0, -HALF), (HALF, 2 * HALF, HALF), ("-y", "+z")).flipped(), "wall")
    cube = subdivided_box(cells)
    for k, centre in enumerate(_centres(rng)):
        turned = _turned(cube, *whole_degrees(rng, 3)).scaled(*[rng.uniform(0.35, 0.75)] * 3)
        builder.add(turned.moved(*centre), ("red", "blue", "ochre")[k % 3])
    near, far = (((-HALF, 0.0, z), (HALF, 0.0, z)) for z in (HALF, -HALF))
    builder.add(zigzag(near, far, triangles - builder.n_triangles), "floor")
    eyes = [(0.5, 10.5, 29.0), (8.0, 13.0, 25.0), (5.0, 7.0, 20.0), (-6.0, 6.0, 22.0), (-9.0, 12.0, 26.0)]
    targets = [(0.0, 9.0, 0.0), (0.0, 8.0, 0.0), (0.0, 8.0, -4.0), (0.0, 9.0, -4.0), (0.0, 9.0, 0.0)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=True, fov_y=48.0, near=0.1, far=100.0,
                           light=Light.point(1.0, 12.5, 3.0))


def _centres(rng: np.random.Generator) -> FloatArray:
    """float64 (N_CUBES, 3): points in the room, none near the light, no two cubes in one another."""
    centres: list[FloatArray] = []
    while len(centres) < N_CUBES:
        point = rng.uniform([-8.0, 1.8, -8.0], [8.0, 18.0, 8.0])
        clear_of = [*centres, np.array([1.0, 12.5, 3.0])]
        if all(((point - other) ** 2).sum() > _APART * _APART for other in clear_of):
            centres.append(point)
    return np.array(centres)


def _turned(shape: Shape, *angles: int) -> Shape:
    """Turn about x, y and z by whole degrees."""
    points = shape.vertices.copy()
    for axis, angle in enumerate(angles):
        c, s = cos_degrees(float(angle)), sin_degrees(float(angle))
        a, b = (axis + 1) % 3, (axis + 2) % 3
        points[:, a], points[:, b] = c * points[:, a] - s * points[:, b], s * points[:, a] + c * points[:, b]
    return Shape(points, shape.triangles)
