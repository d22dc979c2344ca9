"""How a count is spread over the triangles that caused it, small enough to be kept with every result."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

N_HEAVIEST = 16
"""Triangles listed by number, the heaviest first."""


class TriangleWork(BaseModel):
    """One count by triangle. Classes are by powers of two: a count of 0, of 1, of 2 to 3, of 4 to 7 and so on."""

    model_config = ConfigDict(extra="forbid")
    triangles: list[int] = Field(description="number of triangles in each class")
    work: list[int] = Field(description="sum of the counts in each class")
    heaviest: list[tuple[int, int]] = Field(description="triangle and count, from the largest count down")


def triangle_work(counts: NDArray[np.int64]) -> TriangleWork:
    """Sort the triangles of a mesh into classes by their count.

    Parameters
    ----------
    counts : int64 (n_triangles,), from 0 to 2**53.
    """
    classes = np.frexp(counts.astype(np.float64))[1].astype(np.int64)       # 0 for 0, else the number of binary digits
    n_classes = int(classes.max(initial=0)) + 1
    work = np.zeros(n_classes, np.int64)
    np.add.at(work, classes, counts)
    heaviest = np.argsort(-counts, kind="stable")[:N_HEAVIEST]
    return TriangleWork(triangles=np.bincount(classes, minlength=n_classes).tolist(), work=work.tolist(),
                        heaviest=[(int(t), int(counts[t])) for t in heaviest if counts[t] > 0])
