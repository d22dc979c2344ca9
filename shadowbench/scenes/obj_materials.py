"""Materials of an OBJ file, as its MTL file describes them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from shadowbench.errors import InputError
from shadowbench.geometry import Material, Texture
from shadowbench.scenes.textures import load_texture

_COLOR_MAP = "color_map"
"""What map_Kd is called where trimesh reads an MTL file: it would load the image, and forget its name."""


def own_color_maps(text: bytes) -> bytes:
    """Rename map_Kd in an MTL file."""
    return re.sub(rb"(?mi)^([ \t]*)map_Kd(?=[ \t])", rb"\1" + _COLOR_MAP.encode(), text)


def obj_material(surface: Any, path: Path) -> Material:
    """Read an OBJ material: Kd, d or Tr, map_d and map_Kd. Other formats give their name alone.

    Parameters
    ----------
    surface : trimesh's material.
    path : the OBJ file.

    Raises
    ------
    InputError
        If the opacity is not in 0..1, or a texture can't be used.
    """
    keys = getattr(surface, "kwargs", {})
    color = np.atleast_1d(keys.get("kd", 1.0))
    red, green, blue = (min(max(float(v), 0.0), 1.0) for v in (color if len(color) == 3 else (1.0, 1.0, 1.0)))
    alpha = 1.0
    if "d" in keys:
        alpha = float(keys["d"][-1])
    elif "tr" in keys:
        alpha = 1.0 - float(keys["tr"][-1])
    if not 0.0 <= alpha <= 1.0:
        raise InputError(f"{path}: material '{surface.name}' has the alpha {alpha:g}: give d or Tr a value within 0..1")
    opacity = _texture(surface, "map_d", path)
    # Colours of what is opaque dye no light
    colors = _texture(surface, _COLOR_MAP, path) if alpha < 1.0 or opacity is not None else None
    return Material(str(surface.name or "default"), (red, green, blue), alpha, opacity, None, colors)


def _texture(surface: Any, key: str, path: Path) -> Texture | None:
    """Read a texture of a material; None if the material names none."""
    words = getattr(surface, "kwargs", {}).get(key)
    if not words:
        return None
    file = path.parent / words[-1].replace("\\", "/")
    try:
        return load_texture(file, needs_alpha=key == "map_d")
    except InputError as error:
        entry = "map_Kd" if key == _COLOR_MAP else key
        raise InputError(f"{path}: material '{surface.name}' ({entry}): {error}") from error
