"""The result of a procedural scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shadowbench.geometry import Light, Mesh, Vector


@dataclass(frozen=True, eq=False)
class ProceduralScene:
    """A generated scene.

    Attributes
    ----------
    mesh : the geometry; `Mesh.part` numbers its bodies, each of which is either closed or open.
    eyes, targets : Catmull-Rom key frames of a fly-through, world; frame 0 is the first.
    closed : True if the path returns to its first key frame.
    fov_y : full vertical angle of view, degrees.
    near, far : depths along the view, world units.
    light : the light.
    """

    mesh: Mesh
    eyes: Sequence[Vector]
    targets: Sequence[Vector]
    closed: bool
    fov_y: float
    near: float
    far: float
    light: Light
