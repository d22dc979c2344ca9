"""Slow, obvious twin of per-triangle shadow volumes: a recursive loop over tiles that counts by the definitions.

It takes the plane rows from the kernels (they have tests of their own) and decides everything else for itself: the
tree, the boxes, the order of work and the counts.
"""

from dataclasses import dataclass, field

import numpy as np

from shadowbench.kernels.group_frustum import N_GROUP_ROWS
from shadowbench.kernels.lanes import UNDECIDED
from shadowbench.kernels.shadow_frustum import CAP_ROW, EYE_ROW, N_ROWS, WEDGE_ROW

GRIDS = {4: [(2, 2)], 8: [(4, 2), (2, 4)], 16: [(4, 4)], 32: [(8, 4), (4, 8)], 64: [(8, 8)]}
LIMIT = np.float32(UNDECIDED)


@dataclass(eq=False)
class Tile:
    """Samples in columns x0 <= x < x1 and rows y0 <= y < y1, and its children (None: off the image)."""

    x0: int
    x1: int
    y0: int
    y1: int
    children: list = field(default_factory=list)
    samples: list = field(default_factory=list)
    visits: int = 0
    full: bool = False


def value(row, x, y, r):
    """Float32 value of a plane row, in the documented order."""
    a, b, c, d = row
    return (a * x + (b * y + d)) + c * r


