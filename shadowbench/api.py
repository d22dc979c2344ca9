"""The Python interface: run scenes from a notebook or a script, and read results as records and arrays.

``import shadowbench as sb`` brings `run`, `load` and `Results` with it; Numba is imported when the first run starts.
"""

from __future__ import annotations

import html
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.report.gather import Run, read_runs
from shadowbench.results import CellResult

__all__ = ["Results", "load", "run"]

AlgorithmChoice = str | tuple[str, Mapping[str, Any]]
"""``"ptsv"``, ``"ptsv[branching=16]"`` or ``("ptsv", {"branching": 16})``."""


class Results:
    """A finished run: what was measured, as records, and its pictures, as arrays.

    Methods that take `label` accept the label of a cell, such as ``"ptsv"`` or ``"shadow_map+resolution=512"``; `labels`
    lists them. Arrays are of the sample grid, (rows, columns), which is the image where a pixel has one sample.

    Attributes
    ----------
    path : the run folder.
    document : content of ``run.json``: versions, processor, commit, threads, digests, warnings.
    cells : one result per scene, frame, algorithm and parameters; `shadowbench.results.CellResult`.
    """

    def __init__(self, run_: Run) -> None:
        self.path: Path = run_.path
        self.document: dict[str, Any] = run_.document
        self.cells: list[CellResult] = run_.cells

    @property
    def labels(self) -> list[str]:
        """Labels of the methods, in the order of the run."""
        return list(dict.fromkeys(cell.label for cell in self.cells))

    @property
    def frames(self) -> list[int]:
        """Frames that were measured, ascending."""
        return sorted({cell.frame for cell in self.cells})

    @property
    def warnings(self) -> list[str]:
        """Sentences worth attention, as the command line prints them."""
        return list(self.document.get("warnings", []))

    def cell(self, label: str, frame: int = 0) -> CellResult:
        """Return one result.

        Raises
        ------
        KeyError
            If there is no such cell; the message lists what there is.
        """
        for cell in self.cells:
            if (cell.label, cell.frame) == (label, frame):
                return cell
        raise KeyError(f"no {label!r} at frame {frame}: there are {', '.join(self.labels)} at frames {self.frames}")

    def records(self) -> list[dict[str, Any]]:
        """Return one flat dictionary per cell, ready for ``pandas.DataFrame``.

        Keys: scene, frame, label, algorithm, status, reason; every parameter as ``param.NAME``; every count by its name;
        the classes of samples; ``seconds`` (median of the repeats, without compilation), ``stage.NAME`` (the same of each
        stage) and ``memory_bytes``. A key is left out where the cell has no such value.
        """
        return [_record(cell) for cell in self.cells]

    def shadow(self, label: str, frame: int = 0) -> NDArray[np.float32]:
        """Return a method's shadow buffer, float32 (rows, columns): 1 is in shadow."""
        return self._channel(label, frame, "shadow")

    def tests(self, label: str, frame: int = 0) -> NDArray[np.uint32]:
        """Return a method's heat map, uint32 (rows, columns): tests per view sample, 0 where it attributes none."""
        return self._channel(label, frame, "tests")

    def errors(self, label: str, frame: int = 0) -> NDArray[np.uint32]:
        """Return the class of each sample's answer, uint32 (rows, columns): `shadowbench.accuracy.ErrorClass`."""
        return self._channel(label, frame, "error")

    def gbuffer(self, frame: int = 0) -> dict[str, NDArray[Any]]:
        """Return the view samples: ``P.X P.Y P.Z N.X N.Y N.Z depth triangle candidate``, each (rows, columns)."""
        from shadowbench import image_io

        return image_io.read_exr(self._picture(self.path / "frames" / f"{frame:04d}" / "gbuffer.exr"))

    def picture(self, label: str, kind: str = "shaded", frame: int = 0) -> NDArray[np.uint8]:
        """Return a PNG picture, uint8 (height, width, 3): ``shaded``, ``shadow``, ``heatmap``, ``error`` or an extra one.

        Heat maps and error maps have a legend below the image.
        """
        from shadowbench import image_io

        files = self.cell(label, frame).files
        if f"{kind}_png" not in files:
            kinds = [name.removesuffix("_png") for name in files if name.endswith("_png")]
            raise KeyError(f"{label} has no picture {kind!r} at frame {frame}: there are {', '.join(kinds) or 'none'}")
        return image_io.read_png(self._picture(self.path / files[f"{kind}_png"]))

    def report(self, file: str | Path | None = None) -> Path:
        """Write the HTML report (or a zip file, where it is large) and return its path; see `shadowbench report`."""
        from shadowbench.report.command import report

        return report([self.path], None if file is None else Path(file))

    def table(self) -> str:
        """Return the table that `shadowbench show` prints."""
        from shadowbench.report.table import summary

        return summary(self.cells)

    def __repr__(self) -> str:
        return f"<shadowbench results: {', '.join(self.labels)}; {len(self.frames)} frame(s); {self.path}>"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.table())}</pre>"

    def _channel(self, label: str, frame: int, name: str) -> NDArray[Any]:
        from shadowbench import image_io

        files = self.cell(label, frame).files
        if "shadow_exr" not in files:
            raise KeyError(f"{label} has no pictures at frame {frame}: run with pictures=True")
        return image_io.read_exr(self._picture(self.path / files["shadow_exr"]))[name]

    @staticmethod
    def _picture(file: Path) -> Path:
        if not file.is_file():
            raise KeyError(f"{file} is not there: the run was made without pictures, or they were removed")
        return file


