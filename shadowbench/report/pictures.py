"""Pictures of one frame: shaded image, shadow buffer, heat map and error map, and the EXR files beside them.

Heat maps share one fixed logarithmic colour scale, so two of them can be compared by eye whatever they show.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench import image_io
from shadowbench.accuracy import ErrorClass
from shadowbench.algorithms.base import ShadowBuffer
from shadowbench.geometry import Frame, dot
from shadowbench.surfaces import base_color, surface_opacity, surface_transmittance
from shadowbench.view_samples import resolve_to_pixels

HEAT_COLORS = "inferno"
HEAT_LIMIT = 4096
"""Tests per pixel at the bright end of the heat map's scale; the scale is log2(1 + tests)."""

LEGEND_ROWS = 44
AMBIENT = 0.25
BACKGROUND = (0.36, 0.42, 0.52)
ERROR_COLORS = {ErrorClass.FALSE_SHADOW: (0.90, 0.11, 0.14), ErrorClass.FALSE_LIGHT: (0.10, 0.55, 1.0),
                ErrorClass.EDGE_TIE: (1.0, 0.85, 0.1)}

Pixels = NDArray[np.uint8]
Floats = NDArray[np.floating]


def to_srgb(linear: Floats) -> Pixels:
    """Encode linear RGB in 0..1 as 8-bit sRGB."""
    clipped = np.clip(linear, 0.0, 1.0)
    encoded = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * np.power(clipped, 1 / 2.4) - 0.055)
    return (encoded * 255.0 + 0.5).astype(np.uint8)


def write_gbuffer(folder: Path, frame: Frame) -> Path:
    """Write the view samples: float32 position, normal and depth, uint32 triangle and candidate."""
    s = frame.samples
    shape = (s.rows, s.columns)
    triangle = np.where(s.triangle < 0, image_io.NO_TRIANGLE, s.triangle.astype(np.int64))
    channels: dict[str, NDArray] = {}
    for prefix, vectors in (("P", s.position), ("N", s.normal)):
        for i, axis in enumerate("XYZ"):
            channels[f"{prefix}.{axis}"] = vectors[:, i].reshape(shape).astype(np.float32)
    channels |= {"depth": s.depth.reshape(shape).astype(np.float32), "triangle": triangle.reshape(shape),
                 "candidate": s.candidate.reshape(shape)}
    image_io.write_exr(folder / "gbuffer.exr", channels)
    return folder / "gbuffer.exr"


def write_shadow_pictures(folder: Path, frame: Frame, buffers: Sequence[ShadowBuffer], errors: NDArray[np.uint32],
                          heat: NDArray[np.int64] | None, title: str) -> dict[str, Path]:
    """Write ``shadow.exr`` and every PNG of one algorithm.

    Parameters
    ----------
    folder : where to write.
    frame, buffers : the frame and the algorithm's answer for each of its layers; errors and shadow are of the first.
    errors : `ErrorClass` per sample.
    heat : tests per sample, or None.
    title : text of the legends.

    Returns
    -------
    Paths by the kind of picture.
    """
    buffer, shape = buffers[0], (frame.samples.rows, frame.samples.columns)
    tests = np.zeros(shape, np.uint32) if heat is None else heat.reshape(shape)
    channels = {"shadow": buffer.shadow.reshape(shape), "tests": tests, "error": errors.reshape(shape)}
    jobs: dict[str, Callable[[], None]] = {
        "shadow.exr": partial(image_io.write_exr, folder / "shadow.exr", channels)}

    def add(name: str, make: Callable[[], Pixels]) -> None:
        jobs[name] = lambda: image_io.write_png(folder / name, make())

    add("shaded.png", lambda: shaded(frame, buffers))
    add("shadow.png", lambda: shadow_mask(frame, buffer))
    add("error.png", lambda: error_map(frame, errors, title))
    if heat is not None:
        add("heatmap.png", lambda: heat_map(frame, heat, title))
    for name, picture in buffer.images.items():
        add(f"{name}.png", partial(np.asarray, picture))
    with ThreadPoolExecutor() as pool:
        for done in [pool.submit(job) for job in jobs.values()]:
            done.result()
    return {name.replace(".", "_"): folder / name for name in jobs}


