"""Figures: a few kinds of plot, written as SVG, PDF and PNG that are the same bytes for the same data."""

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
    figure, grid = panel_grid(1, n_columns, width, height)
    return figure, grid[0]


def panel_grid(n_rows: int, n_columns: int, width: float, height: float) -> tuple[Figure, Sequence[Sequence[Axes]]]:
    """Make a figure of rows of axes, of a size in inches each."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width * n_columns, height * n_rows), layout="constrained")
        return figure, [list(row) for row in figure.subplots(n_rows, n_columns, squeeze=False)]


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


def table_of(lines: Sequence[tuple[str, ...]], widths: Sequence[float]) -> Figure:
    """Draw a table: what stands for the figure of an item that has none; `widths` in inches."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(sum(widths), 0.26 * (len(lines) + 1)))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        total = sum(widths)
        table = axes.table([list(line) for line in lines], loc="center", cellLoc="left",
                           colWidths=[width / total for width in widths])
        table.auto_set_font_size(False)
        table.set_fontsize(8)
        for (row, _), cell in table.get_celld().items():
            cell.set_edgecolor("#c8c8c8")
            if row == 0:
                cell.set_text_props(weight="bold")
        return figure


def save(figure: Figure, folder: Path) -> None:
    """Write ``figure.svg``, ``figure.pdf`` and ``figure.png``, without dates and version numbers."""
    with mpl.rc_context(_STYLE):
        figure.savefig(folder / "figure.svg", dpi=PNG_DPI, metadata={"Date": None, "Creator": "shadowbench"})
        figure.savefig(folder / "figure.pdf", dpi=PNG_DPI, metadata={"CreationDate": None, "Creator": "shadowbench",
                                                                     "Producer": None})
        save_png(figure, folder / "figure.png")


def save_png(figure: Figure, file: Path, dpi: float = PNG_DPI) -> None:
    """Write a PNG alone."""
    with mpl.rc_context(_STYLE):
        figure.savefig(file, dpi=dpi, metadata={"Software": None}, pil_kwargs={"optimize": True})
