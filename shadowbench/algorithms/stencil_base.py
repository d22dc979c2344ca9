"""What the stencil methods have in common: their parameters, what they prepare, who casts, and the record of a frame."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Mesh, Probe, ShadowBuffer, parameter
from shadowbench.kernels import stencil_volumes
from shadowbench.kernels.shadow_volumes import Casters
from shadowbench.kernels.stencil import StencilTarget
from shadowbench.kernels.volume_bins import VolumeLimits
from shadowbench.kernels.volume_faces import Faces
from shadowbench.kernels.volume_limits import volume_limits
from shadowbench.kernels.volume_polygons import VolumeView


class StencilParams(AlgorithmParams):
    """Parameters of every `StencilAlgorithm`."""

    extrude: Literal["silhouette", "triangle"] = parameter(
        "silhouette", "what volumes are made of: silhouette edges, or every triangle by itself")
    casters: Literal["all", "back_faces", "auto"] = parameter(
        "all", "triangles that cast: all, those facing away from the light, or the latter on closed bodies only")
    stencil_bits: Literal[8, 16, 32] = parameter(32, "bits of the stencil buffer, which wraps around", paper=8)
    scissor: bool = parameter(False, "leave out the part of the screen that a part's shadow can't reach")
    depth_bounds: bool = parameter(False, "leave out samples at depths that a part's shadow can't reach")


class StencilAlgorithm(Algorithm):
    """Base of the methods that count volume faces in a stencil buffer."""

    counters: ClassVar[tuple[str, ...]] = ("stencil_fragments", "depth_tests", "stencil_updates", "peak_stencil",
                                           "stencil_overflows", "stencil_overflows_lit")
    Params = StencilParams

    def prepare(self, mesh: Mesh) -> stencil_volumes.PreparedVolumes:
        """Find the edges, and the closed bodies if the choice of casters depends on them."""
        by_part = self.params.scissor or self.params.depth_bounds
        return stencil_volumes.prepare_volumes(mesh, self.params.casters, by_part)

    def prepared(self, frame: Frame) -> stencil_volumes.PreparedVolumes:
        """What `prepare` found, computed here if the frame does not bring it."""
        return frame.prepared or self.prepare(frame.mesh)

    def casters(self, frame: Frame) -> NDArray[np.bool_] | None:
        """Tell which triangles cast."""
        return stencil_volumes.choose_casters(frame.mesh.corners, frame.light.xyzw(), self.params.casters,
                                              self.prepared(frame).closed)

    def limits(self, frame: Frame, casters: Casters, view: VolumeView) -> VolumeLimits:
        """Bound the shadow of each part, as far as the parameters ask for it."""
        return volume_limits(frame.mesh.corners, frame.mesh.part, casters.facing != 0, frame.light.xyzw(),
                             frame.samples, view, self.params.scissor, self.params.depth_bounds)

    def resolve(self, frame: Frame, target: StencilTarget, probe: Probe) -> ShadowBuffer:
        """Read the shadow off the stencil buffer: the stage "resolve"."""
        with probe.stage("resolve"):
            shadow = stencil_volumes.resolve_stencil(target, self.params.stencil_bits, frame.samples.candidate)
        return ShadowBuffer(shadow)

    def record(self, frame: Frame, faces: Faces, target: StencilTarget, drawn: stencil_volumes.Drawn | None,
               probe: Probe) -> None:
        """Report memory and, if drawing counted, totals, triangles and the heat map."""
        bits, samples = self.params.stencil_bits, frame.samples
        for name, n_bytes in stencil_volumes.memory(faces, samples, bits).items():
            probe.memory(name, n_bytes)
        if drawn is not None:
            for name, value in stencil_volumes.totals(drawn, target, bits, samples).items():
                probe.count(name, value)
            probe.count_triangles("stencil_updates", drawn.per_triangle)
            probe.count_samples(drawn.per_sample.updates.reshape(-1))
