"""The certified reference: which samples are in shadow, by the definition and with no rounding error."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.reference.exact import exact_facing, exact_flags
from shadowbench.reference.frusta import Frusta, find_facing, make_frusta
from shadowbench.reference.light_space import LightSpace, make_light_space
from shadowbench.reference.light_tree import (
    BRANCHING,
    LEAF_SAMPLES,
    WORK_LEVEL,
    LightTree,
    build_light_tree,
)
from shadowbench.reference.predicates import (
    BIAS_DOUBLED,
    BIAS_FLOOR,
    PLANES_IN,
    PLANES_OUT,
    SHADOWED,
    UNIT_ROUNDOFF,
)
from shadowbench.reference.traversal import N_BLOCKS, WalkCounts, Work, deal, walk

FLOOR_ROUNDINGS = 64
"""Rounding floor of the bias, in unit roundoffs of the largest coordinate: a sample position is the end of a
chain of some ten roundings of numbers of that size, so a sample may lie that far behind the very triangle it
was computed on. Biases below the floor say nothing about the scene, so the ambiguity test leaves them out."""
LIST_ENTRIES = 1 << 24
"""Entries that the triangle lists of a batch may take: 64 MB of int32."""
LARGEST_BATCH = 1 << 16
"""Triangles per batch: bounds the memory of their planes to 14 MB."""
PAIR_CAPACITY = 2 * LEAF_SAMPLES * BRANCHING**WORK_LEVEL
"""Undecided pairs that a work node holds before they are settled: room for two triangles that leave all
open."""


class Statistics(NamedTuple):
    """Counts of one call.

    Attributes
    ----------
    node_tests, sample_tests : tests of boxes and of samples against shadow frusta (0 unless counting).
    exact_tests : sample-triangle pairs settled in rational arithmetic.
    exact_facings : triangles whose facing was settled in rational arithmetic.
    memory_bytes : size of the sorted samples, the tree, and the working arrays.
    """

    node_tests: int = 0
    sample_tests: int = 0
    exact_tests: int = 0
    exact_facings: int = 0
    memory_bytes: int = 0


class ReferenceResult(NamedTuple):
    """The truth about a set of samples.

    Attributes
    ----------
    shadow : bool (n,), True where some triangle shadows the sample.
    ambiguous : bool (n,), True where the answer changes if all side planes move out, or in, by the tie
        distance, or for some bias between the rounding floor and twice the bias.
    flags : uint8 (n,), the bits of `shadowbench.reference.predicates` that both come from.
    heat : int64 (n,), sample tests per sample, or None unless counting.
    statistics : counts.
    """

    shadow: NDArray[np.bool_]
    ambiguous: NDArray[np.bool_]
    flags: NDArray[np.uint8]
    heat: NDArray[np.int64] | None
    statistics: Statistics


StageFactory = Callable[[str], AbstractContextManager[Any]]


def bias_floor(corners: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
    """Return the rounding floor of the bias: `FLOOR_ROUNDINGS` unit roundoffs of the largest coordinate."""
    largest = max(float(np.abs(array).max(initial=0.0)) for array in (corners, positions))
    return FLOOR_ROUNDINGS * UNIT_ROUNDOFF * largest


def certified_shadows(
    corners: NDArray[np.float64],
    light: NDArray[np.float64],
    positions: NDArray[np.float64],
    bias: float,
    tie_distance: NDArray[np.float64],
    casters: NDArray[np.bool_] | None = None,
    *,
    counting: bool = False,
    stage: StageFactory = nullcontext,
) -> ReferenceResult:
    """Decide for each sample whether it is in shadow, exactly, and whether that hangs by a thread.

    Sample p is shadowed by triangle T if it is behind T's plane, seen from the light, by more than `bias`,
    and on the inner side of, or exactly on, the three planes through the light and an edge of T. Zero-area
    triangles and triangles edge-on to the light cast nothing.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world.
    light : float64 (4,), homogeneous, world: w = 1 a point light, w = 0 the direction towards one infinitely
        far away.
    positions : float64 (n, 3), samples to decide, world.
    bias : distance along the plane normal, world units, from 0 up.
    tie_distance : float64 (n,), by how much side planes move to find ambiguous samples, world units, from 0
        up.
    casters : bool (n_triangles,), the triangles that cast, or None for all.
    counting : True to fill node_tests, sample_tests and heat.
    stage : called with the names "setup", "hierarchy", "traversal", "exact" and "merge", returns the context
        manager in which that part runs. Traversal and exact arithmetic alternate.

    Raises
    ------
    ValueError
        If an input is not finite or out of range.
    """
    with stage("setup"):
        corners, light, positions, tie_distance, casters = checked(
            corners, light, positions, bias, tie_distance, casters)
        floor = min(bias_floor(corners, positions), bias)
        biases = np.array([floor, bias, 2.0 * bias])
        flags = np.zeros(len(positions), np.uint8)
    with stage("hierarchy"):
        space, tree = None, None
        if len(positions) and np.any(casters):
            space = make_light_space(light, positions)
            tree = build_light_tree(space, positions, tie_distance)
    if space is None or tree is None:
        heat = np.zeros(len(positions), np.int64) if counting else None
        return _result(flags, heat, Statistics())
    search = Search(tree, space, biases, counting, stage)
    size = max(1, min(LARGEST_BATCH, LIST_ENTRIES // search.n_work))
    for start in range(0, len(corners), size):
        search.add_triangles(corners[start:start + size], casters[start:start + size])
    with stage("merge"):
        flags[tree.order] = search.work.flags
        heat = None
        if search.counts is not None:
            heat = np.zeros(len(positions), np.int64)
            heat[tree.order] = search.counts.heat
    return _result(flags, heat, search.statistics())


def checked(
    corners: Any, light: Any, positions: Any, bias: float, tie: Any, casters: Any
) -> tuple[Any, ...]:
    """Bring the inputs into shape, or say what is wrong with them."""
    corners = np.ascontiguousarray(corners, np.float64).reshape(-1, 3, 3)
    positions = np.ascontiguousarray(positions, np.float64).reshape(-1, 3)
    light, tie = np.ascontiguousarray(light, np.float64), np.ascontiguousarray(tie, np.float64)
    casters = np.ones(len(corners), np.bool_) if casters is None else np.ascontiguousarray(casters, np.bool_)
    for name, array in (("triangle vertices", corners), ("sample positions", positions), ("the light", light),
                        ("tie distances", tie)):
        if not np.isfinite(array).all():
            raise ValueError(f"{name} must be finite numbers: remove NaN and infinity from the scene")
    if light.shape != (4,) or light[3] not in (0.0, 1.0):
        raise ValueError(f"light must be (x, y, z, w) with w = 1 (point) or w = 0 (directional), not {light}")
    if light[3] == 0.0 and not light[:3].any():
        raise ValueError("a directional light needs a direction other than (0, 0, 0)")
    if not 0.0 <= bias < 2.0**1023:
        raise ValueError(f"bias must be a finite distance from 0 up, not {bias}")
    if len(tie) != len(positions) or np.any(tie < 0.0):
        raise ValueError("tie distances must be one distance from 0 up per sample position")
    if len(casters) != len(corners):
        raise ValueError("casters must tell for each triangle whether it casts")
    return corners, light, positions, tie, casters


def _result(
    flags: NDArray[np.uint8], heat: NDArray[np.int64] | None, statistics: Statistics
) -> ReferenceResult:
    """Read shadow and ambiguity from the flags: each flag only grows with planes moving out and bias
    shrinking."""
    shadow = (flags & SHADOWED) != 0
    sure = (flags & (PLANES_IN | BIAS_DOUBLED)) == PLANES_IN | BIAS_DOUBLED
    near = (flags & (PLANES_OUT | BIAS_FLOOR)) != 0
    return ReferenceResult(shadow, np.where(shadow, ~sure, near), flags, heat, statistics)


class Search:
    """All triangles, batch by batch, against one light tree."""

    def __init__(self, tree: LightTree, space: LightSpace, biases: NDArray[np.float64], counting: bool,
                 stage: StageFactory) -> None:
        self.tree, self.space, self.biases, self.stage = tree, space, biases, stage
        self.n_work = int(tree.work_nodes[1] - tree.work_nodes[0])
        n_samples, shape = len(tree.order), (self.n_work, PAIR_CAPACITY)
        self.work = Work(np.zeros(n_samples, np.uint8), np.zeros(len(tree.box), np.bool_),
                         np.zeros(self.n_work, np.int64), np.empty(shape, np.int32),
                         np.empty(shape, np.int32), np.empty(shape, np.uint8),
                         np.zeros(self.n_work, np.int64))
        self.counts = None
        if counting:
            self.counts = WalkCounts(np.zeros(self.n_work, np.int64), np.zeros(self.n_work, np.int64),
                                     np.zeros(N_BLOCKS, np.int64), np.zeros(n_samples, np.int64))
        self.exact_tests, self.exact_facings, self.largest_lists = 0, 0, 0

    def add_triangles(self, corners: NDArray[np.float64], casters: NDArray[np.bool_]) -> None:
        """Let a batch of triangles cast: deal out, then walk and settle in turn until all lists are done."""
        with self.stage("setup"):
            frusta = Frusta(np.zeros(len(corners), np.int8), np.empty((len(corners), 4, 6)))
            find_facing(frusta.facing, corners, casters, self.space.light)
            undecided = np.flatnonzero(frusta.facing == 2)
            frusta.facing[undecided] = exact_facing(corners[undecided], self.space.light)
            self.exact_facings += len(undecided)
            make_frusta(frusta, corners, self.space.light, self.space.origin, self.space.extent,
                        self.biases[2])
        with self.stage("traversal"):
            lists, ends = self._deal(frusta, corners)
        while True:
            with self.stage("traversal"):
                self._walk(frusta, corners, lists, ends)
            with self.stage("exact"):
                self._settle(frusta, corners)
            if np.all(self.work.next_item == ends):
                return

    def _deal(
        self, frusta: Frusta, corners: NDArray[np.float64]
    ) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
        """List the triangles that may reach each work node; return the lists and where each ends."""
        arguments = (self.tree, frusta, corners, self.space, self.biases, self.work.finished)
        reached = np.zeros((N_BLOCKS, self.n_work), np.int64)
        deal(*arguments, reached, np.empty(0, np.int32), self.counts)
        # Lists by work node, and in each by block: the exclusive prefix sum in that order.
        ends = np.cumsum(reached.T).reshape(self.n_work, N_BLOCKS)
        starts = np.ascontiguousarray((ends - reached.T).T)
        lists = np.empty(int(ends[-1, -1]), np.int32)
        self.largest_lists = max(self.largest_lists, lists.nbytes)
        self.work.next_item[:] = starts[0]
        deal(*arguments, starts, lists, self.counts)
        return lists, np.ascontiguousarray(ends[:, -1])

    def _walk(self, frusta: Frusta, corners: NDArray[np.float64], lists: NDArray[np.int32], ends: NDArray[np.int64]) -> None:
        """Walk all lists, as far as the buffers of undecided pairs reach."""
        walk(self.tree, frusta, corners, self.space, self.biases, lists, ends, self.work, self.counts)

    def _settle(self, frusta: Frusta, corners: NDArray[np.float64]) -> None:
        """Settle the pairs that still matter in rational arithmetic, and empty the buffers."""
        work, tree = self.work, self.tree
        filled = np.arange(PAIR_CAPACITY) < work.n_pairs[:, None]
        work.n_pairs[:] = 0
        samples, triangles, undecided = (pairs[filled] for pairs in (work.pair_sample, work.pair_triangle,
                                                                     work.pair_flags))
        # Another triangle may have set the open flags, or those that imply them, in the meantime.
        kept = (undecided & ~work.flags[samples]) != 0
        samples, triangles = samples[kept], triangles[kept]
        self.exact_tests += len(samples)
        settled = exact_flags(corners[triangles], frusta.facing[triangles], self.space.light,
                              tree.position[samples], tree.tie[samples], self.biases)
        np.bitwise_or.at(work.flags, samples, settled)

    def statistics(self) -> Statistics:
        """Sum the counts."""
        arrays = (*self.tree, *self.work)
        memory = sum(array.nbytes for array in arrays) + self.largest_lists
        node_tests = sample_tests = 0
        if self.counts is not None:
            node_tests = int(self.counts.node_tests.sum() + self.counts.dealing_tests.sum())
            sample_tests = int(self.counts.sample_tests.sum())
        return Statistics(node_tests, sample_tests, self.exact_tests, self.exact_facings, memory)
