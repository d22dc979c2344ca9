"""Stencil shadow volumes, z-pass: counts the faces between the eye and each sample.

Crow 1977, Heidmann 1991, with edge multiplicities for any triangle soup (Sintorn, Olsson, Assarsson 2011, sec. 4) and
volumes that reach to infinity. The count starts from the number of volumes that contain the eye; ``eye_count: off``
starts from zero, which reproduces the classical failure. Light caps are drawn, also between the eye and the near plane:
the biased caps lie behind the surface, so a sight line may cross them where it just passes the surface.
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
from shadowbench.kernels.eye_volumes import add_touching, eye_totals, find_eye_volumes
from shadowbench.kernels.shadow_volumes import find_casters
from shadowbench.kernels.volume_extrusion import VolumeKind, make_faces
from shadowbench.kernels.volume_limits import volume_limits
from shadowbench.kernels.volume_polygons import volume_view


class Params(AlgorithmParams):
    """Parameters of `ZPass`."""

    extrude: Literal["silhouette", "triangle"] = parameter(
        "silhouette", "what volumes are made of: silhouette edges, or every triangle by itself")
    casters: Literal["all", "back_faces", "auto"] = parameter(
        "all", "triangles that cast: all, those facing away from the light, or the latter on closed bodies only")
    eye_count: Literal["robust", "off"] = parameter(
        "robust", "start from the number of volumes that contain the eye, or from zero")
    stencil_bits: Literal[8, 16, 32] = parameter(32, "bits of the stencil buffer, which wraps around", paper=8)
    scissor: bool = parameter(False, "leave out the part of the screen that a part's shadow can't reach")
    depth_bounds: bool = parameter(False, "leave out samples at depths that a part's shadow can't reach")


class ZPass(Algorithm):
    """Stencil shadow volumes, counted before the samples. Exact on any triangle soup."""

    name = "z_pass"
    title = "Stencil shadow volumes, z-pass"
    paper = "Heidmann 1991"
    exact = True
    stages = ("casters", "eye_count", "silhouette", "volumes", "stencil", "resolve")
    counters = ("stencil_fragments", "depth_tests", "stencil_updates", "sample_tests", "eye_tests", "eye_volumes",
                "eye_volumes_ignored", "peak_stencil", "stencil_overflows", "stencil_overflows_lit")
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
        view = volume_view(frame.camera, samples, stencil_volumes.NEAREST_BEFORE * frame.camera.near)
        with probe.stage("casters"):
            casters = find_casters(adjacency, light, self.casters(frame), frame.bias, view)
        with probe.stage("eye_count"):
            eye = find_eye_volumes(adjacency, light, casters, frame.bias, view, params.eye_count == "robust")
        with probe.stage("silhouette"):
            multiplicity = edge_multiplicities(adjacency, eye.casters.facing)
        with probe.stage("volumes"):
            limits = volume_limits(frame.mesh.corners, frame.mesh.part, casters.facing != 0, light, samples, view,
                                   params.scissor, params.depth_bounds)
            kind = VolumeKind(params.extrude == "triangle", False)
            faces = make_faces(view, adjacency, light, eye.casters, multiplicity, frame.bias, kind)
        with probe.stage("stencil"):
            target = stencil_volumes.empty_stencil(samples)
            stencil_volumes.add_eye_volumes(target, eye.around, limits)
            add_touching(eye.touching, adjacency, light, casters, frame.bias, view, target)
            drawn = stencil_volumes.draw_volumes(view, faces, False, target, limits,
                                                 counting=probe.counting)
        with probe.stage("resolve"):
            shadow = stencil_volumes.resolve_stencil(target, params.stencil_bits, samples.candidate)
        for name, n_bytes in stencil_volumes.memory(faces, samples, params.stencil_bits).items():
            probe.memory(name, n_bytes)
        if drawn is not None:
            for name, value in stencil_volumes.totals(drawn, target, params.stencil_bits, samples).items():
                probe.count(name, value)
            for name, value in eye_totals(eye, adjacency, light, casters, frame.bias, view).items():
                probe.count(name, value)
            probe.count("sample_tests", len(eye.touching) * len(samples.depth))
            probe.count_triangles("stencil_updates", drawn.per_triangle)
            probe.count_samples(drawn.per_sample.updates.reshape(-1) + len(eye.touching))
        return ShadowBuffer(shadow)
