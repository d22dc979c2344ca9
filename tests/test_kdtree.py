"""The kd-tree's construction, clipping and traversal against slow twins and against its invariant."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.algorithms.ray_traced import Params, RayTraced
from shadowbench.geometry import Frame, Light
from shadowbench.kernels.kdtree_build import LEAF, MAX_DEPTH, build_kdtree
from shadowbench.kernels.kdtree_clip import CLIP_MARGIN, GRID, MAX_CORNERS, clipped_bounds
from shadowbench.kernels.kdtree_traversal import empty_counts, trace
from shadowbench.kernels.shadow_rays import MARGIN, make_shadow_rays
from shadowbench.probe import Probe
from tests import kdtree_twin
from tests.hard_cases import HARD_CASES, Case, box, ground, mesh_of, soup

SEEDS = st.integers(0, 10**6)
KINDS = st.sampled_from(["random", "grid", "slivers"])


def leaves(tree):
    """Node and cell, float (6,), of every leaf, and the depth of the deepest."""
    stack, found, deepest = [(0, np.concatenate([np.zeros(3), tree.high]), 0)], [], 0
    while stack:
        node, cell, depth = stack.pop()
        deepest = max(deepest, depth)
        link = int(tree.nodes[2 * node + 1])
        if link & 3 == LEAF:
            found.append((node, cell))
            continue
        for child, side in ((node + 1, 3), (link >> 2, 0)):
            part = cell.copy()
            part[side + (link & 3)] = tree.planes[2 * node]
            stack.append((child, part, depth + 1))
    return found, deepest


def grid_corners(tree, mesh):
    return (mesh.corners - tree.base) * tree.scale


def exact_part(corners, cell):
    """Corners of the exact part of a triangle in a cell, as fractions."""
    polygon = [[Fraction(float(v)) for v in corner] for corner in corners]
    for axis in range(3):
        for limit, sign in ((cell[axis], -1), (cell[3 + axis], 1)):
            values = [sign * (p[axis] - Fraction(float(limit))) for p in polygon]
            kept = []
            for i, here in enumerate(values):
                before, previous = values[i - 1], polygon[i - 1]
                if here * before < 0:
                    s = before / (before - here)
                    kept.append([a + (b - a) * s for a, b in zip(previous, polygon[i], strict=True)])
                if here <= 0:
                    kept.append(polygon[i])
            polygon = kept
    return polygon


@settings(deadline=None, max_examples=60)
@given(SEEDS)
def test_clipped_bounds_hold_the_exact_part_and_little_more(seed):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0, GRID, (1, 3, 3)) if rng.random() < 0.5 else rng.integers(0, 40, (1, 3, 3)).astype(float)
    low = rng.integers(0, GRID if corners.max() > 40 else 40, 3)
    cell = np.concatenate([low, low + rng.integers(0, GRID // 2 if corners.max() > 40 else 20, 3)])
    bounds, scratch = np.empty(6, np.int64), np.empty((2, MAX_CORNERS + 1, 3))
    found = clipped_bounds(corners, 0, cell, scratch[0], scratch[1], bounds)
    part = exact_part(corners[0], cell)
    if part:
        assert found
        for axis in range(3):
            values = [p[axis] for p in part]
            assert bounds[axis] <= min(values) + CLIP_MARGIN and bounds[3 + axis] >= max(values) - CLIP_MARGIN
    if found:
        assert (bounds[:3] >= cell[:3]).all() and (bounds[3:] <= cell[3:]).all() and (bounds[:3] <= bounds[3:]).all()
        wide = exact_part(corners[0], np.concatenate([cell[:3] - 0.5, cell[3:] + 0.5]))
        for axis in range(3):
            values = [p[axis] for p in wide]
            assert bounds[axis] >= min(values) - 1 and bounds[3 + axis] <= max(values) + 1


@settings(deadline=None, max_examples=25)
@given(SEEDS, KINDS, st.integers(1, 14))
def test_tree_equals_the_twin(seed, kind, n):
    mesh = soup(seed, n, kind).mesh
    tree = build_kdtree(mesh.corners)
    corners = grid_corners(tree, mesh)
    pieces = [(t, [*np.floor(c.min(axis=0)).astype(int), *np.ceil(c.max(axis=0)).astype(int)])
              for t, c in enumerate(corners)]
    cell = [0, 0, 0, *tree.high.astype(int)]
    assert kdtree_twin.as_tuples(tree) == kdtree_twin.build(corners, pieces, cell)


@settings(deadline=None, max_examples=30)
@given(SEEDS, KINDS, st.sampled_from([(1.0, 0.0), (1e-3, 1e5), (1e5, 0.0)]))
def test_every_point_of_every_triangle_is_in_a_leaf_that_refers_to_it(seed, kind, place):
    mesh = mesh_of(soup(seed, 60, kind).mesh.corners * place[0] + place[1])
    tree = build_kdtree(mesh.corners)
    found, deepest = leaves(tree)
    assert deepest <= MAX_DEPTH
    rng, corners = np.random.default_rng(seed), grid_corners(tree, mesh)
    cells, nodes = np.array([cell for _, cell in found]), [node for node, _ in found]
    refers = np.zeros((len(found), mesh.n_triangles), bool)
    for k, node in enumerate(nodes):
        first, n = tree.nodes[2 * node], tree.nodes[2 * node + 1] >> 2
        refers[k, tree.references[first:first + n]] = True
        assert len(set(tree.references[first:first + n])) == n
    for t, triangle in enumerate(corners):
        weights = np.concatenate([rng.dirichlet([0.5] * 3, 20), np.eye(3)])
        points = weights @ triangle
        near = (points[:, None] >= cells[:, :3] - CLIP_MARGIN) & (points[:, None] <= cells[:, 3:] + CLIP_MARGIN)
        near = near.all(axis=2)
        assert (near & refers[:, t]).any(axis=1).all()


def test_empty_space_is_cut_off_and_flat_ground_gets_cells_without_height():
    quads = [ground(0.5) + [i, 0, k] for i in range(12) for k in range(12)]
    tree = build_kdtree(np.concatenate([*quads, box((2, 3, 2), (3, 4, 3))]))
    found, _ = leaves(tree)
    assert any(tree.nodes[2 * node + 1] >> 2 == 0 for node, _ in found)
    on_ground = [cell for node, cell in found
                 if (tree.references[tree.nodes[2 * node]:][:tree.nodes[2 * node + 1] >> 2] < 288).any()]
    assert on_ground and all(cell[4] == 0 for cell in on_ground)


def test_empty_and_degenerate_meshes():
    for corners in (np.zeros((0, 3, 3)), np.zeros((3, 3, 3)), np.ones((5, 3, 3)) * 1e5, ground()[[0] * 50]):
        tree = build_kdtree(corners)
        found, _ = leaves(tree)
        assert sorted({int(t) for t in tree.references}) == list(range(len(corners)))
        assert len(found) < 60


def frame_and_rays(case):
    frame = case.frame()
    tree = build_kdtree(frame.mesh.corners)
    rays = make_shadow_rays(frame.mesh.corners, frame.mesh.bounds(), frame.camera[:4], frame.light.xyzw(), frame.bias,
                            frame.samples)
    return Frame(*(getattr(frame, k) for k in ("mesh", "light", "camera", "image", "samples", "bias")), tree), rays


@pytest.mark.parametrize("kind", ["stack", "short_stack", "restart"])
@settings(deadline=None, max_examples=8)
@given(seed=SEEDS, soup_kind=KINDS)
def test_counts_equal_the_twin(kind, seed, soup_kind):
    case = soup(seed, 40, soup_kind)
    frame, rays = frame_and_rays(Case(case.mesh, case.camera, case.light, HARD_CASES["odd image"].image))
    probe = Probe(counting=True)
    shadow = RayTraced(Params(traversal=kind)).shadows(frame, probe).shadow
    traced = np.flatnonzero(frame.samples.candidate)
    some = traced[:: max(len(traced) // 120, 1)]
    twins = {i: kdtree_twin.Ray(frame.prepared, rays, i).run(kind) for i in some}
    assert [bool(shadow[i]) for i in some] == [twin.hit for twin in twins.values()]
    assert [probe.heat[i] for i in some] == [twin.tests for twin in twins.values()]
    if len(some) == len(traced):
        assert probe.counts["kd_nodes"] == sum(twin.nodes for twin in twins.values())
    assert probe.counts["rays_cast"] == len(traced)


@pytest.mark.parametrize("light", [Light.point(3.0, 8.0, 2.0), Light.directional(-0.4, -1.0, 0.3)])
def test_all_counts_of_a_small_frame_equal_the_twin(light):
    case = soup(3, 60)
    frame, rays = frame_and_rays(Case(case.mesh, case.camera, light, HARD_CASES["1x1 image"].image))
    frame, rays = frame_and_rays(Case(case.mesh, case.camera, light, type(case.image)(24, 18)))
    assert frame.samples.candidate.any()
    for kind in ("stack", "short_stack", "restart"):
        probe = Probe(counting=True)
        RayTraced(Params(traversal=kind)).shadows(frame, probe)
        twins = [kdtree_twin.Ray(frame.prepared, rays, i).run(kind) for i in np.flatnonzero(frame.samples.candidate)]
        assert probe.counts["kd_nodes"] == sum(twin.nodes for twin in twins)
        assert probe.counts["kd_leaves"] == sum(twin.leaves for twin in twins)
        assert probe.counts["triangle_tests"] == sum(twin.tests for twin in twins)


def n_cells_within(ray, cells, distance):
    """Cells that a ray passes within a distance (in the largest coordinate), between its ends."""
    low, high = cells[:, :3] - distance - ray.origin, cells[:, 3:] + distance - ray.origin
    ends = np.stack([low / ray.direction, high / ray.direction])
    return int((np.maximum(ends.min(axis=0).max(axis=1), 0.0) <= np.minimum(ends.max(axis=0).min(axis=1), ray.end)).sum())


def test_a_ray_visits_every_leaf_within_the_margin():
    """The light lies 1.2 grid units beside planes that the tree is split at, so that many cells are only just missed."""
    case = HARD_CASES["axis-aligned grid"]
    step = 1.2 / build_kdtree(case.mesh.corners).scale
    frame, rays = frame_and_rays(Case(case.mesh, case.camera, Light.point(step, 8.0, step)))
    cells = np.array([cell for _, cell in leaves(frame.prepared)[0]])
    counts, shadow = empty_counts(len(rays.depth)), np.zeros(len(rays.depth), np.float32)
    trace(frame.prepared, rays, frame.samples.candidate, None, "stack", frame.samples.columns, shadow, counts)
    just_missed = 0
    for i in np.flatnonzero(frame.samples.candidate & (shadow == 0)):
        ray = kdtree_twin.Ray(frame.prepared, rays, i)
        least = n_cells_within(ray, cells, MARGIN - 0.5)
        assert least <= counts.leaves[i] <= n_cells_within(ray, cells, MARGIN + 0.5)
        just_missed += least > n_cells_within(ray, cells, 0.0)
    assert MARGIN >= 2.0 and just_missed > 5
