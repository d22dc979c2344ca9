"""Figures of pictures: rows of tiles with titles, cut out where wanted, wrong samples marked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shadowbench import image_io
from shadowbench.accuracy import ErrorClass
from shadowbench.reproduce.items import Evidence, Pictures, Row
from shadowbench.reproduce.rows import mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Crop = tuple[float, float, float, float]
"""Left, top, right and bottom of a part of a picture, as shares of its width and height."""

WHOLE: Crop = (0.0, 0.0, 1.0, 1.0)

MARKS = {ErrorClass.FALSE_SHADOW: (230, 28, 36), ErrorClass.FALSE_LIGHT: (26, 110, 255)}
"""Colours of wrong samples."""

MARKED = "Wrong samples are red where they are dark but should be lit, blue where they are lit but should be dark. "
"""What a caption says about marks."""

WITH_LEGEND = ("heatmap", "error")
"""Kinds of picture that have a legend below."""


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


def cut(pixels: NDArray, crop: Crop) -> NDArray:
    """Take a part of an array (rows, columns, ...)."""
    height, width = pixels.shape[:2]
    left, top, right, bottom = crop
    rows = slice(round(top * height), max(round(bottom * height), round(top * height) + 1))
    columns = slice(round(left * width), max(round(right * width), round(left * width) + 1))
    return pixels[rows, columns]


def tile_pixels(tile: Tile, pictures: Pictures) -> NDArray[np.uint8]:
    """Read a tile's picture, uint8 (rows, columns, 3)."""
    from shadowbench.report.pictures import LEGEND_ROWS

    files = pictures[tile.view]
    pixels = image_io.read_png(files[tile.kind])[..., :3]
    if tile.kind in WITH_LEGEND:
        pixels = pixels[:-LEGEND_ROWS]
    if tile.marks:
        pixels = marked(pixels, image_io.read_exr(files["shadow_exr"])["error"])
    return cut(pixels, tile.crop)


def marked(pixels: NDArray[np.uint8], errors: NDArray[np.uint32]) -> NDArray[np.uint8]:
    """Paint wrong samples; one sample per pixel."""
    painted = pixels.copy()
    for kind, color in MARKS.items():
        painted[errors == kind] = color
    return painted


def wrong_of(label: str, name: str, **where: str | int) -> Callable[[Sequence[Row]], str]:
    """Make a title: a name and the number of wrong samples."""
    return lambda rows: f"{name}: {mean(rows, 'wrong', method=label, **where):,.0f} wrong"


def draw(axes: Axes, pixels: NDArray[np.uint8], title: str) -> None:
    """Show pixels without axes."""
    axes.imshow(pixels, interpolation="antialiased")
    axes.set_title(title)
    axes.set_axis_off()


def mosaic(tiles: Sequence[Sequence[Tile]], panel: tuple[float, float] = (3.0, 3.2)) -> Callable[[Evidence, Path], None]:
    """Make the plot of rows of tiles, each `panel` inches wide and high."""
    def plot(evidence: Evidence, folder: Path) -> None:
        from shadowbench.reproduce import plots

        figure, grid = plots.panel_grid(len(tiles), max(map(len, tiles)), *panel)
        for axes_row, row in zip(grid, tiles, strict=True):
            for axes in axes_row[len(row):]:
                axes.set_axis_off()
            for axes, tile in zip(axes_row, row, strict=False):
                title = tile.title if isinstance(tile.title, str) else tile.title(evidence.rows)
                draw(axes, tile_pixels(tile, evidence.pictures), title)
        plots.save(figure, folder)
    return plot
