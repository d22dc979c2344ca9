"""The scene file that ``shadowbench init`` writes: it runs as it stands, and its comments show the rest."""

from __future__ import annotations

import re

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


def usable_name(text: str) -> str:
    """Make a scene's name from a file's: anything unusual is replaced."""
    name = re.sub(r"[^\w.-]", "_", text)[:100]
    return name if re.match(r"\w", name) else f"scene{name}"[:100]
