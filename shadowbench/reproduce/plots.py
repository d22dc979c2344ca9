"""Figures: a few kinds of plot, written as SVG and PNG that are the same bytes for the same data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shadowbench import image_io

PNG_DPI = 110
METHOD_COLORS = {"z_pass": "#d1495b", "z_fail": "#edae49", "ptsv": "#8fb8de",
                 "ptsv+casters=back_faces": "#00507a"}
"""One colour per method in all figures."""

COLORS = ("#00507a", "#8fb8de", "#d1495b", "#edae49", "#66a182", "#7d5ba6", "#5c5c5c", "#b38867")
"""Colours of lines that are no single method's."""

_STYLE: dict[Any, Any] = {"svg.hashsalt": "shadowbench", "font.size": 9, "axes.spines.top": False,
                          "axes.spines.right": False}


def panels(n_columns: int, width: float = 4.2, height: float = 3.2) -> tuple[Figure, Sequence[Axes]]:
    """Make a figure of axes side by side, of a size in inches each."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width * n_columns, height), layout="constrained")
        return figure, figure.subplots(1, n_columns, squeeze=False)[0]


def draw_lines(axes: Axes, x: Sequence[float], series: Mapping[str, Sequence[float]], title: str, y_label: str) -> None:
    """Draw one line per method over the frames, on a logarithmic scale from the smallest to the largest value."""
    for label, y in series.items():
        axes.plot(x, y, marker="o", markersize=3, label=label, color=METHOD_COLORS.get(label))
    axes.set(title=title, xlabel="frame of the fly-through", ylabel=y_label, yscale="log")


def draw_line(axes: Axes, x: Sequence[float], y: Sequence[float], label: str, color: str, style: str = "-",
              marker: str = "o") -> None:
    """Draw one line."""
    axes.plot(x, y, style, marker=marker, markersize=3, label=label, color=color)


def draw_groups(axes: Axes, groups: Sequence[str], series: Mapping[str, Sequence[float]], title: str, y_label: str,
                logarithmic: bool = False) -> None:
    """Draw a value per group and series side by side: bars from zero, or points on a logarithmic scale."""
    width = 0.8 / len(series)
    for i, (label, heights) in enumerate(series.items()):
        places = [g - 0.4 + width * (i + 0.5) for g in range(len(groups))]
        if logarithmic:
            axes.plot(places, heights, "o", label=label)
        else:
            axes.bar(places, heights, width, label=label)
    axes.set(title=title, ylabel=y_label, yscale="log" if logarithmic else "linear", xticks=range(len(groups)))
    axes.set_xticklabels(groups)


def legend_below(figure: Figure, axes: Axes) -> None:
    """Put the legend of some axes under all of them."""
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False)


def draw_picture(axes: Axes, file: Path, title: str) -> None:
    """Show a PNG without axes."""
    axes.imshow(image_io.read_png(file), interpolation="antialiased")
    axes.set_title(title)
    axes.set_axis_off()


def save(figure: Figure, folder: Path) -> None:
    """Write ``figure.svg`` and ``figure.png``, without dates and version numbers."""
    with mpl.rc_context(_STYLE):
        figure.savefig(folder / "figure.svg", metadata={"Date": None, "Creator": "shadowbench"})
        figure.savefig(folder / "figure.png", dpi=PNG_DPI, metadata={"Software": None})
