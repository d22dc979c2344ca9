"""Closed bodies of very many small triangles with fur on them: the stand-in for FUZZY of Sintorn et al. 2014 (fig. 5).

Balls with bumps stand close together on a floor. Two thirds of the triangles are their skins, finely divided like a
scan; the rest is fur, closed thin spikes that stand on them.
"""

from __future__ import annotations

import math

import numpy as np

from shadowbench.geometry import Light, cross, dot
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, require_triangles, whole_degrees
from shadowbench.scenes.props import directions
from shadowbench.scenes.shapes import Shape, grid, subdivided_box
from shadowbench.trigonometry import cos_degrees, sin_degrees

MINIMUM = 1_000
"""Fewest triangles: bodies of 12 triangles each, and a few spikes."""

_SKIN = 0.66            # share of the triangles that the skins of the bodies take
_HALF = 8.0             # half the side of the floor
_CELLS = 8              # cells of the floor along a side
_SPIKE = 4              # triangles of a spike

_COLORS = {"floor": (0.42, 0.44, 0.4), "ochre": (0.62, 0.4, 0.16), "red": (0.5, 0.16, 0.1), "grey": (0.45, 0.45, 0.47)}

# Bodies: x, z, radius, material; each rests on the floor.
_BODIES = ((-1.9, 0.4, 1.5, "ochre"), (1.7, -0.5, 1.9, "grey"), (0.5, 2.6, 0.9, "red"), (-0.9, -3.1, 1.2, "red"),
           (4.2, 2.3, 1.1, "ochre"), (-4.3, -1.9, 1.0, "grey"))

_EYES = ((0.0, 3.0, 10.5), (6.0, 2.4, 8.5), (9.5, 4.0, 1.0), (6.0, 3.0, -8.0), (-4.0, 2.2, -8.5), (-9.0, 4.5, -1.0),
         (-5.5, 2.0, 6.0))
_TARGETS = ((0.0, 1.2, 0.0),) * 7


def _body(cells: int, radius: float, rng: np.random.Generator) -> Shape:
    """Closed ball of 12 cells^2 triangles with round bumps, standing on the origin."""
    cube = subdivided_box(cells)
    out = cube.vertices / np.sqrt(dot(cube.vertices, cube.vertices))[:, None]
    bumps = directions(rng, 12)
    swell = np.ones(len(out))
    for i in range(len(bumps)):
        near = np.clip((dot(out, bumps[i][None]) - 0.75) / 0.25, 0.0, 1.0)
        swell = swell + 0.14 * near * near
    return Shape(out * (radius * swell)[:, None] + np.array([0.0, radius, 0.0]), cube.triangles)


def _fur(rng: np.random.Generator, skin: Shape, n: int, length: float) -> Shape:
    """Closed spikes of four triangles that stand at `n` random places of a surface and lean a little."""
    corner = skin.vertices[skin.triangles[rng.integers(0, len(skin.triangles), n)]]
    weight = rng.uniform(0.1, 1.0, (n, 3, 1))
    weight = weight / (weight[:, :1] + weight[:, 1:2] + weight[:, 2:])
    root = corner[:, 0] * weight[:, 0] + corner[:, 1] * weight[:, 1] + corner[:, 2] * weight[:, 2]
    normal = cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = normal / np.sqrt(dot(normal, normal))[:, None]
    way = normal + 0.35 * directions(rng, n) - np.array([0.0, 0.15, 0.0])
    tip = root + way * (length * rng.uniform(0.7, 1.3, (n, 1)))
    u = cross(normal, np.roll(normal, 1, axis=1) + np.array([0.31, 0.17, 0.05]))
    u = u / np.sqrt(dot(u, u))[:, None]
    v = cross(normal, u)
    thick, sunk = 0.06 * length, root - 0.2 * length * normal
    feet = [sunk + thick * (cos_degrees(120.0 * i) * u + sin_degrees(120.0 * i) * v) for i in range(3)]
    points = np.stack([*feet, tip], axis=1)
    faces = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]])
    return Shape(points.reshape(-1, 3), (faces[None] + 4 * np.arange(n)[:, None, None]).reshape(-1, 3))


def _floor(n: int) -> Shape:
    """Level floor of 2 x `_CELLS`^2 triangles, of which the first is cut into n + 1."""
    ticks = np.linspace(-_HALF, _HALF, _CELLS + 1)
    x, z = (a.ravel() for a in np.meshgrid(ticks, ticks))
    vertices, triangles = np.stack([x, np.zeros(len(x)), z], axis=1), grid(_CELLS, _CELLS)
    a, b, c = triangles[0]
    between = vertices[b] + (vertices[c] - vertices[b]) * (np.arange(1, n + 1) / (n + 1))[:, None]
    chain = np.concatenate([[b], len(vertices) + np.arange(n), [c]])
    fan = np.stack([np.full(n + 1, a), chain[:-1], chain[1:]], axis=1)
    return Shape(np.concatenate([vertices, between]), np.concatenate([triangles[1:], fan]))


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the fuzzy bodies with exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("fuzzy", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    builder = MeshBuilder(_COLORS)
    area = sum(radius * radius for _, _, radius, _ in _BODIES)
    skins = []
    for x, z, radius, material in _BODIES:
        cells = max(1, int(math.sqrt(_SKIN * triangles * radius * radius / area / 12)))
        turned = _body(cells, radius, rng).turned_degrees(int(whole_degrees(rng, 1)[0]))
        skins.append((turned.moved(x, 0.0, z), radius, material))
        builder.add(skins[-1][0], material)
    n_spikes = (triangles - builder.n_triangles - 2 * _CELLS**2) // _SPIKE
    # Fur as long as is needed for about the same look at every count.
    for k, (skin, radius, material) in enumerate(skins):
        share = int(n_spikes * radius * radius / area) if k else n_spikes - sum(
            int(n_spikes * r * r / area) for _, r, _ in skins[1:])
        builder.add(_fur(rng, skin, share, 0.16 * radius), material)
    builder.add(_floor(triangles - builder.n_triangles - 2 * _CELLS**2), "floor")
    return ProceduralScene(builder.mesh(), _EYES, _TARGETS, closed=True, fov_y=45.0, near=0.1, far=60.0,
                           light=Light.point(-9.0, 9.0, 7.0))