class Twin:
    """The method on one frame; `run` fills `shadow`, `heat` and `counts`."""

    def __init__(self, frame, params, frusta, groups=None):
        self.params, self.samples = params, frame.samples
        self.n_columns, self.n_rows = frame.samples.columns, frame.samples.rows
        self.rows = frusta.rows.reshape(-1, N_ROWS, 4)
        self.exact_rows, self.triangle = frusta.exact_rows, frusta.triangle
        self.x = self.samples.plane_x.astype(np.float32)
        self.y = self.samples.plane_y.astype(np.float32)
        self.r = np.float32(1.0) / self.samples.depth.astype(np.float32)
        self.included = self.samples.candidate | (not params.remove_unlit)
        self.in_shadow = np.zeros(len(self.r), bool)
        self.visits = {}
        self.per_triangle = np.zeros(frame.mesh.n_triangles, np.int64)
        self.grids = []
        columns, rows = self.n_columns, self.n_rows
        while len(self.grids) < 2 or columns * rows > 1:
            choice = GRIDS[params.branching]
            self.grids.insert(0, choice[len(self.grids) % len(choice)])
            columns, rows = -(-columns // self.grids[0][0]), -(-rows // self.grids[0][1])
        self.root = self.make_tile(0, 0, 0)
        self.counts = {name: np.zeros(len(self.grids), np.int64) for name in
                       ("tests", "trivial_accepts", "trivial_rejects", "refinements", "fruitless_refinements")}
        self.counts["group_tests"] = np.zeros(len(self.grids), np.int64)
        self.retries, self.groups, self.group_tests = 0, groups, {}

    def make_tile(self, level, x0, y0):
        """Make the tile of a level whose first sample is (x0, y0), with all below it; None if off the image."""
        if x0 >= self.n_columns or y0 >= self.n_rows:
            return None
        width = np.prod([g[0] for g in self.grids[level:]])
        height = np.prod([g[1] for g in self.grids[level:]])
        tile = Tile(x0, min(x0 + width, self.n_columns), y0, min(y0 + height, self.n_rows))
        grid_x, grid_y = self.grids[level]
        places = [(x0 + ix * (width // grid_x), y0 + iy * (height // grid_y))
                  for iy in range(grid_y) for ix in range(grid_x)]
        if level + 1 < len(self.grids):
            tile.children = [c for c in (self.make_tile(level + 1, x, y) for x, y in places)
                             if c is not None and self.inside(c).any()]
        else:
            tile.samples = [y * self.n_columns + x for x, y in places if x < self.n_columns and y < self.n_rows]
            tile.samples = [i for i in tile.samples if self.included[i]]
        return tile

    def all_samples(self, tile):
        return (np.arange(tile.y0, tile.y1)[:, None] * self.n_columns + np.arange(tile.x0, tile.x1)).reshape(-1)

    def inside(self, tile):
        """Samples of a tile that the tree holds."""
        everything = self.all_samples(tile)
        return everything[self.included[everything]]

    def is_open(self, tile):
        """True if something below the tile still is to be tested."""
        return not self.params.skip_shadowed or not self.in_shadow[self.inside(tile)].all()

    def run(self):
        if self.root is not None and self.included.any():
            for k in range(len(self.triangle) if self.groups is None else self.groups[1][0]):
                self.visit(k, self.root, 0)
            for g in range(0 if self.groups is None else len(self.groups[1]) - 1):
                self.visit_group(g, self.root, 0)
            for g, tests in self.group_tests.items():
                members = range(self.groups[1][g], self.groups[1][g + 1])
                for i, k in enumerate(members):
                    self.per_triangle[self.triangle[k]] += tests // len(members) + (i < tests % len(members))
        self.in_shadow &= self.samples.candidate
        heat = np.zeros(len(self.r))
        for _, (tile, n_visits) in sorted(self.visits.items(), key=lambda item: item[0]):
            everything = self.all_samples(tile)
            heat[everything] += n_visits * self.params.branching / len(everything)
        self.heat = np.rint(heat).astype(np.int64)
        return self

    def visit_group(self, g, tile, level):
        """Test the children of a tile against a group; above the samples' tiles its members take over."""
        self.counts["group_tests"][level] += self.params.branching
        self.group_tests[g] = self.group_tests.get(g, 0) + self.params.branching
        self.visits.setdefault((-level, tile.x0, tile.y0), [tile, 0])[1] += 1
        rows = self.groups[0].reshape(-1, N_GROUP_ROWS, 4)[g]
        met = [child for child in tile.children if self.is_open(child)
               and all(self.at_corners(row, self.box_of(child))[0] <= LIMIT for row in rows)]
        if level < len(self.grids) - 2:
            for child in met:
                self.visit_group(g, child, level + 1)
            return
        for k in range(self.groups[1][g], self.groups[1][g + 1]):
            if any(self.is_open(child) for child in met):
                self.visit(k, tile, level, met)

    def visit(self, k, tile, level, among=None):
        """Test what is in a tile, or some of its children; True if anything in it is found in shadow."""
        found = False
        self.counts["tests"][level] += self.params.branching
        self.per_triangle[self.triangle[k]] += self.params.branching
        self.visits.setdefault((-level, tile.x0, tile.y0), [tile, 0])[1] += 1
        if level == len(self.grids) - 1:
            for i in tile.samples:
                if not (self.params.skip_shadowed and self.in_shadow[i]):
                    found |= self.test_sample(k, i)
            return found
        children = [child for child in (tile.children if among is None else among) if self.is_open(child)]
        outcome = [(child, self.classify(k, child)) for child in children]
        for child, kind in outcome:
            self.counts[kind][level] += 1
            if kind == "trivial_accepts":
                self.in_shadow[self.inside(child)] = found = True
        for child, kind in outcome:
            if kind == "refinements":
                fruitful = self.visit(k, child, level + 1)
                self.counts["fruitless_refinements"][level] += not fruitful
                found |= fruitful
        return found

    def box_of(self, tile):
        """A tile's box: screen extent of all its samples, depth of those in the tree."""
        everything, inside = self.all_samples(tile), self.inside(tile)
        return [(self.x[everything].min(), self.x[everything].max()),
                (self.y[everything].min(), self.y[everything].max()),
                (self.r[inside].min(), self.r[inside].max())]

    def at_corners(self, row, box):
        """A row's values at the reject and at the accept corner."""
        reject = [high if a < 0 else low for a, (low, high) in zip(row[:3], box, strict=True)]
        accept = [low if a < 0 else high for a, (low, high) in zip(row[:3], box, strict=True)]
        return value(row, *reject), value(row, *accept)

    def classify(self, k, tile):
        """Test a tile's box."""
        box, planes = self.box_of(tile), self.params.culling_planes
        rows = list(range(WEDGE_ROW))
        rows += range(WEDGE_ROW, EYE_ROW) if "wedge" in planes else ()
        rows += range(EYE_ROW, N_ROWS) if planes not in ("none", "wedge") else ()
        accepted = True
        for number in rows:
            reject, accept = self.at_corners(self.rows[k, number], box)
            if reject > LIMIT:
                return "trivial_rejects"
            if number < WEDGE_ROW and not accept < -LIMIT:
                accepted = False
        return "trivial_accepts" if accepted else "refinements"

    def test_sample(self, k, i):
        """Test a sample; True if it is found in shadow."""
        values = [value(row, self.x[i], self.y[i], self.r[i]) for row in self.rows[k, :WEDGE_ROW]]
        if max(values) > LIMIT:
            return False
        if not max(values) < -LIMIT:
            self.retries += 1
            x, y, r = self.samples.plane_x[i], self.samples.plane_y[i], 1.0 / self.samples.depth[i]
            exact = [value(row, x, y, r) for row in self.exact_rows[k]]
            if max(exact[:CAP_ROW]) > 0 or exact[CAP_ROW] >= 0:
                return False
        self.in_shadow[i] = True
        return True