def shaded(frame: Frame, buffers: Sequence[ShadowBuffer]) -> Pixels:
    """Lambert shading with the given shadows, layers composited from the front, uint8 (height, width, 3)."""
    seen: Floats = np.zeros((len(frame.samples.depth), 3))
    through: Floats = np.ones((len(frame.samples.depth), 3))
    for k, (layer, buffer) in enumerate(zip(frame.layers, buffers, strict=True)):
        color, shown = _lambert(layer, _arriving(buffer)), layer.samples.triangle >= 0
        if k + 1 == frame.image.layers:
            return to_srgb(_pixels(seen + through * color, frame))
        mesh, triangles, points = layer.mesh, layer.samples.triangle, layer.samples.position
        seen = seen + through * np.where(shown, surface_opacity(mesh, triangles, points), 0.0)[:, None] * color
        through = through * np.where(shown[:, None], surface_transmittance(mesh, triangles, points), 1.0)
    return to_srgb(_pixels(seen + through * np.array(BACKGROUND) ** 2, frame))


def _arriving(buffer: ShadowBuffer) -> Floats:
    """Shares of light that arrive, (n_samples, 1) or (n_samples, 3)."""
    return (1.0 - buffer.shadow)[:, None] if buffer.arriving is None else buffer.arriving


def _lambert(frame: Frame, arriving: Floats) -> Floats:
    """Linear RGB per sample, float (n_samples, 3)."""
    s, light = frame.samples, frame.light.xyzw()
    to_light = light[:3] - light[3] * s.position
    lengths = np.sqrt(dot(to_light, to_light))
    facing = np.maximum(dot(s.normal, to_light) / np.where(lengths > 0, lengths, 1.0), 0.0)
    direct = np.where(s.candidate[:, None], facing[:, None] * arriving, 0.0)
    colors = base_color(frame.mesh, s.triangle, s.position)
    sky = 0.5 + 0.5 * s.normal[:, 1:2]              # a soft fill light from above keeps unlit shapes readable
    color = colors * (AMBIENT * (0.4 + 0.6 * sky) + (1.0 - AMBIENT) * direct)
    return np.where((s.triangle >= 0)[:, None], color, np.array(BACKGROUND) ** 2)


def _pixels(values: Floats, frame: Frame) -> Floats:
    """Average samples into pixels, (height, width, ...)."""
    resolved: Floats = resolve_to_pixels(values, frame.image)
    return resolved


def shadow_mask(frame: Frame, buffer: ShadowBuffer) -> Pixels:
    """The shadow buffer: white lit, black in shadow, grey facing away from the light, blue-grey background."""
    s = frame.samples
    mask = np.broadcast_to(_arriving(buffer), (len(s.depth), 3)).astype(np.float64)
    mask[~s.candidate] = 0.18
    mask[s.triangle < 0] = np.array(BACKGROUND) ** 2
    return to_srgb(_pixels(mask, frame))


@cache
def heat_ramp() -> Pixels:
    """sRGB colours of the heat map's scale; the first is the colour of no test at all."""
    return to_srgb(image_io.color_ramp(HEAT_COLORS, 256))


def heat_map(frame: Frame, heat: NDArray[np.int64], title: str) -> Pixels:
    """Tests per pixel on the shared scale, with a legend below the picture."""
    tests = resolve_to_pixels(heat, frame.image)
    level = np.log2(1.0 + tests) / np.log2(1.0 + HEAT_LIMIT)
    picture = heat_ramp()[np.minimum(level * 255.0, 255.0).astype(np.int64)]
    return np.concatenate([picture, _heat_legend(picture.shape[1], title, int(tests.sum()), float(tests.mean()))])


