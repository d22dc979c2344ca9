"""Rows of ``data.csv`` for the cluster hierarchy: a second way to count, jobs by rank, tests near steps of depth."""

from __future__ import annotations

from collections.abc import Callable, Sequence

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
    from shadowbench.reproduce.depth_steps import tests_near_steps

    return [{**row, **tests_near_steps(pictures[str(row["method"])])} for row in rows]
