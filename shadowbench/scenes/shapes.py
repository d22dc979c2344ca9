"""Shapes that procedural scenes are built from. Triangles run anticlockwise seen from outside; y is up."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import FloatArray, Vector
from shadowbench.trigonometry import cos_degrees, sin_degrees

Point = tuple[float, float]

_BOX_FACES = {"-x": (0, 1, 3, 2), "+x": (4, 6, 7, 5), "-y": (0, 4, 5, 1),
              "+y": (2, 3, 7, 6), "-z": (0, 2, 6, 4), "+z": (1, 5, 7, 3)}


class Shape(NamedTuple):
    """An indexed piece of surface.

    Attributes
    ----------
    vertices : float64 (n_vertices, 3).
    triangles : int64 (n_triangles, 3), vertex indices.
    """

    vertices: FloatArray
    triangles: NDArray[np.int64]

    def moved(self, x: float, y: float, z: float) -> Shape:
        """Translate."""
        return Shape(self.vertices + np.array([x, y, z]), self.triangles)

    def scaled(self, x: float, y: float, z: float) -> Shape:
        """Scale by positive factors."""
        return Shape(self.vertices * np.array([x, y, z]), self.triangles)

    def turned(self, cosine: float, sine: float) -> Shape:
        """Turn about y so that the x axis comes to point along (cosine, 0, sine)."""
        x, y, z = self.vertices[:, 0], self.vertices[:, 1], self.vertices[:, 2]
        return Shape(np.stack([cosine * x - sine * z, y, sine * x + cosine * z], axis=1), self.triangles)

    def turned_degrees(self, angle: float) -> Shape:
        """Turn about y from the x axis towards the z axis."""
        return self.turned(cos_degrees(float(angle)), sin_degrees(float(angle)))

    def flipped(self) -> Shape:
        """Turn the inside out."""
        return Shape(self.vertices, self.triangles[:, ::-1])


def join(shapes: Sequence[Shape]) -> Shape:
    """Put shapes together as one."""
    if not shapes:
        return Shape(np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    first = np.cumsum([0] + [len(s.vertices) for s in shapes])
    return Shape(np.concatenate([s.vertices for s in shapes]),
                 np.concatenate([s.triangles + start for s, start in zip(shapes, first, strict=False)]))


def copies(shape: Shape, offsets: FloatArray, degrees: NDArray[np.int64] | None = None,
           scales: FloatArray | None = None) -> Shape:
    """Place copies of a shape: each scaled, turned about y by whole degrees, then moved.

    Parameters
    ----------
    offsets : float64 (k, 3).
    degrees : int64 (k,), or None.
    scales : float64 (k, 3) or (k, 1), or None.
    """
    k, n = len(offsets), len(shape.vertices)
    points = np.broadcast_to(shape.vertices, (k, n, 3))
    if scales is not None:
        points = points * scales[:, None, :]
    if degrees is not None:
        turn = unit_circle(360)[degrees % 360]
        c, s = turn[:, :1], turn[:, 1:]
        x, z = points[..., 0], points[..., 2]
        points = np.stack([c * x - s * z, points[..., 1], s * x + c * z], axis=-1)
    points = points + offsets[:, None, :]
    triangles = shape.triangles[None] + (np.arange(k) * n)[:, None, None]
    return Shape(points.reshape(-1, 3), triangles.reshape(-1, 3))


@cache
def unit_circle(segments: int) -> FloatArray:
    """float64 (segments, 2): cosine and sine of equal steps of a turn."""
    table = np.array([[cos_degrees(360.0 * i / segments), sin_degrees(360.0 * i / segments)]
                      for i in range(segments)])
    table.flags.writeable = False
    return table


def box(low: Vector, high: Vector, without: tuple[str, ...] = ()) -> Shape:
    """Axis-aligned box, less the faces named such as "-y"."""
    vertices = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]
                         for i in (0, 1) for j in (0, 1) for k in (0, 1)], np.float64)
    faces = [face for name, face in _BOX_FACES.items() if name not in without]
    return Shape(vertices, np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))], np.int64))


def grid(columns: int, rows: int, closed: bool = False) -> NDArray[np.int64]:
    """Triangles of a grid of vertices stored row by row, facing rows x columns; int64 (n, 3).

    Parameters
    ----------
    columns, rows : numbers of cells.
    closed : True if the last column of cells joins the first vertices.
    """
    width = columns if closed else columns + 1
    i, j = np.arange(columns)[None, :], np.arange(rows)[:, None]
    a, b = j * width + i, j * width + (i + 1) % width
    c, d = a + width, b + width
    return np.stack([np.stack([a, c, d], -1), np.stack([a, d, b], -1)], axis=2).reshape(-1, 3)


def strip(lines: FloatArray, closed: bool = False) -> Shape:
    """Surface through polylines of equal length, float64 (n_lines, n_points, 3); `closed` joins their ends."""
    n_lines, n_points = lines.shape[:2]
    return Shape(lines.reshape(-1, 3), grid(n_points if closed else n_points - 1, n_lines - 1, closed))


def lathe(profile: Sequence[Point], segments: int, bottom: bool = False, top: bool = False) -> Shape:
    """Surface of revolution about y.

    Parameters
    ----------
    profile : (radius, height) from the lowest ring to the highest, radii positive but for an apex at either end.
    segments : sides.
    bottom, top : True to close an end that is a ring by a fan.
    """
    rings = [(r, y) for r, y in profile if r > 0.0]
    circle = unit_circle(segments)
    points = [np.stack([r * circle[:, 0], np.full(segments, y), r * circle[:, 1]], axis=1) for r, y in rings]
    vertices, triangles = np.concatenate(points), [grid(segments, len(rings) - 1, closed=True)]
    around = np.arange(segments)
    for end, closed, ring in ((profile[0], bottom, 0), (profile[-1], top, len(rings) - 1)):
        if end[0] > 0.0 and not closed:
            continue
        a, b = ring * segments + around, ring * segments + (around + 1) % segments
        if ring == 0 and end is profile[0]:
            a, b = b, a
        triangles.append(np.stack([b, a, np.full(segments, len(vertices))], axis=1))
        vertices = np.concatenate([vertices, [[0.0, end[1], 0.0]]])
    return Shape(vertices, np.concatenate(triangles))


def slab(inner: Sequence[Point], outer: Sequence[Point], depth: float, ring: bool = False,
         ends: bool = True) -> Shape:
    """Band between two outlines in the xy plane, given thickness along z: arches, frames, borders.

    Parameters
    ----------
    inner, outer : as many points each, anticlockwise for a ring, clockwise (left to right) for an arch.
    depth : thickness; the slab is centred on z = 0.
    ring : True if the outlines are closed.
    ends : True to close the two ends of an open band.
    """
    a, b = np.asarray(inner, np.float64), np.asarray(outer, np.float64)
    if not ring:
        a, b = a[::-1], b[::-1]
    z = np.full((len(a), 1), 0.5 * depth)
    section = [np.hstack([b, z]), np.hstack([a, z]), np.hstack([a, -z]), np.hstack([b, -z])]
    n = len(a)
    points = np.stack(section, axis=1)                      # (n, 4, 3), one cross-section per row
    triangles = grid(4, n - 1, closed=True)
    if ring:
        last, i = (n - 1) * 4, np.arange(4)
        p, q = last + i, last + (i + 1) % 4
        triangles = np.concatenate([triangles, np.stack([p, i, (i + 1) % 4], 1),
                                    np.stack([p, (i + 1) % 4, q], 1)])
    elif ends:
        caps = [(0, 1, 2), (0, 2, 3), (4 * n - 4, 4 * n - 2, 4 * n - 3), (4 * n - 4, 4 * n - 1, 4 * n - 2)]
        triangles = np.concatenate([triangles, np.array(caps, np.int64)])
    return Shape(points.reshape(-1, 3), triangles)


@cache
def arch(opening: float, spring: float, width: float, height: float, depth: float, segments: int) -> Shape:
    """Wall with a round-headed doorway, centred on x = 0 and z = 0, without bottom faces.

    Parameters
    ----------
    opening, width : of the doorway and of the whole wall.
    spring : height at which the round begins; the wall must be higher than spring + opening / 2.
    height, depth : of the wall.
    segments : of the round; a multiple of 4.
    """
    r, w = 0.5 * opening, 0.5 * width
    quarter = segments // 4
    circle = unit_circle(2 * segments)[segments::-1]
    round_part = [(r * c, spring + r * s) for c, s in circle]
    side = [(-w, spring + (height - spring) * i / quarter) for i in range(quarter)]
    top = [(-w + w * i / quarter, height) for i in range(2 * quarter)]
    mirror = [(-x, y) for x, y in side[::-1]]
    outer = [*side, *top, (w, height), *mirror]
    return slab([(-r, 0.0), *round_part, (r, 0.0)], [(-w, 0.0), *outer, (w, 0.0)], depth, ends=False)


@cache
def frame(width: float, height: float, border: float, depth: float) -> Shape:
    """Rectangular ring centred on the origin, in the xy plane; `width` and `height` are those of the hole."""
    x, y = 0.5 * width, 0.5 * height
    inner = [(-x, -y), (x, -y), (x, y), (-x, y)]
    outer = [(-x - border, -y - border), (x + border, -y - border), (x + border, y + border),
             (-x - border, y + border)]
    return slab(inner, outer, depth, ring=True)


def sheet(profile: Sequence[Point], width: float, columns: int = 1) -> Shape:
    """One-sided surface: a profile of (z, y) points swept along x, centred; rising z with level y faces up."""
    x = np.array([width * (i / columns - 0.5) for i in range(columns + 1)])
    lines = [np.stack([x, np.full_like(x, y), np.full_like(x, z)], axis=1) for z, y in profile]
    return strip(np.stack(lines))


def prism(outline: Sequence[Point], depth: float, bottom: bool = True) -> Shape:
    """Convex outline (x, y), anticlockwise from the bottom edge's left end, given thickness along z, centred.

    `bottom` False leaves out the face below the first edge.
    """
    n, h = len(outline), 0.5 * depth
    front = np.array([[x, y, h] for x, y in outline])
    back = front * np.array([1.0, 1.0, -1.0])
    triangles = [(0, i, i + 1) for i in range(1, n - 1)] + [(n, n + i + 1, n + i) for i in range(1, n - 1)]
    for i in range(0 if bottom else 1, n):
        j = (i + 1) % n
        triangles += [(i, n + i, n + j), (i, n + j, j)]
    return Shape(np.concatenate([front, back]), np.array(triangles, np.int64))


def stairs(steps: int, width: float, run: float, rise: float) -> Shape:
    """Flight of `steps` open-backed boxes rising along +z from the origin, centred on x = 0."""
    step = box((-0.5 * width, 0.0, 0.0), (0.5 * width, 1.0, 1.0), without=("-y", "+z"))
    height = rise * np.arange(1, steps + 1) / steps
    offsets = np.stack([np.zeros(steps), np.zeros(steps), run * np.arange(steps) / steps], axis=1)
    scales = np.stack([np.ones(steps), height, np.full(steps, run / steps)], axis=1)
    return copies(step, offsets, scales=scales)


@cache
def subdivided_box(n: int) -> Shape:
    """Closed cube of side 2 about the origin, each face cut into n x n cells."""
    ticks = np.linspace(-1.0, 1.0, n + 1)
    u, v = (a.ravel() for a in np.meshgrid(ticks, ticks))
    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            points = np.empty((len(u), 3))
            points[:, axis], points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = side, u, v
            face = Shape(points, grid(n, n))
            faces.append(face.flipped() if side > 0 else face)
    return weld(join(faces))


def zigzag(near: tuple[Vector, Vector], far: tuple[Vector, Vector], n: int) -> Shape:
    """Exactly `n` triangles between two lines, each given by its left and its right end: a patch of any count.

    It faces up where `near` lies at larger z than `far`.
    """
    n_near, n_far = n // 2 + 1, n - n // 2 + 1
    front, back = (np.linspace(np.array(line[0], np.float64), np.array(line[1], np.float64), n_points)
                   for line, n_points in ((near, n_near), (far, n_far)))
    triangles, i, j = [], 0, 0
    while i < n_near - 1 or j < n_far - 1:
        # Advance on the side that lags behind, so that the zigzag stays even.
        if j * (n_near - 1) <= i * (n_far - 1) and j < n_far - 1:
            triangles.append((i, n_near + j + 1, n_near + j))
            j += 1
        else:
            triangles.append((i, i + 1, n_near + j))
            i += 1
    return Shape(np.concatenate([front, back]), np.array(triangles, np.int64))


def weld(shape: Shape) -> Shape:
    """Join vertices at the same position."""
    vertices, index = np.unique(shape.vertices, axis=0, return_inverse=True)
    return Shape(vertices, index.reshape(-1)[shape.triangles].astype(np.int64))


def rock() -> Shape:
    """Closed, uneven eight-sided stone about a unit across, its lower half meant to sink into the ground."""
    points = [(0.5, 0.0, 0.1), (-0.1, 0.02, 0.45), (-0.55, -0.03, -0.05), (0.05, 0.0, -0.5), (0.08, 0.4, 0.04),
              (0.0, -0.35, 0.0)]
    sides = [(0, 1), (1, 2), (2, 3), (3, 0)]
    return Shape(np.array(points), np.array([(b, a, 4) for a, b in sides] + [(a, b, 5) for a, b in sides]))
