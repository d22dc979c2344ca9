"""Shadow silhouette maps.

Pradeep Sen, Mike Cammarano, Pat Hanrahan: "Shadow Silhouette Maps", ACM Transactions on Graphics 22, 3 (SIGGRAPH 2003),
pp. 521-526.

Idea: a shadow map is right but for the place of its shadow edges. So a second map keeps points of the casters'
silhouettes, one per texel, and where depth comparisons disagree, lines between neighbouring points part light from shadow.

Stages
------
casters : which triangles cast, and how they face the light.
silhouette : the silhouette edges (sec. 3.1), from edge multiplicities.
fit : choose the projection for the lit candidates (the paper leaves the view to the user).
map : sec. 3, first pass: nearest depth per texel.
points : sec. 3.1, second pass: the silhouette map, a point in every cell that a visible silhouette edge crosses.
compare : sec. 3.2: each lit candidate's depth against the four depths around it.
reconstruct : sec. 3.2: where they disagree, the quadrant between silhouette points that the candidate lies in.

Differences from the paper
--------------------------
* The depth map is that of the shadow map method, texel for texel, and the silhouette map is shifted by half a texel
  against it, not the other way round. So both methods can be compared directly.
* Edges are walked row by row instead of drawn as thin quads. Which texels get a point is decided by the same test.
* Of several edges in a texel, the last one drawn is kept. The paper leaves the order to the geometry, which `order:
  index` stands for (edges are numbered by their positions, lexicographically). `nearest` draws the edges nearest to
  the light last: they are the ones whose shadows show.
* Silhouettes come from edge multiplicities, so open and non-manifold meshes have them too.
* The receiver is taken as a plane, as in the shadow map method. The nearest corner is compared exactly as there, the
  others with the nearest depth that the plane has between the sample and the corner. So where all four agree, or
  where no point has moved, the answer is that of a shadow map.
* Point lights inside the scene get the faces of a cube. Each face is a silhouette map of its own; no line
  crosses from one to the next, because every face has a border that belongs to its own projection.

Limits: one point per texel. Silhouettes that cross in a texel, that run through it side by side, and corners between
depth samples are lost or bent (Fig. 7). What a shadow map misses, a silhouette map misses.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Mesh, Probe, ShadowBuffer, parameter
from shadowbench.kernels import stencil_volumes
from shadowbench.kernels.depth_maps import (
    ALL_LIT,
    ALL_SHADOWED,
    CELL_BORDER,
    Receivers,
    compare_corners,
    render_depth,
)
from shadowbench.kernels.edges import edge_multiplicities
from shadowbench.kernels.light_maps import LightMaps, fit_light_maps, map_view
from shadowbench.kernels.shadow_frustum import find_facing
from shadowbench.kernels.silhouette_lookup import find_places, shade
from shadowbench.kernels.silhouette_points import draw_silhouettes

CORNERS_PER_SAMPLE, POINTS_PER_SAMPLE = 4, 5
"""Depths compared for each sample, and silhouette points read for each sample whose depths disagree (sec. 3.2)."""

POINT_RADIUS = 0.2
"""Radius in texels at which silhouette points are drawn in the picture."""


class Params(AlgorithmParams):
    """Parameters of `SilhouetteMap`."""

    resolution: int = parameter(1024, "texels along the side of the maps, or of each face of the cube", ge=1, le=16384,
                                paper=512)
    projection: Literal["auto", "spot", "cube"] = parameter(
        "auto", "view of a point light; auto is spot if the lit candidates fit a cone of 120 degrees, else cube",
        paper="spot")
    casters: Literal["all", "back_faces", "auto"] = parameter(
        "all", "triangles that cast: all, those facing away from the light, or the latter on closed bodies only")
    order: Literal["nearest", "index"] = parameter(
        "nearest", "which of several edges in a texel is drawn last: the one nearest to the light, or that of the largest "
        "number", paper="index")
    bias: float = parameter(1.0, "depth bias, in units of the scene's bias", ge=0.0, paper=None)
    slope_bias: float = parameter(
        1.0, "scales the reach, in texels, within which a receiver's own plane can't shadow it; 0: constant bias only",
        ge=0.0, paper=0.0)


class Bandwidth(NamedTuple):
    """Bytes of memory traffic to find shadows, by the paper's model (sec. 4)."""

    shadow_map: float
    silhouette_map: float
    shadow_volumes: float


