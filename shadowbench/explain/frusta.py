"""Tests of boxes and samples against shadow frusta, by the definitions of `shadowbench.kernels.lanes`, with the reason."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.kernels.lanes import UNDECIDED
from shadowbench.kernels.shadow_frustum import CAP_ROW, EYE_ROW, N_ROWS, WEDGE_ROW, Frusta

ACCEPTED, REFINED = -1, -2
"""Outcomes of a box's test; from 0 up, the row that rejects."""

INSIDE, INSIDE_BY_FLOAT64 = -1, -2
"""Outcomes of a sample's test; from 0 up, the row that it lies outside of."""

LIMIT = np.float32(UNDECIDED)


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

    def boxes(self, k: Any, low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.int64]:
        """Test boxes against a frustum, or a box against frusta.

        Parameters
        ----------
        k : one frustum and n boxes, or n frusta and one box.
        low, high : float32 (n or 1, 3), the boxes' corners in proj space.

        Returns
        -------
        int64 (n,): `ACCEPTED`, `REFINED` or the row that rejects.
        """
        rows = self.rows[k][..., self.order, :].reshape(-1, len(self.order), 4)
        a, b, c, d = np.moveaxis(rows, -1, 0)
        reject, accept = ((a * near[0] + (b * near[1] + d)) + c * near[2] for near in (
            [np.where(row < 0, one[:, None, axis], other[:, None, axis]) for axis, row in enumerate((a, b, c))]
            for one, other in ((high, low), (low, high))))
        outside = reject > LIMIT
        inside = np.all(accept[:, self.own] < -LIMIT, axis=1)
        first = self.order[np.argmax(outside, axis=1)]
        return np.where(outside.any(axis=1), first, np.where(inside, ACCEPTED, REFINED))

    def samples(self, k: int, x: NDArray[np.float64], y: NDArray[np.float64], depth: NDArray[np.float64]
                ) -> NDArray[np.int64]:
        """Test samples against a frustum: `INSIDE`, `INSIDE_BY_FLOAT64` or the row that it lies outside of; int64 (n,).

        Parameters
        ----------
        x, y, depth : float64 (n,), on the image plane, and along the view.
        """
        a, b, c, d = self.rows[k, :WEDGE_ROW, :, None].transpose(1, 0, 2)
        r = np.float32(1.0) / depth.astype(np.float32)
        value = (a * x.astype(np.float32) + (b * y.astype(np.float32) + d)) + c * r
        codes = np.where((value > LIMIT).any(axis=0), np.argmax(value > LIMIT, axis=0), INSIDE)
        unsure = (codes == INSIDE) & ~(value < -LIMIT).all(axis=0)
        a, b, c, d = self.exact_rows[k, :, :, None].transpose(1, 0, 2)
        exact = (a * x + (b * y + d)) + c * (1.0 / depth)
        outside = exact > 0
        outside[CAP_ROW] = exact[CAP_ROW] >= 0
        decided = np.where(outside.any(axis=0), np.argmax(outside, axis=0), INSIDE_BY_FLOAT64)
        return np.where(unsure, decided, codes)
