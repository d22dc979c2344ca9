"""Axes, scales, markers and text of the figures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

N_COLORS = 7
"""Colours of the style sheet (``--series-0`` and so on); beyond that, dashes tell methods apart."""

DASHES = ("", "6 3", "2 3", "8 3 2 3")
MARKERS = ("M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0Z", "M-3.6,-3.6h7.2v7.2h-7.2Z", "M0,-4.8L4.6,3.4H-4.6Z", "M0,-5L5,0L0,5L-5,0Z",
           "M-4,-4L4,4M4,-4L-4,4", "M-5,0H5M0,-5V5", "M0,4.8L4.6,-3.4H-4.6Z")


@dataclass(frozen=True)
class Box:
    """The area that the axes enclose, in pixels of the figure."""

    left: float
    top: float
    right: float
    bottom: float


@dataclass(frozen=True)
class Scale:
    """Maps values to a range of pixels.

    Attributes
    ----------
    kind : "linear"; "log" for values above 0; "symlog" for 0 and whole numbers above, with 0 a step below 1.
    low, high : the values at the two ends.
    start, end : their places.
    """

    kind: str
    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        """Place of a value."""
        low, high, at = (_warp(self.kind, v) for v in (self.low, self.high, value))
        share = (at - low) / (high - low) if high > low else 0.5
        return self.start + share * (self.end - self.start)


def _warp(kind: str, value: float) -> float:
    if kind == "linear":
        return value
    if kind == "log":
        return math.log10(value)
    return -0.5 if value <= 0 else math.log10(value)


def fit(kind: str, values: Iterable[float], start: float, end: float) -> Scale:
    """Choose round ends around some values: from 0 for a linear scale, whole powers of ten for a logarithmic one."""
    known = [v for v in values if v > 0] or [1.0]
    if kind == "linear":
        top = max(known)
        step = nice_step(top / 4)
        return Scale(kind, 0.0, step * math.ceil(top / step - 1e-9), start, end)
    low, high = 10.0 ** math.floor(math.log10(min(known))), 10.0 ** math.ceil(math.log10(max(known)))
    if high <= low:
        high = low * 10
    return Scale(kind, 0.0 if kind == "symlog" else low, max(high, 10.0) if kind == "symlog" else high, start, end)


def nice_step(rough: float) -> float:
    """Round up to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough * (1 - 1e-9))


def ticks(scale: Scale) -> list[float]:
    """Values to mark, at most about seven."""
    if scale.kind == "linear":
        step = nice_step((scale.high - scale.low) / 5)
        return [scale.low + i * step for i in range(int((scale.high - scale.low) / step + 1e-9) + 1)]
    first = 0 if scale.kind == "symlog" else round(math.log10(scale.low))
    last = round(math.log10(scale.high))
    every = max(1, math.ceil((last - first) / 6))
    powers = [10.0**p for p in range(first, last + 1, every)]
    if last - first <= 1:
        powers = [factor * 10.0**p for p in range(first, last + 1) for factor in (1, 2, 5) if factor * 10.0**p <= scale.high]
    return [0.0, *powers] if scale.kind == "symlog" else powers


def short(value: float) -> str:
    """A number in a few characters: 1.2 k, 35 M."""
    for limit, unit in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if abs(value) >= limit:
            return f"{value / limit:.3g}{unit}"
    return f"{value:.3g}"


def figure(name: str, title: str, width: int, height: int, parts: Iterable[str], css: str = "") -> Markup:
    """Wrap parts into an ``<svg>`` that can be read aloud and saved.

    Parameters
    ----------
    name : file name of the saved figure, without its ending.
    title : one sentence, for screen readers.
    """
    return Markup('<svg class="figure {css}" data-name="{name}" viewBox="0 0 {w} {h}" role="img" aria-label="{title}">'
                  "{body}</svg>").format(css=css, name=name, title=title, w=width, h=height, body=Markup("\n".join(parts)))


def text(x: float, y: float, words: str, anchor: str = "start", css: str = "", rotate: float | None = None) -> str:
    """One line of text."""
    turn = "" if rotate is None else f' transform="rotate({rotate:g} {x:.1f} {y:.1f})"'
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" class="{css}"{turn}>{escape(words)}</text>'


def line(x1: float, y1: float, x2: float, y2: float, css: str) -> str:
    """A straight line."""
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" class="{css}"/>'


def marker(index: int, x: float, y: float, tip: str, extra: str = "") -> str:
    """The mark of a series, with a text that appears when it is pointed at."""
    return (f'<path d="{MARKERS[index % len(MARKERS)]}" transform="translate({x:.1f} {y:.1f})" '
            f'class="mark s{index % N_COLORS}" data-series="{index}"{extra}><title>{escape(tip)}</title></path>')


def path(index: int, points: Sequence[tuple[float, float]]) -> str:
    """The line of a series."""
    if len(points) < 2:
        return ""
    dash = DASHES[index // N_COLORS % len(DASHES)]
    style = f' stroke-dasharray="{dash}"' if dash else ""
    steps = "L".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<path d="M{steps}" class="curve s{index % N_COLORS}" data-series="{index}"{style}/>'


def y_axis(box: Box, scale: Scale, title: str) -> list[str]:
    """Grid lines with their values, and what they mean, above the axis."""
    parts = [text(0, box.top - 12, title, css="axis-title")]
    for value in ticks(scale):
        y = scale(value)
        parts.append(line(box.left, y, box.right, y, "base" if value == scale.low else "grid"))
        parts.append(text(box.left - 6, y + 4, short(value), "end", "tick"))
    return parts


def x_axis(box: Box, scale: Scale, title: str, grid: bool = True) -> list[str]:
    """Values below the axis, and what they mean."""
    parts = [text(box.right, box.bottom + 34, title, "end", "axis-title")]
    for value in ticks(scale):
        x = scale(value)
        if grid:
            parts.append(line(x, box.top, x, box.bottom, "base" if value == scale.low else "grid"))
        parts.append(text(x, box.bottom + 17, short(value), "middle", "tick"))
    return parts
