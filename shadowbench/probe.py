"""What an algorithm tells about its own work: named stages, operation counts, heat maps and memory.

The runner hands a `Probe` to `Algorithm.shadows`. A timing probe measures stages and ignores counts; a counting
probe collects counts, and its stage times are never reported.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from shadowbench.counters import COUNTERS

N_LARGEST = 1024
"""Largest values kept of a count: what Sintorn et al. 2014 plot in Fig. 7."""


class Probe:
    """Collects what one call of `Algorithm.shadows` did.

    Parameters
    ----------
    counting : True to collect counts. Algorithms pass count arrays to their kernels only then.

    Attributes
    ----------
    stages : seconds per stage name, in order of first use.
    counts : integer totals per counter name.
    levels : integer arrays per counter name, one value per tree level (level 0 is the root).
    triangle_counts : int64 (n_triangles,) per counter name.
    largest : the largest single values per counter name, from the largest down, at most `N_LARGEST`.
    heat : int64 (n_samples,), tests per view sample, or None if the method attributes none.
    memory_bytes : bytes of each named structure that lives during the frame.
    """

    def __init__(self, counting: bool = False) -> None:
        self.counting = counting
        self.stages: dict[str, float] = {}
        self.counts: dict[str, int] = {}
        self.levels: dict[str, list[int]] = {}
        self.triangle_counts: dict[str, NDArray[np.int64]] = {}
        self.largest: dict[str, list[int]] = {}
        self.heat: NDArray[np.int64] | None = None
        self.memory_bytes: dict[str, int] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure the wall time of one named stage; a name used twice adds up."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.stages[name] = self.stages.get(name, 0.0) + time.perf_counter() - start

    def count(self, name: str, value: int | np.integer) -> None:
        """Add to an operation count.

        Raises
        ------
        ValueError
            If the name is not in the registry, or is one of the totals, or the value is negative or no integer.
        """
        if name not in COUNTERS:
            raise ValueError(f"counter {name!r} is not declared in shadowbench.counters")
        if name in ("test_and_set", "all_work"):
            raise ValueError(f"{name} is a total: count its terms instead")
        if not isinstance(value, int | np.integer) or value < 0:
            raise ValueError(f"counter {name} takes integers from 0 up, not {value!r}")
        if self.counting:
            self.counts[name] = self.counts.get(name, 0) + int(value)

    def count_levels(self, name: str, per_level: NDArray[np.integer]) -> None:
        """Add a count per tree level, from the root down; the sum goes to the total of that name."""
        self.count(name, np.asarray(per_level).sum())
        if self.counting:
            before, added = self.levels.get(name, []), [int(v) for v in per_level]
            self.levels[name] = [a + b for a, b in zip_longest(before, added, fillvalue=0)]

    def count_triangles(self, name: str, per_triangle: NDArray[np.integer]) -> None:
        """Attribute a count to the triangles that caused it (the total is counted apart)."""
        if self.counting:
            before = self.triangle_counts.get(name)
            self.triangle_counts[name] = np.asarray(per_triangle, np.int64) + (0 if before is None else before)

    def list_largest(self, name: str, values: NDArray[np.integer]) -> None:
        """Keep the largest of the values that a count is the sum of, such as those of single jobs."""
        if self.counting:
            values = np.concatenate([values, self.largest.get(name, [])])
            self.largest[name] = [int(v) for v in np.sort(values)[::-1][:N_LARGEST]]

    def count_samples(self, tests: NDArray[np.integer]) -> None:
        """Add to the heat map: tests per view sample, int (n_samples,)."""
        if self.counting:
            added = tests.astype(np.int64)
            self.heat = added if self.heat is None else self.heat + added

    def memory(self, name: str, n_bytes: int) -> None:
        """Record the size of a structure that lives during the frame; of several in turn, the largest."""
        self.memory_bytes[name] = max(int(n_bytes), self.memory_bytes.get(name, 0))

    def all_counts(self) -> dict[str, int]:
        """Counts with both totals, sorted by name."""
        totals = dict(self.counts)
        totals["test_and_set"] = sum(v for k, v in self.counts.items() if COUNTERS[k].in_test_and_set)
        totals["all_work"] = sum(v for k, v in self.counts.items() if COUNTERS[k].in_all_work)
        return dict(sorted(totals.items()))
