"""What the commands do that show things and write scene files."""

from __future__ import annotations

import difflib
import inspect
from pathlib import Path

from shadowbench.algorithms import ALGORITHMS
from shadowbench.config import load_config, read_document, resolved_yaml, validate_document
from shadowbench.errors import InputError
from shadowbench.report.table import format_table, summary
from shadowbench.results import read_run
from shadowbench.scenes import ALL_SCENES, SCENES
from shadowbench.templates import mesh_template, template


def describe_algorithm(name: str) -> str:
    """Manual page of an algorithm: its module's text, parameters, stages and counters."""
    entry = ALGORITHMS[name]
    algorithm = entry.load()
    rows = []
    for key, info in algorithm.Params.model_fields.items():
        extra = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
        limits = ", ".join(str(limit) for limit in info.metadata)
        rows.append((key, str(getattr(info.annotation, "__name__", info.annotation)).replace("typing.", ""), limits,
                     str(info.default), str(extra.get("paper", info.default)), info.description or ""))
    module = inspect.getmodule(algorithm)
    parts = [f"{algorithm.title} ({algorithm.paper}), {'exact' if algorithm.exact else 'approximate'}",
             inspect.getdoc(module) or "",
             "Parameters\n" + format_table(("name", "type", "limits", "default", "paper", "meaning"), rows)
             if rows else "No parameters.",
             "Stages: " + ", ".join(algorithm.stages), "Counters: " + ", ".join(algorithm.counters)]
    return "\n\n".join(parts)


def describe_scene(name: str) -> str:
    """A built-in scene's summary, or a scene file with every default filled in."""
    if name in SCENES:
        entry = SCENES[name]
        return f"{entry.name}: {entry.summary}\n{entry.triangles} triangles unless said otherwise\n\n" + template(name)
    return resolved_yaml(load_config(Path(name)))


def describe_run(path: Path) -> str:
    """The table of a finished run, with its status and warnings."""
    document, cells = read_run(path)
    lines = [f"{document['scene']}: {document['status']}, {document['created']}",
             *[f"warning: {text}" for text in document.get("warnings", [])], summary(cells)]
    return "\n".join(lines)


def validate_file(file: Path) -> None:
    """Check a scene file, or a suite, which is known by its ``scenes:``.

    Raises
    ------
    InputError
        With every problem.
    """
    document = read_document(file)
    if isinstance(document.value, dict) and "scenes" in document.value and "geometry" not in document.value:
        from shadowbench.check.suite import load_suite

        load_suite(file)
    else:
        validate_document(document)


def not_found(what: str) -> str:
    """Say that a name is unknown, with the nearest ones."""
    names = [*ALGORITHMS] + [scene.name for scene in ALL_SCENES]
    near = difflib.get_close_matches(what, names, n=1)
    hint = f"; did you mean {near[0]}?" if near else ""
    return f"{what} is no algorithm, built-in scene, scene file or run folder{hint}"


def write_template(name: str, mesh: Path | None = None) -> Path:
    """Write ``NAME.yaml`` in the current folder, refusing to overwrite: a built-in scene, or one around a mesh file."""
    file = Path(f"{name.removesuffix('.yaml')}.yaml")
    text = template(file.stem)
    if mesh is not None:
        from shadowbench.scenes.meshes import load_mesh

        low, high = load_mesh(str(mesh)).mesh.bounds().tolist()
        text = mesh_template(file.stem, mesh.as_posix(), low, high)
    try:
        with file.open("x", encoding="utf-8") as stream:
            stream.write(text)
    except FileExistsError as error:
        raise InputError(f"{file} exists already: choose another name, or remove it") from error
    except OSError as error:
        raise InputError(f"cannot write {file}: {error.strerror}") from error
    return file
