"""Slow twins of silhouette maps: every edge against every cell, every sample against every corner, in plain Python.

The arithmetic of single steps is that of the kernels, so results compare bit for bit; what decides (which cells an edge
crosses, which quadrant holds a sample) is found by exhaustion or in rational numbers.
"""

import math
from fractions import Fraction
from types import SimpleNamespace

import numpy as np

from shadowbench.kernels.projection import View, screen_axis
from tests.stencil_twin import facing, multiplicities
from tests.test_rasterizer import twin
from tests.test_shadow_map import inner, twin_fit, twin_locate

BORDER = 2
ENLARGEMENT = 2.0**-10
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))            # row and column of each corner, in the order of their bits


def light_view(faces, eye, parallel, face, resolution, near):
    """View of one face."""
    axes, half = faces[face]
    side = resolution + 2 * BORDER
    half = half * side / resolution
    return View(np.array(eye), *np.array(axes), near, np.inf, not parallel, *screen_axis(side, (0.5,), half),
                *screen_axis(side, (0.5,), -half))


def cut(view, a, b):
    """Range of an edge's parameter that lies beyond the near plane and within twice the map's extent."""
    t0, t1 = 0.0, 1.0
    reach = [p[2] if view.perspective else 1.0 for p in (a, b)]
    planes = [(a[2] - view.near, b[2] - view.near)] if view.perspective else []
    for axis, half in ((0, 2.0 * abs(view.x_half)), (1, 2.0 * abs(view.y_half))):
        planes += [tuple(half * r + sign * p[axis] for p, r in zip((a, b), reach, strict=True)) for sign in (-1, 1)]
    for f0, f1 in planes:
        if f0 < 0 and f1 < 0:
            return None
        if f0 < 0:
            t0 = max(t0, f0 / (f0 - f1))
        elif f1 < 0:
            t1 = min(t1, f0 / (f0 - f1))
    return (t0, t1) if t0 <= t1 else None


def to_cells(view, ends):
    """Column, row and depth of both ends of an edge, in cells; None where it is not on the map."""
    a, b = ([inner(axis, [float(p[k]) - float(view.eye[k]) for k in range(3)])
             for axis in (view.right, view.up, view.forward)] for p in ends)
    places = []
    for t in cut(view, a, b) or ():
        x, y, depth = b if t == 1.0 else [a[k] + t * (b[k] - a[k]) for k in range(3)]
        scale = depth if view.perspective else 1.0
        places.append(((1 + x / (scale * view.x_half)) * (0.5 * view.x_extent) - 0.5,
                       (1 + y / (scale * view.y_half)) * (0.5 * view.y_extent) - 0.5, depth))
    return places or None


def within(x, y):
    return all(-ENLARGEMENT <= c <= 1 + ENLARGEMENT for c in (x, y))


def pick(x0, y0, x1, y1):
    """Fig. 4: parameter of the point that a segment leaves in a cell, or None."""
    if within(x0, y0):
        return 0.0
    if within(x1, y1):
        return 1.0
    hits = []
    for f in (lambda x, y: y - x, lambda x, y: x + y - 1.0):
        f0, f1 = f(x0, y0), f(x1, y1)
        if f0 != f1 and min(f0, f1) <= 0 <= max(f0, f1):
            t = f0 / (f0 - f1)
            if within(x0 + t * (x1 - x0), y0 + t * (y1 - y0)):
                hits.append(t)
    return sum(hits) / len(hits) if hits else None


def twin_points(view, edges, depth):
    """Silhouette map of one view: points from the cells' centres, fragments and points kept."""
    side = len(depth) - 1
    points, fragments, written = np.zeros((side, side, 2), np.float32), 0, 0
    for edge in edges:
        places = to_cells(view, edge)
        if places is None:
            continue
        (x0, y0, d0), (x1, y1, d1) = places
        for row in range(side):
            for column in range(side):
                ends = x0 - column, y0 - row, x1 - column, y1 - row
                t = pick(*ends)
                if t is None:
                    continue
                fragments += 1
                if view.perspective:
                    own = 1 / (1 / d0 + t * (1 / d1 - 1 / d0))
                else:
                    own = d0 + t * (d1 - d0)
                if own > depth[row:row + 2, column:column + 2].max():
                    continue
                written += 1
                x, y = ends[0] + t * (ends[2] - ends[0]), ends[1] + t * (ends[3] - ends[1])
                if t == 1.0:
                    x, y = ends[2:]
                points[row, column] = min(max(x, 0), 1) - 0.5, min(max(y, 0), 1) - 0.5
    return points, fragments, written


