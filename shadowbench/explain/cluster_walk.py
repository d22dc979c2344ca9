"""The cluster hierarchy, walked slowly: the first pass for all frusta, the second node by node of the split level."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.cluster import Cluster
from shadowbench.explain.frusta import ACCEPTED, INSIDE, REFINED, Batch, FrustumTests, box_outcome, sample_outcome
from shadowbench.explain.trace import Shape, Test, Trace
from shadowbench.geometry import Frame
from shadowbench.kernels.cluster_keys import TILE, TILE_SAMPLES
from shadowbench.kernels.lanes import LANES

NOTE = ("Tests of a node's children are shared evenly by the samples that the node holds, those of a whole tile by the "
        "samples of the tile, so that the heat map adds up to all tests. Numbered tests are those with which the rounded "
        "sum of the shares reaches the next number; the last number is the heat map's value.")


@dataclass(frozen=True)
class Visit:
    """A node tested against frustum `k`.

    Attributes
    ----------
    open : bool, the node's children, or the 64 places of its tile, that are still to be tested.
    codes : outcome of each.
    """

    k: int
    node: int
    open: NDArray[np.bool_]
    codes: NDArray[np.int8]


class ClusterWalk:
    """The walk of one frame; parameters as in `Cluster`, groups left out. Needs at least one sample in the hierarchy."""

    def __init__(self, algorithm: Cluster, frame: Frame) -> None:
        self.params, self.samples = algorithm.params, frame.samples
        tree = algorithm._build(frame)
        if tree is None:
            raise ValueError("no sample is in the hierarchy")
        self.nodes, self.clusters, self.tiles = tree.nodes, tree.clusters, tree.tiles
        reach = (np.abs(tree.tiles.plane_x).max(), np.abs(tree.tiles.plane_y).max(), tree.largest_r)
        casters = algorithm.find_casters(frame, reach, may_group=False)
        self.tests = FrustumTests(algorithm.frusta(frame, casters, casters.single), self.params.culling_planes)
        self.n_inner, self.whole = len(tree.nodes.first_child), self.params.leaf == "tile"
        self.split = min(self.params.split_level, len(tree.layout.level_bits)) if self.params.passes == "two" else 1
        self.own = (tree.clusters.samples[:, None] >> np.arange(TILE_SAMPLES, dtype=np.uint64) & np.uint64(1)).astype(bool)
        self.included = algorithm.included(frame)

    def level(self, node: int) -> int:
        """Level of a node; the root's is 0."""
        return int(np.searchsorted(self.nodes.first, node, side="right")) - 1

    def children(self, node: int) -> NDArray[np.int64]:
        """Children of an inner node, in the order of their keys."""
        first = int(self.nodes.first_child[node])
        return np.arange(first, first + int(np.bitwise_count(self.nodes.occupied[node])))

    def boxes(self, nodes: NDArray[np.int64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Boxes of the children of one node, float32 (n, 3) each: smallest and largest coordinates."""
        parent = self.nodes.parent[nodes]
        low = self.nodes.place[parent] + self.nodes.lane[nodes]
        high = low + LANES * self.nodes.n_chunks[parent]
        corners = [np.stack([self.nodes.x[at], self.nodes.y[at], self.nodes.r[at]], axis=1) for at in (low, high)]
        return corners[0], corners[1]

    def tile_places(self, node: int) -> NDArray[np.int64]:
        """Samples at the 64 places of a cluster's tile, row by row; -1 off the image."""
        cluster, place = node - self.n_inner, np.arange(TILE_SAMPLES)
        x = int(self.clusters.column[cluster]) * TILE + place % TILE
        y = int(self.clusters.row[cluster]) * TILE + place // TILE
        return np.where((x < self.samples.columns) & (y < self.samples.rows), y * self.samples.columns + x, -1)

    def first_pass(self, wanted: set[int], only: int | None = None
                   ) -> tuple[list[Visit], dict[int, list[int]], set[int]]:
        """Walk all frusta (or one) down to the split level.

        Returns
        -------
        visits of the wanted nodes, by frustum; jobs: frusta by node of the split level; nodes that were accepted.
        """
        jobs: dict[int, list[int]] = {}
        visits, accepted = [], set()
        waiting = [(0, np.arange(len(self.tests.triangle)))]
        while waiting:
            node, frusta = waiting.pop()
            children = self.children(node)
            codes = self.tests.boxes(frusta, *self.boxes(children)).codes
            if node in wanted or only is not None:
                everything = np.ones(len(children), np.bool_)
                visits += [Visit(int(k), node, everything, codes[i]) for i, k in enumerate(frusta)
                           if only is None or k == only]
            for i, child in enumerate(children.tolist()):
                refined = frusta[codes[:, i] == REFINED]
                if (codes[:, i] == ACCEPTED).any():
                    accepted.add(child)
                if len(refined) and self.level(child) == self.split:
                    jobs[child] = refined.tolist()
                elif len(refined):
                    waiting.append((child, refined))
        return sorted(visits, key=lambda visit: visit.k), jobs, accepted

    def below(self, top: int, frusta: list[int], accepted: set[int]) -> Iterator[Visit]:
        """Do the jobs of a node of the split level, and tell every visit."""
        skip, node = self.params.skip_shadowed, top
        while skip and node >= 0:                           # accepted, or below a node that is
            if node in accepted:
                return
            node = int(self.nodes.parent[node]) if node else -1
        is_open: dict[int, NDArray[np.bool_]] = {}
        batches = {top: self._batch(top, np.array(frusta, np.int64))}
        for k in frusta:
            stack = [top]
            while stack:
                node = stack.pop()
                before = is_open.setdefault(node, self._all_open(node))
                yield (visit := Visit(k, node, before.copy(), batches[node].of(k)))
                if node < self.n_inner:
                    closed = visit.open & (visit.codes == ACCEPTED)
                    for lane in np.flatnonzero(visit.open & (visit.codes == REFINED)).tolist():
                        child = int(self.nodes.first_child[node]) + lane
                        if child not in batches:
                            batches[child] = self._batch(child, batches[node].refined(lane))
                        stack.append(child)
                else:
                    closed = visit.open & (visit.codes <= INSIDE)
                if skip and closed.any():
                    is_open[node] = before & ~closed
                    self._close(node, top, is_open)
            if skip and self._is_over(top, is_open):
                return

    def _all_open(self, node: int) -> NDArray[np.bool_]:
        """What there is to be tested in a node at first."""
        if node < self.n_inner:
            return np.ones(len(self.children(node)), np.bool_)
        if not self.whole:
            return self.own[node - self.n_inner].copy()
        places = self.tile_places(node)
        return (places >= 0) & self.included[places]

    def _is_over(self, node: int, is_open: dict[int, NDArray[np.bool_]]) -> bool:
        """True if nothing in a node is left to test: for a cluster, of its own samples."""
        left = is_open.get(node)
        if left is None:
            return False
        return not (left.any() if node < self.n_inner else (left & self.own[node - self.n_inner]).any())

    def _close(self, node: int, top: int, is_open: dict[int, NDArray[np.bool_]]) -> None:
        """Tell the ancestors up to `top` that a node has nothing left to test."""
        while node != top and self._is_over(node, is_open):
            parent = int(self.nodes.parent[node])
            is_open[parent] = is_open[parent] & (self.children(parent) != node)
            node = parent

    def _batch(self, node: int, frusta: NDArray[np.int64]) -> Batch:
        """Test what is in a node against all frusta that may come."""
        if node < self.n_inner:
            return self.tests.boxes(frusta, *self.boxes(self.children(node)))
        places = self.tile_places(node)
        depth = np.where(self._all_open(node), self.samples.depth[places], 1.0)
        return self.tests.samples(frusta, self.samples.plane_x[places], self.samples.plane_y[places], depth)

    def n_tests(self, visit: Visit) -> int:
        """Tests that a visit counts: children that are open; for a whole tile, all of its places."""
        return TILE_SAMPLES if visit.node >= self.n_inner and self.whole else int(visit.open.sum())

    def shape(self, node: int, code: int) -> Shape:
        """Outline of a node on the image, by the outcome of its test."""
        low, high = self.boxes(np.array([node]))
        columns = np.interp([low[0, 0], high[0, 0]], self.tiles.plane_x, np.arange(self.samples.columns) + 0.5)
        rows = np.interp([-high[0, 1], -low[0, 1]], -self.tiles.plane_y, np.arange(self.samples.rows) + 0.5)
        (x0, x1), (y0, y1) = (columns + (-0.5, 0.5)).tolist(), (rows + (-0.5, 0.5)).tolist()
        css = {ACCEPTED: "accept", REFINED: "refine"}.get(code, "reject")
        kind = "node" if node < self.n_inner else "cluster"
        with np.errstate(divide="ignore", over="ignore"):        # the background is infinitely far away
            near, far = 1.0 / high[0, 2], 1.0 / low[0, 2]
        return Shape(((x0, y0), (x1, y0), (x1, y1), (x0, y1)), css,
                     f"{kind} {node} of level {self.level(node)}, depth {near:.4g} to {far:.4g}")


def explain_sample(algorithm: Cluster, frame: Frame, sample: int) -> Trace:
    """List every test of a node or sample that touched a view sample."""
    trace = Trace(f"sample {sample}", note=NOTE)
    if not algorithm.included(frame).any():
        return trace
    walk = ClusterWalk(algorithm, frame)
    x, y = sample % frame.samples.columns, sample // frame.samples.columns
    tile = y // TILE * walk.tiles.columns + x // TILE
    of_tile = np.flatnonzero(walk.clusters.tile == tile)
    own = [int(c) for c in of_tile if walk.own[c, y % TILE * TILE + x % TILE]]
    chain: list[int] = []
    if own:
        chain = [walk.n_inner + own[0]]
        while chain[-1]:
            chain.append(int(walk.nodes.parent[chain[-1]]))
    leaves = {walk.n_inner + int(c) for c in (of_tile if walk.whole else own)}
    visits, jobs, accepted = walk.first_pass(set(chain[1:]))
    for top in sorted(_ancestors_at(walk, leaves)):
        visits += [v for v in walk.below(top, jobs.get(top, []), accepted) if v.node in chain[1:] or v.node in leaves]
    held = {node: _held(walk, node) for node in chain}
    covered = int((walk.tile_places(next(iter(leaves))) >= 0).sum()) if leaves else 1
    totals: dict[int, int] = {}
    for visit in visits:
        shared = covered if visit.node in leaves and walk.whole else held[visit.node]
        trace.add(_test(walk, visit, chain, x, y, walk.n_tests(visit) / shared, trace))
        totals[visit.node] = totals.get(visit.node, 0) + walk.n_tests(visit)
    value = 0.0                                            # in the order in which the heat map adds them up
    for node in chain[::-1]:
        if node not in leaves or not walk.whole:
            value = totals.get(node, 0) / held[node] + value
    trace.value = int(np.rint(value + sum(totals.get(leaf, 0) for leaf in leaves) / covered if walk.whole else value))
    return trace


def _ancestors_at(walk: ClusterWalk, leaves: set[int]) -> set[int]:
    """Nodes of the split level that hold some leaves."""
    found = set()
    for leaf in leaves:
        node = leaf
        while walk.level(node) > walk.split:
            node = int(walk.nodes.parent[node])
        found.add(node)
    return found


def _held(walk: ClusterWalk, node: int) -> int:
    """Samples that a node holds."""
    if node >= walk.n_inner:
        return int(walk.own[node - walk.n_inner].sum())
    return sum(_held(walk, child) for child in walk.children(node).tolist())


def _test(walk: ClusterWalk, visit: Visit, chain: list[int], x: int, y: int, share: float, trace: Trace) -> Test:
    """The test of the child, or of the sample, that concerns a place of the image."""
    triangle = int(walk.tests.triangle[visit.k])
    if visit.node >= walk.n_inner:
        lane = y % TILE * TILE + x % TILE
        words = "not needed: in shadow already, or no candidate"
        if visit.open[lane]:
            words = sample_outcome(int(visit.codes[lane]))
        other = "" if chain and visit.node == chain[0] else ", with another cluster of its tile"
        return Test(triangle, f"the sample{other}", words, share)
    child = next(node for node in chain if node and int(walk.nodes.parent[node]) == visit.node)
    lane = child - int(walk.nodes.first_child[visit.node])
    code = int(visit.codes[lane])
    words = box_outcome(code) if visit.open[lane] else "not needed: everything in it is in shadow already"
    kind = "node" if child < walk.n_inner else "cluster"
    return Test(triangle, f"{kind} of level {walk.level(child)}", words, share, trace.add_shape(walk.shape(child, code)))


def explain_triangle(algorithm: Cluster, frame: Frame, triangle: int) -> Trace:
    """List every test that a triangle caused: the children of every node that its frustum visits."""
    trace = Trace(f"triangle {triangle}", note="Every test of a node's child, or of a sample, counts as one.")
    if not algorithm.included(frame).any():
        return trace
    walk = ClusterWalk(algorithm, frame)
    found = np.flatnonzero(walk.tests.triangle == triangle)
    if not len(found):
        return trace
    k = int(found[0])
    visits, jobs, accepted = walk.first_pass(set(), only=k)
    for top, frusta in sorted(jobs.items()):
        if k in frusta:
            visits += [v for v in walk.below(top, frusta[:frusta.index(k) + 1], accepted) if v.k == k]
    for visit in visits:
        leaf = visit.node >= walk.n_inner
        for lane in (range(TILE_SAMPLES) if leaf and walk.whole else np.flatnonzero(visit.open).tolist()):
            code = int(visit.codes[lane])
            words = (sample_outcome(code) if leaf else box_outcome(code)) if visit.open[lane] else "not needed"
            place = f"{'place' if leaf else 'child'} {lane} of {'cluster' if leaf else 'node'} {visit.node}"
            number = None if leaf else trace.add_shape(walk.shape(int(walk.children(visit.node)[lane]), code))
            trace.tests.append(Test(triangle, f"{place}, level {walk.level(visit.node)}", words, 1.0, number))
    trace.value = len(trace.tests)
    return trace
