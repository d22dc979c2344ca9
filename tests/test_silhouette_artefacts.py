"""Silhouette maps on minimal scenes: each artefact of Sen et al. (2003), Fig. 7, what has none, and the pictures."""

import numpy as np
import pytest

from shadowbench.algorithms.base import Frame
from shadowbench.geometry import ImageSize, Light, ViewSamples
from tests.hard_cases import HARD_CASES, mesh_of
from tests.test_silhouette_map import run, scene_frame

RESOLUTION, PER_TEXEL = 12, 20


def floor_frame(*parts):
    """A floor of 12 x 12 texels of side 1, centres at half integers, lit from straight above; casters hang over it."""
    ticks = (np.arange(RESOLUTION * PER_TEXEL) + 0.5) / PER_TEXEL
    x, z = (a.ravel() for a in np.meshgrid(ticks, ticks))
    # The outermost samples stretch the map to the whole floor
    x, z = np.concatenate([x, [0, RESOLUTION]]), np.concatenate([z, [0, RESOLUTION]])
    n = len(x)
    position, normal = np.stack([x, np.zeros(n), z], axis=1), np.tile([0.0, 1.0, 0.0], (n, 1))
    samples = ViewSamples(1, n, position, normal, np.ones(n), np.zeros(n, np.int32), np.ones(n, bool), x, z)
    mesh = mesh_of(*[np.reshape(p, (-1, 3, 3)) for p in parts])
    template = HARD_CASES["empty mesh"].frame()
    return Frame(mesh, Light.directional(0, -1, 0), template.camera, ImageSize(n, 1), samples, 1e-6)


def polygon(points, y):
    """Fan of a convex polygon at height y."""
    p = [(x, y, z) for x, z in points]
    return [[p[0], p[i], p[i + 1]] for i in range(1, len(p) - 1)]


def inside(points, x, z):
    """Samples strictly inside a convex polygon."""
    turns = []
    for (ax, az), (bx, bz) in zip(points, [*points[1:], points[0]], strict=True):
        turns.append((bx - ax) * (z - az) - (bz - az) * (x - ax))
    return np.all(np.array(turns) > 0, axis=0) | np.all(np.array(turns) < 0, axis=0)


def artefact(*shapes, **params):
    """Places of the wrong samples under polygons at falling heights, each at least 1e-4 from all polygons' sides."""
    frame = floor_frame(*[polygon(p, 5.0 - i) for i, p in enumerate(shapes)])
    x, z = frame.samples.position[:, 0], frame.samples.position[:, 2]
    truth = np.any([inside(p, x, z) for p in shapes], axis=0)
    shadow = run(frame, resolution=RESOLUTION, **params)[0].shadow > 0
    clear = np.ones(len(x), bool)
    for points in shapes:
        for (ax, az), (bx, bz) in zip(points, [*points[1:], points[0]], strict=True):
            distance = np.abs((bx - ax) * (z - az) - (bz - az) * (x - ax)) / np.hypot(bx - ax, bz - az)
            clear &= distance > 1e-4
    wrong = (shadow != truth) & clear
    return x[wrong], z[wrong], truth[wrong]


def test_a_single_polygon_is_nearly_exact():
    """What the artefacts below are measured against: straight edges are exact, and so are corners along the texels."""
    assert len(artefact([(2.2, 2.2), (9.7, 2.2), (9.7, 8.1), (2.2, 8.1)])[0]) == 0
    for shape in ([(2.3, 1.2), (9.6, 4.1), (8.8, 6.3), (1.5, 3.4)], [(2.2, 9.3), (6.1, 1.9), (10.3, 8.8)]):
        x, z, _ = artefact(shape)
        distance = np.abs(np.stack([x, z], axis=1)[:, None] - np.array(shape)).max(axis=2)
        assert np.all(distance.min(axis=1) < 2.0) and len(x) < 0.01 * (RESOLUTION * PER_TEXEL) ** 2


@pytest.mark.parametrize("order", ["nearest", "index"])
def test_artefact_of_crossing_edges(order):
    """Fig. 7 left: where two silhouettes cross, only one point is left, so the crossing is cut or rounded."""
    upright, level = [(4.2, 1.2), (7.3, 1.2), (7.3, 10.6), (4.2, 10.6)], [(1.3, 4.2), (10.7, 4.2), (10.7, 7.3), (1.3, 7.3)]
    x, z, _ = artefact(upright, level, order=order)
    assert len(x) > 10
    crossings = np.array([(a, b) for a in (4.2, 7.3) for b in (4.2, 7.3)])
    distance = np.abs(np.stack([x, z], axis=1)[:, None] - crossings).max(axis=2)
    assert distance.min(axis=1).max() < 1.5 and len(set(distance.argmin(axis=1))) == 4
    for alone in (upright, level):
        assert len(artefact(alone, order=order)[0]) == 0


@pytest.mark.parametrize(("order", "strip"), [("nearest", (6.7, 7.15)), ("index", (2.6, 2.8))])
def test_artefact_of_parallel_edges(order, strip):
    """Fig. 7 middle: two silhouettes side by side in the same texels: the shadow's edge follows the wrong one.

    The upper rectangle reaches farther to the left, the lower one to the right. Drawn last are the upper one's edges, or
    those with larger coordinates.
    """
    upper, lower = [(2.6, 1.6), (6.7, 1.6), (6.7, 10.4), (2.6, 10.4)], [(2.8, 2.2), (7.15, 2.2), (7.15, 9.7), (2.8, 9.7)]
    x, z, truth = artefact(upper, lower, order=order)
    between = (x > strip[0]) & (x < strip[1]) & (z > 3.5) & (z < 8.5)
    assert truth[between].all() and between.sum() > 0.9 * (strip[1] - strip[0]) * 5 * PER_TEXEL**2
    # A texel farther apart, both are right
    apart = [(px + (0.7 if px > 5 else 0.9), pz) for px, pz in lower]
    x, z, _ = artefact(upper, apart, order=order)
    assert not np.any((z > 3.5) & (z < 8.5))


def test_artefact_of_a_lost_corner():
    """Fig. 7 right: a corner that reaches between depth samples is lost, and with it the shadow up to its tip."""
    x, _, truth = artefact([(1.2, 4.75), (1.2, 7.25), (9.4, 6.02)])
    lost = truth & (x > 5.5)
    assert lost.sum() > 50 and lost.sum() > 0.9 * len(x) and np.all(x > 4.0)


def test_pictures():
    frame = scene_frame("strike", 96)
    images = run(frame, resolution=32)[0].images
    assert set(images) == {"silhouette_points", "warped_grid"}
    for picture in images.values():
        assert picture.shape == (96, 96, 3) and picture.dtype == np.uint8
    red = np.all(images["silhouette_points"] == (215, 25, 28), axis=2)
    assert 20 < red.sum() < 0.1 * red.size
    assert not red.reshape(-1)[~frame.samples.candidate].any()
    # Without silhouettes the grid is a checkerboard of straight lines
    flat = floor_frame(polygon([(0, 0), (12, 0), (12, 12), (0, 12)], 0.0))
    tinted = run(flat, resolution=RESOLUTION)[0].images["warped_grid"].reshape(-1, 3)[:-2]
    board = np.any(tinted != tinted[0], axis=1).reshape(RESOLUTION * PER_TEXEL, -1)[::PER_TEXEL, ::PER_TEXEL]
    assert np.array_equal(board, np.indices(board.shape).sum(axis=0) % 2 == 1)
