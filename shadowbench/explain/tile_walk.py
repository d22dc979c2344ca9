"""Per-triangle shadow volumes, walked slowly: every visit of the tiles below one child of the root, in order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.ptsv import Ptsv
from shadowbench.explain.frusta import ACCEPTED, INSIDE, REFINED, Batch, FrustumTests, box_outcome, sample_outcome
from shadowbench.explain.trace import Shape, Test, Trace
from shadowbench.geometry import Frame
from shadowbench.kernels.depth_hierarchy import build_tile_tree

NOTE = ("Tests of a tile's children are shared evenly by the samples that the tile covers, so that the heat map adds up to "
        "all tests; a share is one test divided by the tile's samples, times its children. Numbered tests are those with "
        "which the rounded sum of the shares reaches the next number; the last number is the heat map's value.")


@dataclass(eq=False)
class Tile:
    """A tile: samples in columns x0 <= x < x1 and rows y0 <= y < y1 of the image.

    Attributes
    ----------
    level : 0 is the root.
    children : tiles by lane, None off the image; empty for a tile of samples.
    low, high : float32 (n_lanes, 3), the children's boxes.
    open : bool (n_lanes,), children or samples that are still to be tested.
    parent, lane : where it belongs.
    batch : outcomes of all frusta that may visit the tile.
    """

    level: int
    x0: int
    y0: int
    x1: int
    y1: int
    parent: Tile | None = None
    lane: int = 0
    children: list[Tile | None] = field(default_factory=list)
    low: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    high: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    open: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    batch: Batch | None = None

    @property
    def covered(self) -> int:
        """Samples of the image that the tile covers."""
        return (self.x1 - self.x0) * (self.y1 - self.y0)

    def shape(self, code: int) -> Shape:
        """Outline, by the outcome of a test."""
        css = {ACCEPTED: "accept", REFINED: "refine"}.get(code, "reject")
        corners = ((self.x0, self.y0), (self.x1, self.y0), (self.x1, self.y1), (self.x0, self.y1))
        return Shape(corners, css, f"tile of level {self.level}, {self.x1 - self.x0} x {self.y1 - self.y0} samples")


@dataclass(frozen=True)
class Visit:
    """The lanes of a tile tested against frustum `k`: what was open before, and each lane's outcome."""

    k: int
    tile: Tile
    open: NDArray[np.bool_]
    codes: NDArray[np.int8]


