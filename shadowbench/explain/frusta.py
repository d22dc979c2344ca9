"""Tests of boxes and samples against shadow frusta, by the definitions of `shadowbench.kernels.lanes`, with the reason."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.kernels.lanes import UNDECIDED
from shadowbench.kernels.shadow_frustum import CAP_ROW, EYE_ROW, N_ROWS, WEDGE_ROW, Frusta

ACCEPTED, REFINED = -1, -2
"""Outcomes of a box's test; from 0 up, the row that rejects."""

INSIDE, INSIDE_BY_FLOAT64 = -1, -2
"""Outcomes of a sample's test; from 0 up, the row that it lies outside of."""

LIMIT = np.float32(UNDECIDED)

AT_ONCE = 1024
"""Frusta whose values are held in memory together."""


def row_name(row: int) -> str:
    """What a plane row is."""
    if row < CAP_ROW:
        return f"the plane through the light and edge {row}"
    if row == CAP_ROW:
        return "the triangle's own plane"
    return f"wedge plane {row - WEDGE_ROW}" if row < EYE_ROW else f"culling plane {row - EYE_ROW} through the eye"


def box_outcome(code: int) -> str:
    """A box's outcome in words."""
    if code == ACCEPTED:
        return "accepted: wholly in the frustum"
    return "refined: neither inside nor outside" if code == REFINED else f"rejected by {row_name(code)}"


def sample_outcome(code: int) -> str:
    """A sample's outcome in words."""
    if code == INSIDE:
        return "IN SHADOW"
    return "IN SHADOW, decided in float64" if code == INSIDE_BY_FLOAT64 else f"lit: outside {row_name(code)}"


@dataclass(frozen=True)
class Batch:
    """Outcomes of tests that do not depend on what was found before, made at once.

    Attributes
    ----------
    frusta : int64 (n,), increasing.
    codes : int8 (n, n_boxes or n_samples).
    """

    frusta: NDArray[np.int64]
    codes: NDArray[np.int8]

    def of(self, k: int) -> NDArray[np.int8]:
        """Outcomes of one of the frusta."""
        found: NDArray[np.int8] = self.codes[int(np.searchsorted(self.frusta, k))]
        return found

    def refined(self, lane: int) -> NDArray[np.int64]:
        """Frusta that go on into a box."""
        return self.frusta[self.codes[:, lane] == REFINED]


class FrustumTests:
    """Tests against the frusta of a frame.

    Parameters
    ----------
    frusta : the frusta.
    culling_planes : the parameter of that name.
    """

    def __init__(self, frusta: Frusta, culling_planes: str) -> None:
        self.triangle: NDArray[np.int64] = frusta.triangle
        self.rows = frusta.rows.reshape(-1, N_ROWS, 4)
        self.exact_rows = frusta.exact_rows
        eye = list(range(EYE_ROW, N_ROWS)) if culling_planes not in ("none", "wedge") else []
        wedge = list(range(WEDGE_ROW, EYE_ROW)) if "wedge" in culling_planes else []
        self.order = np.array([*eye, *wedge, *range(WEDGE_ROW)])     # as the kernels test them
        self.own = self.order < WEDGE_ROW

    def boxes(self, frusta: NDArray[np.int64], low: NDArray[np.float32], high: NDArray[np.float32]) -> Batch:
        """Test boxes against frusta, all against all: `ACCEPTED`, `REFINED` or the row that rejects.

        Parameters
        ----------
        frusta : int64 (n,), increasing.
        low, high : float32 (n_boxes, 3), the boxes' corners in proj space.
        """
        codes = np.empty((len(frusta), len(low)), np.int8)
        for start in range(0, len(frusta), AT_ONCE):
            rows = self.rows[frusta[start:start + AT_ONCE]][:, self.order]
            a, b, c, d = (rows[..., [i]] for i in range(4))
            near = [np.where(row < 0, high[:, axis], low[:, axis]) for axis, row in enumerate((a, b, c))]
            outside = (a * near[0] + (b * near[1] + d)) + c * near[2] > LIMIT
            a, b, c, d = (rows[:, self.own][..., [i]] for i in range(4))
            far = [np.where(row < 0, low[:, axis], high[:, axis]) for axis, row in enumerate((a, b, c))]
            inside = np.all((a * far[0] + (b * far[1] + d)) + c * far[2] < -LIMIT, axis=1)
            first = self.order[np.argmax(outside, axis=1)]
            codes[start:start + AT_ONCE] = np.where(outside.any(axis=1), first, np.where(inside, ACCEPTED, REFINED))
        return Batch(frusta, codes)

    def samples(self, frusta: NDArray[np.int64], x: NDArray[np.float64], y: NDArray[np.float64], depth: NDArray[np.float64]
                ) -> Batch:
        """Test samples against frusta, all against all: `INSIDE`, `INSIDE_BY_FLOAT64` or the row that it lies outside of.

        Parameters
        ----------
        frusta : int64 (n,), increasing.
        x, y, depth : float64 (n_samples,), on the image plane, and along the view.
        """
        a, b, c, d = (self.rows[frusta][:, :WEDGE_ROW, [i]] for i in range(4))
        r = np.float32(1.0) / depth.astype(np.float32)
        value = (a * x.astype(np.float32) + (b * y.astype(np.float32) + d)) + c * r
        codes = np.where((value > LIMIT).any(axis=1), np.argmax(value > LIMIT, axis=1), INSIDE)
        unsure = (codes == INSIDE) & ~(value < -LIMIT).all(axis=1)
        a, b, c, d = (self.exact_rows[frusta][:, :, [i]] for i in range(4))
        exact = (a * x + (b * y + d)) + c * (1.0 / depth)
        outside = exact > 0
        outside[:, CAP_ROW] = exact[:, CAP_ROW] >= 0
        decided = np.where(outside.any(axis=1), np.argmax(outside, axis=1), INSIDE_BY_FLOAT64)
        return Batch(frusta, np.where(unsure, decided, codes).astype(np.int8))
