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

from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Probe, ShadowBuffer, parameter
from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.depth_maps import nearest_own_depth, render_depth
from shadowbench.kernels.light_maps import fit_light_maps, locate, texel
from shadowbench.kernels.projection import N_WORKERS, FloatArray, chunk


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
            rendered = render_depth(maps, frame.mesh.vertices, frame.mesh.triangles, counting=probe.counting)
        with probe.stage("lookup"):
            look_up = _Filter(radius, self.params.bias * frame.bias, self.params.slope_bias * (radius + 0.5))
            found = _Samples(samples.position, samples.normal, samples.candidate,
                             np.zeros(len(samples.candidate), np.float32))
            counts = _ReadCounts(np.zeros(len(samples.candidate), np.int64)) if probe.counting else None
            _look_up_all(maps, rendered.depth, look_up, found, counts)
        probe.memory("maps", rendered.n_bytes)
        if counts is not None:
            probe.count("map_fragments", rendered.n_fragments)
            probe.count("map_texels_written", rendered.n_written)
            probe.count("map_texels_read", counts.texels_read.sum())
            probe.count_samples(counts.texels_read)
        return ShadowBuffer(found.shadow)


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
            limit = nearest_own_depth(axes, face, perspective, u, v, depth, n, step, step) - look_up.bias
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