class TileWalk:
    """The walk of one frame; parameters as in `Ptsv`, groups left out."""

    def __init__(self, algorithm: Ptsv, frame: Frame) -> None:
        s, self.params = frame.samples, algorithm.params
        self.samples = s
        plane_x, plane_y = s.plane_x[: s.columns].copy(), s.plane_y[:: s.columns].copy()
        self.included = algorithm.included(frame).reshape(s.rows, s.columns)
        tree, largest_r = build_tile_tree(s.depth, self.included.reshape(-1), plane_x, plane_y, self.params.branching)
        self.grids = [(int(level["grid_x"]), int(level["grid_y"])) for level in tree.levels]
        casters = algorithm.find_casters(frame, (np.abs(plane_x).max(), np.abs(plane_y).max(), largest_r), may_group=False)
        self.tests = FrustumTests(algorithm.frusta(frame, casters, casters.single), self.params.culling_planes)
        with np.errstate(divide="ignore"):
            self.r = (np.float32(1.0) / s.depth.astype(np.float32)).reshape(s.rows, s.columns)
        self.x, self.y = plane_x.astype(np.float32), plane_y.astype(np.float32)
        self.root = self._tile(0, 0, 0, None, 0)
        if self.root is not None:
            self._expand(self.root, np.arange(len(self.tests.triangle)))

    def _tile(self, level: int, x0: int, y0: int, parent: Tile | None, lane: int) -> Tile | None:
        """Make a tile; None if it lies off the image."""
        if x0 >= self.samples.columns or y0 >= self.samples.rows:
            return None
        width, height = (int(np.prod([grid[axis] for grid in self.grids[level:]])) for axis in (0, 1))
        return Tile(level, x0, y0, min(x0 + width, self.samples.columns), min(y0 + height, self.samples.rows), parent, lane)

    def _expand(self, tile: Tile, frusta: NDArray[np.int64]) -> Batch:
        """Find a tile's children with their boxes, or its samples, and test them against all frusta that may come."""
        if tile.batch is None:
            self._find_children(tile)
            tile.batch = (self.tests.boxes(frusta, tile.low, tile.high) if tile.children
                          else self.tests.samples(frusta, *self._coordinates(tile)))
        return tile.batch

    def _find_children(self, tile: Tile) -> None:
        """Find a tile's children with their boxes, or its samples."""
        grid_x, grid_y = self.grids[tile.level]
        below = self.grids[tile.level + 1:]
        step_x, step_y = (int(np.prod([grid[axis] for grid in below])) for axis in (0, 1))
        places = [(tile.x0 + ix * step_x, tile.y0 + iy * step_y) for iy in range(grid_y) for ix in range(grid_x)]
        tile.open = np.zeros(len(places), np.bool_)
        if not below:
            for lane, (x, y) in enumerate(places):
                tile.open[lane] = x < tile.x1 and y < tile.y1 and self.included[y, x]
            return
        tile.children = [self._tile(tile.level + 1, x, y, tile, lane) for lane, (x, y) in enumerate(places)]
        tile.low, tile.high = np.zeros((2, len(places), 3), np.float32)
        for lane, child in enumerate(tile.children):
            if child is not None:
                inside = self.included[child.y0:child.y1, child.x0:child.x1]
                tile.open[lane] = inside.any()
                if tile.open[lane]:
                    values = (self.x[child.x0:child.x1], self.y[child.y0:child.y1],
                              self.r[child.y0:child.y1, child.x0:child.x1][inside])
                    tile.low[lane], tile.high[lane] = [v.min() for v in values], [v.max() for v in values]

    def outcomes_at_root(self, lane: int) -> NDArray[np.int8]:
        """Outcome of every frustum's test of a child of the root; int8 (n_frusta,)."""
        assert self.root is not None and self.root.batch is not None
        found: NDArray[np.int8] = self.root.batch.codes[:, lane]
        return found

    def below(self, child: Tile, last: int | None = None) -> Iterator[Visit]:
        """Walk all frusta, or those up to `last`, through a child of the root, and tell every visit.

        The root's own tests come first for each frustum: they are not told.
        """
        root, skip = self.root, self.params.skip_shadowed
        if root is None or not root.open[child.lane]:
            return
        root_batch = self._expand(root, np.arange(len(self.tests.triangle)))
        self._expand(child, root_batch.refined(child.lane))
        codes = root_batch.codes[:None if last is None else last + 1, child.lane]
        for k in np.flatnonzero(codes < 0).tolist():
            if skip and not child.open.any():
                return
            if codes[k] == ACCEPTED:
                child.open &= not skip
                continue
            stack = [child]
            while stack:
                tile = stack.pop()
                batch = self._expand(tile, np.zeros(0, np.int64))
                yield (visit := Visit(k, tile, tile.open.copy(), batch.of(k)))
                closed = visit.open & (visit.codes == ACCEPTED)
                if tile.children:
                    waiting = np.flatnonzero(visit.open & (visit.codes == REFINED)).tolist()
                    for found in (tile.children[lane] for lane in waiting):
                        if found is not None:
                            self._expand(found, batch.refined(found.lane))
                            stack.append(found)
                else:
                    closed = visit.open & (visit.codes <= INSIDE)
                if skip and closed.any():
                    tile.open = tile.open & ~closed
                    _close(tile)

    def _coordinates(self, tile: Tile) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Position and depth of a tile's samples; any depth for those that are not tested."""
        columns = np.minimum(tile.x0 + np.arange(len(tile.open)) % self.grids[-1][0], tile.x1 - 1)
        rows = np.minimum(tile.y0 + np.arange(len(tile.open)) // self.grids[-1][0], tile.y1 - 1)
        i = rows * self.samples.columns + columns
        return self.samples.plane_x[i], self.samples.plane_y[i], np.where(tile.open, self.samples.depth[i], 1.0)


def _close(tile: Tile) -> None:
    """Tell the ancestors below the root that a tile has nothing left to test."""
    while not tile.open.any() and tile.parent is not None and tile.parent.level > 0:
        tile.parent.open[tile.lane] = False
        tile = tile.parent


def explain_sample(algorithm: Ptsv, frame: Frame, sample: int) -> Trace:
    """List every test of a tile or sample that touched a view sample."""
    walk, trace = TileWalk(algorithm, frame), Trace(f"sample {sample}", note=NOTE)
    x, y = sample % frame.samples.columns, sample // frame.samples.columns
    root, branching = walk.root, algorithm.params.branching
    if root is None or not walk.included.any() or not len(walk.tests.triangle):
        return trace
    child = _child_at(root, x, y)
    codes = walk.outcomes_at_root(child.lane)
    visits: dict[int, list[Visit]] = {}
    for visit in walk.below(child):
        if visit.tile.x0 <= x < visit.tile.x1 and visit.tile.y0 <= y < visit.tile.y1:
            visits.setdefault(visit.k, []).append(visit)
    occupied = bool(root.open[child.lane])
    totals: dict[int, tuple[int, int]] = {}
    for k, triangle in enumerate(walk.tests.triangle.tolist()):
        code = int(codes[k])
        words = box_outcome(code) if occupied else "holds no lit candidate"
        if occupied and code == REFINED and k not in visits:
            words = "not needed: everything in it is in shadow already"
        trace.add(Test(triangle, "tile of level 1", words, branching / root.covered, trace.add_shape(child.shape(code))))
        totals[0] = (len(walk.tests.triangle), root.covered)
        for visit in visits.get(k, ()):
            trace.add(_lane_test(visit, triangle, x, y, walk, trace))
            level = visit.tile.level
            totals[level] = (totals.get(level, (0, 0))[0] + 1, visit.tile.covered)
    value = 0.0
    for level in sorted(totals, reverse=True):             # in the order in which the heat map adds them up
        value += totals[level][0] * branching / totals[level][1]
    trace.value = int(np.rint(value))
    return trace


def _child_at(tile: Tile, x: int, y: int) -> Tile:
    """The child that holds a sample of the image."""
    return next(c for c in tile.children if c is not None and c.x0 <= x < c.x1 and c.y0 <= y < c.y1)


def _lane_test(visit: Visit, triangle: int, x: int, y: int, walk: TileWalk, trace: Trace) -> Test:
    """The test of the child, or the sample, at a place of the image."""
    tile, share = visit.tile, len(visit.open) / visit.tile.covered
    if tile.children:
        child = _child_at(tile, x, y)
        code = int(visit.codes[child.lane])
        closed = bool((tile.low[child.lane] != tile.high[child.lane]).any())
        words = box_outcome(code) if visit.open[child.lane] else (
            "not needed: everything in it is in shadow already" if closed else "holds no lit candidate")
        return Test(triangle, f"tile of level {child.level}", words, share, trace.add_shape(child.shape(code)))
    lane = (y - tile.y0) * walk.grids[-1][0] + x - tile.x0
    words = sample_outcome(int(visit.codes[lane]))
    if not visit.open[lane]:
        words = "not needed: in shadow already" if walk.included[y, x] else "no lit candidate"
    return Test(triangle, "the sample", words, share)


def explain_triangle(algorithm: Ptsv, frame: Frame, triangle: int) -> Trace:
    """List every test that a triangle caused: the children of every tile that its frustum visits."""
    walk = TileWalk(algorithm, frame)
    trace = Trace(f"triangle {triangle}", note="Every test of a tile's child counts as one.")
    found = np.flatnonzero(walk.tests.triangle == triangle)
    if not len(found) or walk.root is None or not walk.included.any():
        return trace
    k = int(found[0])
    at_root = np.array([walk.outcomes_at_root(lane)[k] for lane in range(len(walk.root.open))])
    visits = [Visit(k, walk.root, walk.root.open.copy(), at_root)]
    for child in [c for c in walk.root.children if c is not None]:
        if walk.root.open[child.lane] and visits[0].codes[child.lane] == REFINED:
            visits += [visit for visit in walk.below(child, k) if visit.k == k]
    for visit in visits:
        for lane, code in enumerate(visit.codes.tolist()):
            below = visit.tile.children[lane] if visit.tile.children else None
            words = box_outcome(code) if visit.tile.children else sample_outcome(code)
            place = f"child {lane} of tile {visit.tile.x0},{visit.tile.y0} of level {visit.tile.level}"
            number = trace.add_shape(below.shape(code)) if below is not None and visit.open[lane] else None
            trace.tests.append(Test(triangle, place, words if visit.open[lane] else "not needed", 1.0, number))
    trace.value = len(trace.tests)
    return trace
