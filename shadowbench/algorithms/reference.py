"""The certified reference as an algorithm: the truth that all others are judged by."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal, cast

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import (
    Algorithm,
    AlgorithmParams,
    Frame,
    Probe,
    ShadowBuffer,
    Transparency,
    parameter,
    taken_materials,
)
from shadowbench.geometry import FloatArray
from shadowbench.reference import certified_shadows, certified_transmittance

TIE_PIXELS = 1e-4
"""Default tie distance in pixel footprints at the sample: far below what a picture shows, far above
rounding."""


class Params(AlgorithmParams):
    """Parameters of the reference."""

    tie_pixels: float = parameter(
        TIE_PIXELS, "Tie distance: how far side planes move to find ambiguous samples, in pixel footprints.",
        ge=0.0, le=1.0)
    transparency: Literal["alpha", "constant", "color", "off"] = parameter(
        "alpha", "What materials let through: by alpha and its texture, by alpha alone, by colours, or nothing.")


def reference_frame(
    frame: Frame, probe: Probe, casters: NDArray[np.bool_] | None = None, tie_pixels: float = TIE_PIXELS
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Decide the lit candidates of a frame.

    Parameters
    ----------
    frame : one frame of view samples.
    probe : takes stages, counts, heat map and memory.
    casters : bool (n_triangles,), the triangles that cast, or None for all.
    tie_pixels : tie distance in pixel footprints at the sample.

    Returns
    -------
    shadow : float32 (n_samples,), 1 = in shadow; 0 for samples that are no lit candidates.
    ambiguous : bool (n_samples,), True where the answer hangs on the tie distance or the bias; False for
        samples that are no lit candidates.
    """
    with probe.stage("setup"):
        candidates = np.flatnonzero(frame.samples.candidate)
        positions = frame.samples.position[candidates]
        tie_distance = tie_pixels * frame.pixel_footprint * frame.samples.depth[candidates]
    result = certified_shadows(frame.mesh.corners, frame.light.xyzw(), positions, frame.bias, tie_distance,
                               casters, counting=probe.counting, stage=probe.stage)
    with probe.stage("merge"):
        shadow = np.zeros(len(frame.samples.candidate), np.float32)
        shadow[candidates] = result.shadow
        ambiguous = np.zeros(len(shadow), np.bool_)
        ambiguous[candidates] = result.ambiguous
    probe.count("node_tests", result.statistics.node_tests)
    probe.count("sample_tests", result.statistics.sample_tests)
    probe.count("exact_tests", result.statistics.exact_tests)
    if result.heat is not None:
        heat = np.zeros(len(shadow), np.int64)
        heat[candidates] = result.heat
        probe.count_samples(heat)
    probe.memory("light_tree", result.statistics.memory_bytes)
    return shadow, ambiguous


def lets_light_through(frame: Frame, mode: Transparency) -> bool:
    """True if some triangle's material is not opaque, as the mode takes it."""
    opaque = np.array([m.is_opaque for m in taken_materials(frame.mesh, mode)], np.bool_)
    return not opaque[frame.mesh.material].all()


def transparent_frame(frame: Frame, probe: Probe, mode: Transparency, casters: NDArray[np.bool_] | None = None,
                      tie_pixels: float = TIE_PIXELS) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Find the light that arrives at the lit candidates of a frame.

    Parameters
    ----------
    mode : how materials are taken; by chance means the expected value.
    (the others as in `reference_frame`)

    Returns
    -------
    arriving : float64 (n_samples, n_channels), shares of the light that arrive; 1 for samples that are no lit candidates.
    ambiguous : as in `reference_frame`.
    """
    candidates = np.flatnonzero(frame.samples.candidate)
    mesh = replace(frame.mesh, materials=taken_materials(frame.mesh, mode))
    tie_distance = tie_pixels * frame.pixel_footprint * frame.samples.depth[candidates]
    result = certified_transmittance(mesh, frame.light.xyzw(), frame.samples.position[candidates], frame.bias, tie_distance,
                                     mode == "color", casters, stage=probe.stage)
    arriving = np.ones((len(frame.samples.candidate), result.transmittance.shape[1]))
    arriving[candidates] = result.transmittance
    ambiguous = np.zeros(len(arriving), np.bool_)
    ambiguous[candidates] = result.ambiguous
    return arriving, ambiguous


class Reference(Algorithm):
    """Error-bounded float64 with rational arithmetic behind it; exact for every light, mesh and scale."""

    name: ClassVar[str] = "reference"
    title: ClassVar[str] = "Certified reference"
    paper: ClassVar[str] = "shadowbench"
    exact: ClassVar[bool] = True
    stages: ClassVar[tuple[str, ...]] = ("setup", "hierarchy", "traversal", "exact", "merge")
    counters: ClassVar[tuple[str, ...]] = ("node_tests", "sample_tests", "exact_tests")
    Params: ClassVar[type[AlgorithmParams]] = Params

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        mode = self.judged_as(frame)
        if not lets_light_through(frame, mode):
            shadow, _ = reference_frame(frame, probe, tie_pixels=self.params.tie_pixels)
            return ShadowBuffer(shadow)
        arriving, _ = transparent_frame(frame, probe, mode, tie_pixels=self.params.tie_pixels)
        shares = arriving.astype(np.float32) if mode == "color" else None
        return ShadowBuffer((1.0 - arriving.mean(axis=1)).astype(np.float32), arriving=shares)

    def judged_as(self, frame: Frame) -> Transparency:
        """How materials are taken."""
        return cast("Transparency", self.params.transparency)