def load(path: str | Path) -> Results:
    """Read a run folder.

    Raises
    ------
    InputError
        If it holds no run.
    """
    return Results(read_runs([Path(path)])[0])


def run(scene: str | Path, algorithms: Iterable[AlgorithmChoice] | None = None, *, frames: Iterable[int] | None = None,
        size: tuple[int, int] | None = None, overrides: Sequence[str] = (), repeats: int = 3, threads: int | None = None,
        out: str | Path | None = None, pictures: bool = True, timings: bool = True, progress: bool = False) -> Results:
    """Measure algorithms on a scene, as `shadowbench run` does, and return the results.

    Parameters
    ----------
    scene : a scene file, or the name of a built-in scene.
    algorithms : what to run, see `AlgorithmChoice`; those of the scene file, or all that support it, if None.
    frames : frame numbers; all of the scene's if None.
    size : width and height in pixels, in place of the scene's.
    overrides : ``dotted.key=value`` settings, such as ``"geometry.0.triangles=5000"``.
    repeats : timed executions per cell.
    threads : threads of the kernels; all processors if None.
    out : run folder to make; ``results/runs/<UTC time>-<scene>`` if None.
    pictures, timings : False to leave them out; counts and the comparison with the reference are always made.
    progress : True to print every finished cell to stderr; warnings, and kernels that are compiled, are always told.

    Returns
    -------
    The results. A cell that failed loses no other: its `status` is "failed" and its `reason` says why.

    Raises
    ------
    InputError
        For anything wrong with the scene, an algorithm, a parameter or the folder.
    """
    from shadowbench.algorithm_specs import parse_algorithm_spec, validate_params
    from shadowbench.plan import RunOptions, plan_cells
    from shadowbench.progress import Progress
    from shadowbench.results import check_writable, default_folder
    from shadowbench.resume import decide
    from shadowbench.run_command import measure_cells, selections
    from shadowbench.run_lock import RunLock
    from shadowbench.scene_sweep import scene_variants
    from shadowbench.scenes.loader import load_scene

    changes = list(overrides)
    if size is not None:
        changes += [f"image.width={size[0]}", f"image.height={size[1]}"]
    start = time.perf_counter()
    loaded = load_scene(scene, changes)
    seconds = time.perf_counter() - start
    if scene_variants(loaded.config):
        raise InputError(f"{loaded.name}: its matrix sweeps the scene itself: call run once per variant, with overrides, or "
                         "use the command line")
    chosen = None if algorithms is None else [
        parse_algorithm_spec(entry) if isinstance(entry, str) else (entry[0], dict(entry[1])) for entry in algorithms]
    if chosen is not None and not chosen:
        raise InputError("algorithms is empty: name at least one, or leave it out")
    for name, params in chosen or ():
        validate_params(name, params)
    only = frozenset({"counts", *["timings"] * timings, *["images"] * pictures})
    numbers = tuple(range(loaded.n_frames)) if frames is None else tuple(frames)
    if not numbers or not set(numbers) <= set(range(loaded.n_frames)):
        raise InputError(f"{loaded.name} has frames 0 to {loaded.n_frames - 1}, not {list(numbers)}")
    options = RunOptions(numbers, repeats, threads or len(os.sched_getaffinity(0)), only)
    folder = default_folder(loaded.name) if out is None else Path(out)
    check_writable(folder)
    cells = plan_cells(loaded, selections(loaded, chosen or ()), numbers)
    argv = ["shadowbench", "run", str(scene), *[word for change in changes for word in ("-D", change)]]
    with RunLock(folder), Progress(len(cells), quiet=not progress) as told:
        measure_cells(loaded, seconds, decide(cells, folder, loaded.name, options), options, folder, argv, told)
    return load(folder)


def _record(cell: CellResult) -> dict[str, Any]:
    """Flatten one result; see `Results.records`."""
    record: dict[str, Any] = {"scene": cell.scene, "frame": cell.frame, "label": cell.label, "algorithm": cell.algorithm,
                              "status": cell.status}
    if cell.reason is not None:
        record["reason"] = cell.reason
    record |= {f"param.{name}": value for name, value in cell.params.items()}
    record |= cell.counts
    if cell.accuracy is not None:
        record |= cell.accuracy.model_dump(exclude_none=True)
    if cell.total_seconds:
        record["seconds"] = float(np.median(cell.total_seconds))
        record |= {f"stage.{name}": float(np.median(values)) for name, values in cell.stages.items()}
    if cell.memory_bytes:
        record["memory_bytes"] = sum(size for name, size in cell.memory_bytes.items() if not name.startswith("modelled_"))
    return record
