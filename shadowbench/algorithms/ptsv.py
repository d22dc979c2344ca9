"""Per-triangle shadow volumes: every triangle's shadow frustum is rasterised into a tree of screen tiles.

Sintorn, Olsson, Assarsson: "An Efficient Alias-free Shadow Algorithm for Opaque and Transparent Objects using
per-triangle Shadow Volumes", 2011. Algorithm 2 of the paper, as printed, accepts every tile that no plane rejects; the
text is right: a tile is accepted only if its accept corner is inside all planes.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Frame, Probe, ShadowBuffer, parameter
from shadowbench.algorithms.frustum_base import Casters, FrustumAlgorithm, FrustumParams
from shadowbench.algorithms.transparency import ClearCasters, Shaded, shadow_buffer
from shadowbench.kernels import shadow_frustum, transparency, transparent_tiles
from shadowbench.kernels.culling_planes import EYE_EDGES
from shadowbench.kernels.depth_hierarchy import TileTree, build_tile_tree
from shadowbench.kernels.shadow_hierarchy import (
    Counts,
    Shadow,
    empty_counts,
    empty_shadow,
    merge_shadow,
    tests_per_sample,
)
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
                "fruitless_refinements", "float64_sample_tests", "light_updates", "texture_lookups")
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
            clear = self.clear_casters(frame, casters)
        shadow = empty_shadow(tree)
        counts = empty_counts(tree, len(frusta.triangle), len(casters.first()) - 1) if probe.counting else None
        with probe.stage("traversal"):
            planes = Planes(EYE_EDGES[params.culling_planes] > 0,
                            "wedge" in params.culling_planes, params.skip_shadowed)
            traverse(tree, frusta, len(casters.single), planes, samples.depth, shadow, counts)
            if casters.groups is not None:
                traverse_groups(tree, frusta, casters.groups, planes, samples.depth, shadow, counts)
        through = None if clear is None else self._shade(frame, tree, clear, planes, shadow, probe)
        with probe.stage("merge"):
            merged = merge_shadow(tree, shadow)
            arriving = None if through is None else transparent_tiles.merge_through(tree, through.light, merged)
            if not params.remove_unlit:
                merged[~samples.candidate] = 0.0
        _record_memory(tree, frusta, through, probe)
        if counts is not None:
            _record_counts(tree, frusta, casters, counts, through, frame.mesh.n_triangles, probe)
        return shadow_buffer(merged, arriving, samples.candidate)

    def _shade(self, frame: Frame, tree: TileTree, clear: ClearCasters, planes: Planes, shadow: Shadow, probe: Probe
               ) -> Shaded:
        """Let the casters that let light through shade what the opaque ones have left."""
        counts = None
        if probe.counting:
            branching = int(tree.levels["grid_x"][0] * tree.levels["grid_y"][0])
            counts = transparency.empty_counts(len(tree.occupied), branching, len(clear.optics.triangle))
        with probe.stage("traversal"):
            light = transparency.all_light(len(tree.occupied), len(frame.samples.depth), clear.optics)
            transparent_tiles.traverse_transparent(tree, *clear, planes, frame.samples.depth, shadow, light, counts)
        return Shaded(clear, light, counts)


def _record_memory(tree: TileTree, frusta: shadow_frustum.Frusta, through: Shaded | None, probe: Probe) -> None:
    """Record the hierarchies as the paper counts them, in bits, and the plane rows as they are.

    The samples' own depths are the depth buffer, which is there anyway; the shadow hierarchy has a bit per sample, and
    both have an entry per tile that contains pixels. Casters that let light through need floats instead of bits.
    """
    n_tiles, n_samples = len(tree.occupied), len(tree.plane_x) * len(tree.plane_y)
    probe.memory("depth_hierarchy", DEPTH_BYTES_PER_TILE * n_tiles)
    probe.memory("shadow_hierarchy", -(-(n_tiles + n_samples) // 8))
    probe.memory("frustum_planes", frusta.rows.nbytes + frusta.exact_rows.nbytes)
    if through is not None and not through.clear.optics.by_chance:
        probe.memory("light_hierarchy", through.light.nodes.nbytes + through.light.samples.nbytes)


def _record_counts(tree: TileTree, frusta: shadow_frustum.Frusta, casters: Casters, counts: Counts, through: Shaded | None,
                   n_triangles: int, probe: Probe) -> None:
    """Report totals, levels, triangles and the heat map from the kernels' counts."""
    first, branching = tree.levels["first"], int(tree.levels["grid_x"][0] * tree.levels["grid_y"][0])
    clear = None if through is None else through.counts
    if clear is not None:
        counts.visits[:] += clear.visits

    def by_level(of_opaque: NDArray[np.int64], name: str) -> NDArray[np.int64]:
        """Add what the transparent casters' nodes counted."""
        return of_opaque if clear is None else of_opaque + np.add.reduceat(getattr(clear, name), first)

    tests = np.add.reduceat(counts.visits, first) * branching
    probe.count_levels("node_tests", tests[:-1])
    probe.count("sample_tests", tests[-1])
    probe.count_levels("group_tests", np.add.reduceat(counts.group_visits, first)[:-1] * branching)
    probe.count_levels("trivial_accepts", by_level(counts.accepts.sum(axis=0), "accepts")[:-1])
    probe.count_levels("trivial_rejects", by_level(counts.rejects.sum(axis=0), "rejects")[:-1])
    refinements = by_level(counts.refinements.sum(axis=0), "refinements")[:-1]
    probe.count_levels("refinements", refinements)
    probe.count_levels("fruitless_refinements", refinements - by_level(counts.fruitful.sum(axis=0), "fruitful")[:-1])
    probe.count("float64_sample_tests", counts.retries.sum() + (0 if clear is None else clear.retries.sum()))
    per_triangle = np.zeros(n_triangles, np.int64)
    at_root, n_single = int(tree.occupied[0] != 0), len(casters.single)
    per_frustum = counts.frustum_visits.sum(axis=0, dtype=np.int64)
    per_frustum[:n_single] += at_root
    per_triangle[frusta.triangle] = per_frustum * branching
    per_group = (counts.unit_visits.sum(axis=0, dtype=np.int64) + at_root) * branching
    add_to_triangles(per_triangle, casters.grouped, casters.first(), per_group)
    if clear is not None:
        per_triangle[casters.clear] = (clear.frustum_visits.sum(axis=0, dtype=np.int64) + at_root) * branching
        probe.count("light_updates", clear.updates.sum())
        probe.count("texture_lookups", clear.lookups.sum())
    probe.count_triangles("test_and_set", per_triangle)
    probe.count_samples(tests_per_sample(tree, counts.visits + counts.group_visits))
