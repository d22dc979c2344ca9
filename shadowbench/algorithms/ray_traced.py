"""Shadow rays through a kd-tree, one for every lit candidate.

Hertel, Hormann, Westermann: "A Hybrid GPU Rendering Pipeline for Alias-Free Hard Shadows", Eurographics 2009 (areas
papers): what its Table 2 calls RT_class, the ray tracer without a map in front. Tree: Wald and Havran, "On building
fast kd-Trees for Ray Tracing, and on doing that in O(N log N)", 2006. Traversal: Foley and Sugerman, "KD-Tree
Acceleration Structures for a GPU Raytracer", 2005; Horn, Sugerman, Houston, Hanrahan: "Interactive k-D Tree GPU
Raytracing", 2007.

Idea: the tree sorts the triangles by where they are. A ray from the light to a sample visits the cells along it and
ends in the first one in which it meets a triangle that shadows the sample.

Stages
------
prepare : build the tree; like the paper's (sec. 6) it depends on neither light nor camera.
rays : planes of every triangle's shadow frustum, and the rays.
trace : the paper's sec. 5.

Differences from the paper
--------------------------
* The paper's test is a ray-triangle intersection. Here it asks the shared definition of shadow, with the planes of
  `shadowbench.kernels.shadow_frustum`, and cells are widened by a proven margin, so the result is exact.
* The paper restarts after every leaf, without a stack. `traversal` offers that, a short stack and a full one; restarts go
  by a trail of bits (see `shadowbench.kernels.kdtree_traversal`).
* The paper does not describe its tree beyond "SAH"; this one splits triangles and favours empty space.

Limits: the tree has to be built anew when triangles move.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Mesh, Probe, ShadowBuffer, parameter
from shadowbench.kernels.kdtree_build import KdTree, build_kdtree
from shadowbench.kernels.kdtree_traversal import empty_counts, trace
from shadowbench.kernels.shadow_rays import make_shadow_rays


class Params(AlgorithmParams):
    """Parameters of `RayTraced`."""

    traversal: Literal["stack", "short_stack", "restart"] = parameter(
        "stack", "how the far children along a ray are kept: on a stack, on one of four entries, or not at all",
        paper="restart")


class RayTraced(Algorithm):
    """One ray through a kd-tree per lit candidate. Exact on any triangle soup."""

    name: ClassVar[str] = "ray_traced"
    title: ClassVar[str] = "Ray tracing, kd-tree"
    paper: ClassVar[str] = "Hertel et al. 2009"
    exact: ClassVar[bool] = True
    stages: ClassVar[tuple[str, ...]] = ("rays", "trace")
    counters: ClassVar[tuple[str, ...]] = ("rays_cast", "kd_nodes", "kd_leaves", "triangle_tests")
    Params: ClassVar[type[AlgorithmParams]] = Params

    def prepare(self, mesh: Mesh) -> KdTree:
        """Build the kd-tree."""
        return build_kdtree(mesh.corners)

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Trace one ray per lit candidate."""
        samples = frame.samples
        tree = self.prepare(frame.mesh) if frame.prepared is None else frame.prepared
        shadow = np.zeros(len(samples.candidate), np.float32)
        counts = empty_counts(len(shadow)) if probe.counting else None
        with probe.stage("rays"):
            rays = make_shadow_rays(frame.mesh.corners, frame.mesh.bounds(), frame.camera[:4], frame.light.xyzw(),
                                    frame.bias, samples)
        with probe.stage("trace"):
            trace(tree, rays, samples.candidate, None, self.params.traversal, samples.columns, shadow, counts)
        probe.count("rays_cast", np.count_nonzero(samples.candidate))
        probe.memory("kd_tree", tree.nodes.nbytes + tree.references.nbytes)
        probe.memory("frustum_planes", rays.rows.nbytes)
        if counts is not None:
            probe.count("kd_nodes", counts.nodes.sum(dtype=np.int64))
            probe.count("kd_leaves", counts.leaves.sum(dtype=np.int64))
            probe.count("triangle_tests", counts.tests.sum(dtype=np.int64))
            probe.count_samples(counts.tests)
        return ShadowBuffer(shadow)
