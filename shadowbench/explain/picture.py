"""The page of an explanation: the nodes, cells or faces that were walked, over the image, and every test."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path

import jinja2
import numpy as np
from numpy.typing import NDArray

from shadowbench import __version__, image_io
from shadowbench.explain.trace import Corner, Trace
from shadowbench.report.html import ASSETS

MOST_ROWS = 20_000
"""Tests that the page lists; the command lists all."""

ZOOM = 48.0
"""Least width of the part that the second picture shows, in samples."""


@dataclass(frozen=True)
class Drawn:
    """A shape as it is drawn: `points` for SVG, and a title that sums up its tests."""

    points: str
    css: str
    title: str


def page(trace: Trace, title: str, image: NDArray[np.uint8], grid: tuple[int, int], spot: tuple[Corner, ...],
         facts: dict[str, str]) -> str:
    """Make the HTML text.

    Parameters
    ----------
    image : the shaded image, uint8 (height, width, 3); grid : columns and rows of samples.
    spot : outline of what is explained, in columns and rows of samples; empty if it is not in the image.
    facts : what to say about it.
    """
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"), autoescape=True,
                                     trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    sums = np.cumsum([test.share for test in trace.tests])
    rows = [(number, test, f"{total:.3f}") for number, test, total in zip(trace.numbers(), trace.tests, sums, strict=True)]
    styles = "\n".join((ASSETS / name).read_text(encoding="utf-8") for name in ("page.css", "tables.css", "print.css"))
    return environment.get_template("explain.html").render(
        version=__version__, title=title, trace=trace, facts=facts, shapes=_drawn(trace), grid=grid, spot=_points(spot),
        image=base64.b64encode(image_io.encode_png(image)).decode(), zoom=_zoom(trace, spot, grid), styles=styles,
        rows=rows[:MOST_ROWS], left_out=max(len(rows) - MOST_ROWS, 0), shared=any(test.share % 1 for test in trace.tests))


def _points(points: tuple[Corner, ...]) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points)


def _drawn(trace: Trace) -> list[Drawn]:
    """Join the shapes of equal outline, the largest first, and say what their tests found."""
    found: dict[tuple[Corner, ...], list[int]] = {}
    for number, shape in enumerate(trace.shapes):
        found.setdefault(shape.points, []).append(number)
    tests = [0] * len(trace.shapes)
    for test in trace.tests:
        if test.shape is not None:
            tests[test.shape] += 1
    drawn = []
    for points, numbers in sorted(found.items(), key=lambda item: -_area(item[0])):
        kinds = {trace.shapes[n].css: tests[n] for n in numbers}
        css = next((kind for kind in ("accept", "refine") if kind in kinds), trace.shapes[numbers[0]].css)
        words = ", ".join(f"{n:,} {_WORDS.get(kind, kind)}" for kind, n in kinds.items() if n)
        drawn.append(Drawn(_points(points), css, f"{trace.shapes[numbers[0]].title}{': ' if words else ''}{words}"))
    return drawn


_WORDS = {"accept": "accepted", "refine": "refined", "reject": "rejected", "leaf": "tests", "face": "changes or depth tests"}


def _area(points: tuple[Corner, ...]) -> float:
    return abs(sum(ax * by - bx * ay for (ax, ay), (bx, by) in zip(points, points[1:] + points[:1], strict=True))) / 2


@dataclass(frozen=True)
class Window:
    """A part of the image in columns and rows of samples."""

    left: float
    top: float
    width: float
    height: float


def _zoom(trace: Trace, spot: tuple[Corner, ...], grid: tuple[int, int]) -> Window | None:
    """The surroundings of what is explained: twice the smallest shape around it, but not less than `ZOOM` samples."""
    if not spot:
        return None
    x, y = (sum(corner[axis] for corner in spot) / len(spot) for axis in (0, 1))
    spread = max(max(corner[axis] for corner in spot) - min(corner[axis] for corner in spot) for axis in (0, 1))
    width = min(max(ZOOM, 2.0 * spread), float(grid[0]))
    height = width * min(grid[1] / grid[0], 1.0)
    return Window(min(max(x - width / 2, 0.0), grid[0] - width), min(max(y - height / 2, 0.0), max(grid[1] - height, 0.0)),
                  width, height)
