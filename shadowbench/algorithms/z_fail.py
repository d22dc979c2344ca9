"""Stencil shadow volumes, z-fail: counts the faces behind each sample.

Everitt, Kilgard: "Practical and Robust Stenciled Shadow Volumes for Hardware-Accelerated Rendering", 2002, with edge
multiplicities for any triangle soup (Sintorn, Olsson, Assarsson 2011, sec. 4). Volumes reach to infinity, light caps
and dark caps close them, and there is no far clipping. The only failure left is a stencil buffer with too few bits.
"""

from __future__ import annotations

from shadowbench.algorithms.base import Frame, Probe, ShadowBuffer
from shadowbench.algorithms.stencil_base import StencilAlgorithm
from shadowbench.kernels import stencil_volumes
from shadowbench.kernels.edges import edge_multiplicities
from shadowbench.kernels.shadow_volumes import find_casters
from shadowbench.kernels.volume_extrusion import VolumeKind, make_faces
from shadowbench.kernels.volume_polygons import volume_view


class ZFail(StencilAlgorithm):
    """Stencil shadow volumes, counted behind the samples. Exact on any triangle soup."""

    name = "z_fail"
    title = "Stencil shadow volumes, z-fail"
    paper = "Everitt and Kilgard 2002"
    exact = True
    stages = ("casters", "silhouette", "volumes", "stencil", "resolve")

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        samples, light, adjacency = frame.samples, frame.light.xyzw(), self.prepared(frame).adjacency
        view = volume_view(frame.camera, samples, stencil_volumes.NEAREST_BEHIND * frame.camera.near)
        with probe.stage("casters"):
            casters = find_casters(adjacency, light, self.casters(frame), frame.bias, view)
        with probe.stage("silhouette"):
            multiplicity = edge_multiplicities(adjacency, casters.facing)
        with probe.stage("volumes"):
            limits = self.limits(frame, casters, view)
            # A directional light's dark caps are points
            kind = VolumeKind(self.params.extrude == "triangle", not frame.light.is_directional)
            faces = make_faces(view, adjacency, light, casters, multiplicity, frame.bias, kind)
        with probe.stage("stencil"):
            target = stencil_volumes.empty_stencil(samples)
            drawn = stencil_volumes.draw_volumes(view, faces, True, target, limits, counting=probe.counting)
        shadow = self.resolve(frame, target, probe)
        self.record(frame, faces, target, drawn, probe)
        return shadow
