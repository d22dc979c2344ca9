"""Stencil shadow volumes, walked slowly: every face that covers one sample, in the order in which faces are drawn."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.stencil_base import StencilAlgorithm
from shadowbench.algorithms.z_pass import ZPass
from shadowbench.explain.trace import Corner, Shape, Test, Trace
from shadowbench.geometry import Frame
from shadowbench.kernels import eye_volumes, stencil_volumes
from shadowbench.kernels.edges import edge_multiplicities
from shadowbench.kernels.shadow_volumes import find_casters
from shadowbench.kernels.stencil import BORDER_ERROR, StencilCounts, draw_faces
from shadowbench.kernels.volume_bins import Bins, band_rows, bin_faces
from shadowbench.kernels.volume_extrusion import VolumeKind, make_faces
from shadowbench.kernels.volume_faces import AT_INFINITY, BEHIND_PLANE, EDGE_ON_PLANE
from shadowbench.kernels.volume_polygons import volume_view

NOTE = ("Every change of the sample's stencil value by one counts as one, as the papers count; faces that the depth test "
        "stops are listed without a number.")


@dataclass(frozen=True)
class Volumes:
    """Faces of a frame, as the method makes them, and what its count starts from.

    Attributes
    ----------
    z_fail : True if faces behind the samples count.
    view, faces, limits : the kernels' records.
    around, touching : triangles whose frusta hold the eye, and those that z-pass tests every sample against.
    planes : of the touching ones, float64 (n, 4, 4).
    """

    z_fail: bool
    view: Any
    faces: Any
    limits: Any
    around: NDArray[np.int64]
    touching: NDArray[np.int64]
    planes: NDArray[np.float64]


def make_volumes(algorithm: StencilAlgorithm, frame: Frame) -> Volumes:
    """Make the faces of a frame: the method's stages before the stencil."""
    z_pass, light = isinstance(algorithm, ZPass), frame.light.xyzw()
    adjacency = algorithm.prepared(frame).adjacency
    nearest = stencil_volumes.NEAREST_BEFORE if z_pass else stencil_volumes.NEAREST_BEHIND
    view = volume_view(frame.camera, frame.samples, nearest * frame.camera.near)
    casters = drawn = find_casters(adjacency, light, algorithm.casters(frame), frame.bias, view)
    around = touching = np.zeros(0, np.int64)
    planes = np.zeros((0, 4, 4))
    if z_pass:
        eye = eye_volumes.find_eye_volumes(adjacency, light, casters, frame.bias, view,
                                           algorithm.params.eye_count == "robust")
        around, touching, drawn = eye.around, eye.touching, eye.casters
        planes = np.zeros((len(touching), 4, 4))
        for i, triangle in enumerate(touching.tolist()):
            eye_volumes._frustum_planes(triangle, adjacency, light, casters, frame.bias, view, planes[i])
    kind = VolumeKind(algorithm.params.extrude == "triangle", not z_pass and not frame.light.is_directional)
    faces = make_faces(view, adjacency, light, drawn, edge_multiplicities(adjacency, drawn.facing), frame.bias, kind)
    return Volumes(not z_pass, view, faces, algorithm.limits(frame, casters, view), around, touching, planes)


def explain_sample(algorithm: StencilAlgorithm, frame: Frame, sample: int) -> Trace:
    """List every face that covers a view sample, with the outcome of the depth test."""
    volumes, trace = make_volumes(algorithm, frame), Trace(f"sample {sample}", note=NOTE)
    view, faces, limits = volumes.view, volumes.faces, volumes.limits
    row, column = divmod(sample, frame.samples.columns)
    x, down, depth = float(view.x[column]), float(view.down[row]), float(frame.samples.depth[sample])
    stencil = 0
    for triangle in volumes.around.tolist():
        part = limits.part[triangle]
        if _within(limits, part, row, column, depth):
            stencil += 1
            trace.add(Test(triangle, "the eye", f"its shadow holds the eye: the stencil starts from {stencil}", 0.0))
    for triangle, planes in zip(volumes.touching.tolist(), volumes.planes, strict=True):
        values = [p[0] + depth * (p[3] + x * p[1] - down * p[2]) for p in planes.tolist()]
        inside = values[3] > 0.0 and min(values[:3]) >= 0.0
        stencil += inside
        trace.add(Test(triangle, "the sample itself, for its shadow touches the eye",
                       f"inside: stencil {stencil}" if inside else "outside"))
    bins = bin_faces(len(view.down), faces, limits)
    band = row // band_rows(len(view.down))
    for face in bins.face[bins.offset[band, 0]:bins.offset[band, -1]].tolist():
        amount = _winding(faces, face, x, down, row) * int(faces.multiplicity[face])
        part = limits.part[faces.triangle[face]]
        if amount and limits.rows[part, 0] <= row <= limits.rows[part, 1] and (
                limits.columns[part, 0] <= column <= limits.columns[part, 1]):
            stencil += _draw(volumes, face, amount, (x, down, depth), stencil, trace, frame)
    trace.value = sum(test.share > 0 for test in trace.tests)
    return trace


def _within(limits: Any, part: int, row: int, column: int, depth: float) -> bool:
    """True if scissor and depth bounds of a part let a sample through."""
    return bool(limits.rows[part, 0] <= row <= limits.rows[part, 1]
                and limits.columns[part, 0] <= column <= limits.columns[part, 1]
                and limits.depths[part, 0] <= depth <= limits.depths[part, 1])


