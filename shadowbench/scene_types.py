"""Numbers, vectors and names as a scene file may hold them, with their limits.

Numbers are strict: text and truth values are no numbers, and infinities and NaN are refused. Unknown keys are errors.
A validator that blames one key inside its section raises `problem_at`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from shadowbench.yaml_positions import KeyPath

MAX_COORDINATE = 1e12
"""Largest coordinate: its third power is still a float32, so nothing computed from it overflows."""
MAX_IMAGE = 8192
"""Largest image side: the cluster keys hold 32 bits up to here."""


def problem_at(path: KeyPath, message: str) -> PydanticCustomError:
    """Make the error that says `message` of the key at `path` inside the section that is validated."""
    return PydanticCustomError("problem", "{message}", {"message": message, "path": path})


def _three_numbers(value: Any) -> Any:
    """Refuse anything but a list of three before its elements are looked at."""
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise problem_at((), "must be a list of 3 numbers")
    return value


def filled_list(value: Any) -> Any:
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
Layers = Annotated[int, Field(strict=True, ge=1, le=32)]
Frames = Annotated[int, Field(strict=True, ge=1, le=100_000)]
FrameIndex = Annotated[int, Field(strict=True, ge=0)]
TriangleCount = Annotated[int, Field(strict=True, ge=1, le=2**31 - 1)]
Seed = Annotated[int, Field(strict=True, ge=0)]
Name = Annotated[str, Field(strict=True, pattern=r"^\w[\w.-]*$", max_length=100)]


class Section(BaseModel):
    """Base of the models: frozen, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")
