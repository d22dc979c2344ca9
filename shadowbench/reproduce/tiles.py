"""Pixels of the tiles of a figure: read, cut out, painted; and what is counted in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from shadowbench import image_io
from shadowbench.accuracy import ErrorClass
from shadowbench.report.pictures import LEGEND_ROWS
from shadowbench.reproduce.items import Pictures
from shadowbench.reproduce.mosaic import Crop, Tile

MARKS = {ErrorClass.FALSE_SHADOW: (230, 28, 36), ErrorClass.FALSE_LIGHT: (26, 110, 255)}
"""Colours of wrong samples."""

WITH_LEGEND = ("heatmap", "error")
"""Kinds of picture that have a legend below."""

BRIGHTEST = 64
"""Triangle tests at the bright end of the scale of `color_tests`, which is logarithmic."""


def cut(pixels: NDArray, crop: Crop) -> NDArray:
    """Take a part of an array (rows, columns, ...)."""
    height, width = pixels.shape[:2]
    left, top, right, bottom = crop
    rows = slice(round(top * height), max(round(bottom * height), round(top * height) + 1))
    columns = slice(round(left * width), max(round(right * width), round(left * width) + 1))
    return pixels[rows, columns]


def tile_pixels(tile: Tile, pictures: Pictures) -> NDArray[np.uint8]:
    """Read a tile's picture, uint8 (rows, columns, 3)."""
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


def draw(axes: Axes, pixels: NDArray[np.uint8], title: str) -> None:
    """Show pixels without axes."""
    axes.imshow(pixels, interpolation="antialiased")
    axes.set_title(title, fontsize=9)
    axes.set_axis_off()


def color_tests(shadow_file: Path, samples_file: Path) -> NDArray[np.uint8]:
    """Triangle tests as brightness, red for samples in shadow, green for lit ones; what needs no test is black."""
    answer, samples = image_io.read_exr(shadow_file), image_io.read_exr(samples_file)
    level = np.minimum(np.log2(1.0 + answer["tests"]) / np.log2(1.0 + BRIGHTEST), 1.0)
    dark, candidate = answer["shadow"] > 0.0, samples["candidate"] > 0
    tint = np.where(dark[..., None], np.array([1.0, 0.22, 0.16]), np.array([0.25, 1.0, 0.3]))
    pixels = (255.0 * (0.12 + 0.88 * level)[..., None] * tint + 0.5).astype(np.uint8)
    pixels[~candidate] = 0
    return pixels


def count_errors(shadow_file: Path, crop: Crop) -> tuple[int, int]:
    """Count the samples in a part of the picture that are wrongly dark, and wrongly lit."""
    errors = cut(image_io.read_exr(shadow_file)["error"], crop)
    return int(np.count_nonzero(errors == ErrorClass.FALSE_SHADOW)), int(np.count_nonzero(errors == ErrorClass.FALSE_LIGHT))


def share_tested(shadow_file: Path) -> float:
    """Share of the image's samples with at least one test."""
    return float(np.mean(image_io.read_exr(shadow_file)["tests"] > 0))
