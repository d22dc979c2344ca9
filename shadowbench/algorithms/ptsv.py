"""Per-triangle shadow volumes: every triangle's shadow frustum is rasterised into a tree of screen tiles.

Sintorn, Olsson, Assarsson: "An Efficient Alias-free Shadow Algorithm for Opaque and Transparent Objects using
per-triangle Shadow Volumes", 2011. Algorithm 2 of the paper, as printed, accepts every tile that no plane rejects; the
text is right: a tile is accepted only if its accept corner is inside all planes.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import (
    Algorithm,
    AlgorithmParams,
    Frame,
    Mesh,
    Probe,
    ShadowBuffer,
    parameter,
)
from shadowbench.kernels import shadow_frustum
from shadowbench.kernels.caster_selection import closed_triangles, select_casters
from shadowbench.kernels.culling_planes import EYE_EDGES
from shadowbench.kernels.depth_hierarchy import TileTree, build_tile_tree
from shadowbench.kernels.shadow_hierarchy import Counts, empty_counts, empty_shadow, merge_shadow, tests_per_sample
from shadowbench.kernels.tile_traversal import Planes, traverse

DEPTH_BYTES_PER_TILE = 4
"""Modelled: a smallest and a largest depth of 16 bits. At 4096 x 4096 that is the 2.1 MB that the paper states."""


class Params(AlgorithmParams):
    """Parameters of `Ptsv`."""

    branching: Literal[4, 8, 16, 32, 64] = parameter(32, "children per tile of the depth hierarchy")
    culling_planes: Literal["none", "silhouette", "wedge", "outline", "outline+wedge"] = parameter(
        "silhouette", "planes beyond the frustum's own that tiles are tested against")
    casters: Literal["all", "back_faces", "auto"] = parameter(
        "all", "triangles that cast: all, those facing away from the light, or the latter on closed bodies only")
    remove_unlit: bool = parameter(True, "leave samples that are no lit candidates out of the hierarchy")
    skip_shadowed: bool = parameter(True, "stop at tiles and samples that are already in shadow")


class Ptsv(Algorithm):
    """Per-triangle shadow volumes. Exact on any triangle soup."""

    name = "ptsv"
    title = "Per-triangle shadow volumes"
    paper = "Sintorn et al. 2011"
    exact = True
    stages = ("hierarchy", "frustum_setup", "traversal", "merge")
    counters = ("node_tests", "sample_tests", "trivial_accepts", "trivial_rejects", "refinements",
                "fruitless_refinements", "float64_sample_tests")
    Params = Params

    def prepare(self, mesh: Mesh) -> NDArray[np.bool_] | None:
        """Find the closed bodies, if the choice of casters depends on them."""
        return closed_triangles(mesh.corners) if self.params.casters == "auto" else None

    def casters(self, frame: Frame) -> NDArray[np.bool_] | None:
        """Tell which triangles cast."""
        if self.params.casters == "all":
            return None
        return select_casters(self.params.casters, _sides(frame), self._closed(frame))

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        samples, params = frame.samples, self.params
        included = samples.candidate if params.remove_unlit else np.ones_like(samples.candidate)
        with probe.stage("hierarchy"):
            plane_x = np.ascontiguousarray(samples.plane_x[: samples.columns])
            plane_y = np.ascontiguousarray(samples.plane_y[:: samples.columns])
            tree, largest_r = build_tile_tree(samples.depth, included, plane_x, plane_y, params.branching)
        with probe.stage("frustum_setup"):
            sides = _sides(frame)
            casters = select_casters(params.casters, sides, self._closed(frame))
            reach = np.array([np.abs(plane_x).max(), np.abs(plane_y).max(), largest_r])
            view = shadow_frustum.View(*frame.camera[:4], frame.light.xyzw(), frame.bias, reach)
            triangles = shadow_frustum.casting_triangles(sides, casters)
            frusta = shadow_frustum.make_frusta(frame.mesh.corners, sides, triangles, view,
                                                EYE_EDGES[params.culling_planes], "wedge" in params.culling_planes)
        shadow = empty_shadow(tree)
        counts = empty_counts(tree, len(frusta.triangle)) if probe.counting else None
        with probe.stage("traversal"):
            planes = Planes(EYE_EDGES[params.culling_planes] > 0,
                            "wedge" in params.culling_planes, params.skip_shadowed)
            traverse(tree, frusta, planes, samples.depth, shadow, counts)
        with probe.stage("merge"):
            merged = merge_shadow(tree, shadow)
            if not params.remove_unlit:
                merged[~samples.candidate] = 0.0
        _record_memory(tree, frusta, probe)
        if counts is not None:
            _record_counts(tree, frusta, counts, frame.mesh.n_triangles, probe)
        return ShadowBuffer(merged)

    def _closed(self, frame: Frame) -> Any:
        """What `prepare` found, computed here if the frame does not bring it."""
        if self.params.casters == "auto" and frame.prepared is None:
            return self.prepare(frame.mesh)
        return frame.prepared


def _sides(frame: Frame) -> NDArray[np.int8]:
    """Which side of each triangle the light sees, int8 (n_triangles,)."""
    sides = np.empty(frame.mesh.n_triangles, np.int8)
    shadow_frustum.find_facing(frame.mesh.corners, frame.light.xyzw(), sides)
    return sides


def _record_memory(tree: TileTree, frusta: shadow_frustum.Frusta, probe: Probe) -> None:
    """Record the hierarchies as the paper counts them, in bits, and the plane rows as they are.

    The samples' own depths are the depth buffer, which is there anyway; the shadow hierarchy has a bit per sample, and
    both have an entry per tile that contains pixels.
    """
    n_tiles, n_samples = len(tree.occupied), len(tree.plane_x) * len(tree.plane_y)
    probe.memory("depth_hierarchy", DEPTH_BYTES_PER_TILE * n_tiles)
    probe.memory("shadow_hierarchy", -(-(n_tiles + n_samples) // 8))
    probe.memory("frustum_planes", frusta.rows.nbytes + frusta.exact_rows.nbytes)


def _record_counts(tree: TileTree, frusta: shadow_frustum.Frusta, counts: Counts, n_triangles: int,
                   probe: Probe) -> None:
    """Report totals, levels, triangles and the heat map from the kernels' counts."""
    branching = int(tree.levels["grid_x"][0] * tree.levels["grid_y"][0])
    tests = np.add.reduceat(counts.visits, tree.levels["first"]) * branching
    probe.count_levels("node_tests", tests[:-1])
    probe.count("sample_tests", tests[-1])
    probe.count_levels("trivial_accepts", counts.accepts.sum(axis=0)[:-1])
    probe.count_levels("trivial_rejects", counts.rejects.sum(axis=0)[:-1])
    probe.count_levels("refinements", counts.refinements.sum(axis=0)[:-1])
    probe.count_levels("fruitless_refinements", (counts.refinements - counts.fruitful).sum(axis=0)[:-1])
    probe.count("float64_sample_tests", counts.retries.sum())
    per_triangle = np.zeros(n_triangles, np.int64)
    at_root = int(tree.occupied[0] != 0)
    per_triangle[frusta.triangle] = (counts.frustum_visits.sum(axis=0, dtype=np.int64) + at_root) * branching
    probe.count_triangles("test_and_set", per_triangle)
    probe.count_samples(tests_per_sample(tree, counts.visits))
