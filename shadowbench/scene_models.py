"""What a scene file may hold: the pydantic models, their limits and defaults.

Numbers are strict: text and truth values are no numbers, and infinities and NaN are refused. Unknown keys are errors.
A validator that blames one key inside its section raises `problem_at`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictBool,
    StrictStr,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from shadowbench.yaml_positions import KeyPath

MAX_COORDINATE = 1e12
"""Largest coordinate: its third power is still a float32, so nothing computed from it overflows."""
MAX_IMAGE = 8192
"""Largest image side: the cluster keys hold 32 bits up to here."""
_UP_TOLERANCE = 1e-24
"""Least squared sine of the angle between up and view, as in `shadowbench.geometry.Camera.basis`."""


def problem_at(path: KeyPath, message: str) -> PydanticCustomError:
    """Make the error that says `message` of the key at `path` inside the section that is validated."""
    return PydanticCustomError("problem", "{message}", {"message": message, "path": path})


def _three_numbers(value: Any) -> Any:
    """Refuse anything but a list of three before its elements are looked at."""
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise problem_at((), "must be a list of 3 numbers")
    return value


def _filled_list(value: Any) -> Any:
    """Refuse anything but a list of at least one."""
    if not isinstance(value, list | tuple) or not value:
        raise problem_at((), "must be a list with at least one item")
    return value


def _scale(value: Any) -> Any:
    """Let one number stand for three equal ones."""
    if isinstance(value, list | tuple):
        return _three_numbers(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise problem_at((), "must be a number or a list of 3 numbers")
    return (value, value, value)


def _bias(value: Any) -> Any:
    """Accept ``auto`` or a number from 0 up."""
    if value == "auto" or (isinstance(value, int | float) and not isinstance(value, bool) and value >= 0):
        return value
    raise problem_at((), "must be auto or a number from 0 up")


def _power_of_two(value: int) -> int:
    """Accept the sample counts for which sample positions are defined."""
    if value not in (1, 2, 4, 8, 16):
        raise problem_at((), f"must be 1, 2, 4, 8 or 16, not {value}")
    return value


Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=MAX_COORDINATE)]
Unit = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1)]
Vector = Annotated[tuple[Number, Number, Number], BeforeValidator(_three_numbers)]
Color = Annotated[tuple[Unit, Unit, Unit], BeforeValidator(_three_numbers)]
Scale = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(_scale), WithJsonSchema({
    "anyOf": [{"type": "number", "exclusiveMinimum": 0},
              {"type": "array", "items": {"type": "number", "exclusiveMinimum": 0}, "minItems": 3, "maxItems": 3}]})]
Bias = Annotated[Literal["auto"] | float, BeforeValidator(_bias), WithJsonSchema({
    "anyOf": [{"const": "auto"}, {"type": "number", "minimum": 0}]})]
Side = Annotated[int, Field(strict=True, ge=1, le=MAX_IMAGE)]
Samples = Annotated[int, Field(strict=True), AfterValidator(_power_of_two),
                    WithJsonSchema({"enum": [1, 2, 4, 8, 16]})]
Frames = Annotated[int, Field(strict=True, ge=1, le=100_000)]
FrameIndex = Annotated[int, Field(strict=True, ge=0)]
TriangleCount = Annotated[int, Field(strict=True, ge=1, le=2**31 - 1)]
Seed = Annotated[int, Field(strict=True, ge=0)]
Name = Annotated[str, Field(strict=True, pattern=r"^\w[\w.-]*$", max_length=100)]


class Section(BaseModel):
    """Base of the models: frozen, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class MaterialConfig(Section):
    """Surface of a geometry entry: each key that is given replaces what the file or the generator says."""

    color: Color | None = Field(None, description="base colour, linear RGB in 0..1")
    alpha: Unit | None = Field(None, description="opacity in 0..1; 1 is opaque")
    alpha_texture: StrictStr | None = Field(None, description="image whose alpha multiplies the opacity")
    alpha_cutoff: Unit | None = Field(None, description="opacity below which a texel is clear; blended without it")


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

    path: Annotated[tuple[PoseKey, ...], BeforeValidator(_filled_list)] = Field(description="poses in order of time")

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


class CameraConfig(Section):
    """The camera: eye and target, or a path of them."""

    eye: Vector | None = None
    target: Vector | None = None
    path: Annotated[tuple[CameraKey, ...], BeforeValidator(_filled_list)] | None = Field(
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
        assert self.eye is not None and self.target is not None
        return (CameraKey(eye=self.eye, target=self.target),)

    @model_validator(mode="after")
    def _consistent(self) -> CameraConfig:
        given = (self.eye is not None, self.target is not None)
        if self.path is not None and any(given):
            raise problem_at(("path",), "a camera has either 'eye' and 'target' or a 'path': remove one")
        if self.path is None and not all(given):
            raise problem_at((), "needs 'eye' and 'target', or a 'path' of them")
        if self.closed and self.path is None:
            raise problem_at(("closed",), "only a 'path' can be closed: remove it")
        if self.far <= self.near:
            where = "far" if "far" in self.model_fields_set else "near"
            raise problem_at((where,), f"far ({self.far:g}) must be greater than near ({self.near:g})")
        if not any(self.up):
            raise problem_at(("up",), "must not be zero")
        for i, key in enumerate(self.key_frames()):
            path: KeyPath = () if self.path is None else ("path", i)
            if key.eye == key.target:
                raise problem_at((*path, "target"), "eye and target are the same point: move one of them")
            if _parallel(self.up, key):
                where = "up" if "up" in self.model_fields_set else "target"
                raise problem_at(("up",) if where == "up" else (*path, "target"),
                                 "up is parallel to the view direction: choose another 'up'")
        return self


def _parallel(up: tuple[float, float, float], key: CameraKey) -> bool:
    """True if the view direction of a key frame is along `up` or against it."""
    x, y, z = (t - e for t, e in zip(key.target, key.eye, strict=True))
    a, b, c = up
    sides = (y * c - z * b, z * a - x * c, x * b - y * a)
    squares = (x * x + y * y + z * z) * (a * a + b * b + c * c)
    return not sum(s * s for s in sides) > _UP_TOLERANCE * squares


class LightConfig(Section):
    """The light: a point, a direction, or a path of points."""

    position: Vector | None = Field(None, description="a point light, world")
    direction: Vector | None = Field(None, description="the direction in which a directional light travels")
    path: Annotated[tuple[Vector, ...], BeforeValidator(_filled_list)] | None = Field(
        None, description="positions of a point light: key frames of a Catmull-Rom curve")
    closed: StrictBool = Field(False, description="whether the path returns to its first position")

    @model_validator(mode="after")
    def _one_kind(self) -> LightConfig:
        if sum(kind is not None for kind in (self.position, self.direction, self.path)) != 1:
            raise problem_at((), "needs exactly one of 'position', 'direction' and 'path'")
        if self.direction is not None and not any(self.direction):
            raise problem_at(("direction",), "must not be zero: give the direction in which the light travels")
        if self.closed and self.path is None:
            raise problem_at(("closed",), "only a 'path' can be closed: remove it")
        return self


class ImageConfig(Section):
    """Size of the image and view samples per pixel."""

    width: Side = 1024
    height: Side = 1024
    samples: Samples = 1


class AlgorithmSpec(Section):
    """An algorithm and the parameters that it was given."""

    name: StrictStr
    params: dict[str, Any] = {}


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
