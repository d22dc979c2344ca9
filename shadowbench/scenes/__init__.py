"""The built-in scenes: an explicit list that can be shown without importing any of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shadowbench.scenes.procedural import ProceduralScene


@dataclass(frozen=True)
class SceneEntry:
    """A built-in scene's line in the list.

    Attributes
    ----------
    name : identifier, as in a scene file's ``generate:``.
    summary : one line.
    triangles : number of triangles where a scene file asks for none.
    target : ``module:function`` of ``generate(triangles, seed) -> ProceduralScene``.
    """

    name: str
    summary: str
    triangles: int
    target: str

    def load(self) -> Callable[[int, int], ProceduralScene]:
        """Import the scene's generator, and with it NumPy."""
        module, _, name = self.target.partition(":")
        generate: Callable[[int, int], ProceduralScene] = getattr(import_module(module), name)
        return generate


_ANALYTIC = "shadowbench.scenes.analytic"

ALL_SCENES: tuple[SceneEntry, ...] = (
    SceneEntry("citadel", "Walled town on a hill: open edges, one-sided terrain, long shadows; a fly-through",
               60_000, "shadowbench.scenes.citadel:generate"),
    SceneEntry("gate", "House seen through a near iron gate, tree shadows across the lawn between; a fly-through",
               88_000, "shadowbench.scenes.gate:generate"),
    SceneEntry("villa", "House with pergolas, balustrades, railings and leaves in a low sun; a fly-through",
               88_000, "shadowbench.scenes.villa:generate"),
    SceneEntry("fuzzy", "Closed bodies of very many small triangles, and fur on them; a fly-through",
               400_000, "shadowbench.scenes.fuzzy:generate"),
    SceneEntry("cubes", "Closed cubes floating in a room around the light",
               12_000, "shadowbench.scenes.cubes:generate"),
    SceneEntry("strike", "Bowling ball running into ten pins: shadows on curved receivers; a fly-through",
               6_000, "shadowbench.scenes.strike:generate"),
    SceneEntry("dragon_cage", "Curly closed body in a cage, lit from its middle: shadow volumes overlap everywhere",
               12_000, "shadowbench.scenes.dragon_cage:generate"),
    SceneEntry("crowd", "Twenty-four figures whose shadows fall on a distant wall; a fly-through",
               14_836, "shadowbench.scenes.crowd:generate"),
    SceneEntry("jeep", "Open jeep on sandy ground: a small closed game model; a fly-through",
               1_732, "shadowbench.scenes.jeep:generate"),
    SceneEntry("castle", "Small castle on a mound: a small closed game model; a fly-through",
               1_204, "shadowbench.scenes.castle:generate"),
    SceneEntry("tree", "Bare tree of thin closed branches in a walled court; a fly-through",
               40_000, "shadowbench.scenes.tree:generate"),
    SceneEntry("tree_on_snow", "Bare tree with fine branches on snow in a low sun; a fly-through",
               78_646, "shadowbench.scenes.tree_on_snow:generate"),
    SceneEntry("four_buildings", "Four town buildings at a crossing; a fly-through",
               11_154, "shadowbench.scenes.four_buildings:generate"),
    SceneEntry("village", "Village round a church, with gardens and trees; a fly-through",
               247_432, "shadowbench.scenes.village:generate"),
    SceneEntry("kitchen", "Kitchen full of things around a lamp; a fly-through",
               103_351, "shadowbench.scenes.kitchen:generate"),
    SceneEntry("solids", "Cylinder, ball, cone and ring on a plane; a fly-through",
               2_400, "shadowbench.scenes.solids:generate"),
    SceneEntry("lost_edges", "Edges that a coarse silhouette map confuses: crossing, side by side, and a sharp corner",
               64, "shadowbench.scenes.lost_edges:generate"),
    SceneEntry("sheets", "Stack of 256 sheets over the eye: more shadow volumes than an 8-bit stencil buffer counts",
               640, "shadowbench.scenes.sheets:generate"),
    SceneEntry("alpha_tree", "Tree whose leaves are alpha-textured squares, on a lawn in a low sun; a path around it",
               35_000, "shadowbench.scenes.alpha_tree:generate"),
    SceneEntry("stained_glass", "Citadel with windows of coloured, semi-transparent panes; a path past them",
               60_000, "shadowbench.scenes.stained_glass:generate"),
    SceneEntry("plane_square", "Square over a plane: its shadow is known in closed form",
               52, f"{_ANALYTIC}:plane_square"),
    SceneEntry("plane_disc", "Tilted regular polygon over a plane: its shadow is known in closed form",
               72, f"{_ANALYTIC}:plane_disc"),
    SceneEntry("plane_frame", "Frame with a hole over a plane: its shadow is known in closed form",
               58, f"{_ANALYTIC}:plane_frame"),
    SceneEntry("plane_box", "Box over a plane: its shadow is known in closed form",
               62, f"{_ANALYTIC}:plane_box"),
    SceneEntry("plane_tetrahedron", "Tetrahedron over a plane: its shadow is known in closed form",
               54, f"{_ANALYTIC}:plane_tetrahedron"),
    SceneEntry("slit", "Narrow slit between two walls: its light is known in closed form",
               74, f"{_ANALYTIC}:slit"),
    SceneEntry("treads", "Open staircase over a plane: its shadow is known in closed form",
               134, f"{_ANALYTIC}:treads"),
    SceneEntry("sunlit_square", "Square over a plane under a directional light: known in closed form",
               52, f"{_ANALYTIC}:sunlit_square"),
    SceneEntry("sunlit_boxes", "Two boxes shading each other under a directional light: known in closed form",
               74, f"{_ANALYTIC}:sunlit_boxes"),
)

SCENES: dict[str, SceneEntry] = {entry.name: entry for entry in ALL_SCENES}
