"""The certified reference against the definition, word for word, on scenes that try to break it."""

import numpy as np
import pytest

from shadowbench.reference import bias_floor, certified, certified_shadows
from shadowbench.reference.exact import exact_facing, exact_flags
from tests import brute_force

KINDS = ("generic", "grid", "degenerate", "light_on_triangle", "slivers", "grazing", "small", "large",
         "translated", "tiny", "huge", "enormous")
SCALES = {"small": 1e-3, "large": 1e5, "tiny": 1e-160, "huge": 1e150, "enormous": 1e307}


def make_scene(kind, seed, n_triangles=8, n_samples=20):
    """Return corners, light, positions, bias and tie distances of a small scene."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    if kind in ("grid", "degenerate", "light_on_triangle"):
        def numbers(*shape):
            return rng.integers(-3, 4, shape).astype(np.float64)
    else:
        def numbers(*shape):
            return rng.uniform(-1.0, 1.0, shape)
    corners, positions = numbers(n_triangles, 3, 3), numbers(n_samples, 3)
    light = np.append(numbers(3), float(seed % 2))
    if not light[:3].any():
        light[1] = 1.0
    if kind == "light_on_triangle":
        a, b, c = corners[0]
        light = np.append((a, (a + b) / 2, (a + b + 2 * c) / 4)[seed % 3], 1.0)
    if kind == "degenerate":
        corners[1] = corners[0]
        corners[2, 2] = corners[2, 1]
        corners[3, 2] = 2 * corners[3, 1] - corners[3, 0]
        positions[:3] = corners[0]
        positions[3] = (corners[0, 0] + corners[0, 1]) / 2
        positions[4] = light[:3]
        positions[5:8] = 2 * corners[4] - light[:3]
        positions[8] = corners[4].sum(axis=0) - 2 * light[:3]
    if kind in ("slivers", "grazing"):
        corners[:, 2] = corners[:, 0] + rng.random((n_triangles, 1)) * (corners[:, 1] - corners[:, 0])
        corners[:, 2] += 1e-9 * numbers(n_triangles, 3)
    if kind == "grazing":
        # Samples a few roundings from the planes through the light and an edge.
        shadows = corners[:, 0] + 0.7 * (corners[:, 0] - light[:3] if light[3] else -light[:3])
        positions[:n_triangles] = shadows
        positions[n_triangles:2 * n_triangles] = np.nextafter(shadows, np.inf)
    scale = SCALES.get(kind, 1.0)
    corners, positions = corners * scale, positions * scale
    light[:3] *= scale
    if kind == "translated":
        corners, positions = corners + 1e5, positions + 1e5
        light[:3] += 1e5 * light[3]
    bias = (1e-5, 0.0, 0.2)[seed % 3] * scale
    ties = np.where(rng.random(n_samples) < 0.2, 0.0, 0.1 * rng.random(n_samples)) * scale
    return corners, light, positions, bias, ties


def flag_bits(flags):
    return [sum(int(flag) << k for k, flag in enumerate(sample)) for sample in flags]


def check_against_definition(corners, light, positions, bias, ties, casters=None):
    result = certified_shadows(corners, light, positions, bias, ties, casters)
    truth = brute_force.sample_flags(corners, light, positions, bias, ties, casters)
    assert result.flags.tolist() == flag_bits(truth)
    assert result.shadow.tolist() == [flags.shadowed for flags in truth]
    assert result.ambiguous.tolist() == [flags.ambiguous for flags in truth]
    return result


def all_pairs(corners, light, positions, bias, ties):
    """Flags of every sample from exact arithmetic on every pair, with no acceleration."""
    floor = min(bias_floor(corners, positions), bias)
    facing = exact_facing(corners, light)
    flags = np.zeros(len(positions), np.uint8)
    for t in np.flatnonzero(facing):
        repeated = np.full(len(positions), t)
        flags |= exact_flags(corners[repeated], facing[repeated], light, positions, ties,
                             np.array([floor, bias, 2 * bias]))
    return flags


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", KINDS)
def test_small_scenes_follow_the_definition(kind, seed):
    check_against_definition(*make_scene(kind, seed))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4, 21))
@pytest.mark.parametrize("kind", KINDS)
def test_many_small_scenes_follow_the_definition(kind, seed):
    check_against_definition(*make_scene(kind, seed, 10, 40))


def test_the_scenes_are_not_trivial():
    results = [certified_shadows(*make_scene(kind, seed)) for kind in KINDS for seed in range(4)]
    assert sum(result.shadow.sum() for result in results) > 50
    assert sum(result.ambiguous.sum() for result in results) > 50
    assert sum(result.statistics.exact_tests for result in results) > 50
    assert sum(result.statistics.exact_facings for result in results) > 5
    assert sum((~result.shadow & ~result.ambiguous).sum() for result in results) > 50


@pytest.mark.parametrize("light", [(0.1, 0.2, -0.1, 1), (3.0, 9.0, 2.0, 1), (0.3, 1.0, -0.4, 0),
                                   (-2.0, 0.1, 0.1, 0)])
def test_the_tree_agrees_with_all_pairs(light):
    rng = np.random.default_rng(11)
    sizes = rng.choice([0.02, 0.3, 2.0], (30, 1, 1))
    corners = rng.uniform(-2, 2, (30, 1, 3)) + rng.normal(size=(30, 3, 3)) * sizes
    positions = rng.uniform(-2, 2, (2500, 3))
    ties = rng.random(2500) * 0.01
    light = np.array(light, np.float64)
    result = certified_shadows(corners, light, positions, 0.01, ties)
    assert np.array_equal(result.flags, all_pairs(corners, light, positions, 0.01, ties))
    assert len(np.unique(result.flags)) > 4


def test_casters_leave_the_others_out():
    corners, light, positions, bias, ties = make_scene("grid", 3)
    casters = np.arange(len(corners)) % 2 == 0
    result = check_against_definition(corners, light, positions, bias, ties, casters)
    assert not np.array_equal(result.flags, certified_shadows(corners, light, positions, bias, ties).flags)


def axis_aligned_scene():
    """A floor of samples exactly in the planes of unit boxes, with bias 0: nearly all pairs are undecided."""
    grid = np.arange(-16, 16, 0.5)
    x, z = (a.ravel() for a in np.meshgrid(grid, grid))
    positions = np.stack([x, np.zeros_like(x), z], axis=1)
    quads = [np.array([[u, h, w], [u + 4, h, w], [u + 4, h, w + 4], [u, h, w + 4]], float)
             for u in (-8, -4, 0, 4) for w in (-8, -4, 0, 4) for h in (0, 2)]
    corners = np.array([quad[list(half)] for quad in quads for half in ((0, 1, 2), (0, 2, 3))])
    return corners, np.array([0.0, 4.0, 0.0, 1.0]), positions, 0.0, np.full(len(positions), 1e-6)


def test_exact_ties_in_bulk():
    corners, light, positions, bias, ties = axis_aligned_scene()
    result = certified_shadows(corners, light, positions, bias, ties)
    assert np.array_equal(result.flags, all_pairs(corners, light, positions, bias, ties))
    assert result.statistics.exact_tests > 100


def test_batches_and_full_pair_buffers_change_nothing(monkeypatch):
    scene = axis_aligned_scene()
    expected = certified_shadows(*scene)
    work_samples = certified.PAIR_CAPACITY // 2
    monkeypatch.setattr(certified, "PAIR_CAPACITY", work_samples)
    monkeypatch.setattr(certified, "LARGEST_BATCH", 7)
    assert np.array_equal(certified_shadows(*scene).flags, expected.flags)


@pytest.mark.parametrize("kind", ["generic", "grid", "degenerate", "slivers"])
def test_order_and_winding_do_not_matter(kind):
    corners, light, positions, bias, ties = make_scene(kind, 5, 30, 60)
    expected = certified_shadows(corners, light, positions, bias, ties).flags
    order = np.random.default_rng(1).permutation(len(corners))
    assert np.array_equal(certified_shadows(corners[order], light, positions, bias, ties).flags, expected)
    assert np.array_equal(certified_shadows(corners[:, ::-1], light, positions, bias, ties).flags, expected)
    turned = certified_shadows(corners, light, positions[::-1], bias, ties[::-1])
    assert np.array_equal(turned.flags, expected[::-1])


@pytest.mark.parametrize("factor", [2.0**-40, 2.0**70])
@pytest.mark.parametrize("seed", [2, 3])
def test_powers_of_two_scale_exactly(factor, seed):
    corners, light, positions, bias, ties = make_scene("grazing", seed, 30, 60)
    expected = certified_shadows(corners, light, positions, bias, ties).flags
    light_scaled = light * [factor, factor, factor, 1]
    scaled = certified_shadows(corners * factor, light_scaled, positions * factor, bias * factor,
                               ties * factor)
    assert np.array_equal(scaled.flags, expected)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_splitting_triangles_keeps_the_shadow(seed):
    corners, light, positions, bias, ties = make_scene("grid", seed, 20, 60)
    middle = (corners[:, 0] + corners[:, 1]) / 2
    halves = np.concatenate([np.stack([corners[:, 0], middle, corners[:, 2]], axis=1),
                             np.stack([middle, corners[:, 1], corners[:, 2]], axis=1)])
    whole = certified_shadows(corners, light, positions, bias, ties).shadow
    assert np.array_equal(certified_shadows(halves, light, positions, bias, ties).shadow, whole)
    assert whole.any() and not whole.all()


def test_adjacent_triangles_leave_no_crack():
    # Samples whose rays pass exactly through the shared edge of two triangles.
    corners = np.array([[[-1, 1, -1], [1, 1, 1], [-1, 1, 1]], [[-1, 1, -1], [1, 1, -1], [1, 1, 1]]], float)
    along = np.linspace(-1.5, 1.5, 301)
    positions = np.stack([along, np.zeros(301), along], axis=1)
    result = certified_shadows(corners, np.array([0.0, 2.0, 0.0, 1.0]), positions, 1e-5, np.full(301, 1e-6))
    assert result.shadow.all()
    # Each triangle on its own is a matter of the tie distance there, and so is their union.
    assert result.ambiguous.all()


@pytest.mark.parametrize("n_triangles, n_samples", [(0, 5), (5, 0), (0, 0)])
def test_nothing_to_do(n_triangles, n_samples):
    result = certified_shadows(np.ones((n_triangles, 3, 3)), np.array([0.0, 1.0, 0.0, 0.0]),
                               np.ones((n_samples, 3)), 0.1, np.ones(n_samples), counting=True)
    assert result.shadow.shape == result.ambiguous.shape == result.heat.shape == (n_samples,)
    assert not result.shadow.any() and not result.ambiguous.any()


def test_degenerate_casters_cast_nothing():
    corners = np.repeat(np.random.default_rng(0).normal(size=(50, 1, 3)), 3, axis=1)
    light = np.array([0.0, 9.0, 0.0, 1.0])
    result = certified_shadows(corners, light, np.zeros((20, 3)), 0.0, np.full(20, 100.0))
    assert not result.flags.any()


def test_samples_at_the_light_are_lit():
    corners = np.random.default_rng(0).normal(size=(50, 3, 3))
    light = np.array([0.1, 0.2, 0.3, 1.0])
    result = certified_shadows(corners, light, np.tile(light[:3], (20, 1)), 0.0, np.ones(20))
    assert not result.flags.any()


def test_a_sample_on_its_own_triangle_is_neither_shadowed_nor_ambiguous():
    rng = np.random.default_rng(4)
    corners = rng.normal(size=(1, 3, 3)) + 1e4
    weights = rng.dirichlet([1, 1, 1], 500)
    positions = (weights[:, :, None] * corners[0]).sum(axis=1)
    light = np.append(corners[0].mean(axis=0) + rng.normal(size=3), 1.0)
    result = certified_shadows(corners, light, positions, 1e-5, np.full(500, 1e-9))
    assert not result.shadow.any() and not result.ambiguous.any()


@pytest.mark.parametrize("change, message", [
    ({"corners": np.full((1, 3, 3), np.nan)}, "vertices must be finite"),
    ({"positions": np.full((2, 3), np.inf)}, "positions must be finite"),
    ({"light": np.array([0.0, 1.0, 0.0, 0.5])}, "w = 1"),
    ({"light": np.zeros(4)}, "direction"),
    ({"bias": -1.0}, "bias"),
    ({"bias": np.nan}, "bias"),
    ({"tie_distance": np.array([1.0, -1.0])}, "tie"),
    ({"tie_distance": np.ones(3)}, "tie"),
    ({"casters": np.ones(3, bool)}, "casters"),
])
def test_bad_input_is_refused(change, message):
    good = {"corners": np.ones((1, 3, 3)), "light": np.array([0.0, 1.0, 0.0, 1.0]),
            "positions": np.ones((2, 3)), "bias": 0.1, "tie_distance": np.ones(2)}
    with pytest.raises(ValueError, match=message):
        certified_shadows(**(good | change))
