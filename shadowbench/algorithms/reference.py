"""The certified reference as an algorithm: the truth that all others are judged by."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Probe, ShadowBuffer, parameter
from shadowbench.reference import certified_shadows

TIE_PIXELS = 1e-4
"""Default tie distance in pixel footprints at the sample: far below what a picture shows, far above
rounding."""


class Params(AlgorithmParams):
    """Parameters of the reference."""

    tie_pixels: float = parameter(
        TIE_PIXELS, "Tie distance: how far side planes move to find ambiguous samples, in pixel footprints.",
        ge=0.0, le=1.0)


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
        shadow, _ = reference_frame(frame, probe, tie_pixels=self.params.tie_pixels)
        return ShadowBuffer(shadow)
