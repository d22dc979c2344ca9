"""A tree whose leaves are alpha-textured quads: the stand-in for Sintorn et al. 2011, Figs. 1b and 8.

Sprigs of leaves are drawn on squares of two triangles each, as games do: most of a square is clear. Trunk and branches are
opaque cones. The tree stands on a lawn in a low evening sun; the path walks once around it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import FloatArray, Light, Mesh, Texture, cross, dot
from shadowbench.scenes.procedural import (
    MeshBuilder,
    ProceduralScene,
    SmoothNoise,
    require_triangles,
    whole_degrees,
)
from shadowbench.scenes.props import Limbs, blades, branches, directions, trunk, tubes
from shadowbench.scenes.shapes import Shape, grid, unit_circle

MINIMUM = 12_000
"""Fewest triangles: trunk, branches, lawn and three sprigs per twig."""

LEAF_ALPHA = 0.5
"""Opacity of a leaf's substance, as in the paper's Fig. 8: what passes is dyed by the leaf's colour."""

_TEXELS = 128
_HALF = 24.0        # half the side of the lawn
_COLORS = {"lawn": (0.30, 0.36, 0.15), "bark": (0.30, 0.22, 0.15), "leaf": (0.9, 0.9, 0.9), "grass": (0.25, 0.38, 0.12)}
_LEAF_COLOR, _LATE_COLOR = np.array([0.20, 0.52, 0.06]), np.array([0.50, 0.58, 0.08])

# Leaves of a sprig: where each begins on the stem, in which direction it points (x, y), and its length.
_SPRIG = (((0.50, 0.10), (-0.80, 0.35), 0.36), ((0.50, 0.16), (0.85, 0.30), 0.36), ((0.50, 0.34), (-0.75, 0.62), 0.37),
          ((0.50, 0.38), (0.78, 0.55), 0.36), ((0.50, 0.55), (-0.50, 0.80), 0.36), ((0.50, 0.58), (0.55, 0.75), 0.35),
          ((0.50, 0.60), (0.02, 1.0), 0.36))


def leaf_texture() -> Texture:
    """Draw a sprig of seven leaves, soft at the edges; float32 (128, 128, 4) in steps of 1 / 255."""
    place = (np.arange(_TEXELS) + 0.5) / _TEXELS
    x, y = np.broadcast_to(place, (_TEXELS, _TEXELS)), np.broadcast_to(1.0 - place[:, None], (_TEXELS, _TEXELS))
    opacity, color = np.zeros((_TEXELS, _TEXELS)), np.broadcast_to(_LEAF_COLOR, (_TEXELS, _TEXELS, 3)).copy()
    stem = np.minimum((0.011 - np.abs(x - 0.5)) * _TEXELS + 0.5, (0.66 - y) * _TEXELS)
    opacity = np.clip(stem, 0.0, 1.0)
    for number, ((x0, y0), (dx, dy), length) in enumerate(_SPRIG):
        scale = 1.0 / (length * np.sqrt(dx * dx + dy * dy))
        along = ((x - x0) * dx + (y - y0) * dy) * scale
        across = ((x - x0) * dy - (y - y0) * dx) * scale
        # Widest at a third of its length, pointed at the end
        inside = np.clip(along, 0.0, 1.0)
        width = 1.55 * inside * (1.0 - inside) * (1.0 - 0.55 * inside)
        leaf = np.clip((width - np.abs(across)) * length * _TEXELS + 0.5, 0.0, 1.0) * ((along > 0.0) & (along < 1.0))
        vein = np.clip(1.0 - np.abs(np.abs(across) - 0.0) * 30.0, 0.0, 1.0)
        tint = _LEAF_COLOR + (_LATE_COLOR - _LEAF_COLOR) * (0.15 * (number % 3) + 0.5 * vein[..., None])
        over = leaf > opacity
        color[over] = tint[over]
        opacity = np.maximum(opacity, leaf)
    pixels = np.concatenate([color, opacity[..., None]], axis=2)
    return Texture("alpha_tree leaf", (np.rint(pixels * 255.0) / 255.0).astype(np.float32), ("clamp", "clamp"))


def _lawn(seed: int) -> Shape:
    """Slightly uneven ground."""
    noise, n = SmoothNoise(np.random.default_rng([seed, 1]), 7.0), 24
    ticks = np.linspace(-_HALF, _HALF, n + 1)
    x, z = (a.ravel() for a in np.meshgrid(ticks, ticks))
    return Shape(np.stack([x, _height(noise, x, z), z], axis=1), grid(n, n))


