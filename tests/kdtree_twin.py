"""Slow, obvious twins of the kd-tree's construction and traversal."""

import numpy as np

from shadowbench.kernels.kdtree_build import EMPTY_BONUS, INTERSECTION_COST, LEAF, MAX_DEPTH, TRAVERSAL_COST
from shadowbench.kernels.kdtree_clip import MAX_CORNERS, clipped_bounds
from shadowbench.kernels.kdtree_traversal import SHORT_STACK
from shadowbench.kernels.shadow_rays import FAR_ROUNDING, MARGIN


def box_of_triangle(corners, t, box):
    """Bounds of the part of a triangle in a cell, or None."""
    bounds, scratch = np.empty(6, np.int64), np.empty((2, MAX_CORNERS + 1, 3))
    inside = clipped_bounds(corners, t, np.array(box, np.int64), scratch[0], scratch[1], bounds)
    return [int(v) for v in bounds] if inside else None


def area(box):
    x, y, z = (float(box[3 + k] - box[k]) for k in range(3))
    return x * y + y * z + z * x


def children(box, axis, position):
    left, right = list(box), list(box)
    left[3 + axis] = right[axis] = position
    return left, right


def sides_of(pieces, axis, position, planar_left):
    """Numbers of the pieces that go left, and of those that go right."""
    left, right = [], []
    for number, (_, bounds) in enumerate(pieces):
        low, high = bounds[axis], bounds[3 + axis]
        flat = low == high == position
        if low < position or (flat and planar_left):
            left.append(number)
        if high > position or (flat and not planar_left):
            right.append(number)
    return left, right


def best_split(pieces, box):
    """Try every plane on which a piece begins or ends: (cost, axis, position, planar_left), or None for a leaf."""
    best = None
    for axis in range(3):
        for position in sorted({p[1][k] for p in pieces for k in (axis, 3 + axis)}):
            for planar_left in (True, False):
                left, right = sides_of(pieces, axis, position, planar_left)
                parts = list(zip((left, right), children(box, axis, position), strict=True))
                if box[axis] == box[3 + axis] or any(not inside and cell[axis] == cell[3 + axis] for inside, cell in parts):
                    continue
                cost = sum(len(inside) * area(cell) for inside, cell in parts) * INTERSECTION_COST
                if any(not inside and cell[axis] < cell[3 + axis] for inside, cell in parts):
                    cost *= EMPTY_BONUS
                cost = TRAVERSAL_COST + cost / area(box)
                if best is None or cost < best[0] * (1 - 1e-12):
                    best = (cost, axis, position, planar_left)
    return best if best is not None and best[0] < len(pieces) * INTERSECTION_COST * (1 - 1e-12) else None


def build(corners, pieces, box, depth=0):
    """Nested tuples: (axis, position, left, right), or the sorted triangles of a leaf."""
    split = best_split(pieces, box) if area(box) > 0.0 and depth < MAX_DEPTH else None
    if split is None:
        return sorted(t for t, _ in pieces)
    _, axis, position, planar_left = split
    parts = sides_of(pieces, axis, position, planar_left)
    both = set(parts[0]) & set(parts[1])
    found = []
    for numbers, cell in zip(parts, children(box, axis, position), strict=True):
        inside = []
        for number in numbers:
            t, bounds = pieces[number]
            bounds = box_of_triangle(corners, t, cell) if number in both else bounds
            if bounds is not None:
                inside.append((t, bounds))
        found.append(build(corners, inside, cell, depth + 1))
    return (axis, position, *found)


def as_tuples(tree, node=0):
    """A compiled tree in the form of `build`."""
    link = int(tree.nodes[2 * node + 1])
    if link & 3 == LEAF:
        first = int(tree.nodes[2 * node])
        return sorted(int(t) for t in tree.references[first:first + (link >> 2)])
    return (link & 3, int(tree.planes[2 * node]), as_tuples(tree, node + 1), as_tuples(tree, link >> 2))