def bandwidth_model(scene_fill: int, silhouette_samples: int, volume_fill: int) -> Bandwidth:
    """Estimate the memory traffic of three methods for one frame (sec. 4).

    A shadow map reads one depth of 4 bytes per sample. A silhouette map does, too, thanks to caches, and 3 points of 8
    bytes for each sample whose depths disagree. Each fragment of a shadow volume reads a depth and a stencil value of 1
    byte, and half of them write it.

    Parameters
    ----------
    scene_fill : view samples that are shaded.
    silhouette_samples : those among them whose four depths disagree; their share is the paper's P.
    volume_fill : fragments of shadow volumes; divided by `scene_fill`, the paper's overdraw factor O.
    """
    return Bandwidth(4.0 * scene_fill, 4.0 * scene_fill + 24.0 * silhouette_samples, 5.5 * volume_fill)


class SilhouetteMap(Algorithm):
    """Depths, and where they disagree, lines between points on silhouettes."""

    name = "silhouette_map"
    title = "Shadow silhouette map"
    paper = "Sen et al. 2003"
    exact = False
    stages = ("casters", "silhouette", "fit", "map", "points", "compare", "reconstruct")
    counters = ("map_fragments", "map_texels_written", "silhouette_edges", "silhouette_fragments",
                "silhouette_points_written", "scene_fill", "silhouette_samples", "corner_reads", "point_reads")
    Params = Params

    def prepare(self, mesh: Mesh) -> stencil_volumes.PreparedVolumes:
        """Find the edges, and the closed bodies if the choice of casters depends on them."""
        return stencil_volumes.prepare_volumes(mesh, self.params.casters, False)

    def casters(self, frame: Frame) -> NDArray[np.bool_] | None:
        """Tell which triangles cast."""
        prepared = frame.prepared or self.prepare(frame.mesh)
        return stencil_volumes.choose_casters(frame.mesh.corners, frame.light.xyzw(), self.params.casters,
                                              prepared.closed)

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        params, mesh, samples, light = self.params, frame.mesh, frame.samples, frame.light.xyzw()
        adjacency, bias = (frame.prepared or self.prepare(mesh)).adjacency, params.bias * frame.bias
        with probe.stage("casters"):
            casting = self.casters(frame)
            facing = np.empty(mesh.n_triangles, np.int8)
            find_facing(mesh.corners, light, facing)
            if casting is not None:
                facing[~casting] = 0
        with probe.stage("silhouette"):
            edges = np.flatnonzero(edge_multiplicities(adjacency, facing))
            edge_ends = adjacency.positions[adjacency.ends[edges]]
            if params.order == "nearest":
                edge_ends = edge_ends[_farthest_first(edge_ends, light)]
        with probe.stage("fit"):
            maps = fit_light_maps(light, samples.position, samples.candidate, params.projection, params.resolution,
                                  CELL_BORDER)
        with probe.stage("map"):
            rendered = render_depth(maps, mesh.vertices, mesh.triangles, casting, probe.counting)
        with probe.stage("points"):
            points, n_fragments, n_written = _draw_all_points(maps, edge_ends, rendered.depth, probe.counting)
        with probe.stage("compare"):
            receivers = Receivers(samples.position, samples.normal, samples.candidate, bias,
                                  params.slope_bias)
            nearer = compare_corners(maps, rendered.depth, receivers)
        with probe.stage("reconstruct"):
            shadow = shade(maps, points, samples.position, nearer)
        probe.memory("maps", rendered.n_bytes)
        probe.memory("silhouette_maps", points.nbytes)
        if not probe.counting:
            return ShadowBuffer(shadow)
        disagree = (nearer != ALL_LIT) & (nearer != ALL_SHADOWED)
        for name, value in (("map_fragments", rendered.n_fragments), ("map_texels_written", rendered.n_written),
                            ("silhouette_edges", len(edges)), ("silhouette_fragments", n_fragments),
                            ("silhouette_points_written", n_written)):
            probe.count(name, value)
        _count_samples(frame, disagree, probe)
        return ShadowBuffer(shadow, _pictures(frame, maps, points, shadow))


