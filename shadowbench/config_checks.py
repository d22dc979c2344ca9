"""What a scene file must satisfy: section by section, then between sections.

Each section is checked by itself, so that one bad section hides nothing in another.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError, create_model

from shadowbench.algorithm_specs import check_algorithms, check_matrix
from shadowbench.scene_models import (
    CameraConfig,
    CheckedSection,
    GenerateEntry,
    LightConfig,
    MeshEntry,
    Placement,
    SceneConfig,
)
from shadowbench.scene_types import Section
from shadowbench.scenes import SCENES
from shadowbench.templates import usable_name
from shadowbench.validation import Fault, describe, did_you_mean, faults_of
from shadowbench.yaml_positions import Document, KeyPath, Mark, Problem

Model = TypeVar("Model", bound=BaseModel)
_BY_PYDANTIC = ("name", "camera", "light", "image", "frames", "bias")
_CHECKED: dict[str, type[CheckedSection]] = {"camera": CameraConfig, "light": LightConfig}


def check_document(document: Document) -> tuple[SceneConfig | None, list[Problem]]:
    """Check a document.

    Returns
    -------
    config : the scene, or None if there are problems.
    problems : all of them, in the order of the text; those of overrides last.
    """
    checker = _Checker(document)
    config = checker.run()
    ordered = sorted(checker.problems, key=lambda p: (_overridden(document, p), p.mark))
    return (None if ordered else config), ordered


def _overridden(document: Document, problem: Problem) -> bool:
    """True if a problem is reported under the name of an override."""
    return document.line(problem).startswith("-D ")


@cache
def _one_key_model(model: type[Section], key: str) -> type[Section]:
    """Make a model that has one key of another, so that each key can be checked by itself."""
    field = model.model_fields[key]
    made: type[Section] = create_model(f"{model.__name__}.{key}", __base__=Section,
                                       **{key: (field.annotation, field)})  # type: ignore[call-overload]
    return made


class _Checker:
    """Collects the problems of one document."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.problems = list(document.problems)

    def add(self, path: KeyPath, message: str, *, of_key: bool = False) -> None:
        """Note a problem, unless the text at that path could not even be read."""
        if not any(path[:depth] in self.document.unreadable for depth in range(1, len(path) + 1)):
            mark: Mark = self.document.mark(path, of_key=of_key)
            self.problems.append(Problem(mark, path, message))

    def add_faults(self, base: KeyPath, faults: list[Fault]) -> None:
        """Note what a check of the value at `base` found."""
        for fault in faults:
            self.add((*base, *fault.path), fault.message, of_key=fault.of_key)

    def validate(self, model: type[Model], value: Any, path: KeyPath) -> Model | None:
        """Check the value at `path` against a model; None if it fails."""
        if not isinstance(value, dict):
            self.add(path, f"must be a mapping, not {describe(value)}")
            return None
        try:
            return model.model_validate(value)
        except ValidationError as error:
            self.add_faults(path, faults_of(error, model, value))
            return None

    def checked_section(self, model: type[CheckedSection], value: Any, path: KeyPath) -> CheckedSection | None:
        """Check a section key by key, and then what its good keys say together, so that no error hides another.

        Returns
        -------
        The section; without its bad keys if it has some, and None if it is no mapping.
        """
        if not isinstance(value, dict):
            self.add(path, f"must be a mapping, not {describe(value)}")
            return None
        good: dict[str, Any] = {}
        for key in value:
            if key not in model.model_fields:
                self.add((*path, key), f"unknown key; {did_you_mean(key, model.model_fields)}", of_key=True)
            else:
                checked = self.validate(_one_key_model(model, key), {key: value[key]}, path)
                good |= {} if checked is None else {key: getattr(checked, key)}
        section = model.model_construct(**good)
        for where, message in section.conflicts(bad=set(value) - set(good)):
            self.add((*path, *where), message)
        return section

    def run(self) -> SceneConfig | None:
        """Check everything."""
        value = self.document.value
        if not isinstance(value, dict):
            if not self.problems:
                self.add((), f"a scene file is a mapping of keys such as 'geometry:', not {describe(value)}")
            return None
        for key in value:
            if key not in SceneConfig.model_fields:
                self.add((key,), f"unknown key; {did_you_mean(key, SceneConfig.model_fields)}", of_key=True)
        sections: dict[str, Any] = {"geometry": self.geometry(value)}
        for key in _BY_PYDANTIC:
            if key in value:
                sections[key] = self.section(key, value[key])
        sections.setdefault("name", usable_name(Path(self.document.file).stem))
        self.camera_and_light(value, sections)
        self.algorithms(value, sections)
        return None if self.problems else SceneConfig(**sections)

    def section(self, key: str, value: Any) -> Any:
        """Check one top-level key."""
        if key in _CHECKED:
            return self.checked_section(_CHECKED[key], value, (key,))
        checked = self.validate(_one_key_model(SceneConfig, key), {key: value}, ())
        return None if checked is None else getattr(checked, key)

    def geometry(self, value: dict[str, Any]) -> tuple[Placement | None, ...]:
        """Check the list of meshes and generated scenes."""
        if "geometry" not in value:
            self.add((), "the scene has no geometry: add 'geometry:' with a 'mesh:' or 'generate:' entry")
            return ()
        entries = value["geometry"]
        if not isinstance(entries, list):
            self.add(("geometry",), f"must be a list of 'mesh:' or 'generate:' entries, not {describe(entries)}")
            return ()
        if not entries:
            self.add(("geometry",), "the scene has no geometry: add a 'mesh:' or 'generate:' entry")
        return tuple(self.entry(entry, ("geometry", i)) for i, entry in enumerate(entries))

    def entry(self, value: Any, path: KeyPath) -> Placement | None:
        """Check one entry of the geometry, with its files, and make its paths absolute."""
        if not isinstance(value, dict) or ("mesh" in value) == ("generate" in value):
            self.add(path, "needs exactly one of 'mesh' (a file) and 'generate' (a built-in scene)")
            if isinstance(value, dict) and not {"mesh", "generate"} & set(value):
                self.unknown_keys(value, path)
            return None
        entry: Placement | None
        if "mesh" in value:
            entry = mesh = self.validate(MeshEntry, value, path)
            file = self.file(value["mesh"], (*path, "mesh"), "mesh")
            entry = mesh and mesh.model_copy(update={"mesh": file})
        else:
            entry = self.validate(GenerateEntry, value, path)
            name = value["generate"]
            if isinstance(name, str) and name not in SCENES:
                self.add((*path, "generate"), f"unknown scene '{name}'; {did_you_mean(name, SCENES)}")
        material = value.get("material")
        for key in ("alpha_texture", "color_texture"):
            if isinstance(material, dict) and material.get(key) is not None:
                file = self.file(material[key], (*path, "material", key), "texture")
                if entry is not None and entry.material is not None:
                    new = entry.material.model_copy(update={key: file})
                    entry = entry.model_copy(update={"material": new})
        return entry

    def unknown_keys(self, value: dict[str, Any], path: KeyPath) -> None:
        """Point at the misspelt keys of an entry whose kind is unknown."""
        known = dict.fromkeys(("mesh", "generate", *MeshEntry.model_fields, *GenerateEntry.model_fields))
        for key in value:
            if key not in known:
                self.add((*path, key), f"unknown key; {did_you_mean(key, known)}", of_key=True)

    def file(self, name: Any, path: KeyPath, kind: str) -> str | None:
        """Find a file that the scene names; return its absolute path."""
        if not isinstance(name, str) or not name:
            return None
        file = (self.document.folder / name).absolute()
        try:
            found = file.is_file()
        except (OSError, ValueError):
            found = False
        if not found:
            self.add(path, f"no such {kind} file: {file} (relative paths start from the scene file's folder)")
        return str(file)

    def camera_and_light(self, value: dict[str, Any], sections: dict[str, Any]) -> None:
        """Check that both are known, and that they are not the same point."""
        entries = value.get("geometry")
        generated = isinstance(entries, list) and any(isinstance(e, dict) and "generate" in e for e in entries)
        for key in ("camera", "light"):
            if key not in value and not generated:
                self.add((), f"the key '{key}' is missing: only a generated scene brings its own {key}")
        camera, light = sections.get("camera"), sections.get("light")
        if not isinstance(camera, CameraConfig) or not isinstance(light, LightConfig):
            return
        if light.position is not None and any(key.eye == light.position for key in camera.key_frames()):
            still = "" if camera.path is None else " at a key frame"
            self.add(("light", "position"), f"light on the camera: the light stands at the camera's eye{still}, from "
                                            "where no shadow can be seen; move one of them")

    def algorithms(self, value: dict[str, Any], sections: dict[str, Any]) -> None:
        """Check the algorithms and the sweep over their parameters."""
        listed = None
        if "algorithms" in value:
            sections["algorithms"], faults = check_algorithms(value["algorithms"])
            self.add_faults(("algorithms",), faults)
            if not faults:
                listed = tuple(spec.name for spec in sections["algorithms"])
        if "matrix" in value:
            sections["matrix"], faults = check_matrix(value["matrix"], listed)
            self.add_faults(("matrix",), faults)
