"""What a scene file may hold: the pydantic models of its sections, and their defaults."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, StrictBool, StrictStr, model_validator

from shadowbench.scene_types import (
    Bias,
    Color,
    FrameIndex,
    Frames,
    Layers,
    Name,
    Positive,
    Samples,
    Scale,
    Section,
    Seed,
    Side,
    TriangleCount,
    Unit,
    Vector,
    filled_list,
    problem_at,
)
from shadowbench.yaml_positions import KeyPath

_UP_TOLERANCE = 1e-24
"""Least squared sine of the angle between up and view, as in `shadowbench.geometry.Camera.basis`."""


class CheckedSection(Section):
    """A section whose keys depend on each other."""

    def conflicts(self, bad: Collection[str] = ()) -> Iterator[tuple[KeyPath, str]]:
        """Say at which keys the section contradicts itself, and how.

        Parameters
        ----------
        bad : keys whose values are wrong by themselves: what depends on them is not looked at.
        """
        return iter(())

    @model_validator(mode="after")
    def _no_conflicts(self) -> CheckedSection:
        for path, message in self.conflicts():
            raise problem_at(path, message)
        return self


class MaterialConfig(Section):
    """Surface of a geometry entry: each key that is given replaces what the file or the generator says."""

    color: Color | None = Field(None, description="base colour, linear RGB in 0..1")
    alpha: Unit | None = Field(None, description="opacity in 0..1; 1 is opaque")
    alpha_texture: StrictStr | None = Field(None, description="image whose alpha multiplies the opacity")
    alpha_cutoff: Unit | None = Field(None, description="opacity below which a texel is clear; blended without it")
    color_texture: StrictStr | None = Field(None, description="image whose colour multiplies the base colour")


class PoseKey(Section):
    """A rigid pose at a moment."""

    frame: FrameIndex | None = Field(None, description="frame number of this pose, from 0")
    time: Unit | None = Field(None, description="moment of this pose: 0 is the first frame, 1 the last")
    rotate: Vector = Field((0.0, 0.0, 0.0), description="degrees about x, then y, then z")
    translate: Vector = Field((0.0, 0.0, 0.0), description="world units, after the rotation")

    @model_validator(mode="after")
    def _one_moment(self) -> PoseKey:
        if (self.frame is None) == (self.time is None):
            raise problem_at((), "needs exactly one of 'frame' and 'time'")
        return self


class Animation(Section):
    """Rigid key frames of a geometry entry."""

    path: Annotated[tuple[PoseKey, ...], BeforeValidator(filled_list)] = Field(description="poses in order of time")

    @model_validator(mode="before")
    @classmethod
    def _bare_list(cls, value: Any) -> Any:
        return {"path": value} if isinstance(value, list) else value

    @model_validator(mode="after")
    def _in_order(self) -> Animation:
        unit = "time" if self.path[0].frame is None else "frame"
        for i, (before, after) in enumerate(zip(self.path, self.path[1:], strict=False), 1):
            if getattr(after, unit) is None:
                raise problem_at(("path", i), f"needs '{unit}' like the first key frame: don't mix frame and time")
            if getattr(after, unit) <= getattr(before, unit):
                raise problem_at(("path", i, unit), "must be later than the key frame before it")
        return self


class Placement(Section):
    """How a geometry entry stands in the world: scaled, then rotated, then posed, then translated."""

    scale: Scale = Field((1.0, 1.0, 1.0), description="a factor, or one per axis")
    rotate: Vector = Field((0.0, 0.0, 0.0), description="degrees about x, then y, then z")
    translate: Vector = Field((0.0, 0.0, 0.0), description="world units")
    material: MaterialConfig | None = None
    animate: Animation | None = Field(None, description="rigid key frames")


class MeshEntry(Placement):
    """Geometry from a file."""

    mesh: Annotated[StrictStr, Field(min_length=1)] = Field(
        description="OBJ, PLY, STL, OFF, glTF, GLB or 3MF file, relative to the scene file")


class GenerateEntry(Placement):
    """Geometry from a built-in scene."""

    generate: StrictStr = Field(description="name of the built-in scene")
    triangles: TriangleCount | None = Field(None, description="about how many; the scene's own number without it")
    seed: Seed = Field(1, description="of the random numbers")


class CameraKey(Section):
    """Where the camera is and looks at a key frame."""

    eye: Vector
    target: Vector


class CameraConfig(CheckedSection):
    """The camera: eye and target, or a path of them."""

    eye: Vector | None = None
    target: Vector | None = None
    path: Annotated[tuple[CameraKey, ...], BeforeValidator(filled_list)] | None = Field(
        None, description="key frames of a Catmull-Rom curve, spread evenly over the frames")
    closed: StrictBool = Field(False, description="whether the path returns to its first key frame")
    up: Vector = (0.0, 1.0, 0.0)
    fov_y: Annotated[Positive, Field(lt=180)] = Field(60.0, description="full vertical angle of view, degrees")
    near: Positive = Field(0.1, description="least visible depth, world units")
    far: Positive = Field(1000.0, description="greatest visible depth, world units")

    def key_frames(self) -> tuple[CameraKey, ...]:
        """Key frames: one for a camera that stands still."""
        if self.path is not None:
            return self.path
        if self.eye is None or self.target is None:
            return ()
        return (CameraKey(eye=self.eye, target=self.target),)

    def conflicts(self, bad: Collection[str] = ()) -> Iterator[tuple[KeyPath, str]]:
        """Yield contradictions (see `CheckedSection`)."""
        placed = [key for key in ("eye", "target") if getattr(self, key) is not None or key in bad]
        path_given = self.path is not None or "path" in bad
        if path_given and placed:
            yield ("path",), "a camera has either 'eye' and 'target' or a 'path': remove one"
        if not path_given and len(placed) < 2:
            yield (), "needs 'eye' and 'target', or a 'path' of them"
        if self.closed and not path_given:
            yield ("closed",), "only a 'path' can be closed: remove it"
        if self.far <= self.near and not {"near", "far"} & set(bad):
            where = "far" if "far" in self.model_fields_set else "near"
            yield (where,), f"far ({self.far:g}) must be greater than near ({self.near:g})"
        if not any(self.up):
            yield ("up",), "must not be zero"
        for i, key in enumerate(self.key_frames()):
            target: KeyPath = ("target",) if self.path is None else ("path", i, "target")
            if key.eye == key.target:
                yield target, "eye and target are the same point: move one of them"
            elif any(self.up) and "up" not in bad and _parallel(self.up, key):
                yield (("up",) if "up" in self.model_fields_set else target,
                       "up is parallel to the view direction: choose another 'up'")


def _parallel(up: tuple[float, float, float], key: CameraKey) -> bool:
    """True if the view direction of a key frame is along `up` or against it."""
    x, y, z = (t - e for t, e in zip(key.target, key.eye, strict=True))
    a, b, c = up
    sides = (y * c - z * b, z * a - x * c, x * b - y * a)
    squares = (x * x + y * y + z * z) * (a * a + b * b + c * c)
    return not sum(s * s for s in sides) > _UP_TOLERANCE * squares


class LightConfig(CheckedSection):
    """The light: a point, a direction, or a path of points."""

    position: Vector | None = Field(None, description="a point light, world")
    direction: Vector | None = Field(None, description="the direction in which a directional light travels")
    path: Annotated[tuple[Vector, ...], BeforeValidator(filled_list)] | None = Field(
        None, description="positions of a point light: key frames of a Catmull-Rom curve")
    closed: StrictBool = Field(False, description="whether the path returns to its first position")

    def conflicts(self, bad: Collection[str] = ()) -> Iterator[tuple[KeyPath, str]]:
        """Yield contradictions (see `CheckedSection`)."""
        kinds = [key for key in ("position", "direction", "path") if getattr(self, key) is not None or key in bad]
        if len(kinds) != 1:
            yield (), "needs exactly one of 'position', 'direction' and 'path'"
        if self.direction is not None and not any(self.direction):
            yield ("direction",), "must not be zero: give the direction in which the light travels"
        if self.closed and "path" not in kinds:
            yield ("closed",), "only a 'path' can be closed: remove it"


class ImageConfig(Section):
    """Size of the image and view samples per pixel."""

    width: Side = 1024
    height: Side = 1024
    samples: Samples = 1
    sampling: Literal["surface", "derivative"] = Field(
        "surface", description="samples on the surfaces that they see, or in the plane that the pixel's centre sees")
    layers: Layers = Field(1, description="transparent surfaces behind each other that are shaded, by depth peeling")


class AlgorithmSpec(Section):
    """An algorithm and the parameters that it was given."""

    name: StrictStr
    params: dict[str, Any] = Field({})


class SceneConfig(Section):
    """A scene file."""

    name: Name = Field(description="name of the scene in results; the file's name without it")
    geometry: tuple[MeshEntry | GenerateEntry, ...] = Field(min_length=1)
    camera: CameraConfig | None = Field(None, description="may be left out if a generated scene brings one")
    light: LightConfig | None = Field(None, description="may be left out if a generated scene brings one")
    image: ImageConfig = ImageConfig()
    frames: Frames = 1
    bias: Bias = Field("auto", description="world distance; auto is 1e-5 of the bounding box's diagonal")
    algorithms: tuple[AlgorithmSpec, ...] | None = Field(None, description="all that support the scene without it")
    matrix: dict[str, tuple[Any, ...]] = Field({}, description="parameters to sweep: algorithm.parameter: [values]")

    def selections(self) -> list[tuple[str, dict[str, Any]]]:
        """Algorithms with the parameters that they were given; none where all are meant."""
        return [(spec.name, dict(spec.params)) for spec in self.algorithms or ()]
