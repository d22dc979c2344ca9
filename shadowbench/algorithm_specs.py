"""Algorithms as the user names them: ``ptsv``, ``cluster: {bounds: explicit}`` and ``ptsv[branching=16]``.

Naming an algorithm imports nothing; checking its parameters imports its class, and with it Numba.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ValidationError

from shadowbench.algorithms import ALGORITHMS
from shadowbench.errors import InputError
from shadowbench.scene_models import AlgorithmSpec
from shadowbench.scene_sweep import is_scene_axis
from shadowbench.validation import Fault, describe, did_you_mean, faults_of, strict_params
from shadowbench.yaml_positions import parse_value, path_text

if TYPE_CHECKING:
    from shadowbench.algorithms.base import AlgorithmParams


def parameter_model(name: str) -> type[AlgorithmParams] | None:
    """Import the model of an algorithm's parameters; None for an optional algorithm that is not installed.

    Raises
    ------
    ImportError
        If an algorithm that is not optional can't be imported.
    """
    entry = ALGORITHMS[name]
    try:
        return entry.load().Params
    except ImportError:
        if entry.extra is None:
            raise
        return None


def check_params(name: str, params: dict[str, Any]) -> list[Fault]:
    """Say what is wrong with the parameters given to a known algorithm."""
    if not params:
        return []
    try:
        model = parameter_model(name)
        if model is not None:
            strict_params(model, params)
    except ImportError as error:
        return [Fault((), f"the algorithm can't be loaded: {error}")]
    except ValidationError as error:
        assert model is not None
        return _parameter_faults(name, error, model, params)
    return []


def _parameter_faults(name: str, error: ValidationError, model: type[BaseModel],
                      params: dict[str, Any]) -> list[Fault]:
    """Translate a validation error of an algorithm's parameters."""
    return [Fault(f.path, f.message.replace("unknown key;", f"unknown parameter of {name};", 1), f.of_key)
            for f in faults_of(error, model, params)]


def complete_params(spec: AlgorithmSpec) -> dict[str, Any]:
    """Fill in the default of every parameter; of an optional algorithm that is not installed, none."""
    model = parameter_model(spec.name)
    return dict(spec.params) if model is None else strict_params(model, spec.params).model_dump(mode="json")


def validate_params(name: str, params: dict[str, Any]) -> AlgorithmParams:
    """Make the parameters of an algorithm from plain values, strictly.

    Raises
    ------
    InputError
        With one line per wrong parameter.
    """
    model = ALGORITHMS[name].load().Params
    try:
        return strict_params(model, params)
    except ValidationError as error:
        raise InputError("\n".join(f"{name}: {path_text(f.path)} {f.message}"
                                   for f in _parameter_faults(name, error, model, params))) from error


def check_name(name: str) -> list[Fault]:
    """Say what is wrong with an algorithm's name."""
    return [] if name in ALGORITHMS else [Fault((), f"unknown algorithm '{name}'; {did_you_mean(name, ALGORITHMS)}")]


def check_algorithms(value: Any) -> tuple[tuple[AlgorithmSpec, ...], list[Fault]]:
    """Read the list under ``algorithms``: names, or mappings of one name to its parameters."""
    if not isinstance(value, list) or not value:
        got = "an empty list" if value == [] else describe(value)
        return (), [Fault((), f"must be a list of algorithms, not {got}; leave the key out for all that support "
                              "the scene")]
    specs: list[AlgorithmSpec] = []
    faults: list[Fault] = []
    for i, item in enumerate(value):
        spec, found = _check_item(item)
        if spec is not None and spec in specs:
            found = [Fault((), f"{spec.name} is listed twice with the same parameters")]
        if spec is not None:
            specs.append(spec)
        faults += [Fault((i, *fault.path), fault.message, fault.of_key) for fault in found]
    return tuple(specs), faults


def _check_item(item: Any) -> tuple[AlgorithmSpec | None, list[Fault]]:
    """Read one item of the list."""
    if isinstance(item, str):
        return (AlgorithmSpec(name=item), []) if item in ALGORITHMS else (None, check_name(item))
    if not isinstance(item, dict) or len(item) != 1:
        return None, [Fault((), "must be a name, or a mapping of one name to its parameters, such as "
                                "'ptsv: {branching: 16}'")]
    [(name, params)] = item.items()
    faults = [Fault((name,), fault.message, True) for fault in check_name(name)]
    if not isinstance(params, dict | None):
        faults.append(Fault((name,), f"the parameters must be a mapping, not {describe(params)}"))
    if faults:
        return None, faults
    spec = AlgorithmSpec(name=name, params=params or {})
    return spec, [Fault((name, *f.path), f.message, f.of_key) for f in check_params(name, spec.params)]