def exact_quadrant(x, y, own, left, right, above, below):
    """Corner whose skewed quadrant holds a place strictly, in rational numbers; None on a border."""
    half = Fraction(1, 2)
    p = [Fraction(float(c)) + half for c in own]
    sides = [[Fraction(float(c)) + half + d for c, d in zip(q, offset, strict=True)]
             for q, offset in ((left, (-1, 0)), (above, (0, -1)), (right, (1, 0)), (below, (0, 1)))]
    corners = {(0, 0): (sides[0], sides[1]), (0, 1): (sides[1], sides[2]), (1, 1): (sides[2], sides[3]),
               (1, 0): (sides[3], sides[0])}
    q = Fraction(x) - p[0], Fraction(y) - p[1]
    for (row, column), (first, last) in corners.items():
        rays = [(s[0] - p[0], s[1] - p[1]) for s in (first, (Fraction(column), Fraction(row)), last)]
        for a, b in (rays[:2], rays[1:]):
            after, before, width = (u[0] * v[1] - u[1] * v[0] for u, v in ((a, q), (q, b), (a, b)))
            on_corner = rays[1][0] * q[1] == rays[1][1] * q[0]
            if width > 0 and ((after > 0 and before > 0) or (on_corner and after >= 0 and before >= 0)):
                return CORNERS.index((row, column))
    return None


def silhouettes(frame, casting, order):
    """Silhouette edges, in the order of drawing."""
    light = frame.light.xyzw()
    found = multiplicities(frame.mesh.corners, light, casting)
    edges = [edge for edge in sorted(found) if found[edge] != 0]
    if order == "nearest":
        def distance(edge):
            middle = [edge[0][k] + edge[1][k] for k in range(3)]
            if light[3] == 0:
                return -inner(light, middle)
            d = [middle[k] - 2 * light[k] for k in range(3)]
            return d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        edges.sort(key=lambda e: -distance(e))
    return edges


def twin_silhouette_map(frame, resolution, projection, bias, slope_bias, order, casters="all"):
    """Shadow, comparisons (-1 for no candidate), counts and the maps by face."""
    faces, eye, spot = twin_fit(frame, projection)
    parallel, samples = frame.light.is_directional, frame.samples
    corners, light = frame.mesh.corners, frame.light.xyzw()
    casting = np.array([casters == "all" or facing(t, light) < 0 for t in corners])
    candidates = np.flatnonzero(samples.candidate)
    places = {i: twin_locate(faces, eye, spot, parallel, samples.position[i]) for i in candidates}
    nearest = min((np.abs(samples.position[i] - eye).max() for i in candidates), default=1.0)
    edges = silhouettes(frame, casting, order)
    maps, counts = {}, dict.fromkeys(("map_fragments", "map_texels_written", "silhouette_fragments",
                                      "silhouette_points_written"), 0)
    for face in {p[0] for p in places.values()}:
        view = light_view(faces, eye, parallel, face, resolution, -np.inf if parallel else 2.0**-200 * nearest)
        depth, _, f, w = twin(view, frame.mesh.vertices, frame.mesh.triangles[casting])
        points, fragments, written = twin_points(view, edges, depth)
        maps[face] = depth, points
        for name, n in zip(counts, (f.sum(), w.sum(), fragments, written), strict=True):
            counts[name] += int(n)
    shadow, nearer = np.zeros(len(samples.candidate), np.float32), np.full(len(samples.candidate), -1)
    for i, (face, u, v, z) in places.items():
        axes, half = faces[face]
        right, up, forward = (inner(a, samples.normal[i]) for a in axes)
        y, x = (resolution / 2 + BORDER + s * (resolution / 2) - 0.5 for s in (-v / half, u / half))
        row, column = math.floor(y), math.floor(x)
        y, x = y - row, x - column
        bits, reach = 0, slope_bias * 2 * half / resolution
        for k, (dy, dx) in enumerate(CORNERS):
            tilt = reach * max(0.5, abs(dx - x)) * abs(right) + reach * max(0.5, abs(dy - y)) * abs(up)
            if parallel:
                limit = z - tilt / abs(forward)
            else:
                limit = z / (1 + tilt / abs(forward + (u * right + v * up)))
            bits |= int(maps[face][0][row + dy, column + dx] < limit - bias * frame.bias) << k
        points = maps[face][1]
        if bits in (0, 15):
            shadow[i] = bits == 15
        else:
            corner = exact_quadrant(x, y, points[row, column], points[row, column - 1], points[row, column + 1],
                                    points[row - 1, column], points[row + 1, column])
            assert corner is not None, "a sample on a line between points: choose another scene"
            shadow[i] = bits >> corner & 1
        nearer[i] = bits
    split = int(np.count_nonzero((nearer > 0) & (nearer < 15)))
    counts |= {"silhouette_edges": len(edges), "scene_fill": int(np.count_nonzero(samples.triangle >= 0)),
               "silhouette_samples": split, "corner_reads": 4 * len(candidates), "point_reads": 5 * split}
    return SimpleNamespace(shadow=shadow, nearer=nearer, counts=counts, maps=maps)
