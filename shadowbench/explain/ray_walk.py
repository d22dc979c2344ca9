"""A shadow ray through the kd-tree, walked slowly: cells in order, and the triangles of each leaf until one shadows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.ray_traced import RayTraced
from shadowbench.explain.trace import Corner, Shape, Test, Trace
from shadowbench.geometry import Frame
from shadowbench.kernels.kdtree_build import LEAF
from shadowbench.kernels.shadow_frustum import CAP_ROW
from shadowbench.kernels.shadow_rays import FAR_ROUNDING, MARGIN, PARALLEL_LENGTH, make_shadow_rays

SMALLEST = 2.0**-40
"""Components of a direction below this are set to it, as the kernel does."""

NOTE = ("A test of the ray against a triangle of a leaf counts as one, and the heat map counts these alone; the cells that "
        "the ray meets are listed without a number. With restarts the kernel meets cells again: they are listed once.")


class RayWalk:
    """The ray of one sample; fills in its trace.

    Parameters
    ----------
    tree, rays : the kernel's records.
    frame : for the picture.
    sample : the lit candidate.
    trace : filled.
    """

    def __init__(self, tree: Any, rays: Any, frame: Frame, sample: int, trace: Trace) -> None:
        self.tree, self.rays, self.frame, self.sample, self.trace = tree, rays, frame, sample, trace
        origin, target = (rays.origin - tree.base) * tree.scale, rays.target[sample] * tree.scale
        self.deferred = False               # True once a triangle shadows the sample that the ray meets beyond its leaf
        self.margin = float(MARGIN + FAR_ROUNDING * rays.reach * tree.scale)
        self.origin, direction = origin, target
        if rays.travel.any():
            direction = rays.travel * (PARALLEL_LENGTH * rays.reach) * tree.scale
            self.origin = origin + target - direction
        direction = np.where(np.abs(direction) < SMALLEST, SMALLEST, direction)
        self.inverse = 1.0 / direction
        ends = np.array([-self.margin - self.origin, tree.high + self.margin - self.origin]) * self.inverse
        self.begin, self.end = max(0.0, ends.min(axis=0).max()), min(1.0, ends.max(axis=0).min())
        stop = float(rays.bias * tree.scale)
        if stop > self.margin:
            squares = direction * direction
            self.end = min(self.end, 1.0 - (stop - self.margin) / np.sqrt(squares[0] + squares[1] + squares[2]))

    def run(self) -> None:
        """Walk from the light to the sample, then test the triangles that the tree is no guide to."""
        root = (np.zeros(3), np.array(self.tree.high, np.float64))
        if self.begin <= self.end and (self._walk(0, self.begin, self.end, root) or self.deferred):
            return
        for t in self.rays.loose:
            if self._hits(int(t), "a triangle outside the tree", None):
                return

    def _walk(self, node: int, begin: float, end: float, box: tuple[NDArray, NDArray]) -> bool:
        """Visit a cell; True if a triangle in it shadows the sample."""
        link = int(self.tree.nodes[2 * node + 1])
        axis = link & 3
        if axis == LEAF:
            first, n = int(self.tree.nodes[2 * node]), link >> 2
            shape = self.trace.add_shape(self._outline(box, "leaf", f"leaf {node}, {n} triangles"))
            self.trace.add(Test(None, f"leaf {node}", f"met: {n} triangle{'s' * (n != 1)}", 0.0, shape))
            return any(self._ends_at(int(t), f"leaf {node}", shape, end) for t in self.tree.references[first:first + n])
        plane = float(self.tree.planes[2 * node])
        t, slack = (plane - self.origin[axis]) * self.inverse[axis], self.margin * abs(self.inverse[axis])
        low, high = (box[0], box[1].copy()), (box[0].copy(), box[1])
        low[1][axis] = high[0][axis] = plane
        near, far = (node + 1, low), (link >> 2, high)
        if self.inverse[axis] < 0.0:
            near, far = far, near
        meets_near = begin <= t + slack
        meets_far = not meets_near or t - slack <= end
        words = "both sides, the light's first" if meets_near and meets_far else (
            "the side of the light alone" if meets_near else "the side of the sample alone")
        self.trace.add(Test(None, f"cell {node}", f"cut at {'xyz'[axis]} = {self._world(plane, axis):.5g}: {words}", 0.0))
        if meets_near and self._walk(near[0], begin, min(end, t + slack), near[1]):
            return True
        return meets_far and self._walk(far[0], max(begin, t - slack), end, far[1])

    def _ends_at(self, t: int, place: str, shape: int | None, end: float) -> bool:
        """Test a triangle; True if it shadows the sample and the ray meets it no farther than the leaf's end."""
        if not self._hits(t, place, shape):
            return False
        if self._crossing(t) <= end:
            return True
        self.deferred = True
        return False

    def _crossing(self, t: int) -> float:
        """Share of the way at which the ray meets a triangle's plane; infinite where its planes do not tell."""
        if t in self.rays.loose:
            return np.inf
        a, b, d, c = self.rays.rows[t].reshape(4, 4)[:, CAP_ROW].tolist()
        x, y = float(self.rays.plane_x[self.sample]), float(self.rays.plane_y[self.sample])
        depth = float(self.rays.depth[self.sample])
        r = 1.0 / depth
        depth = 1.0 / r
        sx, sy, sz, w = self.rays.start_view.tolist()
        plane = np.sqrt(a * a + b * b + d * d) * self.rays.bias - (a * x + (b * y + d) + c * r) * depth
        start = a * (sx - w * x * depth) + b * (sy - w * y * depth) + d * (sz - w * depth)
        return float(1.0 - plane / start)

    def _hits(self, t: int, place: str, shape: int | None) -> bool:
        """The shared definition of shadow, on the planes of a triangle."""
        a, b, d, c = self.rays.rows[t].reshape(4, 4)
        x, y = self.rays.plane_x[self.sample], self.rays.plane_y[self.sample]
        value = a * x + (b * y + d) + c * (1.0 / self.rays.depth[self.sample])
        outside = [*(value[:CAP_ROW] > 0).tolist(), bool(value[CAP_ROW] >= 0)]
        names = [*(f"the plane through the light and edge {k}" for k in range(CAP_ROW)), "the triangle's own plane"]
        words = f"missed: outside {names[outside.index(True)]}" if any(outside) else "IN SHADOW"
        self.trace.add(Test(t, f"triangle of {place}" if place.startswith("leaf") else place, words, 1.0, shape))
        return not any(outside)

    def _world(self, value: float, axis: int) -> float:
        """A place of the tree's grid in the world."""
        return float(value / self.tree.scale + self.tree.base[axis])

    def _outline(self, box: tuple[NDArray, NDArray], css: str, title: str) -> Shape:
        """Convex outline of a cell on the image."""
        corners = np.array([[box[(i >> k) & 1][k] for k in range(3)] for i in range(8)])
        return Shape(_hull(_project(self.frame, corners / self.tree.scale + self.tree.base)), css, title)


