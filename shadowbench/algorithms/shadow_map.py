"""Shadow maps.

Lance Williams: "Casting Curved Shadows on Curved Surfaces", Computer Graphics (SIGGRAPH 1978), pp. 270-274, with
percentage-closer filtering after Reeves, Salesin, Cook: "Rendering Antialiased Shadows with Depth Maps", SIGGRAPH
1987.

Idea: render the scene as the light sees it and keep the nearest depth of every texel. A view sample is in shadow if
something nearer to the light fills its texel.

Stages
------
fit : choose the projection for the lit candidates (the paper leaves the view to the user).
map : the paper's first step, the light's view: nearest depth per texel, sampled at texel centres.
lookup : the paper's second step: transform each visible point to the light's view and compare depths.

Differences from the paper
--------------------------
* The paper's maps hold 16-bit integers after projection; these hold distance along the map's axis in float64.
* The paper subtracts a constant bias. Here the receiver is also taken as a plane: the depth that is compared is the
  nearest that the receiver's own plane has within reach of the filter (`slope_bias` scales that reach). On the
  map's axis this is, to first order, half a texel's footprint times the tangent of the angle between surface
  normal and light.
* The paper has one map of limited angle. Here samples outside a spot map are looked up in the faces of a cube.
* The paper smooths the picture; `pcf` averages the outcome of several comparisons instead, as Reeves et al. do (on a
  regular grid of texels, not at random places).

Limits: shadows have the resolution of the map. Casters thinner than a texel may be missed (false light), edges are
off by up to a texel, and the biases let light leak in where caster and receiver meet.
"""

from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Mesh, Probe, ShadowBuffer, parameter
from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.light_maps import LightMaps, along, fit_light_maps, locate, map_view, texel
from shadowbench.kernels.projection import N_WORKERS, FloatArray, chunk
from shadowbench.kernels.rasterizer import Target, empty_counts, rasterize


class Params(AlgorithmParams):
    """Parameters of `ShadowMap`."""

    resolution: int = parameter(1024, "texels along the side of the map, or of each face of the cube", ge=1, le=16384)
    projection: Literal["auto", "spot", "cube"] = parameter(
        "auto", "view of a point light; auto is spot if the lit candidates fit a cone of 120 degrees, else cube",
        paper="spot")
    pcf: int = parameter(1, "width of the percentage-closer filter in texels, odd", ge=1, le=63)
    bias: float = parameter(1.0, "depth bias, in units of the scene's bias", ge=0.0, paper=None)
    slope_bias: float = parameter(
        1.0, "scales the reach, in texels, within which a receiver's own plane can't shadow it; 0: constant bias only",
        ge=0.0, paper=0.0)

    @field_validator("pcf")
    @classmethod
    def _odd(cls, value: int) -> int:
        if value % 2 == 0:
            raise ValueError(f"pcf must be odd, so that the filter has a middle texel, not {value}")
        return value


class _Samples(NamedTuple):
    """The view samples to look up and what is found: 1 minus the lit share of the filter."""

    position: FloatArray
    normal: FloatArray
    candidate: NDArray[np.bool_]
    shadow: NDArray[np.float32]


class _Filter(NamedTuple):
    """How depths are compared: texels to each side, bias in world units, reach of the receiver's plane in texels."""

    radius: int
    bias: float
    reach: float


class _ReadCounts(NamedTuple):
    """Texels read per sample, int64 (n_samples,)."""

    texels_read: NDArray[np.int64]


