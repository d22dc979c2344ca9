"""Decides whether two sets of timings differ by more than noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

DRIFT = 0.05
"""Share by which medians must differ: two processes on one quiet machine differ by a few percent for no reason in the code
(memory layout, clock, what else runs), however small the spread within each of them."""

FEWEST_REPEATS = 3
"""With three repeats on each side, ranges that do not overlap happen by chance in one case of ten; with two, in one of
three."""

TimeVerdict = Literal["faster", "slower", "noise", "too few repeats", "not timed"]


@dataclass(frozen=True)
class TimeChange:
    """Two sets of timings, in seconds.

    Attributes
    ----------
    a, b : repeats.
    verdict : "faster" or "slower" (B than A) if the ranges of the repeats do not overlap and the medians differ by more
        than `DRIFT`, else "noise".
    """

    a: tuple[float, ...]
    b: tuple[float, ...]
    verdict: TimeVerdict

    @property
    def change(self) -> float | None:
        """Change of the median from A to B, as a share of A's."""
        return float(np.median(self.b) / np.median(self.a) - 1.0) if self.a and self.b and np.median(self.a) > 0 else None


def compare_times(a: Sequence[float], b: Sequence[float]) -> TimeChange:
    """Compare the repeats of one measurement in two runs."""
    return TimeChange(tuple(a), tuple(b), _verdict(a, b))


def _verdict(a: Sequence[float], b: Sequence[float]) -> TimeVerdict:
    if not a or not b:
        return "not timed"
    if min(len(a), len(b)) < FEWEST_REPEATS:
        return "too few repeats"
    median_a, median_b = float(np.median(a)), float(np.median(b))
    if median_b < (1.0 - DRIFT) * median_a and max(b) < min(a):
        return "faster"
    if median_a < (1.0 - DRIFT) * median_b and max(a) < min(b):
        return "slower"
    return "noise"


def spread_text(seconds: Sequence[float]) -> str:
    """Median in milliseconds, with half the range of the repeats; empty if there are none."""
    if not seconds:
        return ""
    return f"{1e3 * float(np.median(seconds)):.2f} ±{500.0 * (max(seconds) - min(seconds)):.2f}"
