"""What a cell is judged by: the reference's answer over the same casters, with materials taken in the same way."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shadowbench import accuracy
from shadowbench.accuracy import ErrorClass
from shadowbench.algorithms.base import Algorithm, ShadowBuffer, Transparency
from shadowbench.algorithms.reference import lets_light_through, reference_frame, transparent_frame
from shadowbench.geometry import FloatArray, Frame
from shadowbench.probe import Probe
from shadowbench.view_samples import resolve_to_pixels

LIGHT_TOLERANCE = 1e-5
"""Greatest difference of a share of light that is no error: float32 products of some hundred factors stay far below."""


@dataclass(frozen=True, eq=False)
class Truth:
    """The reference's answer for one frame, one set of casters and one way to take materials.

    Attributes
    ----------
    shadow : float32 (n_samples,), one less the mean share of the light that arrives.
    ambiguous : bool (n_samples,), True where the answer hangs on the last digits.
    arriving : float64 (n_samples, n_channels), shares of the light that arrive; None if every caster is opaque.
    """

    shadow: NDArray[np.float32]
    ambiguous: NDArray[np.bool_]
    arriving: FloatArray | None = None


def find_truth(frame: Frame, casters: NDArray[np.bool_] | None, mode: Transparency) -> Truth:
    """Ask the reference.

    Parameters
    ----------
    casters : bool (n_triangles,), the triangles that cast, or None for all.
    mode : how materials are taken.
    """
    if not lets_light_through(frame, mode):
        return Truth(*reference_frame(frame, Probe(), casters))
    arriving, ambiguous = transparent_frame(frame, Probe(), mode, casters)
    return Truth((1.0 - arriving.mean(axis=1)).astype(np.float32), ambiguous, arriving)


def classify(algorithm: Algorithm, buffer: ShadowBuffer, truth: Truth, frame: Frame) -> NDArray[np.uint32]:
    """Sort every sample into an `ErrorClass`, uint32 (n_samples,).

    Where light passes through casters, a share that is off by more than `LIGHT_TOLERANCE` is an error. What is drawn by
    chance can be wrong only where nothing is left to chance.
    """
    candidate = frame.samples.candidate
    if truth.arriving is None:
        return accuracy.classify(buffer.shadow, truth.shadow, truth.ambiguous, candidate)
    if algorithm.judged_as(frame) == "stochastic":
        decided = (truth.arriving[:, 0] == 0.0) | (truth.arriving[:, 0] == 1.0)
        return accuracy.classify(buffer.shadow, truth.shadow, truth.ambiguous, candidate & decided)
    answer = (1.0 - buffer.shadow)[:, None] if buffer.arriving is None else buffer.arriving
    excess = answer - truth.arriving
    errors = np.where((excess > LIGHT_TOLERANCE).any(axis=1), ErrorClass.FALSE_LIGHT,
                      np.where((excess < -LIGHT_TOLERANCE).any(axis=1), ErrorClass.FALSE_SHADOW, ErrorClass.OK))
    errors = errors.astype(np.uint32)
    errors[(errors != ErrorClass.OK) & truth.ambiguous] = ErrorClass.EDGE_TIE
    errors[~candidate] = ErrorClass.OK
    return errors


def antialiasing_difference(frame: Frame, truth: Truth, supersampled: Truth) -> FloatArray:
    """How much darker derivative antialiasing makes each pixel than supersampling does, float64 (height, width).

    Exactly right answers are compared, so only the scheme itself differs: it is wrong by design where a pixel sees more
    than one surface.
    Parameters
    ----------
    truth, supersampled : for the samples spread by derivatives, and for those on the surfaces that they see.
    """
    assert frame.supersampled is not None
    darker = resolve_to_pixels(truth.shadow, frame.image) - resolve_to_pixels(supersampled.shadow, frame.image)
    return np.where(np.abs(darker) > LIGHT_TOLERANCE, darker, 0.0)


class Judge:
    """Remembers the reference's answers of one frame, layer by layer.

    Parameters
    ----------
    frame : whose samples are judged.
    """

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self._truths: dict[tuple[bytes, Transparency], list[Truth]] = {}
        self._supersampled: dict[tuple[bytes, Transparency], Truth] = {}

    def knows(self, casters: NDArray[np.bool_] | None, mode: Transparency) -> bool:
        """True if the answer needs no computing."""
        return self._key(casters, mode) in self._truths

    def truths(self, casters: NDArray[np.bool_] | None, mode: Transparency) -> list[Truth]:
        """The reference's answer for each layer, computed once."""
        key = self._key(casters, mode)
        if key not in self._truths:
            self._truths[key] = [find_truth(layer, casters, key[1]) for layer in self.frame.layers]
        return self._truths[key]

    def supersampled(self, casters: NDArray[np.bool_] | None, mode: Transparency) -> Truth:
        """The reference's answer for the samples that derivatives stand for, computed once."""
        key = self._key(casters, mode)
        if key not in self._supersampled:
            assert self.frame.supersampled is not None
            frame = replace(self.frame, samples=self.frame.supersampled)
            self._supersampled[key] = find_truth(frame, casters, key[1])
        return self._supersampled[key]

    def _key(self, casters: NDArray[np.bool_] | None, mode: Transparency) -> tuple[bytes, Transparency]:
        """What the answer depends on: modes that come to the same in this scene share it."""
        if mode == "stochastic":
            mode = "alpha"
        if not lets_light_through(self.frame, mode):
            mode = "off"
        return (b"all" if casters is None else np.packbits(casters).tobytes(), mode)
