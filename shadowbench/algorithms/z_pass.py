"""Stencil shadow volumes, z-pass: counts the faces between the eye and each sample.

Crow 1977, Heidmann 1991, with edge multiplicities for any triangle soup (Sintorn, Olsson, Assarsson 2011, sec. 4) and
volumes that reach to infinity. The count starts from the number of volumes that contain the eye; ``eye_count: off``
starts from zero, which reproduces the classical failure. Light caps are drawn, also between the eye and the near plane:
the biased caps lie behind the surface, so a sight line may cross them where it just passes the surface.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from shadowbench.algorithms.base import Frame, Probe, ShadowBuffer, parameter
from shadowbench.algorithms.stencil_base import StencilAlgorithm, StencilParams
from shadowbench.kernels import stencil_volumes
from shadowbench.kernels.edges import edge_multiplicities
from shadowbench.kernels.eye_volumes import add_touching, eye_totals, find_eye_volumes
from shadowbench.kernels.shadow_volumes import find_casters
from shadowbench.kernels.volume_extrusion import VolumeKind, make_faces
from shadowbench.kernels.volume_polygons import volume_view


class Params(StencilParams):
    """Parameters of `ZPass`."""

    eye_count: Literal["robust", "off"] = parameter(
        "robust", "start from the number of volumes that contain the eye, or from zero")


class ZPass(StencilAlgorithm):
    """Stencil shadow volumes, counted before the samples. Exact on any triangle soup."""

    name = "z_pass"
    title = "Stencil shadow volumes, z-pass"
    paper = "Heidmann 1991"
    exact = True
    stages = ("casters", "eye_count", "silhouette", "volumes", "stencil", "resolve")
    counters = (*StencilAlgorithm.counters, "sample_tests", "eye_tests", "eye_volumes", "eye_volumes_ignored")
    Params = Params

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        samples, light, adjacency = frame.samples, frame.light.xyzw(), self.prepared(frame).adjacency
        view = volume_view(frame.camera, samples, stencil_volumes.NEAREST_BEFORE * frame.camera.near)
        with probe.stage("casters"):
            casters = find_casters(adjacency, light, self.casters(frame), frame.bias, view)
        with probe.stage("eye_count"):
            eye = find_eye_volumes(adjacency, light, casters, frame.bias, view, self.params.eye_count == "robust")
        with probe.stage("silhouette"):
            multiplicity = edge_multiplicities(adjacency, eye.casters.facing)
        with probe.stage("volumes"):
            limits = self.limits(frame, casters, view)
            kind = VolumeKind(self.params.extrude == "triangle", False)
            faces = make_faces(view, adjacency, light, eye.casters, multiplicity, frame.bias, kind)
        with probe.stage("stencil"):
            target = stencil_volumes.empty_stencil(samples)
            stencil_volumes.add_eye_volumes(target, eye.around, limits)
            add_touching(eye.touching, adjacency, light, casters, frame.bias, view, target)
            drawn = stencil_volumes.draw_volumes(view, faces, False, target, limits, counting=probe.counting)
        shadow = self.resolve(frame, target, probe)
        self.record(frame, faces, target, drawn, probe)
        if drawn is not None:
            for name, value in eye_totals(eye, adjacency, light, casters, frame.bias, view).items():
                probe.count(name, value)
            probe.count("sample_tests", len(eye.touching) * len(samples.depth))
            probe.count_samples(np.full(len(samples.depth), len(eye.touching)))
        return shadow
