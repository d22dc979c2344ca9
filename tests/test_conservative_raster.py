"""Conservative rasterisation against exact clipping in rational arithmetic, and against slow twins."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.kernels.conservative_raster import Face, empty_counts, empty_map, rasterize_conservatively
from shadowbench.kernels.light_maps import axes_along
from shadowbench.kernels.shadow_frustum import find_facing

SIDE = 9
SEEDS = st.integers(0, 10**6)
KINDS = st.sampled_from(["random", "grid", "needle", "small", "around the light"])
ALLOWED = 2.0**-10      # texels that rounding and margins may add


def make_face(perspective=True, half=0.5, axes=None, side=SIDE):
    """A face at the origin; by default its axes are the world's, so that rationals stay short."""
    right, up, forward = np.eye(3) if axes is None else axes
    unit = 2.0**-24
    return Face(right.copy(), up.copy(), forward.copy(), np.zeros(3), perspective, 2 * half / side, 0.5 * side, side,
                2.0**-45, unit, 2.0 * unit, 8.0)


def make_triangle(rng, kind):
    """One triangle, (1, 3, 3), with its depths around 2."""
    if kind == "grid":
        return rng.integers(-4, 5, (1, 3, 3)) / 4.0 + [0, 0, 2.0]
    size = {"small": 0.1, "around the light": 3.0}.get(kind, 1.0)
    corners = rng.normal(0, 0.5, (1, 1, 3)) + rng.normal(0, size, (1, 3, 3)) * [1, 1, 0.5]
    if kind == "needle":
        corners[0, 2] = corners[0, 0] + (corners[0, 1] - corners[0, 0]) * rng.random() + rng.normal(0, 1e-4, 3)
    if kind != "around the light":
        corners[..., 2] += 2.0 - min(corners[..., 2].min() - 0.2, 0)
    return corners


def draw(corners, face, discard, light=None, n_layers=1):
    light = np.array([0.0, 0, 0, 1.0] if face.perspective else [0, 0, -1.0, 0.0])
    sides = np.empty(len(corners), np.int8)
    find_facing(corners, light, sides)
    target, counts = empty_map(n_layers, face.side), empty_counts()
    rasterize_conservatively(corners, sides, np.zeros(3), face, 0, discard, target, counts)
    return target, counts, sides


def square(face, row, column, grown=0):
    """Exact u and v bounds of a texel."""
    texel, middle = Fraction(face.texel), Fraction(face.middle)
    return ((column - middle - grown) * texel, (column + 1 - middle + grown) * texel,
            (middle - row - 1 - grown) * texel, (middle - row + grown) * texel)


def exact_part(corners, face, bounds):
    """The exact part of a triangle that is seen in a rectangle of the map: (x, y, depth) as fractions."""
    u0, u1, v0, v1 = bounds
    polygon = [[Fraction(float(x)) for x in p] for p in corners]
    w = (lambda p: p[2]) if face.perspective else (lambda p: Fraction(1))
    inside = [lambda p: p[0] - u0 * w(p), lambda p: u1 * w(p) - p[0], lambda p: p[1] - v0 * w(p),
              lambda p: v1 * w(p) - p[1]]
    if face.perspective:
        inside.append(lambda p: p[2])
    for value in inside:
        kept = []
        for i, p in enumerate(polygon):
            q = polygon[i - 1]
            here, before = value(p), value(q)
            if here * before < 0:
                s = before / (before - here)
                kept.append([a + (b - a) * s for a, b in zip(q, p, strict=True)])
            if here >= 0:
                kept.append(p)
        polygon = kept
    return polygon


def distance_to_triangle(point, triangle):
    """Distance of a point from a triangle in the plane."""
    def cross(a, b):
        return a[0] * b[1] - a[1] * b[0]

    sides = [cross(triangle[(i + 1) % 3] - triangle[i], point - triangle[i]) for i in range(3)]
    if min(sides) >= 0 or max(sides) <= 0:
        return 0.0
    best = np.inf
    for i in range(3):
        a, b = triangle[i], triangle[(i + 1) % 3]
        s = np.clip(((point - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
        best = min(best, float(np.hypot(*(point - a - s * (b - a)))))
    return best


@pytest.mark.parametrize("discard", [True, False], ids=["discard", "polygon"])
@settings(deadline=None, max_examples=50)
@given(seed=SEEDS, kind=KINDS, perspective=st.booleans())
def test_every_touched_texel_holds_a_lower_bound_and_no_far_one_is_marked(discard, seed, kind, perspective):
    rng = np.random.default_rng(seed)
    corners, face = make_triangle(rng, kind), make_face(perspective)
    target, _, sides = draw(corners, face, discard)
    if sides[0] == 0:
        assert (target.triangle < 0).all()
        return
    in_front = perspective is False or corners[0, :, 2].min() > 0.01
    projected = corners[0, :, :2] / (corners[0, :, 2:] if perspective else 1.0)
    for row in range(SIDE):
        for column in range(SIDE):
            bounds = square(face, row, column)
            part = exact_part(corners[0], face, bounds)
            if part:
                assert target.triangle[0, row, column] == 0
                assert Fraction(float(target.depth[0, row, column])) <= min(p[2] for p in part)
            elif in_front and target.triangle[0, row, column] == 0:
                middle = np.array([float(bounds[0] + bounds[1]), float(bounds[2] + bounds[3])]) / 2
                if discard:
                    limit = 2**0.5 * face.texel * (1 + ALLOWED)
                    assert distance_to_triangle(middle, projected) <= limit
                else:
                    assert exact_part(corners[0], face, square(face, row, column, Fraction(ALLOWED)))
            if target.covered[0, row, column]:
                assert covers_exactly(corners[0], face, bounds)


def covers_exactly(corners, face, bounds):
    """True if the rays of all four corners of a rectangle meet the inside of a triangle."""
    p = [[Fraction(float(x)) for x in corner] for corner in corners]
    for u in bounds[:2]:
        for v in bounds[2:]:
            if face.perspective:
                values = [u * (a[1] * b[2] - a[2] * b[1]) + v * (a[2] * b[0] - a[0] * b[2]) + a[0] * b[1] - a[1] * b[0]
                          for a, b in ((p[0], p[1]), (p[1], p[2]), (p[2], p[0]))]
                a, b, c = p
                volume = (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2])
                          + a[2] * (b[0] * c[1] - b[1] * c[0]))
                values = [value * volume for value in values]
            else:
                values = [(b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])
                          for a, b in ((p[0], p[1]), (p[1], p[2]), (p[2], p[0]))]
                values = [value * sum(values) for value in values]
            if not all(value > 0 for value in values):
                return False
    return True


