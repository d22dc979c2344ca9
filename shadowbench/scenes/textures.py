"""Textures of materials: read once, checked, and told apart from images that can't serve.

Opacity is the last channel of an image with two or four channels, or the only channel of a grey one. Colours of integer
images are decoded from sRGB; colours of float images are linear already.
"""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench import image_io
from shadowbench.errors import InputError
from shadowbench.geometry import Mesh, Texture, Wrap

LARGEST_UV = 65536.0
"""Greatest magnitude of a texture coordinate: farther out, float32 files hold fewer than 7 bits below the whole."""

REPEAT: tuple[Wrap, Wrap] = ("repeat", "repeat")


def load_texture(path: str | Path, needs_alpha: bool = True) -> Texture:
    """Read the texture of an image file.

    Parameters
    ----------
    path : the image.
    needs_alpha : True if the texture gives opacity; False if a colour image without opacity will do.

    Raises
    ------
    InputError
        If the file is missing or no image, or has no opacity where it is needed.
    """
    path = Path(path).absolute()
    if not path.is_file():
        raise InputError(f"the texture {path} is missing: put it there, or take it out of the material")
    state = path.stat()
    pixels, has_alpha = _read(path, state.st_mtime_ns, state.st_size)
    if needs_alpha and not has_alpha:
        raise InputError(f"the texture {path} has no alpha channel: save it as RGBA, or as a grey image of the opacity")
    return Texture(str(path), pixels)


def embedded_texture(data: bytes, suffix: str, name: str, wrap: tuple[Wrap, Wrap] = REPEAT) -> Texture:
    """Read a texture from the bytes of an image file; one without opacity is opaque.

    Raises
    ------
    InputError
        If the bytes are no image.
    """
    with tempfile.NamedTemporaryFile(suffix=suffix) as file:
        file.write(data)
        file.flush()
        try:
            pixels, _ = _pixels(Path(file.name))
        except OSError as error:
            raise InputError(f"{name} is not a readable image: export the file again") from error
    return Texture(name, pixels, wrap)


@cache
def _read(path: Path, changed: int, size: int) -> tuple[NDArray[np.float32], bool]:
    """Pixels of a file in its present state, and whether they have opacity."""
    try:
        return _pixels(path)
    except OSError as error:
        raise InputError(f"the texture {path} is not a readable image: save it again, for example as PNG") from error


def _pixels(path: Path) -> tuple[NDArray[np.float32], bool]:
    """Linear RGB and opacity, float32 (rows, columns, 4), read-only, and whether the image has opacity."""
    image, is_float = image_io.read_texture(path)
    n_channels = image.shape[2]
    pixels = np.ones((*image.shape[:2], 4), np.float32)
    color = image[..., :3] if n_channels >= 3 else image[..., :1]
    pixels[..., :3] = color if is_float else _linear(color)
    has_alpha = n_channels != 3
    if has_alpha:
        pixels[..., 3] = image[..., min(n_channels, 4) - 1]
    np.clip(np.nan_to_num(pixels), 0.0, 1.0, out=pixels)
    pixels.setflags(write=False)
    return pixels, has_alpha


def _linear(encoded: NDArray[np.float32]) -> NDArray[np.float32]:
    """Decode sRGB."""
    decoded = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return decoded.astype(np.float32)


def check_texture_coordinates(mesh: Mesh, where: str) -> None:
    """Refuse textured triangles that can't be looked up.

    Raises
    ------
    InputError
        If there are no texture coordinates, or one is not finite or beyond `LARGEST_UV`.
    """
    for index, material in enumerate(mesh.materials):
        if material.alpha_texture is None and material.color_texture is None:
            continue
        of_material = mesh.material == index
        if not of_material.any():
            continue
        if mesh.uv is None:
            raise InputError(f"{where}: the material '{material.name}' has a texture, but the mesh has no texture "
                             "coordinates: export them, or take the texture out of the material")
        bad = np.flatnonzero(~(np.abs(mesh.uv[of_material]) <= LARGEST_UV).all(axis=(1, 2)))
        if len(bad):
            triangle = int(np.flatnonzero(of_material)[bad[0]])
            raise InputError(f"{where}: triangle {triangle} (counted from 0) of the material '{material.name}' has texture "
                             f"coordinates that are not numbers within {LARGEST_UV:.0f}, {len(bad)} such triangles: "
                             "repair the texture coordinates")