def _project(frame: Frame, points: NDArray[np.float64]) -> list[Corner]:
    """Columns and rows of samples of world points; those behind the eye are drawn at its side of the near plane."""
    camera, s = frame.camera, frame.samples
    relative = points - camera.eye
    depth = np.maximum((relative * camera.forward).sum(axis=1), camera.near)
    x = (relative * camera.right).sum(axis=1) / depth / camera.tan_x
    y = (relative * camera.up).sum(axis=1) / depth / camera.tan_y
    return [(float(c), float(r)) for c, r in zip((x + 1) / 2 * s.columns, (1 - y) / 2 * s.rows, strict=True)]


def _hull(points: list[Corner]) -> tuple[Corner, ...]:
    """Convex hull, in order."""
    ordered = sorted(set(points))

    def half(places: list[Corner]) -> list[Corner]:
        chain: list[Corner] = []
        for p in places:
            while len(chain) > 1 and ((chain[-1][0] - chain[-2][0]) * (p[1] - chain[-2][1])
                                      <= (chain[-1][1] - chain[-2][1]) * (p[0] - chain[-2][0])):
                chain.pop()
            chain.append(p)
        return chain

    return tuple(half(ordered)[:-1] + half(ordered[::-1])[:-1]) if len(ordered) > 2 else tuple(ordered)


def explain_sample(algorithm: RayTraced, frame: Frame, sample: int) -> Trace:
    """List every cell that a sample's ray meets, and every triangle that it is tested against."""
    trace = Trace(f"sample {sample}", note=NOTE)
    if not frame.samples.candidate[sample]:
        return trace
    tree = algorithm.prepare(frame.mesh) if frame.prepared is None else frame.prepared
    rays = make_shadow_rays(frame.mesh.corners, frame.mesh.bounds(), frame.camera[:4], frame.light.xyzw(), frame.bias,
                            frame.samples)
    light, here = frame.light.xyzw(), frame.samples.position[sample]
    start = light[:3] if light[3] else here + light[:3] * (2.0 * frame.mesh.diagonal() / np.sqrt((light[:3] ** 2).sum()))
    trace.add_shape(Shape(tuple(_project(frame, np.stack([start, here]))), "ray", "the ray"))
    RayWalk(tree, rays, frame, sample, trace).run()
    trace.value = sum(test.share > 0 for test in trace.tests)
    return trace
