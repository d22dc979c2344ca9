"""Conservative shadow maps: most samples are decided by a map, the others by rays that the map shortens.

Hertel, Hormann, Westermann: "A Hybrid GPU Rendering Pipeline for Alias-Free Hard Shadows", Eurographics 2009 (areas
papers).

Idea: each texel of a shadow map keeps a lower bound of the depth of everything that touches it, and the triangle that this
is the bound of. A sample nearer than the bound is lit; one that the triangle shadows is in shadow. What is left is
uncertain: its ray is traced, from the bound on.

Stages
------
prepare : build the kd-tree (sec. 6).
rays : planes of every triangle's shadow frustum, and the rays.
fit : choose the projection for the lit candidates (the paper leaves it to the user).
map : conservative rasterisation, sec. 4.1.
classify : sec. 4.2.
trace : sec. 5.

Differences from the paper
--------------------------
* The final answer is exact, and so is each class by itself. Depths in the map are true lower bounds; the paper shifts
  triangles with the hardware's slope-scaled bias. "Shadowed" is the shared definition's test of the stored triangle,
  its cap plane alone where the triangle covers the texel; the paper compares depths there.
* The paper calls samples of the stored triangle itself lit (its triangle id takes the place of a bias). That is wrong where
  another triangle crosses the texel in front of the sample but behind the texel's nearest point. Here each texel
  also holds a lower bound for all *other* triangles: a sample nearer than that, whom the stored triangle does not shadow,
  is lit. `layers: 1` does without it; then only samples in front of everything in their texel are known to be lit.
* With the shared definition a surface never shadows itself, so `self_shadow: bias` needs no triangle id; `id` skips the
  test of a sample's own triangle, as the paper does.
* The paper's rays start at the stored depth; here at the second one once the stored triangle is known not to shadow
  the sample.
* The paper has one map of limited angle. Here samples outside a spot map fall in the faces of a cube.
* Sec. 4.1 discards by the distance to the lines through the edges; see `shadowbench.kernels.conservative_raster`.
* Table 2 of the paper has the heads of its last two columns swapped: fewer rays are cast with the scheme than without.

Limits: texels in which many triangles meet (edges, dense meshes, foliage) leave most of their samples uncertain.
"""

from __future__ import annotations

from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Mesh, Probe, ShadowBuffer, parameter
from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels import conservative_raster
from shadowbench.kernels.conservative_raster import ConservativeMap, Face, empty_map, rasterize_conservatively
from shadowbench.kernels.kdtree_build import KdTree, build_kdtree
from shadowbench.kernels.kdtree_traversal import Start, empty_counts, parallel_length, trace
from shadowbench.kernels.light_maps import LightMaps, fit_light_maps, locate, texel
from shadowbench.kernels.projection import N_WORKERS, chunk
from shadowbench.kernels.shadow_rays import ShadowRays, is_behind, is_shadowed_by, make_shadow_rays

UNLIT, LIT, SHADOWED, UNCERTAIN = 0, 1, 2, 3
"""Classes of samples; the first are no lit candidates."""

CLASS_COLORS = np.array([[40, 40, 48], [120, 200, 110], [60, 80, 170], [240, 190, 60]], np.uint8)
"""Colours of the classes in the picture: dark, green, blue, amber."""

ROUNDING = 64.0 * 2.0**-53
"""Rounding of a place on the map or of a depth, relative to the numbers that it is computed from."""


class Params(AlgorithmParams):
    """Parameters of `ConservativeMapMethod`."""

    resolution: int = parameter(1024, "texels along the side of the map, or of each face of the cube", ge=1, le=16384)
    projection: Literal["auto", "spot", "cube"] = parameter(
        "auto", "view of a point light; auto is spot if the lit candidates fit a cone of 120 degrees, else cube",
        paper="spot")
    raster: Literal["discard", "polygon"] = parameter(
        "discard", "grow edges by a texel's diagonal and discard by distance, or draw the polygon of up to nine corners")
    layers: Literal[1, 2] = parameter(
        2, "depth bounds per texel: one for all triangles, or a second one for all but the nearest", paper=1)
    classify: bool = parameter(True, "trace uncertain samples alone; otherwise all lit candidates")
    shorten: bool = parameter(True, "start rays at the depth that the map holds; otherwise at the light")
    self_shadow: Literal["bias", "id"] = parameter(
        "bias", "what keeps a surface from shadowing itself: the shared bias alone, or the triangle's id as well",
        paper="id")
    traversal: Literal["stack", "short_stack", "restart"] = parameter(
        "stack", "how the far children along a ray are kept: on a stack, on one of four entries, or not at all",
        paper="restart")


