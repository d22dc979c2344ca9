"""The view-sample cluster hierarchy: shadow frusta walked through a tree over clusters of view samples.

Sintorn, Kämpe, Olsson, Assarsson: "Per-Triangle Shadow Volumes Using a View-Sample Cluster Hierarchy", I3D 2014.

Idea
----
Per-triangle shadow volumes with a better tree. A screen tile that sees both a near gate and a far house has a box that
spans the space between, and every shadow in that space is walked into the tile in vain. So the samples of a tile are
split by depth as well, into clusters about as deep as they are wide, and a tree is built over the clusters alone.

Stages
------
``hierarchy`` : keys, clusters, tree and bounds (Sec. 2 "Building the acceleration structure", Sec. 2.1).
``frustum_setup`` : planes of each casting triangle (Sec. 2 "Triangle Setup"); with `group`, bounding frusta of groups.
``traversal`` : Algorithm 1, in two passes (Sec. 2.2).
``merge`` : samples of nodes that lie wholly in a frustum (Sec. 2 "Traversal", last paragraphs).

Differences from the paper
--------------------------
- Eq. 1 writes the whole field of view where clusters as deep as wide, its stated intent, need the half angle.
- Slices start at the nearest of every 16th sample in every 16th row, or at the near plane if all of these see the sky; what
  is nearer belongs to the first slice. With `depth_start` ``near_plane``, as in the paper, 512 slices reach to about a
  hundred times the near distance, and everything beyond shares the last one.
- Culling planes are tested before the frustum's own; the outcome is the same. The sets ``outline`` and ``outline+wedge``
  and groups of frusta are not in the paper.
- A job is done by one thread, and threads own nodes of the split level, so counts do not depend on timing. With one pass
  that level is the root's children. Frusta of the first pass do not know what others have found; those of the second do.
- Children that exist are tested and counted, in order of their keys; the GPU runs 32 lanes whether they exist or not.
- Shadowed samples are dropped from leaves (`skip_shadowed`), and leaves may test their own samples alone (`leaf`).

Limits
------
Up to 8192 samples in a row or column, where the key fills 32 bits. The full layout needs 24 bytes for each of up to 8.66
million nodes at 1024 x 1024.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Frame, Probe, ShadowBuffer, parameter
from shadowbench.algorithms.frustum_base import Casters, FrustumAlgorithm, FrustumParams
from shadowbench.algorithms.transparency import ClearCasters, Shaded, shadow_buffer
from shadowbench.kernels import cluster_counts, cluster_hierarchy, cluster_samples, cluster_shadow, transparency
from shadowbench.kernels.cluster_jobs import Jobs, Rules, expand
from shadowbench.kernels.cluster_keys import KeyLayout, key_layout, make_slices
from shadowbench.kernels.cluster_traversal import finish
from shadowbench.kernels.culling_planes import EYE_EDGES
from shadowbench.kernels.group_frustum import Groups, needed_members
from shadowbench.kernels.shadow_frustum import Frusta
from shadowbench.kernels.transparent_clusters import merge_through, root_children, traverse_transparent
from shadowbench.kernels.unit_counts import add_to_triangles, sum_by_unit

if TYPE_CHECKING:
    from shadowbench.scenes.loader import Scene

BOX_BYTES, POINTER_BYTES = 24, 4
"""Modelled (Sec. 3): six floats per box, and a pointer per possible node in the compact layout."""

LARGEST_FULL_KEY = 26
"""Bits of the longest key that the full layout serves: 1.6 GB of boxes at 2048 x 2048, and 8 times that at 4096."""


class Params(FrustumParams):
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


class _Hierarchy(NamedTuple):
    """The hierarchy of a frame."""

    layout: KeyLayout
    clusters: cluster_hierarchy.Clusters
    nodes: cluster_hierarchy.Nodes
    largest_r: float
    tiles: cluster_samples.TileSamples


class _Filled(NamedTuple):
    """What a traversal reads and fills besides."""

    rules: Rules
    leaves: cluster_shadow.Leaves
    shadow: cluster_shadow.Shadow
    counts: cluster_shadow.Counts | None


class _Work(NamedTuple):
    """Jobs of one kind and what they cost.

    Attributes
    ----------
    first_pass, second_pass : visits and tests of each unit and of each job; None if they are not counted.
    triangles : of the frusta; first : the frusta of each unit.
    """

    jobs: Jobs
    first_pass: Any
    second_pass: Any
    triangles: NDArray[np.int64]
    first: NDArray[np.int64]


class Cluster(FrustumAlgorithm):
    """The view-sample cluster hierarchy. Exact on any triangle soup."""

    name = "cluster"
    title = "View-sample cluster hierarchy"
    paper = "Sintorn et al. 2014"
    stages = ("hierarchy", "frustum_setup", "traversal", "merge")
    counters = ("node_tests", "sample_tests", "group_tests", "trivial_accepts", "trivial_rejects", "refinements",
                "float64_sample_tests", "iterations", "occupied_nodes", "light_updates", "texture_lookups")
    Params = Params

    def unsupported(self, scene: Scene) -> str | None:
        """Say why the keys or the full layout can't serve the image."""
        columns, rows = scene.image.columns, scene.image.rows
        try:
            layout = key_layout(columns, rows)
        except ValueError as error:
            return str(error)
        if self.params.layout == "full" and layout.shift[0] > LARGEST_FULL_KEY:
            size = cluster_counts.full_tree_nodes(layout) * BOX_BYTES
            return (f"the full layout takes {size / 1e9:.0f} GB at {columns} x {rows} samples: use layout=compact")
        return None

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        samples, params = frame.samples, self.params
        with probe.stage("hierarchy"):
            tree = self._build(frame)
        if tree is None:
            return ShadowBuffer(np.zeros(len(samples.depth), np.float32))
        with probe.stage("frustum_setup"):
            casters = self.find_casters(frame, (np.abs(tree.tiles.plane_x).max(), np.abs(tree.tiles.plane_y).max(),
                                                tree.largest_r))
            frusta = self.frusta(frame, casters, casters.single)
            clear = self.clear_casters(frame, casters)
        with probe.stage("traversal"):
            filled = self._empty(tree, probe.counting)
        work = [self._walk_frusta(frame, tree, frusta, filled, probe)]
        if casters.groups is not None:
            work.append(self._walk_groups(frame, tree, casters, casters.groups, filled, probe))
        through = None if clear is None else self._shade(frame, tree, clear, filled, probe)
        with probe.stage("merge"):
            merged = cluster_shadow.merge_clusters(tree.nodes, tree.clusters, tree.tiles, filled.shadow)
            parts = (tree.nodes, filled.leaves), tree.tiles
            arriving = None if through is None else merge_through(*parts, through.light, merged)
            if not params.remove_unlit:
                merged[~samples.candidate] = 0.0
        self._record_memory(tree, probe)
        if filled.counts is None:
            return shadow_buffer(merged, arriving, samples.candidate)
        self._record_counts(frame, tree, filled.counts, work, through, probe)
        buffer = shadow_buffer(merged, arriving, samples.candidate)
        buffer.images["levels"] = cluster_counts.picture_levels(tree.nodes, tree.clusters, tree.tiles)
        return buffer

    def _shade(self, frame: Frame, tree: _Hierarchy, clear: ClearCasters, filled: _Filled, probe: Probe) -> Shaded:
        """Let the casters that let light through shade what the opaque ones have left."""
        counts, n_nodes = None, len(tree.nodes.parent)
        if probe.counting:
            counts = transparency.empty_counts(n_nodes, root_children(tree.nodes), len(clear.optics.triangle))
        with probe.stage("traversal"):
            light = transparency.all_light(n_nodes, len(frame.samples.depth), clear.optics)
            traverse_transparent((tree.nodes, filled.leaves), tree.tiles, *clear, filled.rules, frame.samples.depth,
                                 filled.shadow, light, counts)
        if not clear.optics.by_chance:
            probe.memory("light_hierarchy", light.nodes.nbytes + light.samples.nbytes)
        return Shaded(clear, light, counts)

    def _walk_frusta(self, frame: Frame, tree: _Hierarchy, frusta: Frusta, filled: _Filled, probe: Probe) -> _Work:
        """Walk frusta by themselves, in two passes (Sec. 2.2)."""
        split, n_frusta = 1, len(frusta.triangle)
        if self.params.passes == "two":
            split = min(self.params.split_level, len(tree.layout.level_bits))
        with probe.stage("traversal"):
            jobs, first_pass = expand(n_frusta, tree.nodes, frusta, None, filled.rules, split, filled.shadow, filled.counts)
            second_pass = finish((tree.nodes, filled.leaves), tree.tiles, frusta, None, filled.rules, jobs,
                                 frame.samples.depth, filled.shadow, filled.counts)
        return _Work(jobs, first_pass, second_pass, frusta.triangle, np.arange(n_frusta + 1))

    def _walk_groups(self, frame: Frame, tree: _Hierarchy, casters: Casters, groups: Groups, filled: _Filled,
                     probe: Probe) -> _Work:
        """Walk groups down to the parents of the clusters, and from there the members of those that get so far."""
        first = casters.first()
        with probe.stage("traversal"):
            jobs, first_pass = expand(len(first) - 1, tree.nodes, None, groups, filled.rules,
                                      max(len(tree.layout.level_bits) - 1, 1), filled.shadow, filled.counts)
        with probe.stage("frustum_setup"):
            members, groups = needed_members(groups, jobs.unit)
            frusta = self.frusta(frame, casters, casters.grouped[members])
        with probe.stage("traversal"):
            second_pass = finish((tree.nodes, filled.leaves), tree.tiles, frusta, groups, filled.rules, jobs,
                                 frame.samples.depth, filled.shadow, filled.counts)
        return _Work(jobs, first_pass, second_pass, casters.grouped, first)

    def _build(self, frame: Frame) -> _Hierarchy | None:
        """Build the hierarchy; None if no sample is included."""
        samples, params = frame.samples, self.params
        layout = key_layout(samples.columns, samples.rows)
        start = cluster_samples.nearest_depth(samples.depth, samples.columns)
        if params.depth_start == "near_plane" or start == np.inf:
            start = frame.camera.near
        tiles = cluster_samples.tile_samples(np.ascontiguousarray(samples.plane_x[: samples.columns]),
                                             np.ascontiguousarray(samples.plane_y[:: samples.columns]))
        slices = make_slices(start, frame.camera.tan_y, tiles.rows, 1 << int(layout.axis_shift[0, 2]))
        clusters, nodes, largest_r = cluster_hierarchy.build_cluster_tree(
            tiles, samples.depth, self.included(frame), layout, slices, params.bounds == "explicit", params.layout == "full")
        if nodes is None:
            return None
        return _Hierarchy(layout, clusters, nodes, largest_r, tiles)

    def _empty(self, tree: _Hierarchy, counting: bool) -> _Filled:
        """Allocate the shadow buffer, and counts if they are asked for."""
        planes, whole = self.params.culling_planes, self.params.leaf == "tile"
        shadow = cluster_shadow.empty_shadow(tree.nodes, tree.clusters, tree.tiles.columns * tree.tiles.rows, whole)
        return _Filled(Rules(EYE_EDGES[planes] > 0, "wedge" in planes, self.params.skip_shadowed, whole),
                       cluster_shadow.make_leaves(tree.clusters), shadow,
                       cluster_shadow.empty_counts(tree.nodes) if counting else None)

    def _record_memory(self, tree: _Hierarchy, probe: Probe) -> None:
        """Record what the layout holds, and what both layouts take by the paper's model (Sec. 3)."""
        n_full, n_occupied = cluster_counts.full_tree_nodes(tree.layout), len(tree.nodes.parent)
        probe.memory("child_bits", -(-n_full // 8))
        if self.params.bounds == "explicit":
            probe.memory("boxes", 3 * tree.nodes.x.nbytes)
            if self.params.layout == "compact":
                probe.memory("box_places", tree.nodes.place.nbytes)
            probe.memory("modelled_full", n_full * BOX_BYTES)
            probe.memory("modelled_compact", n_full * POINTER_BYTES + n_occupied * BOX_BYTES)

    def _record_counts(self, frame: Frame, tree: _Hierarchy, counts: cluster_shadow.Counts, work: list[_Work],
                       through: Shaded | None, probe: Probe) -> None:
        """Report totals, levels, triangles, jobs and the heat map from the kernels' counts."""
        nodes, whole = tree.nodes, self.params.leaf == "tile"
        clear = None if through is None else through.counts
        if clear is not None:
            for name in ("visits", "tests", "accepts", "rejects", "refinements", "retries"):
                getattr(counts, name)[:] += getattr(clear, name)
            probe.count("light_updates", clear.updates.sum())
            probe.count("texture_lookups", clear.lookups.sum())
        n_inner, first = len(nodes.first_child), nodes.first[:-2]
        for name, values in (("node_tests", counts.tests), ("group_tests", counts.group_tests),
                             ("trivial_accepts", counts.accepts), ("trivial_rejects", counts.rejects),
                             ("refinements", counts.refinements)):
            probe.count_levels(name, np.add.reduceat(values[:n_inner], first))
        probe.count_levels("iterations", np.add.reduceat(counts.visits, nodes.first[:-1]))
        probe.count_levels("occupied_nodes", np.diff(nodes.first))
        probe.count("sample_tests", counts.tests[n_inner:].sum())
        probe.count("float64_sample_tests", counts.retries.sum())
        probe.count_samples(cluster_counts.tests_per_sample(nodes, tree.clusters, tree.tiles, counts, whole))
        per_triangle, iterations = np.zeros(frame.mesh.n_triangles, np.int64), []
        for jobs, (visits, tests), (job_visits, job_tests), triangles, units in work:
            n_units = len(units) - 1
            add_to_triangles(per_triangle, triangles, units,
                                            tests + sum_by_unit(jobs.unit, job_tests, n_units))
            # Sec. 2.2: with one pass a job is a triangle, with two also a triangle and a node of the split level
            if self.params.passes == "one":
                iterations.append(visits + sum_by_unit(jobs.unit, job_visits, n_units))
            else:
                iterations += [visits, job_visits]
        if through is not None and clear is not None:
            # A worker's walk of a frustum is a job
            per_triangle[through.clear.optics.triangle] += clear.frustum_tests.sum(axis=0) + root_children(nodes)
            iterations.append(clear.frustum_visits.reshape(-1).astype(np.int64))
        probe.count_triangles("test_and_set", per_triangle)
        probe.list_largest("iterations", np.concatenate(iterations))
