"""Where the work goes: by level of the tree, and by the triangle that causes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from shadowbench.report.figures import svg
from shadowbench.report.gather import Series

LEVEL_COUNT = "node_tests"
"""The count that the levels' figure compares; the table beside it has the others."""

TRIANGLE_COUNT = "test_and_set"


@dataclass(frozen=True)
class TriangleSum:
    """Work of the triangles of all frames of a method, in classes by powers of two.

    Attributes
    ----------
    triangles, work : number of triangles and sum of counts of each class: 0, 1, 2 to 3, 4 to 7 and so on.
    heaviest : the triangles with the largest counts in any one frame: frame, triangle, count.
    """

    triangles: list[int]
    work: list[int]
    heaviest: list[tuple[int, int, int]]

    @property
    def concentration(self) -> str:
        """Say how few triangles cause how much of the work."""
        total, n_triangles, n, work = sum(self.work), sum(self.triangles), 0, 0
        for count, amount in zip(self.triangles[::-1], self.work[::-1], strict=True):
            n, work = n + count, work + amount
            if 2 * work >= total:
                break
        if not total:
            return "no triangle causes any test"
        return f"{100 * n / n_triangles:.2g} % of the triangles cause {100 * work / total:.0f} % of its tests"


def triangle_sum(series: Series) -> TriangleSum | None:
    """Add up a method's frames; None if it does not attribute its work to triangles."""
    cells = [cell for cell in series.done if TRIANGLE_COUNT in cell.triangles]
    if not cells:
        return None
    n = max(len(cell.triangles[TRIANGLE_COUNT].work) for cell in cells)
    triangles, work = [0] * n, [0] * n
    heaviest = []
    for cell in cells:
        record = cell.triangles[TRIANGLE_COUNT]
        for i, (count, amount) in enumerate(zip(record.triangles, record.work, strict=True)):
            triangles[i] += count
            work[i] += amount
        heaviest += [(cell.frame, triangle, count) for triangle, count in record.heaviest]
    heaviest.sort(key=lambda entry: (-entry[2], entry[0], entry[1]))
    return TriangleSum(triangles, work, heaviest)


def class_name(number: int) -> str:
    """The least count of a class: 0, 1, 2, 4, 8."""
    return svg.short(2 ** (number - 1)) if number else "0"


def levels_of(series: Series) -> dict[str, list[float]]:
    """Mean over the frames of every count that is kept by level."""
    cells = [cell for cell in series.done if cell.levels]
    names = {name for cell in cells for name in cell.levels}
    sums: dict[str, list[float]] = {}
    for name in sorted(names):
        lists = [cell.levels.get(name, []) for cell in cells]
        sums[name] = [sum(values[i] for values in lists if i < len(values)) / len(cells)
                      for i in range(max(len(values) for values in lists))]
    return sums


def by_level(series: Sequence[Series]) -> Markup | None:
    """Node tests per level, a curve per method; None if no method walks a tree."""
    curves = {s.index: list(enumerate(levels_of(s).get(LEVEL_COUNT, []))) for s in series}
    return _lines(series, curves, "levels", "node tests per frame", "level of the tree, from the root",
                  [str(i) for i in range(max((len(c) for c in curves.values()), default=0))])


def by_triangle(series: Sequence[Series]) -> list[Markup]:
    """Two figures over the classes of triangles: how many there are, and how much work they cause."""
    sums = {s.index: total for s in series if (total := triangle_sum(s)) is not None}
    names = [class_name(i) for i in range(max((len(t.work) for t in sums.values()), default=0))]
    figures = (_lines(series, {i: list(enumerate(map(float, t.triangles))) for i, t in sums.items()}, "triangles",
                      "triangles, all frames", "tests that a triangle causes in a frame, at least", names),
               _lines(series, {i: list(enumerate(map(float, t.work))) for i, t in sums.items()}, "triangle-work",
                      "tests caused by these triangles, all frames", "tests that a triangle causes in a frame, at least",
                      names))
    return [figure for figure in figures if figure is not None]


def _lines(series: Sequence[Series], curves: dict[int, list[tuple[int, float]]], name: str, title: str, x_title: str,
           names: Sequence[str]) -> Markup | None:
    """Curves over named classes on a logarithmic scale with 0."""
    if not any(curves.values()):
        return None
    box = svg.Box(58, 30, 548, 230)
    values = [value for curve in curves.values() for _, value in curve]
    y = svg.fit("log" if min(values) >= 1.0 else "symlog", values, box.bottom, box.top)
    x = svg.Scale("linear", 0, max(len(names) - 1, 1), box.left + 16, box.right - 16)
    parts = svg.y_axis(box, y, title)
    step = max(1, -(-len(names) // 8))
    parts += [svg.text(x(i), box.bottom + 17, words, "middle", "tick") for i, words in enumerate(names) if i % step == 0]
    parts.append(svg.text(box.right, box.bottom + 34, x_title, "end", "axis-title"))
    for s in series:
        curve = curves.get(s.index, [])
        places = [(x(i), y(value)) for i, value in curve]
        parts.append(svg.path(s.index, places))
        parts += [svg.marker(s.index, px, py, f"{s.title}, {names[i]}: {value:,.6g}")
                  for (px, py), (i, value) in zip(places, curve, strict=True)]
    return svg.figure(f"work-by-{name}", f"{title} of each method", 560, 270, parts)
