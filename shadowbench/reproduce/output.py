"""Writes an item's folder: data, verdicts, table, caption, figure; and says the verdicts as text."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shadowbench import image_io
from shadowbench.report.table import format_table
from shadowbench.reproduce.items import Evidence, Item, Measured, Measurement, Pictures, Verdict
from shadowbench.reproduce.rows import read_csv, to_csv
from shadowbench.reproduce.store import Origin
from shadowbench.scenes import SCENES

THUMBNAIL_WIDTH, THUMBNAIL_LINES = 420, 12
"""Pixels across a thumbnail, about, and verdicts in that of an item without a figure."""

_LATEX = {"\\": r"\textbackslash{}", "%": r"\%", "&": r"\&", "_": r"\_", "#": r"\#", "$": r"\$", "{": r"\{", "}": r"\}",
          "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}

HEADER = ("", "claim", "published", "measured", "verdict")


class Circumstances(NamedTuple):
    """How an item came about.

    Attributes
    ----------
    command : what regenerates it.
    origins : where its cells were measured.
    """

    command: str
    origins: Sequence[Origin]


def write_item(item: Item, measured: Sequence[Measured], pictures: Pictures, folder: Path,
               circumstances: Circumstances) -> list[Verdict]:
    """Write everything about an item; the verdicts are computed from ``data.csv`` as it was written.

    Parameters
    ----------
    item, measured : what was asked for, and its cells.
    pictures : files of the cells by view and kind.
    folder : made with its parents.
    circumstances : for the caption.
    """
    folder.mkdir(parents=True, exist_ok=True)
    table = item.rows(measured)
    if item.from_pictures is not None:
        table = item.from_pictures(table, pictures)
    _write(folder / "data.csv", to_csv(table))
    origins = [f"- commit {o.commit}; {o.machine}, {o.threads} thread(s)" for o in circumstances.origins]
    views = view_lines(measurement for measurement, _ in measured)
    return _write_from_data(item, pictures, folder, [*origins, f"Regenerate: `{circumstances.command}`", *views])


def redraw(item: Item, folder: Path) -> list[Verdict]:
    """Write anew what follows from ``data.csv``: verdicts, tables, the caption, and the figure unless it shows pictures.

    Raises
    ------
    OSError
        If the item was not reproduced in this folder.
    LookupError, ValueError
        If its ``data.csv`` lacks what the claims are about.
    """
    caption_lines = (folder / "caption.md").read_text(encoding="utf-8").splitlines()
    kept = [line for line in caption_lines if line.startswith(("- commit ", "Regenerate: ", "- `"))]
    return _write_from_data(item, {}, folder, kept)


def _write_from_data(item: Item, pictures: Pictures, folder: Path, caption_lines: Sequence[str]) -> list[Verdict]:
    """Write all but ``data.csv``."""
    rows = read_csv(folder / "data.csv")
    verdicts = item.judge(rows)
    _write(folder / "verdict.json", verdict_json(item, verdicts))
    _write(folder / "table.md", markdown_table(verdicts))
    _write(folder / "table.tex", latex_table(verdicts))
    _write(folder / "caption.md", caption(item, verdicts, caption_lines))
    if item.plot is not None and (pictures or not item.shows_pictures):
        item.plot(Evidence(rows, pictures), folder)
    write_thumbnail(folder, verdicts)
    return verdicts


def write_thumbnail(folder: Path, verdicts: Sequence[Verdict]) -> None:
    """Write ``thumbnail.png``: the figure, or the table of verdicts, made small."""
    figure = folder / "figure.png"
    if figure.exists():
        pixels = image_io.read_png(figure)[..., :3]
        step = -(-pixels.shape[1] // THUMBNAIL_WIDTH)
        rows, columns = (n // step * step for n in pixels.shape[:2])
        blocks = pixels[:rows, :columns].reshape(rows // step, step, columns // step, step, 3)
        image_io.write_png(folder / "thumbnail.png", (blocks.mean(axis=(1, 3)) + 0.5).astype(np.uint8))
        return
    from shadowbench.reproduce import plots

    lines = [("claim", "published", "measured")]
    lines += [(_shortened(v.claim, 62), _shortened(v.published, 22), v.measured) for v in verdicts[:THUMBNAIL_LINES]]
    table = plots.table_of(lines, (4.2, 1.6, 1.0))
    plots.save_png(table, folder / "thumbnail.png", dpi=THUMBNAIL_WIDTH / 6.8)


def _shortened(text: str, n: int) -> str:
    """Cut a text to n letters."""
    return text if len(text) <= n else text[:n - 1].rstrip() + "…"


def verdict_json(item: Item, verdicts: Sequence[Verdict]) -> str:
    """Text of ``verdict.json``."""
    document = {"item": item.id, "title": item.title, "source": item.source,
                "verdicts": [asdict(verdict) for verdict in verdicts]}
    return json.dumps(document, indent=2) + "\n"


def markdown_table(verdicts: Sequence[Verdict]) -> str:
    """Text of ``table.md``: published beside measured, and why."""
    lines = ["| claim | published | measured | verdict | why |", "| --- | --- | --- | --- | --- |"]
    lines += [f"| {v.claim} | {v.published} | {v.measured} | **{v.verdict}** | {v.why} |" for v in verdicts]
    return "\n".join(lines) + "\n"


def latex_table(verdicts: Sequence[Verdict]) -> str:
    """Text of ``table.tex``: a tabular without packages."""
    lines = [r"\begin{tabular}{p{0.5\linewidth}lll}", r"\hline", r"Claim & Published & Measured & Verdict \\", r"\hline"]
    lines += [" & ".join(map(_latex, (v.claim, v.published, v.measured, v.verdict))) + r" \\" for v in verdicts]
    return "\n".join([*lines, r"\hline", r"\end{tabular}"]) + "\n"


def _latex(text: str) -> str:
    """Escape what LaTeX reads as commands."""
    return "".join(_LATEX.get(letter, letter) for letter in text)


def verdict_table(item: Item, verdicts: Sequence[Verdict]) -> str:
    """The verdicts for the terminal, with the reasons of those that do not simply hold."""
    rows = [("", v.claim, v.published, v.measured, v.verdict) for v in verdicts]
    reasons = [f"  {v.verdict}: {v.claim}: {v.why}" for v in verdicts if v.verdict != "holds"]
    return "\n".join([f"{item.id} ({item.paper}): {item.title}", format_table(HEADER, rows), *reasons])


def view_lines(measurements: Iterable[Measurement]) -> list[str]:
    """Say which scenes, sizes and frames were measured, a line of a caption each."""
    lines = set()
    for m in measurements:
        light = "" if m.light is None else ", the light moved"
        lines.add(f"- `{m.scene}` ({m.triangles or SCENES[m.scene].triangles:,} triangles), {m.shape[0]} x {m.shape[1]}, "
                  f"frames {', '.join(map(str, m.frames))} of a path of {m.n_frames}{light}")
    return sorted(lines)


def caption(item: Item, verdicts: Sequence[Verdict], lines: Sequence[str]) -> str:
    """Text of ``caption.md``: what is shown, on which stand-in scene, from where, and why claims do not hold.

    Parameters
    ----------
    lines : those that begin with "- commit" (where it was measured), "- `" (`view_lines`) and "Regenerate: ".
    """
    def beginning(start: str) -> list[str]:
        return [line for line in lines if line.startswith(start)]

    failed = [f"- {v.verdict}: {v.claim}: {v.why}." for v in verdicts if v.verdict != "holds"]
    held = sum(v.verdict == "holds" for v in verdicts)
    return "\n".join([f"# {item.id}: {item.title}", "", f"Published: {item.source}.", "", item.shows.strip(), "",
                      "Procedural stand-in scenes, not the paper's:", "", *beginning("- `"), "",
                      "Measured:", "", *beginning("- commit "), "",
                      f"{held} of {len(verdicts)} claims hold." + (" The others:" if failed else ""),
                      *(["", *failed] if failed else []), "", *beginning("Regenerate: "), ""])


def _write(file: Path, text: str) -> None:
    """Write a file in one step, so that no reader sees half of it."""
    temporary = file.with_name(file.name + ".part")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(file)
