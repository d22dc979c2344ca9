"""Packs the pictures of a frame so that a browser can compare them pixel by pixel, and so that they take little room.

A method's numbers travel as PNG images whose channels are integers: the state of a pixel (shadow, error class, kind) and
its number of tests. The page colours them itself, so that all heat maps share one scale and a difference is exact. Shaded
images travel as the first method's, and for every other method the pixels that differ from it: nothing at all for methods
that agree.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench import image_io
from shadowbench.geometry import ImageSize
from shadowbench.report.gather import Run, Series
from shadowbench.results import CellResult
from shadowbench.view_samples import resolve_to_pixels

OWN_PICTURES = frozenset({"shadow_exr", "shaded_png", "shadow_png", "heatmap_png", "error_png"})
"""Files of every method; any other picture of a cell is an extra of its method."""

BACKGROUND, UNLIT, CANDIDATE = 0, 1, 2
"""Kinds of a pixel: shows nothing, faces away from the light, or needs a test (one of its samples does)."""

Pixels = NDArray[np.uint8]


@dataclass(frozen=True)
class Chunk:
    """The pictures of one frame of one run as JSON text.

    Attributes
    ----------
    key : ``run/frame``, by the numbers that the page uses.
    text : the JSON.
    """

    key: str
    text: str


def pack(runs: Sequence[Run], series: Sequence[Series]) -> Iterator[Chunk]:
    """Pack frame after frame; those without pictures are left out."""
    with ThreadPoolExecutor() as pool:
        for number, run in enumerate(runs):
            own = [s for s in series if s.run is run]
            for frame in run.frames:
                document = _pack_frame(run, frame, own, pool)
                if document is not None:
                    yield Chunk(f"{number}/{frame}", json.dumps(document, separators=(",", ":")))


class _Blobs:
    """PNG files by a short name of their content, so that equal ones are kept once.

    Parameters
    ----------
    pool : threads that compress them.
    """

    def __init__(self, pool: ThreadPoolExecutor) -> None:
        self._pool = pool
        self._files: dict[str, Future[bytes]] = {}

    def add(self, pixels: Pixels) -> str:
        """Keep an image; return its name."""
        name = hashlib.sha256(repr(pixels.shape).encode() + pixels.tobytes()).hexdigest()[:16]
        if name not in self._files:
            self._files[name] = self._pool.submit(image_io.encode_png, pixels)
        return name

    def texts(self) -> dict[str, str]:
        """Return all files as text, by name."""
        return {name: base64.b64encode(file.result()).decode() for name, file in self._files.items()}


def _pack_frame(run: Run, frame: int, series: Sequence[Series], pool: ThreadPoolExecutor) -> dict[str, Any] | None:
    """Pack what there is of a frame's pictures; None if there are none."""
    size = ImageSize(**run.document["image"])
    gbuffer = run.path / "frames" / f"{frame:04d}" / "gbuffer.exr"
    cells = [(s, s.cells[frame]) for s in series
             if frame in s.cells and all(_exists(run.path, s.cells[frame], name) for name in ("shadow_exr", "shaded_png"))]
    if not cells or not gbuffer.is_file():
        return None
    kind = _kinds(gbuffer, size)
    blobs, base, methods = _Blobs(pool), None, {}
    answers = pool.map(lambda cell: image_io.read_exr(run.path / cell[1].files["shadow_exr"]), cells)
    for (s, cell), channels in zip(cells, answers, strict=True):
        shaded = image_io.read_png(run.path / cell.files["shaded_png"])[..., :3]
        if base is None:
            base = shaded
            layers = [blobs.add(shaded)]
            first = layers[0]
        else:
            layers = [first, *_patch(base, shaded, blobs)]
        methods[str(s.index)] = {"shaded": layers, "state": blobs.add(_state(channels, kind, size)),
                                 "tests": blobs.add(_tests(channels, size)) if "heatmap_png" in cell.files else None,
                                 "extras": _extras(run.path, cell, blobs)}
    return {"width": size.width, "height": size.height, "methods": methods, "blobs": blobs.texts()}


def _exists(folder: Path, cell: CellResult, name: str) -> bool:
    return name in cell.files and (folder / cell.files[name]).is_file()


def _kinds(gbuffer: Path, size: ImageSize) -> Pixels:
    """Kind of every pixel, uint8 (height, width)."""
    channels = image_io.read_exr(gbuffer)
    surface = resolve_to_pixels(channels["triangle"].reshape(-1) != image_io.NO_TRIANGLE, size) > 0
    candidate = resolve_to_pixels(channels["candidate"].reshape(-1) > 0, size) > 0
    return np.where(candidate, CANDIDATE, np.where(surface, UNLIT, BACKGROUND)).astype(np.uint8)


def _state(channels: dict[str, NDArray], kind: Pixels, size: ImageSize) -> Pixels:
    """Shadow 0..255 (its mean over the pixel's samples), worst error class and kind of every pixel."""
    shadow = resolve_to_pixels(channels["shadow"].reshape(-1).astype(np.float64), size)
    errors = channels["error"].reshape(-1)
    worst = np.zeros((size.height, size.width), np.uint8)
    for error in (3, 2, 1):                          # a false shadow hides a false light, and that an edge tie
        worst[resolve_to_pixels(errors == error, size) > 0] = error
    return np.stack([np.rint(255.0 * shadow).astype(np.uint8), worst, kind], axis=-1)


def _tests(channels: dict[str, NDArray], size: ImageSize) -> Pixels:
    """Tests of every pixel as three bytes, the highest first."""
    tests = np.minimum(resolve_to_pixels(channels["tests"].reshape(-1).astype(np.int64), size), 2**24 - 1)
    return np.stack([tests >> 16, tests >> 8 & 255, tests & 255], axis=-1).astype(np.uint8)


def _patch(base: Pixels, pixels: Pixels, blobs: _Blobs) -> list[str]:
    """Keep the pixels that differ from the base: none, a patch, or the whole image if its size differs."""
    if pixels.shape != base.shape:
        return [blobs.add(pixels)]
    differs = np.any(pixels != base, axis=-1)
    if not differs.any():
        return []
    patch = np.zeros((*differs.shape, 4), np.uint8)
    patch[differs, :3], patch[differs, 3] = pixels[differs], 255
    return [blobs.add(patch)]


def _extras(folder: Path, cell: CellResult, blobs: _Blobs) -> dict[str, str]:
    """Pictures that only this method has, such as its classification of the samples."""
    names = [name for name in cell.files if name.endswith("_png") and name not in OWN_PICTURES]
    return {name.removesuffix("_png"): blobs.add(image_io.read_png(folder / cell.files[name])[..., :3])
            for name in names if _exists(folder, cell, name)}