class Ray:
    """One ray through a compiled tree; fills in `nodes`, `leaves`, `tests` and `hit` for a kind of traversal."""

    def __init__(self, tree, rays, i, begin=0.0):
        self.tree, self.rays, self.i = tree, rays, i
        self.nodes = self.leaves = self.tests = 0
        self.hit = False
        origin, target = (rays.origin - tree.base) * tree.scale, rays.target[i] * tree.scale
        self.margin = MARGIN + FAR_ROUNDING * rays.reach * tree.scale
        self.origin, self.direction = origin, target
        if rays.travel.any():
            self.direction = rays.travel * (2 * rays.reach) * tree.scale
            self.origin = origin + target - self.direction
        self.direction = np.where(np.abs(self.direction) < 2.0**-40, 2.0**-40, self.direction)
        ends = (np.array([-self.margin - self.origin, tree.high + self.margin - self.origin])) * (1 / self.direction)
        length = np.sqrt((self.direction ** 2)[0] + (self.direction ** 2)[1] + (self.direction ** 2)[2])
        self.begin = max(begin, ends.min(axis=0).max())
        self.end = min(1.0, ends.max(axis=0).min())
        if rays.bias * tree.scale > self.margin:
            self.end = min(self.end, 1.0 - (rays.bias * tree.scale - self.margin) / length)

    def test(self, t):
        """The shared definition, on the rows of a triangle."""
        self.tests += 1
        a, b, d, c = self.rays.rows[t].reshape(4, 4)
        x, y, r = self.rays.plane_x[self.i], self.rays.plane_y[self.i], 1.0 / self.rays.depth[self.i]
        value = a * x + (b * y + d) + c * r
        return bool((value[:3] <= 0).all() and value[3] < 0)

    def crossing(self, t):
        """Share of the way at which the ray meets a triangle's plane, from the cap plane's row."""
        if t in self.rays.loose:
            return np.inf
        a, b, d, c = self.rays.rows[t].reshape(4, 4)[:, 3]
        x, y, r = self.rays.plane_x[self.i], self.rays.plane_y[self.i], 1.0 / self.rays.depth[self.i]
        start, w = self.rays.start_view[:3], self.rays.start_view[3]
        way = start - w * np.array([x, y, 1.0]) * (1.0 / r)
        above = np.sqrt(a * a + b * b + d * d) * self.rays.bias - (a * x + (b * y + d) + c * r) * (1.0 / r)
        return 1.0 - above / (a * way[0] + b * way[1] + d * way[2])

    def run(self, kind):
        """Walk the tree, then test the loose triangles."""
        if self.begin <= self.end:
            self.hit = self.walk(kind)
        self.hit = self.hit or any(self.test(t) for t in self.rays.loose)
        return self

    def step(self, node, begin, end):
        """Children that a ray meets at an inner node, near first, with their intervals."""
        self.nodes += 1
        link = int(self.tree.nodes[2 * node + 1])
        axis, inverse = link & 3, 1 / self.direction[link & 3]
        t, slack = (self.tree.planes[2 * node] - self.origin[axis]) * inverse, self.margin * abs(inverse)
        near, far = (node + 1, link >> 2) if inverse >= 0 else (link >> 2, node + 1)
        met = [(near, begin, min(end, t + slack))] if begin <= t + slack else []
        if not met or t - slack <= end:
            met.append((far, max(begin, t - slack), end))
        return met

    def walk(self, kind):
        """Visit leaves in order. What waits is known in full; a restart is paid for by walking down again."""
        waiting = []                    # (level, node, begin, end): all far children still to be visited
        kept = []                       # levels of those that the short stack still holds
        root, alone = 0, True           # level to restart from; True while nothing waits on the way down from it
        level, node, begin, end = 0, 0, self.begin, self.end
        deferred = False                # True once a triangle shadows the sample that is met beyond its leaf
        while True:
            while int(self.tree.nodes[2 * node + 1]) & 3 != LEAF:
                met = self.step(node, begin, end)
                node, begin, end = met[0]
                level += 1
                if len(met) == 2:
                    waiting.append((level, *met[1]))
                    kept = [*kept, level][-SHORT_STACK:]
                    alone = False
                root = level if alone else root
            self.leaves += 1
            first = int(self.tree.nodes[2 * node])
            for t in self.tree.references[first:first + (int(self.tree.nodes[2 * node + 1]) >> 2)]:
                if self.test(t):
                    if self.crossing(t) <= end:
                        return True
                    deferred = True
            if not waiting:
                return deferred
            level, node, begin, end = waiting.pop()
            if kind == "restart":
                self.nodes += level
            elif kind == "short_stack" and kept:
                kept.pop()
            elif kind == "short_stack":
                self.nodes += level - root
                open_levels = [entry[0] for entry in waiting]
                kept = open_levels[-SHORT_STACK:]
                alone = not open_levels
                root = min([level, *(n - 1 for n in open_levels)])