class ShadowMap(Algorithm):
    """Nearest depth from the light, compared with each sample's depth."""

    name: ClassVar[str] = "shadow_map"
    title: ClassVar[str] = "Shadow map"
    paper: ClassVar[str] = "Williams 1978"
    exact: ClassVar[bool] = False
    stages: ClassVar[tuple[str, ...]] = ("fit", "map", "lookup")
    counters: ClassVar[tuple[str, ...]] = ("map_fragments", "map_texels_written", "map_texels_read")
    Params: ClassVar[type[AlgorithmParams]] = Params

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Render the maps that the lit candidates need and look each candidate up in them."""
        samples, radius = frame.samples, self.params.pcf // 2
        with probe.stage("fit"):
            maps = fit_light_maps(frame.light.xyzw(), samples.position, samples.candidate, self.params.projection,
                                  self.params.resolution, radius + 1)
        with probe.stage("map"):
            depth = _render_depth(maps, frame.mesh, probe)
        with probe.stage("lookup"):
            look_up = _Filter(radius, self.params.bias * frame.bias, self.params.slope_bias * (radius + 0.5))
            found = _Samples(samples.position, samples.normal, samples.candidate,
                             np.zeros(len(samples.candidate), np.float32))
            counts = _ReadCounts(np.zeros(len(samples.candidate), np.int64)) if probe.counting else None
            _look_up_all(maps, depth, look_up, found, counts)
        if counts is not None:
            probe.count("map_texels_read", counts.texels_read.sum())
            probe.count_samples(counts.texels_read)
        return ShadowBuffer(found.shadow)


def _render_depth(maps: LightMaps, mesh: Mesh, probe: Probe) -> FloatArray:
    """Rasterise the scene into every map: nearest depth per texel, float64 (n_layers, side, side)."""
    depth = np.full((maps.n_layers, maps.side, maps.side), np.inf)
    triangle = np.full((maps.side, maps.side), -1, np.int32)      # needed by the rasteriser, not by this method
    for face in np.flatnonzero(maps.layer >= 0):
        view = map_view(maps, int(face))
        counts = empty_counts(view) if probe.counting else None
        rasterize(view, mesh.vertices, mesh.triangles, Target(depth[maps.layer[face]], triangle), counts)
        if counts is not None:
            probe.count("map_fragments", counts.fragments.sum(dtype=np.int64))
            probe.count("map_texels_written", counts.written.sum(dtype=np.int64))
    probe.memory("maps", depth.nbytes + triangle.nbytes)
    return depth


@kernel
def _nearest_own_depth(axes, face, perspective, u, v, depth, n, step):
    """Smallest depth that a sample's own plane has on rays up to `step` away in u and in v on the map plane.

    The plane through the sample with normal n has the depth ``depth (n . ray) / (n . other ray)`` on another ray of
    a perspective map.
    """
    along_right, along_up = along(axes, face, 0, n[0], n[1], n[2]), along(axes, face, 1, n[0], n[1], n[2])
    facing = along(axes, face, 2, n[0], n[1], n[2])
    if perspective:
        facing += u * along_right + v * along_up
    change = step * (abs(along_right) + abs(along_up)) / abs(facing)
    return depth / (1.0 + change) if perspective else depth - change


@kernel
def _look_up_chunk(worker, maps, map_depth, look_up, samples, counts):
    """Compare one worker's share of the lit candidates with the maps."""
    position, normal, candidate, shadow = samples.position, samples.normal, samples.candidate, samples.shadow
    eye, axes, half, layer, fitted, perspective = (maps.eye, maps.axes, maps.half, maps.layer, maps.fitted,
                                                   maps.perspective)
    radius, resolution = look_up.radius, maps.resolution
    first, end = chunk(worker, len(candidate))
    for i in range(first, end):
        if candidate[i]:
            face, u, v, depth = locate(axes, half, fitted, perspective, position[i, 0] - eye[0],
                                       position[i, 1] - eye[1], position[i, 2] - eye[2])
            n = (normal[i, 0], normal[i, 1], normal[i, 2])
            step = look_up.reach * 2.0 * half[face] / resolution
            limit = _nearest_own_depth(axes, face, perspective, u, v, depth, n, step) - look_up.bias
            row, column = texel(u, v, half[face], resolution, maps.border)
            # Count the texels around the sample that something nearer fills
            n_nearer = 0
            for y in range(row - radius, row + radius + 1):
                for x in range(column - radius, column + radius + 1):
                    if map_depth[layer[face], y, x] < limit:
                        n_nearer += 1
                    if counts is not None:
                        counts.texels_read[i] += 1
            shadow[i] = np.float32(n_nearer / ((2 * radius + 1) * (2 * radius + 1)))


@parallel_kernel
def _look_up_all(maps, map_depth, look_up, samples, counts):
    for worker in prange(N_WORKERS):
        _look_up_chunk(worker, maps, map_depth, look_up, samples, counts)