def _winding(faces: Any, face: int, x: float, down: float, row: int) -> int:
    """Winding number of a face's border around a sample, in rational arithmetic."""
    if not faces.rows[face, 0] <= row <= faces.rows[face, 1]:
        return 0
    corners = faces.polygon[face, :faces.n_corners[face]].tolist()
    winding = 0
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        upper, lower = ((ax, ay), (bx, by)) if ay < by else ((bx, by), (ax, ay))
        if ay == by or not upper[1] <= down < lower[1]:
            continue
        (ux, uy), (lx, ly) = upper, lower
        across = (Fraction(ux) - Fraction(x)) * (Fraction(ly) - Fraction(down))
        if across <= (Fraction(uy) - Fraction(down)) * (Fraction(lx) - Fraction(x)):
            winding += 1 if ay < by else -1
    return winding


def _draw(volumes: Volumes, face: int, amount: int, ray: tuple[float, float, float], stencil: int, trace: Trace,
          frame: Frame) -> int:
    """List a face that covers the sample, as often as it is drawn; returns what it adds to the stencil value."""
    faces, part = volumes.faces, volumes.limits.part[volumes.faces.triangle[face]]
    triangle, shape = int(faces.triangle[face]), _shape(volumes, face, frame)
    number = trace.add_shape(shape)
    if not volumes.limits.depths[part, 0] <= ray[2] <= volumes.limits.depths[part, 1]:
        trace.add(Test(triangle, shape.title, "left out: the depth bounds exclude the sample", 0.0, number))
        return 0
    behind = _is_behind(faces, face, *ray)
    where = "behind the sample" if behind else "before the sample"
    change = -amount if volumes.z_fail else amount
    for i in range(abs(amount)):
        if behind == volumes.z_fail:
            now = stencil + (i + 1) * (1 if change > 0 else -1)
            trace.add(Test(triangle, shape.title, f"{where}: stencil {now}", 1.0, number))
        else:
            trace.add(Test(triangle, shape.title, f"{where}: no change", 0.0, number))
    return change if behind == volumes.z_fail else 0


def _is_behind(faces: Any, face: int, x: float, down: float, depth: float) -> bool:
    """True if a face that covers a sample lies behind it."""
    side = int(faces.eye_side[face])
    if side == AT_INFINITY:
        return depth < np.inf
    at_eye, right, up, forward = faces.plane[face].tolist()
    if side == EDGE_ON_PLANE:
        return not _meets_before(faces.borders[face].tolist(), x, down, depth)
    f = at_eye + depth * ((forward - down * up) + x * right)
    return bool(f <= 0.0) if side == BEHIND_PLANE else bool(f > 0.0)


def _meets_before(borders: list[list[float]], x: float, down: float, depth: float) -> bool:
    """True if the ray of a sample meets a face that is seen edge-on no farther than the sample."""
    enter, leave = -np.inf, np.inf
    for at_eye, mx, my, mz in borders:
        change = depth * (mz + x * mx - down * my)
        noise = BORDER_ERROR * (abs(mx) + abs(my) + abs(mz)) * depth * (1.0 + abs(x) + abs(down))
        if change == 0.0 or (abs(at_eye) <= noise and abs(change) <= noise):
            continue
        if change > 0.0:
            enter = max(enter, -at_eye / change)
        else:
            leave = min(leave, -at_eye / change)
    return (0.5 * (enter + leave) if enter > leave else enter) <= 1.0


def _shape(volumes: Volumes, face: int, frame: Frame) -> Shape:
    """A face's border on the image."""
    camera, s = frame.camera, frame.samples
    corners: list[Corner] = [((x / camera.tan_x + 1) / 2 * s.columns, (down / camera.tan_y + 1) / 2 * s.rows)
                             for x, down in volumes.faces.polygon[face, :volumes.faces.n_corners[face]].tolist()]
    far = volumes.faces.eye_side[face] == AT_INFINITY
    times = abs(int(volumes.faces.multiplicity[face]))
    drawn = f", drawn {times} times" if times > 1 else ""
    return Shape(tuple(corners), "face", f"{'dark cap' if far else 'face'} {face}{drawn}")


def explain_triangle(algorithm: StencilAlgorithm, frame: Frame, triangle: int) -> Trace:
    """List every change of a stencil value by a triangle's faces, and by the edges that it is the first to use.

    The samples come from the method's own kernel, with all other faces left out.
    """
    volumes = make_volumes(algorithm, frame)
    trace = Trace(f"triangle {triangle}", note="Every change of a stencil value by one counts as one.")
    bins = bin_faces(len(volumes.view.down), volumes.faces, volumes.limits)
    own = volumes.faces.triangle[bins.face] == triangle
    for face in dict.fromkeys(bins.face[own].tolist()):
        trace.add_shape(_shape(volumes, face, frame))
    kept = np.concatenate([[0], np.cumsum(own)])
    target = stencil_volumes.empty_stencil(frame.samples)
    fragments, depth_tests, updates = np.zeros((3, *target.stencil.shape), np.int64)
    counts = StencilCounts(fragments, depth_tests, updates, np.zeros(int(own.sum()), np.int64))
    draw_faces(volumes.view, volumes.faces, Bins(kept[bins.offset], bins.face[own]), volumes.z_fail, target, volumes.limits,
               stencil_volumes.NO_MASK, counts)
    for sample in np.flatnonzero(counts.updates).tolist():
        row, column = divmod(sample, frame.samples.columns)
        total = int(target.stencil.view(np.int32)[row, column])
        for i in range(int(counts.updates[row, column])):
            trace.add(Test(triangle, f"sample {column},{row}", f"change {i + 1} of {counts.updates[row, column]}, "
                           f"together {total:+d}"))
    trace.value = len(trace.tests)
    return trace
