"""Figures of pictures: rows of tiles with titles, cut out where wanted, wrong samples marked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from shadowbench.reproduce.items import Evidence, Row
from shadowbench.reproduce.rows import mean

Crop = tuple[float, float, float, float]
"""Left, top, right and bottom of a part of a picture, as shares of its width and height."""

WHOLE: Crop = (0.0, 0.0, 1.0, 1.0)

MARKED = "Wrong samples are red where they are dark but should be lit, blue where they are lit but should be dark. "
"""What a caption says about marks."""

@dataclass(frozen=True)
class Tile:
    """One picture of a figure.

    Attributes
    ----------
    view : key of `Pictures`.
    title : what stands above it; or what makes it from the rows of ``data.csv``.
    kind : kind of picture.
    crop : the part to show.
    marks : True to mark wrong samples.
    """

    view: str
    title: str | Callable[[Sequence[Row]], str]
    kind: str = "shaded"
    crop: Crop = WHOLE
    marks: bool = False


def wrong_of(label: str, name: str, **where: str | int) -> Callable[[Sequence[Row]], str]:
    """Make a title: a name and the number of wrong samples."""
    return lambda rows: f"{name}: {mean(rows, 'wrong', method=label, **where):,.0f} wrong"


def mosaic(layout: Sequence[Sequence[Tile]], panel: tuple[float, float] = (3.0, 3.2)) -> Callable[[Evidence, Path], None]:
    """Make the plot of rows of tiles, each `panel` inches wide and high."""
    def plot(evidence: Evidence, folder: Path) -> None:
        from shadowbench.reproduce import plots, tiles

        figure, grid = plots.panel_grid(len(layout), max(map(len, layout)), *panel)
        for axes_row, row in zip(grid, layout, strict=True):
            for axes in axes_row[len(row):]:
                axes.set_axis_off()
            for axes, tile in zip(axes_row, row, strict=False):
                title = tile.title if isinstance(tile.title, str) else tile.title(evidence.rows)
                tiles.draw(axes, tiles.tile_pixels(tile, evidence.pictures), title)
        plots.save(figure, folder)
    return plot