class _Samples(NamedTuple):
    """Lit candidates, and what the map says of them.

    Attributes
    ----------
    candidate : bool (n_samples,).
    own : int32 (n_samples,), the sample's triangle where it needs no test, else -1.
    kind : uint8 (n_samples,), class.
    share : float64 (n_samples,), where the ray starts, as in `kdtree_traversal.Start`.
    """

    candidate: NDArray[np.bool_]
    own: NDArray[np.int32]
    kind: NDArray[np.uint8]
    share: NDArray[np.float64]


class _TestCounts(NamedTuple):
    """Tests of stored or loose triangles, int32 (n_samples,)."""

    tests: NDArray[np.int32]


class ConservativeMapMethod(Algorithm):
    """A conservative map in front of a ray tracer. Exact on any triangle soup."""

    name: ClassVar[str] = "conservative_map"
    title: ClassVar[str] = "Conservative shadow map"
    paper: ClassVar[str] = "Hertel et al. 2009"
    exact: ClassVar[bool] = True
    stages: ClassVar[tuple[str, ...]] = ("rays", "fit", "map", "classify", "trace")
    counters: ClassVar[tuple[str, ...]] = (
        "conservative_fragments", "fragments_discarded", "map_texels_written", "map_texels_read", "stored_triangle_tests",
        "lit_by_map", "shadowed_by_map", "rays_cast", "kd_nodes", "kd_leaves", "triangle_tests")
    Params: ClassVar[type[AlgorithmParams]] = Params

    def prepare(self, mesh: Mesh) -> KdTree:
        """Build the kd-tree."""
        return build_kdtree(mesh.corners)

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Draw the map, classify every lit candidate, trace what is uncertain."""
        tree, params = self.prepare(frame.mesh) if frame.prepared is None else frame.prepared, self.params
        with probe.stage("rays"):
            rays = make_shadow_rays(frame.mesh.corners, frame.mesh.bounds(), frame.camera[:4], frame.light.xyzw(),
                                    frame.bias, frame.samples)
        samples, _, target = self.classified(frame, rays, tree, probe)
        shadow = (samples.kind == SHADOWED).astype(np.float32)
        counts = empty_counts(len(shadow)) if probe.counting else None
        with probe.stage("trace"):
            trace(tree, rays, samples.kind == UNCERTAIN, Start(samples.share) if params.shorten else None, params.traversal,
                  frame.samples.columns, shadow, counts)
        probe.count("rays_cast", np.count_nonzero(samples.kind == UNCERTAIN))
        probe.memory("maps", sum(array.nbytes for array in target))
        probe.memory("kd_tree", tree.nodes.nbytes + tree.references.nbytes)
        probe.memory("frustum_planes", rays.rows.nbytes)
        if counts is None:
            return ShadowBuffer(shadow)
        probe.count("kd_nodes", counts.nodes.sum(dtype=np.int64))
        probe.count("kd_leaves", counts.leaves.sum(dtype=np.int64))
        probe.count("triangle_tests", counts.tests.sum(dtype=np.int64))
        probe.count_samples(counts.tests)
        assert probe.heat is not None
        shape = (frame.samples.rows, frame.samples.columns)
        return ShadowBuffer(shadow, {"classes": CLASS_COLORS[samples.kind].reshape(*shape, 3),
                                     "triangle_tests": _test_picture(probe.heat, shadow).reshape(*shape, 3)})

    def classified(self, frame: Frame, rays: ShadowRays, tree: KdTree,
                   probe: Probe) -> tuple[_Samples, LightMaps, ConservativeMap]:
        """Draw the map and classify every lit candidate by it alone (all as uncertain without `classify`)."""
        params, samples = self.params, frame.samples
        light = np.array([0.0, 0.0, 0.0, 1.0])
        if frame.light.is_directional:
            light = frame.light.xyzw()
        with probe.stage("fit"):
            maps = fit_light_maps(light, rays.target, samples.candidate, params.projection, params.resolution, 1)
        with probe.stage("map"):
            target = _draw_maps(maps, frame.mesh, rays, 1.0 / tree.scale, params, probe)
        n = len(samples.candidate)
        with probe.stage("classify"):
            own = samples.triangle if params.self_shadow == "id" else np.full(n, -1, np.int32)
            found = _Samples(samples.candidate, own, np.zeros(n, np.uint8), np.zeros(n))
            counts = _TestCounts(np.zeros(n, np.int32)) if probe.counting else None
            length = parallel_length(rays) if frame.light.is_directional else 0.0
            _classify_all(maps, target, rays, params.classify, length, found, counts)
        if counts is not None:
            probe.count("map_texels_read", np.count_nonzero(samples.candidate))
            probe.count("stored_triangle_tests", counts.tests.sum(dtype=np.int64))
            probe.count("lit_by_map", np.count_nonzero(found.kind == LIT))
            probe.count("shadowed_by_map", np.count_nonzero(found.kind == SHADOWED))
            probe.count_samples(counts.tests)
        return found, maps, target


def _draw_maps(maps: LightMaps, mesh: Mesh, rays: ShadowRays, unit: float, params: Params, probe: Probe) -> ConservativeMap:
    """Rasterise the casters into every map that a lit candidate falls in."""
    target = empty_map(maps.n_layers, maps.side)
    depth_pad = 2.0 * unit + ROUNDING * rays.reach
    for number in np.flatnonzero(maps.layer >= 0):
        right, up, forward = (np.ascontiguousarray(v) for v in maps.axes[number])
        half = float(maps.half[number])
        pad = ROUNDING * (1.0 + half) * (1.0 + half) if maps.perspective else ROUNDING * rays.reach
        face = Face(right, up, forward, maps.eye, maps.perspective, 2.0 * half / maps.resolution, 0.5 * maps.side,
                    maps.side, pad, unit, depth_pad, rays.reach)
        counts = conservative_raster.empty_counts() if probe.counting else None
        rasterize_conservatively(mesh.corners, rays.sides, rays.origin, face, int(maps.layer[number]),
                                 params.raster == "discard", target, counts)
        if counts is not None:
            probe.count("conservative_fragments", counts.fragments.sum())
            probe.count("fragments_discarded", counts.discarded.sum())
            probe.count("map_texels_written", counts.written.sum())
    return target if params.layers == 2 else target._replace(next_depth=target.depth)


def _test_picture(tests: NDArray[np.int64], shadow: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Brightness by the number of triangle tests, up to 32; red in shadow, green in light (the paper's figure 4)."""
    share = np.minimum(tests, 32) / 32.0
    bright = np.where(tests > 0, 0.15 + 0.85 * share, 0.0)
    whitening = 0.6 * share * share
    main, rest = np.rint(255 * bright), np.rint(255 * bright * whitening)
    return np.stack([np.where(shadow > 0, main, rest), np.where(shadow > 0, rest, main), rest], axis=-1).astype(np.uint8)


