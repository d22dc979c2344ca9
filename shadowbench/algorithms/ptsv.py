"""Per-triangle shadow volumes: every triangle's shadow frustum is rasterised into a tree of screen tiles.

Sintorn, Olsson, Assarsson: "An Efficient Alias-free Shadow Algorithm for Opaque and Transparent Objects using
per-triangle Shadow Volumes", 2011. Algorithm 2 of the paper, as printed, accepts every tile that no plane rejects; the
text is right: a tile is accepted only if its accept corner is inside all planes.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from shadowbench.algorithms.base import Frame, Probe, ShadowBuffer, parameter
from shadowbench.algorithms.frustum_base import Casters, FrustumAlgorithm, FrustumParams
from shadowbench.kernels import shadow_frustum
from shadowbench.kernels.culling_planes import EYE_EDGES
from shadowbench.kernels.depth_hierarchy import TileTree, build_tile_tree
from shadowbench.kernels.shadow_hierarchy import Counts, empty_counts, empty_shadow, merge_shadow, tests_per_sample
from shadowbench.kernels.tile_groups import FEWEST_LEVELS, traverse_groups
from shadowbench.kernels.tile_traversal import Planes, traverse
from shadowbench.kernels.unit_counts import add_to_triangles

DEPTH_BYTES_PER_TILE = 4
"""Modelled: a smallest and a largest depth of 16 bits. At 4096 x 4096 that is the 2.1 MB that the paper states."""


class Params(FrustumParams):
    """Parameters of `Ptsv`."""

    branching: Literal[4, 8, 16, 32, 64] = parameter(32, "children per tile of the depth hierarchy")
    culling_planes: Literal["none", "silhouette", "wedge", "outline", "outline+wedge"] = parameter(
        "silhouette", "planes beyond the frustum's own that tiles are tested against")


class Ptsv(FrustumAlgorithm):
    """Per-triangle shadow volumes. Exact on any triangle soup."""

    name = "ptsv"
    title = "Per-triangle shadow volumes"
    paper = "Sintorn et al. 2011"
    stages = ("hierarchy", "frustum_setup", "traversal", "merge")
    counters = ("node_tests", "sample_tests", "group_tests", "trivial_accepts", "trivial_rejects", "refinements",
                "fruitless_refinements", "float64_sample_tests")
    Params = Params

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        samples, params = frame.samples, self.params
        with probe.stage("hierarchy"):
            plane_x = np.ascontiguousarray(samples.plane_x[: samples.columns])
            plane_y = np.ascontiguousarray(samples.plane_y[:: samples.columns])
            tree, largest_r = build_tile_tree(samples.depth, self.included(frame), plane_x, plane_y, params.branching)
        with probe.stage("frustum_setup"):
            casters = self.find_casters(frame, (np.abs(plane_x).max(), np.abs(plane_y).max(), largest_r),
                                        may_group=len(tree.levels) >= FEWEST_LEVELS)
            frusta = self.frusta(frame, casters, np.concatenate([casters.single, casters.grouped]))
        shadow = empty_shadow(tree)
        counts = empty_counts(tree, len(frusta.triangle), len(casters.first()) - 1) if probe.counting else None
        with probe.stage("traversal"):
            planes = Planes(EYE_EDGES[params.culling_planes] > 0,
                            "wedge" in params.culling_planes, params.skip_shadowed)
            traverse(tree, frusta, len(casters.single), planes, samples.depth, shadow, counts)
            if casters.groups is not None:
                traverse_groups(tree, frusta, casters.groups, planes, samples.depth, shadow, counts)
        with probe.stage("merge"):
            merged = merge_shadow(tree, shadow)
            if not params.remove_unlit:
                merged[~samples.candidate] = 0.0
        _record_memory(tree, frusta, probe)
        if counts is not None:
            _record_counts(tree, frusta, casters, counts, frame.mesh.n_triangles, probe)
        return ShadowBuffer(merged)


def _record_memory(tree: TileTree, frusta: shadow_frustum.Frusta, probe: Probe) -> None:
    """Record the hierarchies as the paper counts them, in bits, and the plane rows as they are.

    The samples' own depths are the depth buffer, which is there anyway; the shadow hierarchy has a bit per sample, and
    both have an entry per tile that contains pixels.
    """
    n_tiles, n_samples = len(tree.occupied), len(tree.plane_x) * len(tree.plane_y)
    probe.memory("depth_hierarchy", DEPTH_BYTES_PER_TILE * n_tiles)
    probe.memory("shadow_hierarchy", -(-(n_tiles + n_samples) // 8))
    probe.memory("frustum_planes", frusta.rows.nbytes + frusta.exact_rows.nbytes)


def _record_counts(tree: TileTree, frusta: shadow_frustum.Frusta, casters: Casters, counts: Counts, n_triangles: int,
                   probe: Probe) -> None:
    """Report totals, levels, triangles and the heat map from the kernels' counts."""
    branching = int(tree.levels["grid_x"][0] * tree.levels["grid_y"][0])
    tests = np.add.reduceat(counts.visits, tree.levels["first"]) * branching
    probe.count_levels("node_tests", tests[:-1])
    probe.count("sample_tests", tests[-1])
    probe.count_levels("group_tests", np.add.reduceat(counts.group_visits, tree.levels["first"])[:-1] * branching)
    probe.count_levels("trivial_accepts", counts.accepts.sum(axis=0)[:-1])
    probe.count_levels("trivial_rejects", counts.rejects.sum(axis=0)[:-1])
    probe.count_levels("refinements", counts.refinements.sum(axis=0)[:-1])
    probe.count_levels("fruitless_refinements", (counts.refinements - counts.fruitful).sum(axis=0)[:-1])
    probe.count("float64_sample_tests", counts.retries.sum())
    per_triangle = np.zeros(n_triangles, np.int64)
    at_root, n_single = int(tree.occupied[0] != 0), len(casters.single)
    per_frustum = counts.frustum_visits.sum(axis=0, dtype=np.int64)
    per_frustum[:n_single] += at_root
    per_triangle[frusta.triangle] = per_frustum * branching
    per_group = (counts.unit_visits.sum(axis=0, dtype=np.int64) + at_root) * branching
    add_to_triangles(per_triangle, casters.grouped, casters.first(), per_group)
    probe.count_triangles("test_and_set", per_triangle)
    probe.count_samples(tests_per_sample(tree, counts.visits + counts.group_visits))
