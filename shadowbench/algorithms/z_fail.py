"""Stencil shadow volumes, z-fail: counts the faces behind each sample.

Everitt, Kilgard: "Practical and Robust Stenciled Shadow Volumes for Hardware-Accelerated Rendering", 2002, with edge
multiplicities for any triangle soup (Sintorn, Olsson, Assarsson 2011, sec. 4). Volumes reach to infinity, light caps
and dark caps close them, and there is no far clipping. The only failure left is a stencil buffer with too few bits.
"""

from __future__ import annotations

from typing import Literal

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
from shadowbench.kernels import stencil_volumes
from shadowbench.kernels.edges import edge_multiplicities
from shadowbench.kernels.shadow_volumes import find_casters
from shadowbench.kernels.volume_extrusion import VolumeKind, make_faces
from shadowbench.kernels.volume_limits import volume_limits
from shadowbench.kernels.volume_polygons import volume_view


class Params(AlgorithmParams):
    """Parameters of `ZFail`."""

    extrude: Literal["silhouette", "triangle"] = parameter(
        "silhouette", "what volumes are made of: silhouette edges, or every triangle by itself")
    casters: Literal["all", "back_faces", "auto"] = parameter(
        "all", "triangles that cast: all, those facing away from the light, or the latter on closed bodies only")
    stencil_bits: Literal[8, 16, 32] = parameter(32, "bits of the stencil buffer, which wraps around", paper=8)
    scissor: bool = parameter(False, "leave out the part of the screen that a part's shadow can't reach")
    depth_bounds: bool = parameter(False, "leave out samples at depths that a part's shadow can't reach")


class ZFail(Algorithm):
    """Stencil shadow volumes, counted behind the samples. Exact on any triangle soup."""

    name = "z_fail"
    title = "Stencil shadow volumes, z-fail"
    paper = "Everitt and Kilgard 2002"
    exact = True
    stages = ("casters", "silhouette", "volumes", "stencil", "resolve")
    counters = ("stencil_fragments", "depth_tests", "stencil_updates", "peak_stencil", "stencil_overflows",
                "stencil_overflows_lit")
    Params = Params

    def prepare(self, mesh: Mesh) -> stencil_volumes.PreparedVolumes:
        """Find the edges, and the closed bodies if the choice of casters depends on them."""
        by_part = self.params.scissor or self.params.depth_bounds
        return stencil_volumes.prepare_volumes(mesh, self.params.casters, by_part)

    def casters(self, frame: Frame) -> NDArray[np.bool_] | None:
        """Tell which triangles cast."""
        prepared = frame.prepared or self.prepare(frame.mesh)
        return stencil_volumes.choose_casters(frame.mesh.corners, frame.light.xyzw(), self.params.casters,
                                              prepared.closed)

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        params, samples, light = self.params, frame.samples, frame.light.xyzw()
        adjacency = (frame.prepared or self.prepare(frame.mesh)).adjacency
        view = volume_view(frame.camera, samples, stencil_volumes.NEAREST_BEHIND * frame.camera.near)
        with probe.stage("casters"):
            casters = find_casters(adjacency, light, self.casters(frame), frame.bias, view)
        with probe.stage("silhouette"):
            multiplicity = edge_multiplicities(adjacency, casters.facing)
        with probe.stage("volumes"):
            limits = volume_limits(frame.mesh.corners, frame.mesh.part, casters.facing != 0, light, samples, view,
                                   params.scissor, params.depth_bounds)
            # A directional light's dark caps are points
            kind = VolumeKind(params.extrude == "triangle", not frame.light.is_directional)
            faces = make_faces(view, adjacency, light, casters, multiplicity, frame.bias, kind)
        with probe.stage("stencil"):
            target = stencil_volumes.empty_stencil(samples)
            drawn = stencil_volumes.draw_volumes(view, faces, True, target, limits,
                                                 counting=probe.counting)
        with probe.stage("resolve"):
            shadow = stencil_volumes.resolve_stencil(target, params.stencil_bits, samples.candidate)
        for name, n_bytes in stencil_volumes.memory(faces, samples, params.stencil_bits).items():
            probe.memory(name, n_bytes)
        if drawn is not None:
            for name, value in stencil_volumes.totals(drawn, target, params.stencil_bits, samples).items():
                probe.count(name, value)
            probe.count_triangles("stencil_updates", drawn.per_triangle)
            probe.count_samples(drawn.per_sample.updates.reshape(-1))
        return ShadowBuffer(shadow)
