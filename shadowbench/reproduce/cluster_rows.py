"""Rows of ``data.csv`` for the cluster hierarchy: a second way to count, jobs by rank, tests near steps of depth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench.reproduce.items import Measured, Pictures, Row
from shadowbench.reproduce.rows import cell_rows, where

STEP_OF_DEPTH = 1.5
"""Two neighbouring samples are a depth discontinuity if one is this many times as far away as the other: floors at a
grazing angle stay below it, and a thing before something else 10 m behind it at 20 m reaches it."""

NEAR_STEP = 8
"""Pixels around a discontinuity that count as near: the side of a tile, so every tile that has one lies within."""

OPEN = ("trivial_accepts", "trivial_rejects", "refinements", "sample_tests")
"""Tests of `ptsv` without those of children that hold no samples or are already wholly in shadow."""


def counted(*columns: str) -> Callable[[Sequence[Measured]], list[Row]]:
    """Make rows as `cell_rows` does, with ``test_and_set`` and ``open_tests``.

    The latter are the operations if only children that hold samples and are not yet wholly in shadow count: for `ptsv`,
    which counts all children of a visited tile, those in `OPEN`; for the others the same as ``test_and_set``.
    """
    plain = cell_rows("test_and_set", *columns)

    def rows(measured: Sequence[Measured]) -> list[Row]:
        return [{**row, "open_tests": sum(each.cell.counts[name] for name in OPEN) if each.cell.algorithm == "ptsv"
                 else row["test_and_set"]} for row, each in zip(plain(measured), measured, strict=True)]
    return rows


def job_rows(measured: Sequence[Measured]) -> list[Row]:
    """One row for each of the largest jobs: its rank from 1 on, and its iterations."""
    return [{**where(each), "rank": rank, "iterations": iterations}
            for each in measured for rank, iterations in enumerate(each.cell.largest["iterations"], 1)]


def add_tests_near_steps(rows: Sequence[Row], pictures: Pictures) -> list[Row]:
    """Add the mean tests per lit candidate near a depth discontinuity and elsewhere, and the share of those near one."""
    return [{**row, **_tests_near_steps(pictures[str(row["method"])])} for row in rows]


def _tests_near_steps(files: Mapping[str, Path]) -> dict[str, float]:
    """Read one method's tests per sample and its view samples."""
    from shadowbench import image_io

    samples, tests = image_io.read_exr(files["gbuffer_exr"]), image_io.read_exr(files["shadow_exr"])["tests"]
    candidate = samples["candidate"] != 0
    near = near_steps(samples["depth"])
    near, elsewhere = near & candidate, ~near & candidate
    return {"near_share": round(float(near.sum() / candidate.sum()), 6), "tests_near": round(float(tests[near].mean()), 3),
            "tests_elsewhere": round(float(tests[elsewhere].mean()), 3)}


def near_steps(depth: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Tell which samples lie within `NEAR_STEP` rows and columns of a depth discontinuity.

    Parameters
    ----------
    depth : (rows, columns), inf on background, which makes no discontinuity: no hierarchy holds it.
    """
    at: NDArray[np.bool_] = np.zeros(depth.shape, np.bool_)
    for axis in (0, 1):
        a, b = np.moveaxis(depth, axis, 0)[:-1], np.moveaxis(depth, axis, 0)[1:]
        step = np.isfinite(a) & np.isfinite(b) & (np.maximum(a, b) >= STEP_OF_DEPTH * np.minimum(a, b))
        along = np.moveaxis(at, axis, 0)
        along[:-1] |= step
        along[1:] |= step
    # Grow by whole rows, then by whole columns.
    for axis in (0, 1):
        padded = np.pad(at, [(NEAR_STEP, NEAR_STEP) if i == axis else (0, 0) for i in (0, 1)])
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEAR_STEP + 1, axis)
        at = np.asarray(windows.any(axis=-1))
    return at
