"""Pydantic's errors in the words of a scene file: what is wrong, at which key, and what was probably meant."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable
from inspect import isclass
from typing import Any, NamedTuple, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from shadowbench.yaml_positions import KeyPath, shorten

Model = TypeVar("Model", bound=BaseModel)


class Fault(NamedTuple):
    """A problem inside a value: the key path from that value, and whether the key itself is to blame."""

    path: KeyPath
    message: str
    of_key: bool = False


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Suggest the known word most like `word`, or list them all."""
    known = list(known)
    close = difflib.get_close_matches(word.lower(), known, n=1, cutoff=0.6)
    if close:
        return f"did you mean '{close[0]}'?"
    return f"known: {', '.join(known)}" if known else "none is known here"


def describe(value: Any) -> str:
    """Name a value the way a YAML file shows it."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list | tuple):
        return "a list"
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"the text {shorten(value)!r}" if isinstance(value, str) else str(value)


def faults_of(error: ValidationError, model: type[BaseModel], value: Any) -> list[Fault]:
    """Translate a validation error of `value` against `model`.

    Alternatives of one key that were all refused become one fault.
    """
    faults: dict[tuple[KeyPath, bool], list[str]] = {}
    for detail in error.errors(include_url=False):
        path, known = _place(detail["loc"], model, value)
        blamed = detail.get("ctx", {}).get("path", ()) if detail["type"] == "problem" else ()
        path, _ = _place((*path, *blamed), model, value)
        fault = _fault(detail, path, known)
        messages = faults.setdefault((fault.path, fault.of_key), [])
        if fault.message not in messages:
            messages.append(fault.message)
    return [Fault(path, " or ".join(messages), of_key) for (path, of_key), messages in faults.items()]


def strict_params(model: type[Model], params: dict[str, Any]) -> Model:
    """Validate parameters that came from YAML, strictly: text and truth values are no numbers.

    Strict JSON is the mode in which pydantic still takes a list for a tuple and text for an enumeration.
    """
    return model.model_validate_json(json.dumps(params), strict=True)


def _place(loc: Iterable[Any], model: type[BaseModel], value: Any) -> tuple[KeyPath, list[str]]:
    """Follow an error's location through the value that was given.

    Returns
    -------
    path : the part of the location that exists in the value: not the names of alternatives of a union.
    known : names of the keys of the innermost section.
    """
    path: list[str | int] = []
    section: type[BaseModel] | None = model
    inner = model
    for part in loc:
        if section is not None and part in section.model_fields:
            inner, section = section, _section_in(section.model_fields[part].annotation)
        if (isinstance(value, dict) and part in value) or (
                isinstance(value, list) and isinstance(part, int) and part < len(value)):
            path.append(part)
            value = value[part]
    known = inner if section is None else section
    return tuple(path), list(known.model_fields)


def _section_in(annotation: Any) -> type[BaseModel] | None:
    """Find the model inside a field's type."""
    if isclass(annotation) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for found in map(_section_in, get_args(annotation)) if found), None)


def _fault(detail: Any, path: KeyPath, known: list[str]) -> Fault:
    """Word one of pydantic's errors."""
    kind, limits, given = detail["type"], detail.get("ctx", {}), describe(detail["input"])
    if kind == "extra_forbidden":
        return Fault(path, f"unknown key; {did_you_mean(str(detail['loc'][-1]), known)}", True)
    if kind == "missing":
        return Fault(path, f"the key '{detail['loc'][-1]}' is missing")
    if kind in ("literal_error", "enum"):
        choices = re.findall(r"'([^']*)'", limits["expected"])
        hint = f"; {did_you_mean(str(detail['input']), choices)}" if choices else ""
        return Fault(path, f"must be {limits['expected']}, not {given}" + (hint if "mean" in hint else ""))
    if kind in _EXPECTED:
        limits = {name: f"{limit:g}" if isinstance(limit, float) else limit for name, limit in limits.items()}
        return Fault(path, f"must be {_EXPECTED[kind].format(**limits)}, not {given}")
    message = str(detail["msg"]).removeprefix("Value error, ")
    return Fault(path, message[:1].lower() + message[1:])


_EXPECTED = {
    "float_type": "a number", "finite_number": "a finite number", "int_type": "a whole number",
    "int_from_float": "a whole number", "bool_type": "true or false", "string_type": "text",
    "tuple_type": "a list", "list_type": "a list", "dict_type": "a mapping", "model_type": "a mapping",
    "model_attributes_type": "a mapping", "greater_than": "greater than {gt}",
    "greater_than_equal": "at least {ge}", "less_than": "less than {lt}", "less_than_equal": "at most {le}",
    "string_pattern_mismatch": "a word of letters, digits, '_', '-' and '.'",
    "string_too_long": "at most {max_length} characters long",
    "string_too_short": "at least {min_length} character long",
}
"""What a value should have been, by the type of pydantic's error."""
