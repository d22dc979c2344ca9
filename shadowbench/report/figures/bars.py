"""Bars: how the time of a frame is shared by the stages of each method."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup, escape

from shadowbench.report.figures import svg
from shadowbench.report.gather import Series

ROW, BAR = 46, 18
SHADES = 4
"""Shades of a method's stages; neighbours differ, and each bar is also described in words below it."""


def stage_means(series: Series) -> dict[str, float]:
    """Mean over the frames of each stage's median, in milliseconds."""
    stages: dict[str, list[float]] = {}
    cells = [cell for cell in series.done if cell.stages]
    for cell in cells:
        for name, seconds in cell.stages.items():
            stages.setdefault(name, []).append(1e3 * float(np.median(seconds)))
    return {name: sum(values) / len(cells) for name, values in stages.items()}


def stage_bars(series: Sequence[Series]) -> Markup | None:
    """A bar per method on one linear scale, each stage a part of it; None if nothing was timed."""
    rows = [(s, stages) for s in series if (stages := stage_means(s))]
    if not rows:
        return None
    width, height = 1140, 44 + ROW * len(rows) + 34
    box = svg.Box(8, 30, width - 40, height - 40)
    x = svg.fit("linear", [sum(stages.values()) for _, stages in rows], box.left, box.right)
    parts = svg.x_axis(box, x, "ms per frame")
    for i, (s, stages) in enumerate(rows):
        parts.append(_row(s, stages, x, box.top + 6 + ROW * i))
    return svg.figure("stage-times", "Time per frame of each method, by stage", width, height, parts, "wide")


def _row(series: Series, stages: dict[str, float], x: svg.Scale, top: float) -> str:
    """One method: its name with its stages in words, and below it the bar."""
    total = sum(stages.values())
    words = f"{total:.1f} ms: " + " · ".join(f"{name} {ms:.2f}" for name, ms in stages.items())
    parts = [f'<g data-series="{series.index}">',
             f'<text x="{x.start:.1f}" y="{top + 10:.1f}"><tspan class="label s{series.index % svg.N_COLORS}">'
             f'{escape(series.title)}</tspan><tspan class="tick" dx="10">{escape(words)}</tspan></text>']
    at = 0.0
    for n, (name, ms) in enumerate(stages.items()):
        start, end = x(at), x(at + ms)
        parts.append(f'<rect x="{start:.2f}" y="{top + 16:.1f}" width="{max(end - start - 0.6, 0.4):.2f}" height="{BAR}" '
                     f'class="bar s{series.index % svg.N_COLORS} shade{n % SHADES}">'
                     f"<title>{escape(f'{series.title}: {name} {ms:.3f} ms, {100 * ms / max(total, 1e-12):.0f} %')}"
                     "</title></rect>")
        at += ms
    return "".join([*parts, "</g>"])
