"""The view-sample cluster hierarchy."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

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
from shadowbench.kernels import cluster_hierarchy, cluster_shadow, shadow_frustum
from shadowbench.kernels.caster_selection import closed_triangles, select_casters
from shadowbench.kernels.cluster_jobs import Jobs, Rules, expand
from shadowbench.kernels.cluster_keys import KeyLayout, key_layout, make_slices
from shadowbench.kernels.cluster_traversal import finish
from shadowbench.kernels.culling_planes import EYE_EDGES
from shadowbench.kernels.frustum_groups import group_triangles
from shadowbench.kernels.group_frustum import make_groups, needed_members

LARGEST_FULL_KEY = 26
"""Bits of the longest key that the full layout serves: 1.6 GB of boxes at 2048 x 2048, and 8 times that at 4096."""


class Params(AlgorithmParams):
    """Parameters of `Cluster`."""

    bounds: Literal["explicit", "implicit"] = parameter(
        "explicit", "boxes of the nodes: those of their samples, or those that follow from their keys")
    culling_planes: Literal["none", "silhouette", "wedge", "outline", "outline+wedge"] = parameter(
        "wedge", "planes beyond the frustum's own that nodes are tested against")
    passes: Literal["one", "two"] = parameter("two", "split the traversal at the root's children, or at split_level")
    split_level: int = parameter(2, "level of the tree whose nodes become jobs of the second pass", ge=1, le=7)
    layout: Literal["full", "compact"] = parameter(
        "full", "room for the boxes of all possible nodes, or of those that exist")
    leaf: Literal["tile", "cluster"] = parameter("tile", "samples that a leaf tests: all of its tile, or its own")
    depth_start: Literal["nearest_sample", "near_plane"] = parameter(
        "nearest_sample", "where the slices of depth start", paper="near_plane")
    casters: Literal["all", "back_faces", "auto"] = parameter(
        "all", "triangles that cast: all, those facing away from the light, or the latter on closed bodies only")
    group: Literal[1, 8, 16, 32, 64] = parameter(1, "frusta of a group that share the walk through the upper levels")
    remove_unlit: bool = parameter(True, "leave samples that are no lit candidates out of the hierarchy")
    skip_shadowed: bool = parameter(True, "stop at nodes and samples that are already in shadow")


class _Hierarchy(NamedTuple):
    """The hierarchy of a frame and what the traversal fills."""

    layout: KeyLayout
    clusters: cluster_hierarchy.Clusters
    nodes: cluster_hierarchy.Nodes
    leaves: cluster_shadow.Leaves
    tiles: cluster_hierarchy.TileSamples
    shadow: cluster_shadow.Shadow
    counts: cluster_shadow.Counts | None


class _Work(NamedTuple):
    """Jobs of one kind, of which triangles, and what they cost if that is counted."""

    jobs: Jobs
    first_pass: Any
    second_pass: Any
    triangles: NDArray[np.int64]
    first: NDArray[np.int64]


class Cluster(Algorithm):
    """The view-sample cluster hierarchy. Exact on any triangle soup."""

    name = "cluster"
    title = "View-sample cluster hierarchy"
    paper = "Sintorn et al. 2014"
    exact = True
    stages = ("hierarchy", "frustum_setup", "traversal", "merge")
    counters = ("node_tests", "sample_tests", "group_tests", "trivial_accepts", "trivial_rejects", "refinements",
                "float64_sample_tests")
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
            tree = self._build(frame, included, probe.counting)
        if tree is None:
            return ShadowBuffer(np.zeros(len(samples.depth), np.float32))
        with probe.stage("frustum_setup"):
            sides = _sides(frame)
            triangles = shadow_frustum.casting_triangles(sides, select_casters(params.casters, sides, self._closed(frame)))
            reach = np.array([np.abs(tree.tiles.plane_x).max(), np.abs(tree.tiles.plane_y).max(),
                              float(tree.clusters.r_high.max())])
            view = shadow_frustum.View(*frame.camera[:4], frame.light.xyzw(), frame.bias, reach)
            groups = None
            if params.group > 1:
                units, faces = group_triangles(frame.mesh.corners, triangles, view.light, params.group)
                triangles, grouped = np.split(units.order, [units.n_single])
                groups = make_groups(frame.mesh.corners, units, faces, view)
            frusta = self._frusta(frame, sides, triangles, view)
        rules = Rules(EYE_EDGES[params.culling_planes] > 0, "wedge" in params.culling_planes, params.skip_shadowed,
                      params.leaf == "tile")
        n_levels = len(tree.layout.level_bits)
        with probe.stage("traversal"):
            split = 1 if params.passes == "one" else min(params.split_level, n_levels)
            jobs, first_pass = expand(len(triangles), tree.nodes, frusta, None, rules, split, tree.shadow, tree.counts)
            second_pass = finish((tree.nodes, tree.leaves), tree.tiles, frusta, None, rules, jobs, samples.depth,
                                 tree.shadow, tree.counts)
        if groups is not None:
            with probe.stage("traversal"):
                jobs, first_pass = expand(len(groups.first) - 1, tree.nodes, None, groups, rules, max(n_levels - 1, 1),
                                          tree.shadow, tree.counts)
            with probe.stage("frustum_setup"):
                members, groups = needed_members(groups, jobs.unit)
                frusta = self._frusta(frame, sides, grouped[members], view)
            with probe.stage("traversal"):
                finish((tree.nodes, tree.leaves), tree.tiles, frusta, groups, rules, jobs, samples.depth, tree.shadow,
                       tree.counts)
        with probe.stage("merge"):
            merged = cluster_shadow.merge_clusters(tree.nodes, tree.clusters, tree.tiles, tree.shadow)
            if not params.remove_unlit:
                merged[~samples.candidate] = 0.0
        if tree.counts is not None:
            n_inner = len(tree.nodes.first_child)
            probe.count("node_tests", tree.counts.tests[:n_inner].sum())
            probe.count("group_tests", tree.counts.group_tests[:n_inner].sum())
            probe.count("sample_tests", tree.counts.tests[n_inner:].sum())
        return ShadowBuffer(merged)

    def _build(self, frame: Frame, included: NDArray[np.bool_], counting: bool) -> _Hierarchy | None:
        """Build the hierarchy; None if no sample is included."""
        samples, params = frame.samples, self.params
        layout = key_layout(samples.columns, samples.rows)
        start = frame.camera.near if params.depth_start == "near_plane" else float(samples.depth.min())
        tiles = cluster_hierarchy.tile_samples(np.ascontiguousarray(samples.plane_x[: samples.columns]),
                                               np.ascontiguousarray(samples.plane_y[:: samples.columns]))
        slices = make_slices(start if start < np.inf else frame.camera.near, frame.camera.tan_y, tiles.rows,
                             1 << int(layout.axis_shift[0, 2]))
        clusters, nodes = cluster_hierarchy.build_cluster_tree(
            tiles, samples.depth, included, layout, slices, params.bounds == "explicit", params.layout == "full")
        if nodes is None:
            return None
        shadow = cluster_shadow.empty_shadow(nodes, clusters, tiles.columns * tiles.rows, params.leaf == "tile")
        return _Hierarchy(layout, clusters, nodes, cluster_shadow.make_leaves(clusters, tiles), tiles, shadow,
                          cluster_shadow.empty_counts(nodes) if counting else None)

    def _frusta(self, frame: Frame, sides: NDArray[np.int8], triangles: NDArray[np.int64],
                view: shadow_frustum.View) -> shadow_frustum.Frusta:
        """Set up the frusta of some triangles."""
        planes = self.params.culling_planes
        return shadow_frustum.make_frusta(frame.mesh.corners, sides, triangles, view, EYE_EDGES[planes], "wedge" in planes)

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
