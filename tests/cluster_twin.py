"""Slow, obvious twin of the cluster hierarchy: dictionaries of samples by key prefix, loops, counts by the definitions.

It takes plane rows and the grouping of triangles from the kernels (they have tests of their own) and decides everything
else for itself: keys, boxes, order of work and counts.
"""

from dataclasses import dataclass, field

import numpy as np

from shadowbench.kernels.group_frustum import N_GROUP_ROWS
from shadowbench.kernels.lanes import UNDECIDED
from shadowbench.kernels.shadow_frustum import CAP_ROW, EYE_ROW, N_ROWS, WEDGE_ROW

LIMIT = np.float32(UNDECIDED)


@dataclass(eq=False)
class Node:
    """Samples that share a prefix of their keys; `children` is empty for clusters."""

    level: int
    samples: list = field(default_factory=list)
    children: list = field(default_factory=list)
    box: list = field(default_factory=list)
    tests: int = 0
    full: bool = False


def value(row, x, y, r):
    """Float32 value of a plane row, in the documented order."""
    a, b, c, d = row
    return (a * x + (b * y + d)) + c * r


class Twin:
    """The method on one frame; `run` fills `in_shadow`, `heat` and the counts.

    Parameters
    ----------
    frusta : all frusta, those of groups last.
    groups : None, or (rows of the groups, first frustum of each).
    """

    def __init__(self, frame, params, frusta, groups=None):
        self.params, self.samples, self.frame = params, frame.samples, frame
        self.rows, self.exact_rows = frusta.rows.reshape(-1, N_ROWS, 4), frusta.exact_rows
        self.triangle, self.groups = frusta.triangle, groups
        s = frame.samples
        self.x, self.y = s.plane_x.astype(np.float32), s.plane_y.astype(np.float32)
        self.r = np.float32(1.0) / s.depth.astype(np.float32)
        self.included = s.candidate | (not params.remove_unlit)
        self.in_shadow = np.zeros(len(self.r), bool)
        self.make_tree()
        self.counts = {name: np.zeros(self.n_levels, np.int64) for name in
                       ("node_tests", "group_tests", "trivial_accepts", "trivial_rejects", "refinements")}
        self.iterations = np.zeros(self.n_levels + 1, np.int64)
        self.sample_tests = self.retries = 0
        self.first_visits, self.job_visits, self.unit_tests, self.found = {}, [], {}, {}

    def slice_of(self, depth):
        """Eq. 1: count the boundaries that a depth has reached."""
        return sum(depth >= b for b in self.boundaries[1:])

    def make_tree(self):
        s = self.samples
        tiles = -(-max(s.columns, s.rows) // 8)
        bits = (tiles - 1).bit_length()
        axes = [axis for _ in range(bits) for axis in "xyz"] + ["z", "z"]
        ratio = 1.0 + 2.0 * self.frame.camera.tan_y / -(-s.rows // 8)
        start = min(s.depth[s.columns * y + x] for y in range(0, s.rows, 16) for x in range(0, s.columns, 16))
        if self.params.depth_start == "near_plane" or start == np.inf:
            start = self.frame.camera.near
        self.boundaries = [start]
        while len(self.boundaries) < 2 ** axes.count("z"):
            self.boundaries.append(self.boundaries[-1] * ratio)
        self.n_levels = -(-len(axes) // 5)
        self.shifts = [len(axes)] + [5 * (self.n_levels - level) for level in range(1, self.n_levels + 1)]
        self.axes, by_prefix = axes, {}
        for i in np.flatnonzero(self.included):
            place = {"x": int(i % s.columns) // 8, "y": int(i // s.columns) // 8, "z": self.slice_of(s.depth[i])}
            key, used = 0, dict.fromkeys("xyz", 0)
            for position, axis in enumerate(axes):
                key |= (place[axis] >> used[axis] & 1) << position
                used[axis] += 1
            for level, shift in enumerate(self.shifts):
                by_prefix.setdefault((level, key >> shift), Node(level)).samples.append(int(i))
        for (level, key), node in sorted(by_prefix.items(), key=lambda item: item[0]):
            if level:
                parent = by_prefix[level - 1, key >> (self.shifts[level - 1] - self.shifts[level])]
                parent.children.append(node)
            node.box = self.box_of(node)
        self.by_level = [[node for (at, _), node in sorted(by_prefix.items(), key=lambda item: item[0]) if at == level]
                         for level in range(self.n_levels + 1)]

    def box_of(self, node):
        """Explicit bounds of the samples, or implicit ones of the tiles and slices that the prefix stands for."""
        s, inside = self.samples, np.array(node.samples)
        if self.params.bounds == "explicit":
            return [(v[inside].min(), v[inside].max()) for v in (self.x, self.y, self.r)]
        below = self.axes[:self.shifts[node.level]]
        first, nx, ny, nz = inside[0], *(1 << below.count(axis) for axis in "xyz")
        x0, y0 = first % s.columns // 8 // nx * nx * 8, first // s.columns // 8 // ny * ny * 8
        x1, y1 = min(x0 + 8 * nx, s.columns) - 1, min(y0 + 8 * ny, s.rows) - 1
        xs, ys = (self.x[x0], self.x[x1]), (self.y[y0 * s.columns], self.y[y1 * s.columns])
        z0 = self.slice_of(s.depth[first]) // nz * nz
        one, z1 = np.float32(1), z0 + nz
        with np.errstate(over="ignore"):
            high = self.r[self.included].max() if z0 == 0 else one / np.float32(self.boundaries[z0])
            low = np.float32(0) if z1 >= len(self.boundaries) else one / np.float32(self.boundaries[z1])
        return [(min(xs), max(xs)), (min(ys), max(ys)), (low, high)]

    def corners(self, row, box):
        reject = [high if a < 0 else low for a, (low, high) in zip(row[:3], box, strict=True)]
        accept = [low if a < 0 else high for a, (low, high) in zip(row[:3], box, strict=True)]
        return value(row, *reject), value(row, *accept)

    def classify(self, k, box):
        planes = self.params.culling_planes
        numbers = list(range(WEDGE_ROW))
        numbers += range(WEDGE_ROW, EYE_ROW) if "wedge" in planes else ()
        numbers += range(EYE_ROW, N_ROWS) if planes not in ("none", "wedge") else ()
        accepted = True
        for number in numbers:
            reject, accept = self.corners(self.rows[k, number], box)
            if reject > LIMIT:
                return "trivial_rejects"
            if number < WEDGE_ROW and not accept < -LIMIT:
                accepted = False
        return "trivial_accepts" if accepted else "refinements"

    def group_meets(self, g, box):
        rows = self.groups[0].reshape(-1, N_GROUP_ROWS, 4)[g]
        return all(self.corners(row, box)[0] <= LIMIT for row in rows)

    def is_over(self, node):
        """True if nothing below the node is left to test, as far as the node's own tests have found."""
        if not self.params.skip_shadowed:
            return False
        if node.full:
            return True
        if node.children:
            return all(self.is_over(child) for child in node.children)
        return set(node.samples) <= self.found.get(id(node), set())

    def accept(self, node):
        """Mark a node that lies wholly in a frustum, with all below it."""
        node.full = True
        self.in_shadow[node.samples] = True
        for child in node.children:
            self.accept(child)

    def spend(self, unit, node, kind, tests):
        """Count one visit of a node by a frustum ("one", number) or a group ("group", number)."""
        node.tests += tests
        self.iterations[node.level] += 1
        self.unit_tests[unit] = self.unit_tests.get(unit, 0) + tests
        if kind == "sample_tests":
            self.sample_tests += tests
        else:
            self.counts[kind][node.level] += tests

    def run(self):
        if not self.included.any():
            return self
        n_single = len(self.triangle) if self.groups is None else int(self.groups[1][0])
        split = 1 if self.params.passes == "one" else min(self.params.split_level, self.n_levels)
        # Single frusta: the first pass skips nothing, and what it accepts is marked when it is over
        jobs, accepted = {}, []
        for k in range(n_single):
            self.expand(("one", k), self.by_level[0][0], split, jobs, accepted)
        for node in accepted:
            self.accept(node)
        self.finish(split, jobs)
        # Groups: down to the parents of the clusters, skipping what the single frusta have shadowed
        if self.groups is not None:
            split, jobs = max(self.n_levels - 1, 1), {}
            for g in range(len(self.groups[1]) - 1):
                self.expand(("group", g), self.by_level[0][0], split, jobs, [])
            self.finish(split, jobs)
        self.in_shadow &= self.samples.candidate
        return self

    def meet(self, unit, node):
        """Children that a unit does not reject, with what it makes of them."""
        if unit[0] == "one":
            kinds = [(child, self.classify(unit[1], child.box)) for child in node.children]
            self.spend(unit, node, "node_tests", len(kinds))
            for _, kind in kinds:
                self.counts[kind][node.level] += 1
            return [(child, kind) for child, kind in kinds if kind != "trivial_rejects"]
        children = [child for child in node.children if not self.is_over(child)]
        self.spend(unit, node, "group_tests", len(children))
        return [(child, "refinements") for child in children if self.group_meets(unit[1], child.box)]

    def expand(self, unit, node, split, jobs, accepted):
        self.first_visits[unit] = self.first_visits.get(unit, 0) + 1
        for child, kind in self.meet(unit, node):
            if kind == "trivial_accepts":
                accepted.append(child)
            elif child.level == split:
                jobs.setdefault(id(child), []).append(unit)
            else:
                self.expand(unit, child, split, jobs, accepted)

    def finish(self, split, jobs):
        for top in self.by_level[split]:
            for unit in jobs.get(id(top), []):
                before = int(self.iterations.sum())
                if not self.is_over(top):
                    self.do_job(unit, top)
                self.job_visits.append((unit, int(self.iterations.sum()) - before))

    def do_job(self, unit, top):
        if unit[0] == "one":
            self.walk(unit[1], top, top.children, unit)
            return
        met = [child for child, _ in self.meet(unit, top)] if top.children else []
        for k in range(self.groups[1][unit[1]], self.groups[1][unit[1] + 1]):
            if self.is_over(top) or (top.children and all(self.is_over(child) for child in met)):
                return
            self.walk(k, top, met, unit)

    def walk(self, k, node, among, unit):
        """Walk a frustum from a node down; `among` are the children that it may meet."""
        if not node.children:
            self.test_samples(k, node, unit)
            return
        children = [child for child in among if not self.is_over(child)]
        self.spend(unit, node, "node_tests", len(children))
        kinds = [(child, self.classify(k, child.box)) for child in children]
        for child, kind in kinds:
            self.counts[kind][node.level] += 1
            if kind == "trivial_accepts":
                self.accept(child)
        for child, kind in kinds:
            if kind == "refinements":
                self.walk(k, child, child.children, unit)

    def tile_of(self, node):
        """All places of the tile of a cluster, in the image or not."""
        s, i = self.samples, node.samples[0]
        row, column = i // s.columns // 8 * 8, i % s.columns // 8 * 8
        return [y * s.columns + x for y in range(row, min(row + 8, s.rows))
                for x in range(column, min(column + 8, s.columns))]

    def test_samples(self, k, node, unit):
        whole = self.params.leaf == "tile"
        candidates = [i for i in self.tile_of(node) if self.included[i]] if whole else node.samples
        found = self.found.setdefault(id(node), set())
        if self.params.skip_shadowed:
            candidates = [i for i in candidates if i not in found]
        self.spend(unit, node, "sample_tests", 64 if whole else len(candidates))
        for i in candidates:
            values = [value(row, self.x[i], self.y[i], self.r[i]) for row in self.rows[k, :WEDGE_ROW]]
            if max(values) > LIMIT:
                continue
            if not max(values) < -LIMIT:
                self.retries += 1
                s = self.samples
                exact = [value(row, s.plane_x[i], s.plane_y[i], 1.0 / s.depth[i]) for row in self.exact_rows[k]]
                if max(exact[:CAP_ROW]) > 0 or exact[CAP_ROW] >= 0:
                    continue
            found.add(i)
            self.in_shadow[i] = True

    def heat(self):
        """Tests of each node shared evenly by its samples; those of a whole tile by the tile."""
        heat = np.zeros(len(self.r))
        for nodes in self.by_level:
            for node in nodes:
                whole = not node.children and self.params.leaf == "tile"
                shared = self.tile_of(node) if whole else node.samples
                heat[shared] += node.tests / len(shared)
        return heat

    def per_triangle(self):
        """Tests of each triangle; those of a group are dealt out evenly, the rest to the first members."""
        tests = np.zeros(self.frame.mesh.n_triangles, np.int64)
        for (kind, number), total in self.unit_tests.items():
            first, end = (number, number + 1) if kind == "one" else self.groups[1][number:number + 2]
            for i, k in enumerate(range(first, end)):
                tests[self.triangle[k]] += total // (end - first) + (i < total % (end - first))
        return tests

    def all_iterations(self):
        """Visits of each job, largest first: of each triangle with one pass, of each part of it with two."""
        if self.params.passes == "two":
            values = [*self.first_visits.values(), *(visits for _, visits in self.job_visits)]
        else:
            sums = dict(self.first_visits)
            for unit, visits in self.job_visits:
                sums[unit] += visits
            values = list(sums.values())
        return sorted(values, reverse=True)[:1024]