@pytest.mark.parametrize("discard", [True, False], ids=["discard", "polygon"])
def test_bounds_are_close_and_covered_texels_are_found(discard):
    """What holds of an empty map too would prove little: bounds are within a texel's depth, large triangles cover."""
    face = make_face(side=32)
    corners = np.array([[[-2.0, -2, 3], [2, -2, 4], [0, 3, 5]]])
    target, counts, _ = draw(corners, face, discard)
    covered = target.covered[0]
    assert 0.2 < covered.mean() < 0.9
    for row, column in zip(*np.nonzero(covered), strict=True):
        part = exact_part(corners[0], face, square(face, row, column))
        assert 0 <= float(min(p[2] for p in part)) - target.depth[0, row, column] < 1e-3
    marked = (target.triangle[0] >= 0).sum()
    assert marked == counts.fragments.sum() - counts.discarded.sum() == counts.written.sum()
    assert discard or counts.discarded.sum() == 0


@pytest.mark.parametrize("discard", [True, False], ids=["discard", "polygon"])
@settings(deadline=None, max_examples=40)
@given(seed=SEEDS, perspective=st.booleans())
def test_fragments_equal_the_twin(discard, seed, perspective):
    rng = np.random.default_rng(seed)
    corners, face = make_triangle(rng, "random"), make_face(perspective, side=24)
    _, counts, sides = draw(corners, face, discard)
    points = corners[0, :, :2] / (corners[0, :, 2:] if perspective else 1.0)
    edges = np.roll(points, -1, axis=0) - points
    area = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    normals = np.stack([-edges[:, 1], edges[:, 0]], axis=1) * np.sign(area) / np.hypot(*edges.T)[:, None]
    n_fragments = n_far = 0
    diagonal = 2**0.5 * face.texel
    for row in range(face.side):
        for column in range(face.side):
            u, v = (column + 0.5 - face.middle) * face.texel, (face.middle - row - 0.5) * face.texel
            inside = ((np.array([u, v]) - points) * normals).sum(axis=1)
            if discard:
                n_fragments += bool((inside >= -diagonal).all())
                n_far += bool((inside >= -diagonal).all()) and distance_to_triangle(np.array([u, v]), points) > diagonal
            else:
                reach = 0.5 * face.texel * np.abs(normals).sum(axis=1)
                apart = np.maximum(points.min(axis=0) - [u, v], [u, v] - points.max(axis=0)) > 0.5 * face.texel
                n_fragments += bool((inside >= -reach).all() and not apart.any())
    assert sides[0] != 0
    # Margins may add a texel that rounding puts on the border
    assert n_fragments <= counts.fragments.sum() <= n_fragments + 1
    assert abs(counts.discarded.sum() - n_far) <= 1


@pytest.mark.parametrize("discard", [True, False], ids=["discard", "polygon"])
def test_two_layers_hold_the_nearest_triangle_and_the_bound_of_the_others(discard):
    rng = np.random.default_rng(4)
    corners = np.concatenate([make_triangle(rng, "random") for _ in range(30)])
    corners[20:25] = corners[10:15]
    face = make_face(side=16, axes=axes_along(np.array([0.1, 0.2, 1.0])))
    target, counts, _ = draw(corners, face, discard)
    alone = [draw(corners[t:t + 1], face, discard) for t in range(len(corners))]
    depths = np.stack([single.depth[0] for single, _, _ in alone])
    order = np.argsort(depths, axis=0, kind="stable")
    nearest = np.take_along_axis(depths, order, axis=0)
    assert np.array_equal(target.depth[0], nearest[0]) and np.array_equal(target.next_depth[0], nearest[1])
    filled = np.isfinite(nearest[0])
    assert filled.any() and np.array_equal(target.triangle[0][filled], order[0][filled])
    covered = np.stack([single.covered[0] for single, _, _ in alone])
    assert np.array_equal(target.covered[0], np.take_along_axis(covered, order, axis=0)[0])
    assert counts.fragments.sum() == sum(c.fragments.sum() for _, c, _ in alone)
    running = np.minimum.accumulate(np.concatenate([np.full((1, 16, 16), np.inf), depths]), axis=0)
    assert counts.written.sum() == (depths < running[:-1]).sum()


def test_a_needle_grows_far_but_little_of_it_is_kept():
    """Sharp corners make the grown triangle reach far; the distance to its edges' lines would keep all of that."""
    corners = np.array([[[-0.4, -0.3, 2], [0.5, 0.1, 2], [0.5, 0.11, 2]]])
    _, counts, _ = draw(corners, make_face(side=64), True)
    assert counts.discarded.sum() > 0.2 * counts.fragments.sum()
