"""Comparison of a shadow buffer with the certified reference."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import Frame, cross, dot

AMBIGUOUS_WARNING_SHARE = 1e-3
"""Share of ambiguous samples among the lit candidates above which a warning is printed."""

SHADOWED_FROM = 0.5
"""A filtered shadow value at or above this counts as "in shadow"."""


LISTED_DIFFERENCES = 1000
"""Differences that are listed one by one, with their distance to the boundary found by brute force."""


class ErrorClass(IntEnum):
    """What a sample's answer is when compared with the reference; the value stored in ``shadow.exr``."""

    OK = 0
    FALSE_SHADOW = 1
    FALSE_LIGHT = 2
    EDGE_TIE = 3


@dataclass(frozen=True)
class Accuracy:
    """Numbers of samples: all, those that need a test, those in shadow, and the mismatches by class."""

    samples: int
    lit_candidates: int
    shadowed: int
    ambiguous: int
    false_shadow: int
    false_light: int
    edge_tie: int

    @property
    def wrong(self) -> int:
        """Samples that differ from the reference although their answer is not ambiguous."""
        return self.false_shadow + self.false_light


def classify(shadow: NDArray[np.float32], truth: NDArray[np.float32], ambiguous: NDArray[np.bool_],
             candidate: NDArray[np.bool_]) -> NDArray[np.uint32]:
    """Sort every sample into an `ErrorClass`, uint32 (n_samples,). Samples that are no lit candidates are OK."""
    dark, truly_dark = shadow >= SHADOWED_FROM, truth >= SHADOWED_FROM
    errors = np.where(dark & ~truly_dark, ErrorClass.FALSE_SHADOW,
                      np.where(~dark & truly_dark, ErrorClass.FALSE_LIGHT, ErrorClass.OK)).astype(np.uint32)
    errors[(errors != ErrorClass.OK) & ambiguous] = ErrorClass.EDGE_TIE
    errors[~candidate] = ErrorClass.OK
    return errors


def measure(shadow: NDArray[np.float32], errors: NDArray[np.uint32], ambiguous: NDArray[np.bool_],
            candidate: NDArray[np.bool_]) -> Accuracy:
    """Count samples per class."""
    per_class = np.bincount(errors, minlength=len(ErrorClass))
    return Accuracy(samples=len(shadow), lit_candidates=int(np.count_nonzero(candidate)),
                    shadowed=int(np.count_nonzero((shadow >= SHADOWED_FROM) & candidate)),
                    ambiguous=int(np.count_nonzero(ambiguous & candidate)),
                    false_shadow=int(per_class[ErrorClass.FALSE_SHADOW]),
                    false_light=int(per_class[ErrorClass.FALSE_LIGHT]),
                    edge_tie=int(per_class[ErrorClass.EDGE_TIE]))


def boundary_distance(frame: Frame, samples: NDArray[np.integer], truth: NDArray[np.float32]) -> NDArray[np.float64]:
    """How far the shadow planes must move for the reference's answer to change, in pixel footprints.

    Brute force over all triangles in float64: meant for the few samples where two methods disagree. Side planes and
    cap plane move by the same distance, measured in the footprint of a pixel at the sample's depth.

    Parameters
    ----------
    frame : the frame.
    samples : indices of lit candidates, (n,).
    truth : the reference's shadow buffer, (n_samples,).

    Returns
    -------
    float64 (n,), inf where no triangle can change the answer.
    """
    corners, light = frame.mesh.corners, frame.light.xyzw()
    distances = np.empty(len(samples))
    for k, index in enumerate(samples):
        point = frame.samples.position[index]
        depth_inside = _depth_inside_frusta(corners, light, point, frame.bias)
        footprint = frame.pixel_footprint * frame.samples.depth[index]
        if truth[index] >= SHADOWED_FROM:
            change = depth_inside.max(initial=-np.inf)
        else:
            change = -depth_inside.max(initial=-np.inf)
        distances[k] = max(change, 0.0) / footprint
    return distances


def list_differences(frame: Frame, shadow: NDArray[np.float32], truth: NDArray[np.float32],
                     ambiguous: NDArray[np.bool_]) -> str:
    """List where a method differs from the reference, as CSV text: sample, both answers, distance to the boundary.

    ``distance_pixels`` is `boundary_distance`, for the first `LISTED_DIFFERENCES` samples.
    """
    different = np.flatnonzero(((shadow >= SHADOWED_FROM) != (truth >= SHADOWED_FROM)) & frame.samples.candidate)
    different = different[:LISTED_DIFFERENCES]
    rows, columns = np.divmod(different, frame.samples.columns)
    lines = ["column,row,shadow,reference,ambiguous,distance_pixels"]
    for k, distance in enumerate(boundary_distance(frame, different, truth)):
        i = different[k]
        lines.append(f"{columns[k]},{rows[k]},{shadow[i]:g},{truth[i]:g},{int(ambiguous[i])},{distance:.3g}")
    return "\n".join(lines) + "\n"


def _depth_inside_frusta(corners: NDArray[np.float64], light: NDArray[np.float64], point: NDArray[np.float64],
                         bias: float) -> NDArray[np.float64]:
    """Signed world distance of a point to the nearest face of each triangle's shadow frustum, positive inside."""
    normal = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    side = np.sign(dot(normal, light[:3] - light[3] * corners[:, 0]))
    casts = side != 0
    corners, normal, side = corners[casts], normal[casts], side[casts]
    depth = -side * dot(normal, point - corners[:, 0]) / np.sqrt(dot(normal, normal)) - bias
    for edge in range(3):
        a, b, c = corners[:, edge], corners[:, (edge + 1) % 3], corners[:, (edge + 2) % 3]
        if light[3] == 0.0:
            plane = cross(b - a, np.broadcast_to(light[:3], a.shape))
            anchor = a
        else:
            plane = cross(a - light[:3], b - light[:3])
            anchor = np.broadcast_to(light[:3], a.shape)
        length = np.sqrt(dot(plane, plane))
        inner = np.sign(dot(plane, c - anchor))
        with np.errstate(invalid="ignore", divide="ignore"):
            distance = inner * dot(plane, point - anchor) / length
        depth = np.minimum(depth, np.where(length > 0, distance, -np.inf))
    return depth
