"""The scene files that ``shadowbench init`` writes: they run as they stand, and comments show the rest."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence

from shadowbench.scenes import SCENES

_TEMPLATE = """\
# {summary}.
#
#   shadowbench validate FILE      check this file
#   shadowbench run FILE           measure every algorithm on it
#
# Every key but 'geometry' may be left out where a comment says so. Paths are relative to this file.

name: {name}

geometry:
  - generate: {scene}            # a built-in scene; see `shadowbench list scenes`
    triangles: {triangles}            # about how many
    seed: 1                     # of the random numbers
# - mesh: models/chair.obj      # OBJ, PLY, STL, OFF, glTF, GLB or 3MF
#   scale: 0.01                 # a factor, or one per axis
#   rotate: [90, 0, 0]          # degrees about x, then y, then z
#   translate: [0, 0, 0]        # world units
#   material: {{alpha: 0.5, color: [1, 1, 1]}}
#   animate: {{path: [{{time: 0}}, {{time: 1, rotate: [0, 360, 0]}}]}}

# A built-in scene brings its own camera and light. Scenes of mesh files alone need both.
# camera: {{eye: [0, 2, 8], target: [0, 1, 0], up: [0, 1, 0], fov_y: 60, near: 0.1, far: 1000}}
# light: {{position: [3, 6, 2]}}  # or {{direction: [0, -1, 0]}}, or {{path: [[3, 6, 2], [-3, 6, 2]]}}

image: {{width: 1024, height: 1024, samples: 1}}

frames: 1                       # frames of the camera's path
bias: auto                      # world distance; auto is 1e-5 of the bounding box's diagonal

# Left out, all algorithms that support the scene run, with their defaults.
# algorithms: [reference]       # parameters: see `shadowbench show ALGORITHM`
# matrix: {{}}                    # sweeps: algorithm.parameter: [value, value]
"""


DEFAULT_SCENE = "citadel"
"""The built-in scene to start from under a name of one's own."""


def template(name: str = DEFAULT_SCENE) -> str:
    """Write a commented scene file: of the built-in scene `name`, or else a scene of that name to start from."""
    entry = SCENES.get(name, SCENES[DEFAULT_SCENE])
    return _TEMPLATE.format(name=usable_name(name), scene=entry.name, summary=entry.summary,
                            triangles=entry.triangles)


_MESH_TEMPLATE = """\
# A mesh of yours, seen and lit from outside: move camera and light to taste, then
#
#   shadowbench run FILE
#
# Coordinates go from {low} to {high}. Paths are relative to this file.

name: {name}

geometry:                       # an entry may also have scale:, rotate:, translate: and material:
  - mesh: {mesh}

camera: {{eye: {eye}, target: {target}, up: [0, 1, 0], fov_y: 50, near: {near}, far: {far}}}
light: {{position: {light}}}   # or {{direction: [-1, -3, -1]}}, the way the light travels

image: {{width: 1024, height: 1024, samples: 1}}

# Left out, all algorithms that support the scene run, with their defaults.
algorithms: [reference, shadow_map, ptsv, cluster, ray_traced]
"""

EYE, LIGHT = (0.7, 0.45, 0.9), (-0.35, 1.6, 0.8)
"""Where camera and light stand, from the middle of the mesh, in lengths of its bounding box's diagonal."""


def mesh_template(name: str, mesh: str, low: Sequence[float], high: Sequence[float]) -> str:
    """Write a scene file for a mesh, with a camera that sees all of it and a light above.

    Parameters
    ----------
    name : name of the scene.
    mesh : path of the mesh file as the scene file names it.
    low, high : the mesh's bounding box.
    """
    center = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    diagonal = sum((b - a) ** 2 for a, b in zip(low, high, strict=True)) ** 0.5 or 1.0

    def vector(values: Iterable[float]) -> str:
        return "[" + ", ".join(f"{value:.4g}" for value in values) + "]"

    def place(offset: Sequence[float]) -> str:
        return vector(c + diagonal * share for c, share in zip(center, offset, strict=True))

    return _MESH_TEMPLATE.format(name=usable_name(name), mesh=json.dumps(mesh), low=vector(low), high=vector(high),
                                 eye=place(EYE), target=vector(center), light=place(LIGHT),
                                 near=f"{diagonal / 1000:.4g}", far=f"{diagonal * 10:.4g}")


def usable_name(text: str) -> str:
    """Make a scene's name from a file's: anything unusual is replaced."""
    name = re.sub(r"[^\w.-]", "_", text)[:100]
    return name if re.match(r"\w", name) else f"scene{name}"[:100]
