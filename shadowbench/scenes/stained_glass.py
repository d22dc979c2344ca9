"""The citadel with windows of coloured glass: the stand-in for Sintorn et al. 2011, Fig. 1c.

Two rows of pointed windows stand in the yard, without a building around them: mosaics of semi-transparent panes in iron
bars between stone piers. The light from the west throws their colours on the yard, and on each other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shadowbench.geometry import Light, Material, Mesh, Vector
from shadowbench.scenes import citadel
from shadowbench.scenes.hill import YARD
from shadowbench.scenes.procedural import (
    MeshBuilder,
    ProceduralScene,
    Site,
    require_triangles,
)
from shadowbench.scenes.shapes import Shape, arch, box, copies

GLASS_ALPHA = 0.2
"""Opacity of the panes: what passes is dyed by the pane's colour."""

_GLASS: dict[str, Vector] = {
    "ruby glass": (0.95, 0.05, 0.06), "cobalt glass": (0.06, 0.12, 0.95), "amber glass": (1.0, 0.62, 0.04),
    "emerald glass": (0.04, 0.75, 0.16), "violet glass": (0.55, 0.08, 0.75), "pale glass": (0.85, 0.95, 1.0)}
_COLORS: dict[str, Vector] = {"window stone": (0.55, 0.52, 0.46), "lead": (0.07, 0.07, 0.08), **_GLASS}

_OPENING, _SPRING, _DEPTH = 4.4, 5.6, 0.9       # of a window: width, height where the round begins, thickness of the wall
_COLUMNS, _ROWS = 8, 15                         # panes of a window
_WINDOWS = tuple((x, 4.0 + 6.4 * k) for x in (-2.0, 7.5) for k in range(5))


_EYES = ((27.0, 24.0, 31.0), (24.0, 20.0, 20.0), (18.0, 16.0, 9.0), (3.2, 15.0, 1.0), (2.8, 14.5, 16.0), (12.0, 21.0, 41.0))
_TARGETS = ((6.0, 13.5, 15.0), (5.0, 13.5, 15.0), (0.0, 14.5, 18.0), (3.0, 14.0, 20.0), (5.0, 14.0, 34.0), (4.0, 14.0, 18.0))


def _pane_colors(rng: np.random.Generator) -> np.ndarray:
    """Which glass each pane of a window has, int64 (rows, columns): rings of colour around a rose, and a border."""
    row, column = np.arange(_ROWS)[:, None], np.arange(_COLUMNS)[None]
    dx, dy = 2.0 * np.abs(column - 0.5 * (_COLUMNS - 1)), 2.0 * np.abs(row - 0.72 * (_ROWS - 1))
    ring = np.sqrt(dx * dx + dy * dy).astype(np.int64)
    first = int(rng.integers(0, 4))
    colors = (first + ring // 2) % 5
    border = (column == 0) | (column == _COLUMNS - 1) | (row == 0)
    colors = np.where(border, (first + 1 + row + column) % 2 * 2, colors)
    return np.where(rng.uniform(size=colors.shape) < 0.08, 5, colors)


def _window(site: Site, rng: np.random.Generator) -> None:
    """A window in the plane z = 0: panes, bars between them, and stone around."""
    width, height = _OPENING / _COLUMNS, (_SPRING + 0.5 * _OPENING) / _ROWS
    colors = _pane_colors(rng)
    pane = Shape(np.array([[0.0, 0.0, 0.0], [width, 0.0, 0.0], [width, height, 0.0], [0.0, height, 0.0]]),
                 np.array([[0, 1, 2], [0, 2, 3]]))
    row, column = np.divmod(np.arange(_ROWS * _COLUMNS), _COLUMNS)
    places = np.stack([column * width - 0.5 * _OPENING, row * height, np.zeros(len(row))], axis=1)
    # Panes above the round lie in the stone
    x, y = np.abs(places[:, 0] + 0.5 * width), places[:, 1] - _SPRING
    inside = (y < 0.0) | (x * x + y * y < 0.25 * _OPENING * _OPENING)
    for index, name in enumerate(_GLASS):
        chosen = inside & (colors.reshape(-1) == index)
        if chosen.any():
            site.add(copies(pane, places[chosen]), name)
    top = _SPRING + 0.5 * _OPENING
    for k in range(1, _COLUMNS):
        x0 = k * width - 0.5 * _OPENING
        site.add(box((x0 - 0.03, 0.0, -0.05), (x0 + 0.03, top, 0.05)), "lead")
    for k in range(1, _ROWS):
        site.add(box((-0.5 * _OPENING, k * height - 0.03, -0.05), (0.5 * _OPENING, k * height + 0.03, 0.05)), "lead")
    site.add(arch(_OPENING, _SPRING, 6.4, 9.2, _DEPTH, 16), "window stone")
    site.add(box((-3.2, -1.0, -0.5 * _DEPTH), (3.2, 0.0, 0.5 * _DEPTH), ("-y",)), "window stone")


def _windows(seed: int) -> MeshBuilder:
    """All windows, facing west."""
    rng, builder = np.random.default_rng([seed, 7]), MeshBuilder(_COLORS)
    for x, z in _WINDOWS:
        _window(Site.at(builder, x, YARD + 0.5, z, 90), rng)
    return builder


def n_window_triangles() -> int:
    """How many triangles the windows have."""
    return _windows(1).n_triangles


def _joined(first: Mesh, second: Mesh) -> Mesh:
    """Two meshes as one, with glass in place of the glass's opaque stand-ins."""
    glass = tuple(Material(m.name, m.color, GLASS_ALPHA if m.name in _GLASS else 1.0) for m in second.materials)
    return replace(first, vertices=np.concatenate([first.vertices, second.vertices]),
                   triangles=np.concatenate([first.triangles, second.triangles + np.int32(len(first.vertices))]),
                   part=np.concatenate([first.part, second.part + first.part.max() + 1]).astype(np.int32),
                   material=np.concatenate([first.material, second.material + len(first.materials)]).astype(np.int32),
                   materials=(*first.materials, *glass))


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the citadel with its windows, exactly `triangles` triangles.

    Raises
    ------
    InputError
        If `triangles` is too low for the windows and the citadel's minimum.
    """
    windows = _windows(seed)
    require_triangles("stained_glass", triangles, citadel.MINIMUM + windows.n_triangles)
    town = citadel.generate(triangles - windows.n_triangles, seed)
    return ProceduralScene(_joined(town.mesh, windows.mesh()), _EYES, _TARGETS, closed=True, fov_y=60.0, near=0.1, far=500.0,
                           light=Light.point(-120.0, 85.0, 24.0))