def _height(noise: SmoothNoise, x: FloatArray, z: FloatArray) -> FloatArray:
    """Height of the lawn, which is even where the tree stands."""
    far = np.minimum((x * x + z * z) / 60.0, 1.0)
    return np.asarray(0.28 * noise(x, z) * far)


def _limbs(builder: MeshBuilder, rng: np.random.Generator) -> Limbs:
    """Trunk, boughs, branches and twigs; returns the twigs."""
    stem = trunk((0.0, -0.3, 0.0), 3.4, 0.34)
    upper = Limbs(stem.end, stem.end + np.array([0.15, 1.9, -0.1]), stem.end_radius, 0.55 * stem.end_radius)
    boughs = branches(rng, Limbs(*(np.concatenate(pair) for pair in zip(stem, upper, strict=True))), 9, 3.6)
    boughs = Limbs(boughs.start, np.maximum(boughs.end, boughs.start + np.array([-9.0, 0.35, -9.0])),
                   boughs.start_radius, boughs.end_radius)
    mid = branches(rng, boughs, 6, 2.1)
    twigs = branches(rng, mid, 5, 1.1)
    builder.add(tubes(stem, 14), "bark")
    builder.add(tubes(upper, 10), "bark")
    builder.add(tubes(boughs, 8), "bark")
    builder.add(tubes(mid, 5), "bark")
    builder.add(tubes(twigs, 3), "bark")
    return twigs


def _sprigs(rng: np.random.Generator, twigs: Limbs, n: int) -> Shape:
    """`n` squares that start on the outer halves of the twigs and point outwards, at random about their stems."""
    which = rng.integers(0, len(twigs.start), n)
    t = rng.uniform(0.25, 1.0, (n, 1))
    foot = twigs.start[which] * (1.0 - t) + twigs.end[which] * t
    along = twigs.end[which] - twigs.start[which]
    along = along / np.sqrt(dot(along, along))[:, None] + 0.8 * directions(rng, n) + np.array([0.0, -0.12, 0.0])
    along = along / np.sqrt(np.maximum(dot(along, along), 0.01))[:, None]
    side = cross(along, directions(rng, n))
    side = side / np.sqrt(np.maximum(dot(side, side), 1e-6))[:, None]
    size = rng.uniform(0.24, 0.38, (n, 1))
    a, b = foot - 0.5 * size * side, foot + 0.5 * size * side
    points = np.stack([a, b, b + size * along, a + size * along], axis=1)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])[None] + 4 * np.arange(n)[:, None, None]
    return Shape(points.reshape(-1, 3), triangles.reshape(-1, 3))


def _textured(mesh: Mesh) -> Mesh:
    """Put the texture on the sprigs, whose two triangles follow each other."""
    leaf = [m.name for m in mesh.materials].index("leaf")
    texture = leaf_texture()
    surfaces = tuple(replace(m, alpha=LEAF_ALPHA, alpha_texture=texture, color_texture=texture) if i == leaf else m
                     for i, m in enumerate(mesh.materials))
    of_leaves: NDArray[np.bool_] = mesh.material == leaf
    corners = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
    uv = np.zeros((mesh.n_triangles, 3, 2))
    uv[of_leaves] = np.tile(corners, (int(np.count_nonzero(of_leaves)) // 2, 1, 1))
    return replace(mesh, materials=surfaces, uv=uv)


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the tree with exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("alpha_tree", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    builder = MeshBuilder(_COLORS)
    builder.add(_lawn(seed), "lawn")
    twigs = _limbs(builder, rng)
    n_grass = (triangles - builder.n_triangles) // 8
    n_sprigs = (triangles - builder.n_triangles - n_grass) // 2
    builder.add(_sprigs(rng, twigs, n_sprigs), "leaf")
    n_grass = triangles - builder.n_triangles
    circle = unit_circle(360)[whole_degrees(rng, n_grass)]
    roots = 15.0 * np.sqrt(rng.uniform(0.004, 1.0, (n_grass, 1))) * circle
    noise = SmoothNoise(np.random.default_rng([seed, 1]), 7.0)
    y = _height(noise, roots[:, 0], roots[:, 1]) - 0.02
    builder.add(blades(rng, np.stack([roots[:, 0], y, roots[:, 1]], axis=1), 0.22), "grass")
    eyes = tuple((17.0 * x, 6.5, 17.0 * z) for x, z in unit_circle(8)[[1, 2, 3, 4, 5, 6, 7, 0]].tolist())
    targets = ((1.5, 3.2, 0.2),) * 8
    return ProceduralScene(_textured(builder.mesh()), eyes, targets, closed=True, fov_y=50.0, near=0.1, far=200.0,
                           light=Light.point(-40.0, 42.0, -8.0))
