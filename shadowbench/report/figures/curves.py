"""Curves over the frames of a fly-through, and costs against wrong samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from shadowbench.report.figures import svg
from shadowbench.report.gather import Series
from shadowbench.report.summary import MethodSummary, median_ms, wrong_samples
from shadowbench.results import CellResult


@dataclass(frozen=True)
class Measure:
    """Something that every cell has a value of.

    Attributes
    ----------
    name : for file names; title : above the axis.
    value : of a cell, or None where it has none.
    zero : True if 0 is a value to be shown on the logarithmic scale.
    """

    name: str
    title: str
    value: Callable[[CellResult], float | None]
    zero: bool = False


def _count(name: str) -> Callable[[CellResult], float | None]:
    return lambda cell: cell.counts.get(name) or None


MEASURES = (Measure("test_and_set", "test_and_set, operations", _count("test_and_set")),
            Measure("all_work", "all_work, operations", _count("all_work")),
            Measure("time", "median time, ms", median_ms),
            Measure("wrong", "wrong samples", wrong_samples, zero=True))


LETTER = 7.4
"""Width of a letter of a point's name, in pixels, on the wide side."""


def fly_through(series: Sequence[Series]) -> list[Markup]:
    """One figure per measure: a curve per method over the frames. Empty if no run has two frames."""
    return [figure for measure in MEASURES if (figure := _curves(series, measure)) is not None]


def _curves(series: Sequence[Series], measure: Measure) -> Markup | None:
    curves = {s.index: [(cell.frame, value) for cell in s.done if (value := measure.value(cell)) is not None]
              for s in series}
    points = [point for curve in curves.values() for point in curve]
    frames = [frame for frame, _ in points]
    if len(set(frames)) < 2:
        return None
    box = svg.Box(58, 30, 548, 230)
    y = svg.fit("symlog" if measure.zero else "log", [value for _, value in points], box.bottom, box.top)
    x = svg.Scale("linear", min(frames), max(frames), box.left + 8, box.right - 8)
    parts = svg.y_axis(box, y, measure.title)
    step = max(1, round(svg.nice_step((x.high - x.low) / 8)))
    parts += [svg.text(x(f), box.bottom + 17, str(f), "middle", "tick") for f in range(min(frames), max(frames) + 1, step)]
    parts.append(svg.text(box.right, box.bottom + 34, "frame", "end", "axis-title"))
    parts.append(f'<line class="scrub" x1="{x(frames[0]):.1f}" x2="{x(frames[0]):.1f}" y1="{box.top}" y2="{box.bottom}" '
                 f'data-x="{x.start} {x.end} {x.low:g} {x.high:g}"/>')
    for s in series:
        places = [(x(frame), y(value)) for frame, value in curves[s.index]]
        parts.append(svg.path(s.index, places))
        parts += [svg.marker(s.index, px, py, f"{s.title}, frame {frame}: {value:,.6g}", f' data-frame="{frame}"')
                  for (px, py), (frame, value) in zip(places, curves[s.index], strict=True)]
    return svg.figure(f"frames-{measure.name}", f"{measure.title} of each method over the frames", 560, 270, parts)


def against_wrong(methods: Sequence[MethodSummary]) -> list[Markup]:
    """Cost per frame against wrong samples per frame: once as time, once as operations."""
    costs: tuple[tuple[str, str, Callable[[MethodSummary], float | None]], ...] = (
        ("time", "time per frame, ms", lambda m: m.milliseconds),
        ("all_work", "all_work per frame, operations", lambda m: m.counts.get("all_work") or None))
    return [figure for name, title, cost in costs if (figure := _scatter(methods, name, title, cost)) is not None]


def _scatter(methods: Sequence[MethodSummary], name: str, title: str,
             cost: Callable[[MethodSummary], float | None]) -> Markup | None:
    points = [(m, c, (m.wrong or 0) / m.n_done) for m in methods
              if m.wrong is not None and m.n_done and (c := cost(m)) is not None]
    if len(points) < 2:
        return None
    box = svg.Box(58, 30, 548, 260)
    x = svg.fit("log", [c for _, c, _ in points], box.left + 10, box.right - 10)
    y = svg.fit("symlog", [max(w, 1.0) if w else 0.0 for _, _, w in points], box.bottom - 12, box.top)
    parts = [*svg.y_axis(box, y, "wrong samples per frame"), *svg.x_axis(box, x, title)]
    taken = [(x(c) - 6, x(c) + 6, y(max(w, 1.0) if w else 0.0) + 4) for _, c, w in points]
    for m, c, w in points:
        at_x, at_y = x(c), y(max(w, 1.0) if w else 0.0)
        parts.append(svg.marker(m.series.index, at_x, at_y, f"{m.series.title}: {c:,.6g}, {w:,.6g} wrong samples per frame"))
        parts.append(_label(m.series, at_x, at_y, taken, box))
    return svg.figure(f"wrong-against-{name}", f"Wrong samples against {title}", 560, 300, parts)


def _label(series: Series, x: float, y: float, taken: list[tuple[float, float, float]], box: svg.Box) -> str:
    """Name a point beside it, moved up until it covers no other name."""
    words = series.title if len(series.title) <= 28 else series.title[:27] + "…"
    width, left = LETTER * len(words), x > (box.left + box.right) / 2
    start = x - 9 - width if left else x + 9
    at = y + 4
    while any(abs(at - y_taken) < 13 and start < right and left_end < start + width for left_end, right, y_taken in taken):
        at -= 13
    taken.append((start, start + width, at))
    return (f'<g data-series="{series.index}">' + svg.text(x - 9 if left else x + 9, at, words, "end" if left else "start",
                                                          f"label s{series.index % svg.N_COLORS}") + "</g>")
