"""Scene files: read, check, override, write back. Everything wrong with a file is reported at once.

Importing this module imports no Numba, no matplotlib and no trimesh. Algorithm parameters are the exception:
checking them imports the algorithms that the file gives parameters to.
"""

from __future__ import annotations

import copy
import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.representer import SafeRepresenter

from shadowbench.algorithm_specs import complete_params, parse_algorithm_spec, validate_params
from shadowbench.algorithms import ALGORITHMS
from shadowbench.config_checks import check_document
from shadowbench.errors import InputError
from shadowbench.scene_models import (
    AlgorithmSpec,
    CameraConfig,
    GenerateEntry,
    ImageConfig,
    LightConfig,
    MaterialConfig,
    MeshEntry,
    SceneConfig,
)
from shadowbench.scenes import SCENES
from shadowbench.templates import template
from shadowbench.validation import did_you_mean
from shadowbench.yaml_positions import MAX_BYTES, START, Document, KeyPath, Problem, parse_text, parse_value

__all__ = ["AlgorithmSpec", "CameraConfig", "ConfigErrors", "GenerateEntry", "ImageConfig", "LightConfig",
           "MaterialConfig", "MeshEntry", "SceneConfig", "apply_overrides", "builtin_document", "load_config",
           "parse_algorithm_spec", "read_document", "resolved_yaml", "scene_schema", "template",
           "validate_document", "validate_params"]


class ConfigErrors(InputError):
    """Everything wrong with a scene file.

    Attributes
    ----------
    lines : one problem each, as ``file:line:col key.path message``, in the order of the file.
    """

    def __init__(self, lines: Sequence[str]) -> None:
        super().__init__("\n".join(lines))
        self.lines = tuple(lines)


def load_config(path: str | Path, overrides: Iterable[str] = (), *, text: str | None = None) -> SceneConfig:
    """Read and check a scene file.

    Parameters
    ----------
    path : the file; relative paths in it start from its folder.
    overrides : ``dotted.key=value`` settings that replace what the file says.
    text : the file's text, if it is already at hand.

    Raises
    ------
    ConfigErrors
        With every problem of the file and the overrides.
    """
    return validate_document(apply_overrides(read_document(path, text), overrides))


def read_document(path: str | Path, text: str | None = None) -> Document:
    """Read a scene file without checking what it means.

    Raises
    ------
    ConfigErrors
        If the file can't be read at all; problems of the YAML stay in the document.
    """
    path = Path(path)
    if text is None:
        text = _read_text(path)
    return parse_text(text, str(path), path.parent)


def _read_text(path: Path) -> str:
    """Read a UTF-8 file of sensible size."""
    try:
        if path.is_dir():
            raise ConfigErrors([f"{path}: is a folder: give the scene file in it"])
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        hint = did_you_mean(path.name, [*_scene_files(path.parent), *SCENES])
        hint = f"; {hint}" if "mean" in hint else ""
        raise ConfigErrors([f"{path}: no such file or built-in scene{hint}"]) from None
    except (OSError, ValueError) as error:
        raise ConfigErrors([f"{path}: can't be read: {getattr(error, 'strerror', None) or error}"]) from None
    if len(data) > MAX_BYTES:
        raise ConfigErrors([f"{path}: larger than {MAX_BYTES:,} bytes: this is no scene file"])
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[:error.start].decode("utf-8", "replace")
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        raise ConfigErrors([f"{path}:{line}:{column} not UTF-8 text (byte 0x{data[error.start]:02x}): save the "
                            "file as UTF-8"]) from None


def _scene_files(folder: Path) -> list[str]:
    """Names of the YAML files beside a file that was not found."""
    try:
        return sorted(p.name for p in folder.iterdir() if p.suffix in (".yaml", ".yml"))
    except OSError:
        return []


def builtin_document(name: str) -> Document:
    """Make the scene file of a built-in scene with its defaults."""
    return parse_text(f"name: {name}\ngeometry:\n  - generate: {name}\n", f"<{name}>")


def validate_document(document: Document) -> SceneConfig:
    """Check a document that was read.

    Raises
    ------
    ConfigErrors
        With every problem.
    """
    config, problems = check_document(document)
    if config is None:
        raise ConfigErrors([document.line(problem) for problem in problems])
    return config


_KEY_PART = re.compile(r"([^.\[\]]+)|\[(\d+)\]")


