"""What to run: the cells of a run, the options that hold for all of them, and what run.json says beforehand."""

from __future__ import annotations

import inspect
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from shadowbench import environment, jit
from shadowbench.algorithms import ALGORITHMS
from shadowbench.algorithms.base import Algorithm, AlgorithmParams
from shadowbench.results import make_key, make_label
from shadowbench.scene_models import GenerateEntry
from shadowbench.scenes import SCENES
from shadowbench.scenes.loader import Scene
from shadowbench.source_digest import source_digest

EVERYTHING = frozenset({"counts", "timings", "images"})


@dataclass(frozen=True)
class RunOptions:
    """How to run.

    Attributes
    ----------
    frames : frame numbers.
    repeats : timed executions per cell.
    threads : threads of the kernels.
    only : subset of "counts", "timings", "images" to produce.
    keep_going : True to go on after a failed cell.
    verify : False to leave out the comparison with the reference, and with it all pictures.
    warm_up : False to time the first execution too, unless it compiled something.
    timeout : seconds after which a cell is given up, or None. Compiling does not count.
    """

    frames: tuple[int, ...]
    repeats: int = 3
    threads: int = 1
    only: frozenset[str] = EVERYTHING
    keep_going: bool = True
    verify: bool = True
    warm_up: bool = True
    timeout: float | None = None

    def __post_init__(self) -> None:
        if "images" in self.only and not self.verify:
            raise ValueError("pictures show errors, so they need the comparison with the reference")


@dataclass(frozen=True)
class Cell:
    """One measurement to make."""

    frame: int
    algorithm: Algorithm
    label: str
    key: str

    @property
    def name(self) -> str:
        """The algorithm's id."""
        return self.algorithm.name


def plan_cells(scene: Scene, selections: Iterable[tuple[str, AlgorithmParams]], frames: Iterable[int]) -> list[Cell]:
    """List the cells of a run, frame by frame, without repeats."""
    algorithms: dict[str, Algorithm] = {}
    for name, params in selections:
        changed = params.model_dump(exclude_defaults=True)
        algorithms.setdefault(make_label(name, changed), ALGORITHMS[name].load()(params))
    # What decides a cell's counts; the list of other algorithms does not, nor does where a mesh file lies.
    config = scene.config.model_dump(mode="json", exclude={"algorithms", "matrix", "name"})
    for entry in config["geometry"]:
        entry.pop("mesh", None)
    where = {"scene": config, "generators": _generators(scene), "meshes": sorted(scene.digests.values())}
    return [Cell(frame, algorithm, label,
                 make_key(sources=_sources(algorithm), **where, frame=frame, algorithm=algorithm.name,
                          params=algorithm.params.model_dump(mode="json")))
            for frame in frames for label, algorithm in algorithms.items()]


def _sources(algorithm: Algorithm) -> str:
    """Digest of the sources that decide what a cell measures: the method's and the runner's."""
    method = source_digest(Path(inspect.getfile(type(algorithm))))
    return f"{method} {source_digest(Path(__file__).with_name('runner.py'))}"


def _generators(scene: Scene) -> list[str]:
    """Digests of the sources of the scene's generators, which are imported by name when they are used."""
    names = {entry.generate for entry in scene.config.geometry if isinstance(entry, GenerateEntry)}
    modules = sorted(SCENES[name].target.partition(":")[0] for name in names)
    return [source_digest(Path(inspect.getfile(import_module(module)))) for module in modules]


def sweep(selections: Iterable[tuple[str, dict[str, Any]]], matrix: Mapping[str, Sequence[Any]]
          ) -> list[tuple[str, dict[str, Any]]]:
    """Expand ``matrix`` axes named ``algorithm.parameter`` into one selection per combination of values."""
    expanded = []
    for name, params in selections:
        axes = {key.partition(".")[2]: values for key, values in matrix.items() if key.partition(".")[0] == name}
        for values in itertools.product(*axes.values()):
            expanded.append((name, {**params, **dict(zip(axes, values, strict=True))}))
    return expanded


def describe(scene: Scene, options: RunOptions, argv: list[str]) -> dict[str, Any]:
    """Fields of run.json that are known before the run."""
    return {"argv": argv, "scene": scene.name, "scene_file": None if scene.path is None else str(scene.path),
            "digests": scene.digests, "image": asdict(scene.image), "bias": scene.bias,
            "frames": list(options.frames), "repeats": options.repeats, "only": sorted(options.only),
            "threads": options.threads, "threading_layer": jit.THREADING_LAYER,
            "seeds": [entry.seed for entry in scene.config.geometry if isinstance(entry, GenerateEntry)],
            "packages": environment.package_versions(), "git": environment.git_state(),
            "processor": environment.processor()}
