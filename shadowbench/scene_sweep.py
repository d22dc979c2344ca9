"""Sweeps over the scene itself: axes of ``matrix:`` that are keys of the scene file, such as ``image.width``."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterable
from typing import Any

from shadowbench.scene_models import SceneConfig

SWEPT = ("image", "frames", "bias", "camera", "light", "geometry")
"""Keys of a scene file that an axis may start with."""


def is_scene_axis(axis: str) -> bool:
    """True for an axis such as ``image.width``, ``light.position``, ``frames`` or ``geometry.0.triangles``."""
    return re.split(r"[.\[]", axis, maxsplit=1)[0] in SWEPT


def scene_variants(config: SceneConfig) -> list[list[str]]:
    """Expand the scene axes of a matrix into overrides, one list per combination; none if there are no such axes.

    Every variant gets a name of its own, for it is another scene in all results, and leaves the scene axes out.
    """
    axes = {axis: values for axis, values in config.matrix.items() if is_scene_axis(axis)}
    if not axes:
        return []
    rest = {axis: values for axis, values in config.matrix.items() if axis not in axes}
    return [[*(f"{axis}={json.dumps(value)}" for axis, value in zip(axes, values, strict=True)),
             f"name={json.dumps(variant_name(config.name, zip(axes, values, strict=True)))}",
             f"matrix={json.dumps(rest)}"]
            for values in itertools.product(*axes.values())]


def variant_name(name: str, settings: Iterable[tuple[str, Any]]) -> str:
    """Name a variant after its settings: ``citadel-image.width_512-frames_4``."""
    parts = [re.sub(r"[^\w.-]+", "_", f"{axis}={json.dumps(value)}").strip("_") for axis, value in settings]
    return "-".join([name, *parts])[:100]
