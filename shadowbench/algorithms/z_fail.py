"""Stencil shadow volumes, z-fail: counts the faces behind each sample.

Everitt, Kilgard: "Practical and Robust Stenciled Shadow Volumes for Hardware-Accelerated Rendering", 2002, with edge
multiplicities for any triangle soup (Sintorn, Olsson, Assarsson 2011, sec. 4). Volumes reach to infinity, light caps
and dark caps close them, and there is no far clipping. The only failure left is a stencil buffer with too few bits.

With `transparency` ``constant``, casters whose alpha is the same all over cast lighter shadows (Kim, Kim, Turk: "A
Shadow-Volume Algorithm for Opaque and Transparent Nonmanifold Casters", 2008): a float buffer takes log(1 - alpha) for
each volume around a sample. The volumes of each alpha are counted on their own, and the count is multiplied by the
logarithm: the sum is the paper's, without the rounding of terms that cancel. Opaque casters stay in the stencil buffer, so
no logarithm of zero is taken.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Frame, Probe, ShadowBuffer, Transparency, parameter, taken_materials
from shadowbench.algorithms.stencil_base import StencilAlgorithm, StencilParams
from shadowbench.kernels import stencil_volumes
from shadowbench.kernels.edges import edge_multiplicities
from shadowbench.kernels.shadow_volumes import find_casters
from shadowbench.kernels.stencil import StencilCounts, StencilTarget
from shadowbench.kernels.volume_extrusion import VolumeKind, make_faces
from shadowbench.kernels.volume_faces import Faces
from shadowbench.kernels.volume_polygons import volume_view

FLOAT_BYTES = 4
"""Of the buffer that takes logarithms, per sample."""


class Params(StencilParams):
    """Parameters of `ZFail`."""

    transparency: Literal["off", "constant"] = parameter(
        "off", "what materials let through: nothing, or one less their alpha, textures ignored")


class _Counted(NamedTuple):
    """Volumes counted in a stencil buffer of their own."""

    faces: Faces
    target: StencilTarget
    drawn: stencil_volumes.Drawn | None


class ZFail(StencilAlgorithm):
    """Stencil shadow volumes, counted behind the samples. Exact on any triangle soup."""

    name = "z_fail"
    title = "Stencil shadow volumes, z-fail"
    paper = "Everitt and Kilgard 2002"
    exact = True
    stages = ("casters", "silhouette", "volumes", "stencil", "resolve")
    Params = Params

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        materials = taken_materials(frame.mesh, self.params.transparency)
        opacity = np.array([m.opacity for m in materials])[frame.mesh.material]
        chosen = self.casters(frame)
        if (opacity == 1.0).all():
            counted = self._count(frame, chosen, probe)
            shadow = self.resolve(frame, counted.target, probe)
            self.record(frame, *counted, probe)
            return shadow
        return self._transparent(frame, opacity, chosen, probe)

    def _transparent(self, frame: Frame, opacity: NDArray[np.float64], chosen: NDArray[np.bool_] | None, probe: Probe
                     ) -> ShadowBuffer:
        """Count the opaque casters' volumes, then those of each alpha, and add up their logarithms."""
        counted = self._count(frame, _among(chosen, opacity == 1.0), probe)
        dark = self.resolve(frame, counted.target, probe).shadow
        logarithms, drawn = np.zeros(len(dark), np.float32), counted.drawn
        for alpha in np.unique(opacity[(opacity > 0.0) & (opacity < 1.0)]):
            around = self._count(frame, _among(chosen, opacity == alpha), probe)
            with probe.stage("resolve"):
                logarithms += (np.log(1.0 - alpha) * around.target.stencil.reshape(-1)).astype(np.float32)
            if drawn is not None and around.drawn is not None:
                drawn = _sum(drawn, around.drawn)
        with probe.stage("resolve"):
            arriving = np.where((dark == 0.0) & frame.samples.candidate, np.exp(logarithms), 1.0 - dark)
        self.record(frame, counted.faces, counted.target, drawn, probe)
        probe.memory("logarithms", FLOAT_BYTES * len(dark))
        return ShadowBuffer((1.0 - arriving).astype(np.float32))

    def judged_as(self, frame: Frame) -> Transparency:
        """How the reference must take the materials, to judge this method."""
        mode: Transparency = self.params.transparency
        return mode

    def _count(self, frame: Frame, chosen: NDArray[np.bool_] | None, probe: Probe) -> _Counted:
        """Count the volumes of the chosen casters around each sample."""
        samples, light, adjacency = frame.samples, frame.light.xyzw(), self.prepared(frame).adjacency
        view = volume_view(frame.camera, samples, stencil_volumes.NEAREST_BEHIND * frame.camera.near)
        with probe.stage("casters"):
            casters = find_casters(adjacency, light, chosen, frame.bias, view)
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
        return _Counted(faces, target, drawn)


def _among(chosen: NDArray[np.bool_] | None, group: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Casters of a group."""
    return group if chosen is None else chosen & group


def _sum(a: stencil_volumes.Drawn, b: stencil_volumes.Drawn) -> stencil_volumes.Drawn:
    """Add what two passes counted."""
    per_sample = StencilCounts(a.per_sample.fragments + b.per_sample.fragments,
                               a.per_sample.depth_tests + b.per_sample.depth_tests,
                               a.per_sample.updates + b.per_sample.updates,
                               np.concatenate([a.per_sample.per_entry, b.per_sample.per_entry]))
    return stencil_volumes.Drawn(per_sample, a.per_triangle + b.per_triangle)
