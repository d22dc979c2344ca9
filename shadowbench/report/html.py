"""Makes the HTML report: gathers what the page shows, and fills in the templates."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup

from shadowbench import __version__
from shadowbench.counters import COUNTERS
from shadowbench.report import commands
from shadowbench.report.figures import bars, curves, svg, work
from shadowbench.report.gather import Run, Series, series_of
from shadowbench.report.packing import Chunk, pack
from shadowbench.report.pictures import HEAT_LIMIT, heat_ramp
from shadowbench.report.rows import columns, failures, rows
from shadowbench.report.summary import sentences, summarise
from shadowbench.results import CellResult, RunFolder, tables

LARGEST_FILE = 20 * 2**20
"""Bytes of pictures that one HTML file holds; above that a report is packed into a zip file."""

SCRIPTS = ("page.js", "pixels.js", "paint.js", "viewer.js", "loupe.js", "table.js", "figures.js", "start.js")
STYLES = ("page.css", "tables.css", "viewer.css", "print.css")
ASSETS = Path(__file__).parent / "assets"


@dataclass(frozen=True)
class Pictures:
    """The pictures of a report, as far as they are in the file.

    Attributes
    ----------
    chunks : frames whose pictures are in the file.
    beside : keys of frames whose pictures lie in files of their own, ``pictures/RUN-FRAME.js``.
    left_out : number of frames whose pictures are not there at all.
    """

    chunks: Sequence[Chunk] = ()
    beside: Sequence[str] = ()
    left_out: int = 0


def write_report(folder: RunFolder) -> None:
    """Write ``report.html`` into a run folder; pictures of later frames are left out if it would grow too large."""
    document = json.loads((folder.path / "run.json").read_text(encoding="utf-8"))
    runs = [Run(folder.path, folder.path.name, document, folder.cells)]
    series = series_of(runs)
    chunks: list[Chunk] = []
    size = 0
    for chunk in pack(runs, series):
        size += len(chunk.text)
        if size > LARGEST_FILE:
            break
        chunks.append(chunk)
    shown = sum(1 for frame in runs[0].frames if (folder.path / "frames" / f"{frame:04d}" / "gbuffer.exr").is_file())
    folder.write_text("report.html", render(runs, series, Pictures(chunks, left_out=shown - len(chunks))))


def render(runs: Sequence[Run], series: Sequence[Series], pictures: Pictures) -> str:
    """Make the HTML text."""
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"), autoescape=True,
                                     trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    environment.filters["thousands"] = lambda value: f"{value:,.0f}"
    environment.filters["embed"] = embed
    methods = [summarise(s) for s in series]
    wanted = columns(series)
    used = {name for s in series for cell in s.done for name in cell.counts}
    return environment.get_template("report.html").render(
        version=__version__, runs=runs, series=series, methods=methods, sentences=sentences(methods), n_colors=svg.N_COLORS,
        markers=svg.MARKERS, columns=wanted, rows=rows(series, wanted), failures=failures(methods),
        counters=[counter for name, counter in COUNTERS.items() if name in used],
        fly_through=curves.fly_through(series), stages=bars.stage_bars(series), scatter=curves.against_wrong(methods),
        levels=work.by_level(series), level_tables=[(s, table) for s in series if (table := work.levels_of(s))],
        triangles=work.by_triangle(series), triangle_sums=[(s, t) for s in series if (t := work.triangle_sum(s))],
        pictures=pictures, data=page_data(runs, series, pictures), files=[_files(run) for run in runs],
        spec={s.index: commands.spec(_first(s)) for s in series}, explain=commands.explain,
        unexplained={s.index: commands.unexplained(_first(s), by_triangle=True) for s in series},
        scripts=Markup("\n".join(_asset(name) for name in SCRIPTS)),
        styles=Markup("\n".join(_asset(name) for name in STYLES)))


def _first(series: Series) -> CellResult:
    return next(iter(series.cells.values()))


def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def embed(document: Any) -> Markup:
    """Write JSON (or JSON text) so that it may stand inside a ``<script>`` element."""
    text = document if isinstance(document, str) else json.dumps(document, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c"))


def page_data(runs: Sequence[Run], series: Sequence[Series], pictures: Pictures) -> dict[str, Any]:
    """What the page's script needs to know beside the pictures."""
    there = [chunk.key for chunk in pictures.chunks] + list(pictures.beside)
    ramp = heat_ramp()
    return {
        "runs": [{"name": run.name, "frames": run.frames, "explain": commands.explain(run)} for run in runs],
        "series": [{"title": s.title, "run": runs.index(s.run), "color": s.index % svg.N_COLORS,
                    "spec": commands.spec(_first(s)), "unexplained": commands.unexplained(_first(s))} for s in series],
        "pictures": there, "beside": list(pictures.beside), "heatLimit": HEAT_LIMIT,
        "ramp": "".join(f"{r:02x}{g:02x}{b:02x}" for r, g, b in np.asarray(ramp).tolist())}


def _files(run: Run) -> dict[str, str]:
    """The run's raw results by file name, as they are in its folder."""
    counts, timings = tables(run.cells)
    lines = "".join(cell.model_dump_json(by_alias=True) + "\n" for cell in run.cells)
    return {"counts.csv": counts, "timings.csv": timings, "results.jsonl": lines,
            "run.json": json.dumps(run.document, indent=2) + "\n"}