def _heat_legend(width: int, title: str, total: int, mean: float) -> Pixels:
    """A colour bar with powers of four, and the total."""
    strip = np.full((LEGEND_ROWS, width, 3), 24, np.uint8)
    left, right = 8, max(width - 8, 9)
    levels = np.linspace(0, 255, right - left).astype(np.int64)
    strip[4:16, left:right] = heat_ramp()[levels][None]
    if width < 320:                                  # no room for text
        return strip
    for power in range(0, 13, 2):
        x = left + int((right - left - 1) * np.log2(1.0 + 2**power) / np.log2(1.0 + HEAT_LIMIT))
        strip = image_io.draw_text(strip, min(x, width - 34), 28, str(2**power), 11)
    text = f"tests per pixel, log scale   {title}   total {total:,}   mean {mean:.1f}"
    return image_io.draw_text(strip, left, 41, text, 11)


def error_map(frame: Frame, errors: NDArray[np.uint32], title: str) -> Pixels:
    """Mismatches over the dimmed scene, each grown to 3x3 pixels so that a single one can be seen."""
    dim = 0.25 * _pixels(_lambert(frame, np.ones((len(errors), 1))), frame).mean(axis=-1, keepdims=True)
    picture = np.repeat(dim, 3, axis=-1)
    counts = {}
    for kind in (ErrorClass.EDGE_TIE, ErrorClass.FALSE_LIGHT, ErrorClass.FALSE_SHADOW):
        hit = errors == kind
        counts[kind] = int(np.count_nonzero(hit))
        grown = _grow(resolve_to_pixels(hit.astype(np.int64), frame.image) > 0)
        picture[grown] = np.array(ERROR_COLORS[kind]) ** 2.2
    return np.concatenate([to_srgb(picture), _error_legend(picture.shape[1], title, counts)])


def antialiasing_map(frame: Frame, darker: NDArray[np.float64]) -> Pixels:
    """Where derivative antialiasing differs from supersampling, over the dimmed scene.

    Parameters
    ----------
    darker : float64 (height, width), how much darker it makes a pixel.
    """
    picture = 0.25 * _pixels(_lambert(frame, np.ones((len(frame.samples.depth), 1))), frame).mean(axis=-1, keepdims=True)
    picture = np.repeat(picture, 3, axis=-1)
    for kind, share in ((ErrorClass.FALSE_SHADOW, darker), (ErrorClass.FALSE_LIGHT, -darker)):
        share = np.clip(share, 0.0, 1.0)[..., None] ** 0.5
        picture = picture * (1.0 - share) + share * np.array(ERROR_COLORS[kind]) ** 2.2
    strip = np.full((LEGEND_ROWS, picture.shape[1], 3), 24, np.uint8)
    if picture.shape[1] >= 320:
        text = (f"derivative antialiasing against supersampling: {int(np.count_nonzero(darker > 0)):,} pixels darker (red), "
                f"{int(np.count_nonzero(darker < 0)):,} lighter (blue)")
        strip = image_io.draw_text(strip, 8, 26, text, 11)
    return np.concatenate([to_srgb(picture), strip])


def _grow(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Set the eight neighbours of every set pixel."""
    padded = np.pad(mask, 1)
    rows = padded[:-2] | padded[1:-1] | padded[2:]
    return rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:]


def _error_legend(width: int, title: str, counts: dict[ErrorClass, int]) -> Pixels:
    """Names, colours and numbers of the error classes."""
    strip = np.full((LEGEND_ROWS, width, 3), 24, np.uint8)
    if width < 320:
        return strip
    x = 8
    for kind in (ErrorClass.FALSE_SHADOW, ErrorClass.FALSE_LIGHT, ErrorClass.EDGE_TIE):
        color = np.array(ERROR_COLORS[kind])
        strip[6:18, x:x + 12] = (color * 255).astype(np.uint8)
        text = f"{kind.name.lower().replace('_', ' ')} {counts[kind]:,}"
        strip = image_io.draw_text(strip, x + 18, 17, text, 12)
        x += max(140, 34 + 8 * len(text))
    return image_io.draw_text(strip, 8, 37, f"{title} against the certified reference", 12)
