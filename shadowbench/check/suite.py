"""Suite files: which scenes and algorithms `shadowbench check` measures.

A suite is a YAML file in the manner of a scene file, and checked like one: every problem at once, with its place.

    name: ci
    algorithms: [ptsv, cluster: {bounds: explicit}]      # for every scene that lists none itself
    scenes:
      - scene: citadel                                   # a built-in scene, or a scene file
        set: {image.width: 160, geometry.0.triangles: 6000}
        frames: [0, 2]
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, StrictStr, ValidationError

from shadowbench.algorithm_specs import check_algorithms
from shadowbench.algorithms import PEERS
from shadowbench.config import ConfigErrors, read_document
from shadowbench.errors import InputError
from shadowbench.scene_models import AlgorithmSpec
from shadowbench.scene_types import FrameIndex, Name, Section, filled_list
from shadowbench.scenes import SCENES
from shadowbench.scenes.loader import Scene, load_scene
from shadowbench.templates import usable_name
from shadowbench.validation import Fault, describe, did_you_mean, faults_of
from shadowbench.yaml_positions import Document, KeyPath, Problem


class SuiteScene(Section):
    """An entry under ``scenes``, without its algorithms."""

    scene: Annotated[StrictStr, Field(min_length=1)]
    set: dict[str, Any] = Field({}, description="dotted keys of the scene file and their values")
    frames: Annotated[tuple[FrameIndex, ...], BeforeValidator(filled_list)] = (0,)


class SuiteHead(Section):
    """What a suite file says beside its lists."""

    name: Name


@dataclass(frozen=True)
class SuiteEntry:
    """A scene to measure, loaded.

    Attributes
    ----------
    scene : the scene with its overrides.
    frames : frame numbers.
    selections : algorithms and the parameters that they were given.
    source, overrides : the scene and its ``-D`` settings, as one gives them to `shadowbench run`.
    """

    scene: Scene
    frames: tuple[int, ...]
    selections: tuple[tuple[str, dict[str, Any]], ...]
    source: str
    overrides: tuple[str, ...]


@dataclass(frozen=True)
class Suite:
    """A suite file, checked and loaded."""

    name: str
    entries: tuple[SuiteEntry, ...]


def load_suite(path: Path) -> Suite:
    """Read and check a suite file, and load its scenes.

    Raises
    ------
    ConfigErrors
        With every problem, as ``file:line:col key.path message``.
    InputError
        If there is no such file.
    """
    if not path.exists():
        raise InputError(f"{path}: no such suite file: name one, or run in a checkout that has it")
    reader = _Reader(read_document(path))
    suite = reader.suite()
    if reader.problems or suite is None:
        ordered = sorted(reader.problems, key=lambda problem: problem.mark)
        raise ConfigErrors([reader.document.line(problem) for problem in ordered])
    return suite


class _Reader:
    """Collects the problems of one suite file."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.problems = list(document.problems)

    def add(self, path: KeyPath, message: str, *, of_key: bool = False) -> None:
        """Note a problem, unless the text at that path could not even be read."""
        if not any(path[:depth] in self.document.unreadable for depth in range(1, len(path) + 1)):
            self.problems.append(Problem(self.document.mark(path, of_key=of_key), path, message))

    def add_faults(self, base: KeyPath, faults: list[Fault]) -> None:
        """Note what a check of the value at `base` found."""
        for fault in faults:
            self.add((*base, *fault.path), fault.message, of_key=fault.of_key)

    def suite(self) -> Suite | None:
        """Check everything; None if the file is no mapping."""
        value = self.document.value
        if not isinstance(value, dict):
            self.problems = [p for p in self.problems if "geometry" not in p.message]
            if not self.problems:
                self.add((), f"a suite file is a mapping with 'scenes:', not {describe(value)}")
            return None
        for key in value:
            if key not in ("name", "algorithms", "scenes"):
                self.add((key,), f"unknown key; {did_you_mean(key, ('name', 'algorithms', 'scenes'))}", of_key=True)
        name = value.get("name", usable_name(Path(self.document.file).stem))
        try:
            SuiteHead(name=name)
        except ValidationError as error:
            self.add_faults((), faults_of(error, SuiteHead, {"name": name}))
        common = self.algorithms(value, ())
        scenes = value.get("scenes")
        if not isinstance(scenes, list) or not scenes:
            self.add(("scenes",) if "scenes" in value else (), "needs 'scenes:', a list with at least one 'scene:'")
            return None
        entries = [self.entry(item, ("scenes", i), common) for i, item in enumerate(scenes)]
        loaded = [entry for entry in entries if entry is not None]
        names = [entry.scene.name for entry in loaded]
        for i, entry in enumerate(entries):
            if entry is not None and names.count(entry.scene.name) > 1:
                self.add(("scenes", i), f"two scenes are called {entry.scene.name}: set a 'name' of its own")
        return Suite(str(name), tuple(loaded))

    def algorithms(self, value: dict[str, Any], path: KeyPath) -> tuple[AlgorithmSpec, ...] | None:
        """Check a list of algorithms; None where there is no list."""
        if "algorithms" not in value:
            return None
        specs, faults = check_algorithms(value["algorithms"])
        self.add_faults((*path, "algorithms"), faults)
        for i, spec in enumerate(specs if not faults else ()):
            if spec.name in PEERS:
                self.add((*path, "algorithms", i), f"{spec.name} is a peer: its answers depend on the machine, so they "
                                                   "cannot be gated")
        return specs

    def entry(self, value: Any, path: KeyPath, common: tuple[AlgorithmSpec, ...] | None) -> SuiteEntry | None:
        """Check one scene of the list and load it."""
        if not isinstance(value, dict):
            self.add(path, f"must be a mapping such as '{{scene: citadel}}', not {describe(value)}")
            return None
        own = self.algorithms(value, path)
        specs = common if own is None else own
        if specs is None:
            self.add(path, "has no algorithms: list them here, or once for all scenes under the top-level 'algorithms'")
        rest = {key: item for key, item in value.items() if key != "algorithms"}
        try:
            checked = SuiteScene.model_validate(rest)
        except ValidationError as error:
            self.add_faults(path, faults_of(error, SuiteScene, rest))
            return None
        scene = self.load(checked, path)
        if scene is None:
            return None
        for i, frame in enumerate(checked.frames):
            if frame >= scene.n_frames:
                self.add((*path, "frames", i), f"the scene has frames 0 to {scene.n_frames - 1}: set 'frames' to have more")
        return SuiteEntry(scene, checked.frames, tuple((spec.name, dict(spec.params)) for spec in specs or ()),
                          self.source(checked), tuple(_overrides(checked)))

    def source(self, entry: SuiteScene) -> str:
        """Name of a built-in scene, or path of a scene file, which starts from the suite's folder."""
        return entry.scene if entry.scene in SCENES else str(self.document.folder / entry.scene)

    def load(self, entry: SuiteScene, path: KeyPath) -> Scene | None:
        """Load a scene; what is wrong with an override is reported at its place in the suite."""
        source = self.source(entry)
        if entry.scene not in SCENES and not Path(source).is_file():
            self.add((*path, "scene"), f"no such scene file or built-in scene; {did_you_mean(entry.scene, SCENES)}")
            return None
        overrides = _overrides(entry)
        try:
            return load_scene(source, overrides)
        except ConfigErrors as error:
            for line in error.lines:
                key = next((key for override, key in overrides.items() if line.startswith(f"-D {override}:")), None)
                if key is None:
                    self.add((*path, "scene"), line)
                else:
                    said = line.removeprefix(f"-D {key}={json.dumps(entry.set[key])}: ")
                    self.add((*path, "set", key), said.removeprefix(f"{key} "))
        except InputError as error:
            self.add((*path, "scene"), str(error))
        return None


def _overrides(entry: SuiteScene) -> dict[str, str]:
    """Settings as ``key=value`` texts, each with its key."""
    return {f"{key}={json.dumps(value)}": key for key, value in entry.set.items()}
