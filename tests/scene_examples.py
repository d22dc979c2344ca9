"""A built-in scene and an algorithm for tests: small, and independent of the real ones."""

from typing import ClassVar, Literal

from pydantic import model_validator

from shadowbench.algorithms import Entry
from shadowbench.algorithms.base import Algorithm, AlgorithmParams, ShadowBuffer, parameter
from shadowbench.errors import InputError
from shadowbench.geometry import Light, Material, Mesh
from shadowbench.scenes import SceneEntry
from shadowbench.scenes.procedural import ProceduralScene

GROUND = [[-5.0, 0.0, -5.0], [5.0, 0.0, -5.0], [5.0, 0.0, 5.0], [-5.0, 0.0, 5.0]]


def quad(triangles: int, seed: int) -> ProceduralScene:
    """Two parts of one triangle each, with a camera path of three key frames."""
    if triangles < 2:
        raise InputError("quad needs at least 2 triangles: raise 'triangles'")
    mesh = Mesh.from_arrays(GROUND, [[0, 2, 1], [0, 3, 2]])
    ground = Material("ground", (0.5, 0.5, 0.5))
    mesh = Mesh(mesh.vertices, mesh.triangles, mesh.part + [0, 1], mesh.material, (ground,))
    eyes = [(0.0, 5.0, 10.0), (10.0, 5.0, 0.0), (0.0, 6.0, -10.0)]
    return ProceduralScene(mesh, eyes, [(0.0, 0.0, 0.0)] * 3, False, 50.0, 0.1, 100.0, Light.point(1, 8, 1))


def nothing(triangles: int, seed: int) -> ProceduralScene:
    """A scene without triangles."""
    eyes, targets = [(0.0, 5.0, 10.0)], [(0.0, 0.0, 0.0)]
    return ProceduralScene(Mesh.from_arrays([], []), eyes, targets, False, 50.0, 0.1, 100.0, Light.point(1, 8, 1))


class SampleParams(AlgorithmParams):
    branching: int = parameter(32, "children of a node", ge=2, le=64)
    casters: Literal["all", "back_faces"] = parameter("all", "which triangles cast")
    slopes: tuple[float, float] = parameter((0.0, 1.0), "two numbers")
    resolution: int | Literal["auto"] = parameter("auto", "size of the map")

    @model_validator(mode="after")
    def _power_of_two(self) -> "SampleParams":
        if self.branching & (self.branching - 1):
            raise ValueError("branching is no power of two")
        return self


class Sample(Algorithm):
    name: ClassVar[str] = "sample"
    Params: ClassVar[type[AlgorithmParams]] = SampleParams

    def shadows(self, frame, probe) -> ShadowBuffer:
        raise AssertionError("no test runs this method")


SCENE_ENTRIES = (
    SceneEntry("quad", "Two triangles", 2, "tests.scene_examples:quad"),
    SceneEntry("nothing", "No triangles", 1, "tests.scene_examples:nothing"),
)

ALGORITHM_ENTRIES = (
    Entry("sample", "Sample", "tests", True, "For tests", "tests.scene_examples:Sample"),
    Entry("broken", "Broken", "tests", True, "Can't be imported", "tests.no_such_module:Broken"),
    Entry("optional", "Optional", "tests", True, "Is not installed", "tests.no_such_module:Optional", "peers"),
)
