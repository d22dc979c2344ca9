"""The offline HTML report: one file with its pictures inside."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import jinja2

from shadowbench.counters import COUNTERS
from shadowbench.report.table import HEADER, summary_row
from shadowbench.results import CellResult, RunFolder

EMBED_LIMIT = 16 * 2**20
"""Bytes of pictures that go into the file; those of later frames are linked to the run folder instead."""

PICTURES = (("shaded_png", "shaded"), ("shadow_png", "shadow buffer"), ("heatmap_png", "heat map"),
            ("error_png", "errors"), ("antialiasing_png", "against supersampling"))


def write_report(folder: RunFolder) -> None:
    """Write ``report.html`` into a run folder from its cells and its run.json."""
    run = json.loads((folder.path / "run.json").read_text(encoding="utf-8"))
    folder.write_text("report.html", render(folder.path, run, folder.cells))


def render(path: Path, run: dict[str, Any], cells: list[CellResult]) -> str:
    """Make the HTML text.

    Parameters
    ----------
    path : the run folder, for the pictures.
    run : the content of run.json.
    cells : the results.
    """
    environment = jinja2.Environment(loader=jinja2.PackageLoader("shadowbench.report", "templates"), autoescape=True,
                                     trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    environment.filters["thousands"] = lambda value: f"{value:,}"
    used = {name for cell in cells for name in cell.counts}
    return environment.get_template("report.html").render(
        run=run, header=HEADER, cells=cells, rows=[summary_row(cell) for cell in cells],
        frames=_galleries(path, cells), counters=[COUNTERS[name] for name in COUNTERS if name in used])


def _galleries(path: Path, cells: list[CellResult]) -> list[dict[str, Any]]:
    """Group the pictures by frame and method, embedding them while there is room."""
    room = EMBED_LIMIT
    frames: dict[int, list[dict[str, Any]]] = {}
    for cell in cells:
        pictures = []
        for kind, title in PICTURES:
            if kind not in cell.files:
                continue
            data = (path / cell.files[kind]).read_bytes()
            room -= len(data)
            source = f"data:image/png;base64,{base64.b64encode(data).decode()}" if room > 0 else cell.files[kind]
            pictures.append({"title": title, "source": source})
        if pictures:
            frames.setdefault(cell.frame, []).append({"label": cell.label, "pictures": pictures})
    return [{"frame": frame, "methods": methods} for frame, methods in frames.items()]
