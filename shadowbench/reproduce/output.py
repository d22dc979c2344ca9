"""Writes an item's folder: data, verdicts, table, caption, figure; and says the verdicts as text."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

from shadowbench.report.table import format_table
from shadowbench.reproduce.items import Evidence, Item, Measured, Pictures, Verdict
from shadowbench.reproduce.rows import read_csv, to_csv
from shadowbench.reproduce.store import Origin
from shadowbench.scenes import SCENES

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
    pictures : files of the cells by label and kind.
    folder : made with its parents.
    circumstances : for the caption.
    """
    folder.mkdir(parents=True, exist_ok=True)
    table = item.rows(measured)
    if item.from_pictures is not None:
        table = item.from_pictures(table, pictures)
    _write(folder / "data.csv", to_csv(table))
    rows = read_csv(folder / "data.csv")
    verdicts = item.judge(rows)
    _write(folder / "verdict.json", verdict_json(item, verdicts))
    _write(folder / "table.md", markdown_table(verdicts))
    _write(folder / "caption.md", caption(item, measured, circumstances))
    if item.plot is not None:
        item.plot(Evidence(rows, pictures), folder)
    return verdicts


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


def verdict_table(item: Item, verdicts: Sequence[Verdict]) -> str:
    """The verdicts for the terminal, with the reasons of those that do not simply hold."""
    rows = [("", v.claim, v.published, v.measured, v.verdict) for v in verdicts]
    reasons = [f"  {v.verdict}: {v.claim}: {v.why}" for v in verdicts if v.verdict != "holds"]
    return "\n".join([f"{item.id} ({item.paper}): {item.title}", format_table(HEADER, rows), *reasons])


def caption(item: Item, measured: Sequence[Measured], circumstances: Circumstances) -> str:
    """Text of ``caption.md``: what is shown, on which stand-in scene, from where."""
    scenes = sorted({(m.scene, m.shape, m.frames, m.n_frames, m.triangles) for m, _ in measured})
    where = [f"- `{name}` ({triangles or SCENES[name].triangles:,} triangles), {shape[0]} x {shape[1]}, "
             f"frames {', '.join(map(str, frames))} of a path of {n_frames}"
             for name, shape, frames, n_frames, triangles in scenes]
    origins = [f"- commit {o.commit}; {o.machine}, {o.threads} thread(s)" for o in circumstances.origins]
    return "\n".join([f"# {item.id}: {item.title}", "", f"Published: {item.source}.", "", item.shows, "",
                      "Procedural stand-in scenes, not the paper's:", "", *where, "", "Measured:", "", *origins, "",
                      f"Regenerate: `{circumstances.command}`", ""])


def _write(file: Path, text: str) -> None:
    """Write a file in one step, so that no reader sees half of it."""
    temporary = file.with_name(file.name + ".part")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(file)