def check_matrix(value: Any, listed: tuple[str, ...] | None) -> tuple[dict[str, tuple[Any, ...]], list[Fault]]:
    """Read the sweep axes under ``matrix``: ``algorithm.parameter: [values]``, or a key of the scene such as
    ``image.width``, whose values are checked with each variant of the scene.

    Parameters
    ----------
    value : what the file has there.
    listed : names under ``algorithms``, or None if the file has no valid list.
    """
    if not isinstance(value, dict):
        return {}, [Fault((), f"must be a mapping such as 'cluster.bounds: [implicit, explicit]', not "
                              f"{describe(value)}")]
    faults: list[Fault] = []
    for axis, values in value.items():
        name, dot, parameter = axis.partition(".")
        if is_scene_axis(axis):
            faults += _check_list(axis, values)
        elif not dot or not name or not parameter:
            faults.append(Fault((axis,), "must be written as 'algorithm.parameter: [values]', or be a key of the scene such "
                                         "as 'image.width'", True))
        elif check_name(name):
            faults += [Fault((axis,), fault.message, True) for fault in check_name(name)]
        elif listed is not None and name not in listed:
            faults.append(Fault((axis,), f"'{name}' is not under 'algorithms': add it there, or remove this axis",
                                True))
        else:
            faults += _check_list(axis, values) or _check_axis(axis, name, parameter, values)
    return {axis: tuple(values) for axis, values in value.items() if isinstance(values, list)}, faults


def _check_list(axis: str, values: Any) -> list[Fault]:
    """Check that an axis has values."""
    if isinstance(values, list) and values:
        return []
    got = "an empty list" if values == [] else describe(values)
    return [Fault((axis,), f"must be a list of values, not {got}")]


def _check_axis(axis: str, name: str, parameter: str, values: list[Any]) -> list[Fault]:
    """Check each value of a sweep axis by itself."""
    faults: list[Fault] = []
    for i, item in enumerate(values):
        if any(item == other and type(item) is type(other) for other in values[:i]):
            faults.append(Fault((axis, i), f"{describe(item)} is listed twice"))
        for fault in check_params(name, {parameter: item}):
            if fault.of_key or not fault.path:
                return [*faults, Fault((axis,), fault.message, True)]
            faults.append(Fault((axis, i, *fault.path[1:]), fault.message))
    return faults


def parse_algorithm_spec(text: str) -> tuple[str, dict[str, Any]]:
    """Read ``name`` or ``name[key=value,...]``, the values written as in YAML.

    Returns
    -------
    name, params : a known algorithm and its checked parameters.

    Raises
    ------
    InputError
        With one line per problem, each naming `text`.
    """
    match = re.fullmatch(r"\s*([^\[\]\s]+)\s*(?:\[(.*)\])?\s*", text, re.DOTALL)
    if match is None:
        raise InputError(f"-a {text}: write it as name or 'name[key=value,...]'")
    name, inside = match.group(1), match.group(2)
    problems = [fault.message for fault in check_name(name)]
    params: dict[str, Any] = {}
    for item in _split(inside or ""):
        key, equals, value = item.partition("=")
        key = key.strip()
        if not equals or not key:
            problems.append(f"'{item.strip()}' is not key=value")
        elif key in params:
            problems.append(f"{key} is given twice")
        else:
            try:
                params[key] = parse_value(value)
            except ValueError as error:
                problems.append(f"{key}: {error}")
    if not problems:
        problems = [f"{path_text(f.path)} {f.message}".strip() for f in check_params(name, params)]
    if problems:
        raise InputError("\n".join(f"-a {text}: {problem}" for problem in problems))
    return name, params


def _split(text: str) -> list[str]:
    """Split at the commas that stand outside brackets and quotes."""
    items, depth, quote = [""], 0, ""
    for c in text:
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        elif c in "[{":
            depth += 1
        elif c in "]}":
            depth -= 1
        if c == "," and depth == 0 and not quote:
            items.append("")
        else:
            items[-1] += c
    return items if len(items) > 1 or items[0].strip() else []