def _farthest_first(edge_ends: NDArray[np.float64], light: NDArray[np.float64]) -> NDArray[np.int64]:
    """Order of edges by the distance of their middles from the light, falling; equal ones in order of their numbers."""
    x, y, z = (edge_ends[:, 0] + edge_ends[:, 1]).T
    if light[3] == 0.0:
        distance = -(x * light[0] + y * light[1] + z * light[2])
    else:
        x, y, z = (a - 2.0 * b / light[3] for a, b in zip((x, y, z), light[:3], strict=True))
        distance = x * x + y * y + z * z
    return np.argsort(-distance, kind="stable")


def _draw_all_points(maps: LightMaps, edge_ends: NDArray[np.float64], depth: NDArray[np.float64],
                     counting: bool) -> tuple[NDArray[np.float32], int, int]:
    """Draw the silhouette map of every face: float32 (n_layers, side - 1, side - 1, 2), fragments, points kept."""
    points = np.zeros((maps.n_layers, maps.side - 1, maps.side - 1, 2), np.float32)
    n_fragments = n_written = 0
    for face in np.flatnonzero(maps.layer >= 0):
        layer = maps.layer[face]
        fragments, written = draw_silhouettes(map_view(maps, int(face)), edge_ends, depth[layer], points[layer],
                                              counting)
        n_fragments, n_written = n_fragments + fragments, n_written + written
    return points, n_fragments, n_written


def _count_samples(frame: Frame, disagree: NDArray[np.bool_], probe: Probe) -> None:
    """Count what the look-ups read."""
    candidate = frame.samples.candidate
    reads = CORNERS_PER_SAMPLE * candidate + POINTS_PER_SAMPLE * disagree.astype(np.int64)
    probe.count("scene_fill", np.count_nonzero(frame.samples.triangle >= 0))
    probe.count("silhouette_samples", np.count_nonzero(disagree))
    probe.count("corner_reads", CORNERS_PER_SAMPLE * np.count_nonzero(candidate))
    probe.count("point_reads", POINTS_PER_SAMPLE * np.count_nonzero(disagree))
    probe.count_samples(reads)


def _pictures(frame: Frame, maps: LightMaps, points: NDArray[np.float32],
              shadow: NDArray[np.float32]) -> dict[str, NDArray[np.uint8]]:
    """Silhouette points over the scene (Fig. 9), and the warped grid of depths over it (Fig. 10)."""
    samples = frame.samples
    shape = (samples.rows, samples.columns)
    places = find_places(maps, points, samples.position, samples.candidate)
    gray = np.where(samples.triangle < 0, 255.0, np.where(samples.candidate & (shadow == 0), 225.0, 110.0))
    scene = np.repeat(gray.astype(np.uint8)[:, None], 3, axis=1)
    over_scene, warped = scene.copy(), scene.copy()
    over_scene[places.distance < POINT_RADIUS] = (215, 25, 28)
    odd = (places.texel.sum(axis=1) % 2 == 1) & samples.candidate
    warped[odd] = (0.75 * scene[odd] + 0.25 * np.array([44, 123, 182])).astype(np.uint8)
    return {"silhouette_points": over_scene.reshape(*shape, 3), "warped_grid": warped.reshape(*shape, 3)}
