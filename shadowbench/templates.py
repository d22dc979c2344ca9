"""The scene file that ``shadowbench init`` writes: it runs as it stands, and its comments show the rest."""

from __future__ import annotations

from shadowbench.errors import InputError
from shadowbench.scenes import SCENES
from shadowbench.validation import did_you_mean

_TEMPLATE = """\
# {summary}.
#
#   shadowbench validate FILE      check this file
#   shadowbench run FILE           measure every algorithm on it
#
# Every key but 'geometry' may be left out where a comment says so. Paths are relative to this file.

name: {name}

geometry:
  - generate: {name}            # a built-in scene; see `shadowbench list scenes`
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


def template(name: str = "citadel") -> str:
    """Write a commented scene file of a built-in scene.

    Raises
    ------
    InputError
        If there is no such scene.
    """
    if name not in SCENES:
        raise InputError(f"unknown scene '{name}'; {did_you_mean(name, SCENES)}")
    entry = SCENES[name]
    return _TEMPLATE.format(name=name, summary=entry.summary, triangles=entry.triangles)