def apply_overrides(document: Document, overrides: Iterable[str]) -> Document:
    """Set keys from outside the file, as ``-D image.width=64`` does.

    Parameters
    ----------
    document : stays as it is.
    overrides : ``dotted.key=value``; an item of a list is named by its index from 0, and everything after
        ``matrix.`` is one key. Values are YAML.

    Returns
    -------
    A changed copy. What is wrong with an override becomes a problem of the document that names the override.
    """
    result = copy.deepcopy(document)
    for override in overrides:
        key, equals, text = override.partition("=")
        try:
            if not equals or not key.strip():
                raise ValueError("write it as key=value")
            path = _set(result, _override_path(key.strip(), result.value), parse_value(text))
        except ValueError as error:
            result.problems.append(Problem(START, (), str(error), override))
        else:
            result.problems = [p for p in result.problems if p.path[:len(path)] != path]
            result.unreadable = {p for p in result.unreadable if p[:len(path)] != path}
            result.overrides[path] = override
    return result


def _override_path(key: str, value: Any) -> KeyPath:
    """Split a dotted key, telling list indices from keys by what the document has there."""
    if key.startswith("matrix."):
        return "matrix", key.removeprefix("matrix.")
    path: list[str | int] = []
    for dotted in key.split("."):
        parts = _KEY_PART.findall(dotted)
        if "".join(word or f"[{index}]" for word, index in parts) != dotted or not dotted:
            raise ValueError(f"'{key}' is no dotted key such as geometry.0.scale")
        for word, index in parts:
            if index or (isinstance(value, list) and word.isdecimal()):
                position = int(index or word)
                path.append(position)
                value = value[position] if isinstance(value, list) and position < len(value) else None
            else:
                path.append(word)
                value = value.get(word) if isinstance(value, dict) else None
    return tuple(path)


def _set(document: Document, path: KeyPath, value: Any) -> KeyPath:
    """Put a value into a document, making the mappings on the way."""
    if document.value is None:
        document.value = {}
    place: Any = document.value
    for depth, part in enumerate(path):
        where = ".".join(map(str, path[:depth])) or "the file"
        if isinstance(place, list):
            if not isinstance(part, int) or part >= len(place):
                raise ValueError(f"{where} is a list of {len(place)}: '{part}' is not one of its indices from 0")
        elif not isinstance(place, dict) or isinstance(part, int):
            raise ValueError(f"{where} has no key '{part}': it is no {'list' if isinstance(part, int) else 'mapping'}")
        elif depth + 1 < len(path) and place.get(part) is None:
            place[part] = {}
        if depth + 1 == len(path):
            place[part] = value
        else:
            place = place[part]
    return path


def scene_schema() -> dict[str, Any]:
    """JSON schema of scene files, for editors."""
    schema = SceneConfig.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "shadowbench scene file"
    schema["required"] = ["geometry"]
    schema["properties"]["name"].pop("default", None)
    schema["$defs"]["GenerateEntry"]["properties"]["generate"]["enum"] = list(SCENES)
    schema["$defs"]["AlgorithmSpec"] = {
        "description": "An algorithm's name, or one name with its parameters.",
        "anyOf": [{"enum": list(ALGORITHMS)},
                  {"type": "object", "minProperties": 1, "maxProperties": 1, "additionalProperties": False,
                   "properties": {name: {"type": ["object", "null"]} for name in ALGORITHMS}}]}
    return schema


class _Representer(SafeRepresenter):
    """Writes text with unprintable characters in double quotes, where alone they survive."""

    def represent_text(self, text: str) -> Any:
        """Choose the quotes; ruamel knows those of printable text."""
        return self.represent_scalar("tag:yaml.org,2002:str", text, style=None if text.isprintable() else '"')


_Representer.add_representer(str, _Representer.represent_text)


def _with_count(entry: MeshEntry | GenerateEntry) -> MeshEntry | GenerateEntry:
    """Fill in a generated scene's own number of triangles."""
    if isinstance(entry, MeshEntry) or entry.triangles is not None:
        return entry
    return entry.model_copy(update={"triangles": SCENES[entry.generate].triangles})


def resolved_yaml(config: SceneConfig) -> str:
    """Write a scene file that says everything: each default filled in, each path absolute.

    It reads back as the same scene. Left out is only what has no value to write: camera and light that a built-in
    scene brings, and ``algorithms`` where all are meant.
    """
    data = config.model_dump(mode="json", exclude_none=True, exclude={"geometry"})
    entries = [_with_count(entry).model_dump(mode="json", exclude_none=True) for entry in config.geometry]
    data = {"name": config.name, "geometry": entries, **data}
    if config.algorithms is not None:
        data["algorithms"] = [{spec.name: complete_params(spec)} for spec in config.algorithms]
    stream = io.StringIO()
    writer: Any = YAML(typ="safe", pure=True)
    writer.Representer = _Representer
    writer.default_flow_style = False
    writer.sort_base_mapping_type_on_output = False
    writer.width = MAX_BYTES                # never fold a line: folding loses spaces of odd file names
    writer.dump(data, stream)
    return stream.getvalue()