@kernel
def _is_shadowed_by_stored(rays, t, covered, x, y, r):
    """The exact test of a sample against its texel's triangle: its cap plane alone where it covers the texel."""
    return is_behind(rays, t, x, y, r) if covered else is_shadowed_by(rays, t, x, y, r)


@kernel
def _classify_chunk(worker, maps, target, rays, classify, length, samples, counts):
    """Classify one worker's share of the lit candidates, and find where their rays start."""
    axes, half, layer, fitted, perspective, eye = (maps.axes, maps.half, maps.layer, maps.fitted, maps.perspective,
                                                   maps.eye)
    depths, triangles, next_depths, covers = target.depth, target.triangle, target.next_depth, target.covered
    candidate, own, kind, share, position = samples.candidate, samples.own, samples.kind, samples.share, rays.target
    plane_x, plane_y, depth, loose = rays.plane_x, rays.plane_y, rays.depth, rays.loose
    first, end = chunk(worker, len(candidate))
    for i in range(first, end):
        if candidate[i]:
            face, u, v, here = locate(axes, half, fitted, perspective, position[i, 0] - eye[0], position[i, 1] - eye[1],
                                      position[i, 2] - eye[2])
            row, column = texel(u, v, half[face], maps.resolution, maps.border)
            place = layer[face]
            bound, t = depths[place, row, column], np.int64(triangles[place, row, column])
            x, y, r = plane_x[i], plane_y[i], 1.0 / depth[i]
            kind[i] = UNCERTAIN
            if classify:
                if here <= bound:
                    kind[i] = LIT
                else:
                    if t != own[i]:
                        if counts is not None:
                            counts.tests[i] += 1
                        if _is_shadowed_by_stored(rays, t, covers[place, row, column], x, y, r):
                            kind[i] = SHADOWED
                    # The stored triangle is settled: what is left begins at the second bound
                    bound = next_depths[place, row, column]
                    if kind[i] != SHADOWED and here <= bound:
                        kind[i] = LIT
                if kind[i] == LIT:
                    for k in range(len(loose)):
                        if counts is not None:
                            counts.tests[i] += 1
                        if is_shadowed_by(rays, loose[k], x, y, r):
                            kind[i] = SHADOWED
                            break
            if kind[i] == UNCERTAIN:
                share[i] = max(bound / here if perspective else 1.0 - (here - bound) / length, 0.0)


@parallel_kernel
def _classify_all(maps, target, rays, classify, length, samples, counts):
    for worker in prange(N_WORKERS):
        _classify_chunk(worker, maps, target, rays, classify, length, samples, counts)
