"""The `report` command: one HTML file about one or several runs, or a zip file where the pictures are many."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

from shadowbench.errors import InputError
from shadowbench.report.gather import read_runs, series_of
from shadowbench.report.html import LARGEST_FILE, Pictures, render
from shadowbench.report.packing import Chunk, pack


def report(paths: Sequence[Path], output: Path | None, largest: int = LARGEST_FILE) -> Path:
    """Write a report.

    Parameters
    ----------
    paths : run folders.
    output : file to write; ``report.html`` in the run folder, or in the current one for several runs, if None.
    largest : bytes that an HTML file may have before its pictures go into a zip file.

    Returns
    -------
    The file written: `output`, or one of its name that ends in ``.zip``.

    Raises
    ------
    InputError
        If a folder holds no run, or the file can't be written.
    """
    runs = read_runs(paths)
    series = series_of(runs)
    target = output or (paths[0] if len(paths) == 1 else Path()) / "report.html"
    if target.is_dir():
        raise InputError(f"{target} is a folder: name a file, such as {target / 'report.html'}")
    with tempfile.TemporaryDirectory() as spool:
        keys, size = [], 0
        for chunk in pack(runs, series):
            _spooled(Path(spool), chunk.key).write_text(chunk.text, encoding="utf-8")
            keys.append(chunk.key)
            size += len(chunk.text)
        try:
            if size <= largest:
                chunks = [Chunk(key, _spooled(Path(spool), key).read_text(encoding="utf-8")) for key in keys]
                text = render(runs, series, Pictures(chunks))
                if len(text.encode()) <= largest:
                    return _write_html(target, text)
            page = render(runs, series, Pictures(beside=keys))
            return _write_zip(target.with_suffix(".zip"), page, keys, Path(spool))
        except OSError as error:
            raise InputError(f"cannot write {target}: {error.strerror}; choose another file with -o") from error


def _spooled(folder: Path, key: str) -> Path:
    """File of a frame's pictures, also by this name in the zip file."""
    return folder / f"{key.replace('/', '-')}.js"


def _write_html(target: Path, text: str) -> Path:
    """Write the one file in one step."""
    if target.suffix == ".zip":
        target = target.with_suffix(".html")
    temporary = target.with_name(target.name + ".part")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(target)
    return target


def _write_zip(target: Path, page: str, keys: Sequence[str], spool: Path) -> Path:
    """Write the page, and a script per frame that hands it the pictures: a page may load scripts from a disk, not data."""
    temporary = target.with_name(target.name + ".part")
    with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        archive.writestr(zipfile.ZipInfo("report.html"), page, zipfile.ZIP_DEFLATED)
        for key in keys:
            file = _spooled(spool, key)
            script = f'shadowbenchPictures("{key}", {file.read_text(encoding="utf-8")});\n'
            archive.writestr(zipfile.ZipInfo(f"pictures/{file.name}"), script, zipfile.ZIP_DEFLATED)
    temporary.replace(target)
    return target
