"""Reading and writing images: the only module that calls OpenImageIO.

OpenImageIO reports failure by return value, aborts on an unknown type name, and rescales floats that are written
to an integer channel; the functions here raise OSError, take NumPy arrays, and store integers as they are.
"""

from __future__ import annotations

import itertools
import tempfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

LARGEST_EXACT_INTEGER = 2**23
"""OpenImageIO converts through float32 on the way to an integer channel; up to here nothing is lost."""

NO_TRIANGLE = 2**32 - 1
"""Value of an unsigned channel where there is nothing (also exact)."""

_FIXED_DATE = "1970:01:01 00:00:00"     # EXR embeds the date: a fixed one makes identical files identical
_UINT_MAX = 2**32 - 1


def write_exr(path: Path, channels: dict[str, NDArray]) -> None:
    """Write a float32 / uint32 multi-channel EXR.

    Parameters
    ----------
    path : file to write.
    channels : arrays (rows, columns) by channel name; integer and bool arrays become uint32 channels, others float32.

    Raises
    ------
    ValueError
        If an integer is negative, or above `LARGEST_EXACT_INTEGER` without being `NO_TRIANGLE`.
    OSError
        If the file can't be written.
    """
    names = list(channels)
    rows, columns = channels[names[0]].shape
    pixels = np.empty((rows, columns, len(names)), np.float64)
    formats = []
    for i, name in enumerate(names):
        values = channels[name]
        if values.dtype.kind in "bui":
            wide = values.astype(np.int64)
            if np.any((wide < 0) | ((wide > LARGEST_EXACT_INTEGER) & (wide != NO_TRIANGLE))):
                raise ValueError(f"channel {name} of {path.name} holds integers outside 0..{LARGEST_EXACT_INTEGER}")
            pixels[..., i] = wide / _UINT_MAX
            formats.append("uint")
        else:
            pixels[..., i] = values
            formats.append("float")
    spec = oiio.ImageSpec(columns, rows, len(names), "uint" if set(formats) == {"uint"} else "float")
    spec.channelnames = tuple(names)
    spec.channelformats = tuple(oiio.TypeDesc(f) for f in formats)
    spec.attribute("compression", "zip:1")
    spec.attribute("DateTime", _FIXED_DATE)
    _write(path, spec, pixels)


def write_png(path: Path, pixels: NDArray[np.uint8], compression: int = 1) -> None:
    """Write sRGB pixels, uint8 (rows, columns, 1 to 4). Raises OSError if the file can't be written.

    Where there is a fourth channel, it is 0 or 255, and the others are 0 where it is 0.
    """
    rows, columns, channels = pixels.shape
    spec = oiio.ImageSpec(columns, rows, channels, "uint8")
    spec.attribute("png:compressionLevel", compression)
    _write(path, spec, np.ascontiguousarray(pixels))


def encode_png(pixels: NDArray[np.uint8]) -> bytes:
    """Return the bytes of a PNG file of `pixels` (see `write_png`), as small as they get in reasonable time."""
    with tempfile.TemporaryDirectory() as folder:
        write_png(Path(folder) / "image.png", pixels, compression=7)
        return (Path(folder) / "image.png").read_bytes()


def _write(path: Path, spec: oiio.ImageSpec, pixels: NDArray) -> None:
    output = oiio.ImageOutput.create(str(path))
    if output is None:
        raise OSError(f"cannot write {path}: {oiio.geterror()}")
    ok = output.open(str(path), spec) and output.write_image(pixels)
    error = output.geterror()
    if not (output.close() and ok):
        raise OSError(f"cannot write {path}: {error or output.geterror() or 'unknown error'}")


def read_exr(path: Path) -> dict[str, NDArray]:
    """Read every channel as an array (rows, columns): uint32 where it is stored so, else float32.

    Raises OSError if the file can't be read.
    """
    image = oiio.ImageInput.open(str(path))
    if image is None:
        raise OSError(f"cannot read {path}: {oiio.geterror()}")
    spec = image.spec()
    formats = spec.channelformats or (spec.format,) * spec.nchannels
    channels: dict[str, NDArray] = {}
    kinds = ["uint" if str(stored) == "uint" else "float" for stored in formats]
    # Neighbours of a kind at once: a file is decompressed anew for every read
    for kind, run in itertools.groupby(range(len(kinds)), key=kinds.__getitem__):
        places = list(run)
        pixels = image.read_image(0, 0, places[0], places[-1] + 1, kind)
        if pixels is None:
            raise OSError(f"cannot read {path}: {image.geterror()}")
        channels |= {spec.channelnames[place]: np.ascontiguousarray(pixels[..., i]) for i, place in enumerate(places)}
    image.close()
    return channels


def read_png(path: Path) -> NDArray[np.uint8]:
    """Read pixels, uint8 (rows, columns, channels). Raises OSError if the file can't be read."""
    image = oiio.ImageInput.open(str(path))
    if image is None:
        raise OSError(f"cannot read {path}: {oiio.geterror()}")
    pixels = image.read_image("uint8")
    if pixels is None:
        raise OSError(f"cannot read {path}: {image.geterror()}")
    image.close()
    return pixels.astype(np.uint8, copy=False)


def color_ramp(name: str, n_colors: int = 256) -> NDArray[np.float32]:
    """Colours of a named map (``inferno``, ``viridis``, ...), linear RGB float32 (n_colors, 3), dark to light."""
    ramp = oiio.ImageBuf(np.linspace(0.0, 1.0, n_colors, dtype=np.float32).reshape(1, n_colors, 1))
    return np.asarray(oiio.ImageBufAlgo.color_map(ramp, 0, name).get_pixels(oiio.FLOAT), np.float32)[0]


def draw_text(pixels: NDArray[np.uint8], x: int, y: int, text: str, size: int,
              color: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> NDArray[np.uint8]:
    """Return `pixels` (rows, columns, 3) with a line of text whose baseline starts at column x, row y.

    Where the build of OpenImageIO has no fonts, the picture comes back without the text.
    """
    buffer = oiio.ImageBuf(np.ascontiguousarray(pixels))
    oiio.ImageBufAlgo.render_text(buffer, x, y, text, size, "", color)
    return np.asarray(buffer.get_pixels(oiio.UINT8), np.uint8)


def read_texture(path: Path) -> tuple[NDArray[np.float32], bool]:
    """Read an image as it is stored, colours not multiplied by opacity.

    Returns
    -------
    float32 (rows, columns, channels) with integers scaled to 0..1, and whether the file holds floats.

    Raises OSError if the file can't be read.
    """
    hints = oiio.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)
    image = oiio.ImageInput.open(str(path), hints)
    if image is None:
        raise OSError(f"cannot read {path}: {oiio.geterror()}")
    is_float = str(image.spec().format) in ("half", "float", "double")
    pixels = image.read_image("float")
    if pixels is None:
        raise OSError(f"cannot read {path}: {image.geterror()}")
    image.close()
    return np.asarray(pixels, np.float32), is_float
