"""The report: what it holds, whatever a run holds. How it behaves in a browser is in test_report_browser.py."""

import base64
import io
import json
import re
import xml.etree.ElementTree as ElementTree
import zipfile
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from shadowbench import image_io
from shadowbench.errors import InputError
from shadowbench.report import commands
from shadowbench.report.command import report
from shadowbench.report.figures import svg
from shadowbench.report.gather import Run, read_runs, series_of, short_names
from shadowbench.report.html import ASSETS, SCRIPTS, STYLES, embed
from shadowbench.report.summary import sentences, summarise
from shadowbench.results import CellResult
from shadowbench.triangle_work import triangle_work
from tests.command_line import call

METHODS = ["ptsv", "shadow_map[resolution=64]", "reference"]


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """Three methods on two frames, four samples per pixel."""
    folder = tmp_path_factory.mktemp("run") / "out"
    options = [word for method in METHODS for word in ("-a", method)]
    done = call("run", "plane_box", "-D", "frames=2", "-D", "image.samples=4", "--size", "48x32", "--repeats", "2",
                "--out", folder, *options)
    assert done.code == 0, done.errors
    return folder


@pytest.fixture(scope="module")
def page(run_folder):
    return (run_folder / "report.html").read_text(encoding="utf-8")


def scripts(text, attribute):
    """Contents of the JSON script elements that have an attribute, by its value."""
    pattern = rf'<script type="application/json" {attribute}="([^"]*)">(.*?)</script>'
    return {name: json.loads(content) for name, content in re.findall(pattern, text, re.DOTALL)}


def decode(blobs, name):
    """Pixels of a packed picture, by another PNG decoder."""
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(blobs[name]))))


class Tags(HTMLParser):
    """Collects ids, links within the page and everything that a page could load."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.loaded, self.open = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name == "href":
                self.links.append(value)
            if name in ("src", "srcset", "data", "action") or (name == "href" and tag == "link"):
                self.loaded.append(value)


def test_page_loads_nothing(page):
    tags = Tags(page)
    assert tags.loaded == [] and len(set(tags.ids)) == len(tags.ids)
    assert {link[1:] for link in tags.links if link.startswith("#")} <= set(tags.ids)
    assert not re.search(r"(?:https?:)?//[a-z0-9.-]+\.[a-z]{2,}", page.replace("http://www.w3.org/2000/svg", ""))
    assert "default-src 'none'" in page


def test_scripts_use_only_elements_that_there_are(page):
    ids = set(Tags(page).ids)
    used = set(re.findall(r'\$\("([a-z-]+)"\)', "".join((ASSETS / name).read_text() for name in SCRIPTS)))
    assert len(used) > 25 and used <= ids
    assert {path.name for path in ASSETS.iterdir()} == {*SCRIPTS, *STYLES}


@pytest.mark.parametrize("frame", [0, 1])
def test_packed_pictures_are_the_run_folders(page, run_folder, frame):
    packed = scripts(page, "data-pictures")[f"0/{frame}"]
    labels = ["ptsv", "shadow_map+resolution=64", "reference"]
    for index, label in enumerate(labels):
        method, folder = packed["methods"][str(index)], run_folder / "frames" / f"{frame:04d}" / label
        shaded = decode(packed["blobs"], method["shaded"][0]).copy()
        for name in method["shaded"][1:]:
            patch = decode(packed["blobs"], name)
            shaded[patch[..., 3] == 255] = patch[patch[..., 3] == 255, :3]
        assert np.array_equal(shaded, image_io.read_png(folder / "shaded.png"))
        truth = image_io.read_exr(folder / "shadow.exr")
        per_pixel = {name: values.reshape(32, 2, 48, 2) for name, values in truth.items()}
        high, middle, low = np.moveaxis(decode(packed["blobs"], method["tests"]).astype(np.int64), -1, 0)
        assert np.array_equal(high * 65536 + middle * 256 + low, per_pixel["tests"].sum(axis=(1, 3)))
        state = decode(packed["blobs"], method["state"])
        assert np.abs(state[..., 0] / 255.0 - per_pixel["shadow"].mean(axis=(1, 3))).max() < 0.002
        assert np.array_equal(state[..., 1] > 0, (per_pixel["error"] > 0).any(axis=(1, 3)))
    assert packed["methods"]["2"]["shaded"] == packed["methods"]["0"]["shaded"]     # exact methods share one picture
    assert state[..., 1].max() == 0 and state[..., 2].max() == 2


@pytest.mark.parametrize(("algorithm", "params", "by_triangle", "refused"), [
    ("ptsv", {}, False, False), ("ptsv", {"group": 8}, False, True), ("shadow_map", {}, False, True),
    ("ray_traced", {}, False, False), ("ray_traced", {}, True, True), ("z_fail", {}, True, False)])
def test_explain_is_offered_where_it_can_answer(algorithm, params, by_triangle, refused):
    cell = a_cell().model_copy(update={"algorithm": algorithm, "params": params})
    assert (commands.unexplained(cell, by_triangle) is not None) == refused


def test_raw_files_are_inside(page, run_folder):
    files = scripts(page, "data-files")["0"]
    assert set(files) == {"counts.csv", "timings.csv", "results.jsonl", "run.json"}
    for name in ("counts.csv", "timings.csv"):
        assert files[name] == (run_folder / name).read_text()
    assert sorted(files["results.jsonl"].splitlines()) == sorted((run_folder / "results.jsonl").read_text().splitlines())


def test_page_says_who_is_right_and_what_it_costs(page, run_folder):
    _, cells = read_runs([run_folder])[0].document, read_runs([run_folder])[0].cells
    wrong = sum(c.accuracy.false_shadow + c.accuracy.false_light for c in cells if c.algorithm == "shadow_map")
    assert wrong > 0 and f"shadow_map+resolution=64 {wrong:,} of" in page
    assert "✓ all right" in page and page.count('class="plot"') == 10
    for cell in cells:
        assert f">{cell.counts['all_work']:,}<" in page


def test_figures_are_well_formed(page):
    found = re.findall(r"<svg class=\"figure.*?</svg>", page, re.DOTALL)
    assert len(found) == 10
    for text in found:
        root = ElementTree.fromstring(text)
        width, height = (float(word) for word in root.get("viewBox").split()[2:])
        numbers = [float(part.get(name)) for part in root.iter() for name in ("x", "x1", "x2", "y", "y1", "y2")
                   if part.get(name)]
        assert all(-1 <= number <= max(width, height) + 1 for number in numbers)


def test_too_many_pictures_make_a_zip(run_folder, tmp_path):
    file = report([run_folder], tmp_path / "all.html", largest=10_000)
    assert file == tmp_path / "all.zip" and not (tmp_path / "all.html").exists()
    with zipfile.ZipFile(file) as archive:
        assert sorted(archive.namelist()) == ["pictures/0-0.js", "pictures/0-1.js", "report.html"]
        text = archive.read("report.html").decode()
        script = archive.read("pictures/0-1.js").decode()
    assert scripts(text, "data-pictures") == {} and scripts(text, "id")["page-data"]["beside"] == ["0/0", "0/1"]
    assert script.startswith('shadowbenchPictures("0/1", {') and script.endswith("});\n")
    first = file.read_bytes()
    assert report([run_folder], tmp_path / "all.html", largest=10_000).read_bytes() == first


def test_several_runs_in_one_report(run_folder, tmp_path):
    done = call("run", "plane_box", "--size", "48x32", "-a", "cluster", "--only", "counts", "--out", tmp_path / "other")
    assert done.code == 0
    done = call("report", run_folder, tmp_path / "other", "-o", tmp_path / "both.html")
    assert done.output.strip() == str(tmp_path / "both.html")
    text = (tmp_path / "both.html").read_text()
    assert "out / ptsv" in text and "other / cluster" in text
    assert set(scripts(text, "data-files")) == {"0", "1"}
    alone = call("report", tmp_path / "other")
    assert alone.code == 0 and "<h2>Pictures</h2>" not in (tmp_path / "other" / "report.html").read_text()


def test_bad_folders_are_told(run_folder, tmp_path):
    assert "holds no run" in call("report", tmp_path).errors
    assert "named twice" in call("report", run_folder, run_folder).errors
    assert call("report", run_folder, "-o", tmp_path / "no" / "such.html").code == 2
    with pytest.raises(InputError, match="is a folder"):
        report([run_folder], tmp_path)


def a_run(tmp_path, cells, argv=("shadowbench", "run", "scene.yaml")):
    document = {"argv": list(argv), "image": {"width": 48, "height": 32, "samples": 1}}
    return Run(tmp_path, "run", document, cells)


def a_cell(**more):
    return CellResult(**{"key": "k", "scene": "s", "frame": 0, "algorithm": "ptsv", "label": "ptsv", "params": {},
                         "status": "done", **more})


def test_failures_come_with_commands(tmp_path, run_folder):
    lines = (run_folder / "results.jsonl").read_text().splitlines()
    bad = json.loads(lines[0]) | {"status": "failed", "reason": "</script><b>MemoryError</b>", "counts": {}, "files": {}}
    copy = tmp_path / "copy"
    copy.mkdir()
    words = "run plane_box -D frames=2 -D image.samples=4 --size 48x32 -a ptsv -a reference --repeats 2 --out x"
    document = json.loads((run_folder / "run.json").read_text()) | {"argv": ["shadowbench", *words.split()]}
    (copy / "run.json").write_text(json.dumps(document))
    (copy / "results.jsonl").write_text("\n".join([json.dumps(bad), *lines[1:]]) + "\n")
    text = report([copy], None).read_text()
    assert "<b>MemoryError" not in text and "&lt;b&gt;MemoryError" in text and "Failures (1)" in text
    assert "✗ failed in 1 frame" in text
    assert json.loads(scripts(text, "data-files")["0"]["results.jsonl"].splitlines()[0])["reason"] == bad["reason"]
    command = re.search(r'<code id="again-1">(.*?)</code>', text)[1]
    assert command == "shadowbench run plane_box -D frames=2 -D image.samples=4 --size 48x32 -a ptsv --frames 0"


@pytest.mark.parametrize("argv, expected", [
    ("shadowbench run s.yaml -a ptsv --frames 0:9 --resume --out x -D a=1", "shadowbench run s.yaml -D a=1"),
    ("shadowbench run --out=x s.yaml --repeats=3 -aptsv --plugin m.py", "shadowbench run s.yaml --plugin m.py"),
    ("shadowbench run s.yaml --quick", "shadowbench run s.yaml --size 48x32"),
])
def test_a_cell_runs_again_as_it_was(tmp_path, argv, expected):
    cell = a_cell(label="ptsv+branching=16+skip_shadowed=False",
                  params={"branching": 16, "group": 1, "skip_shadowed": False})
    command = commands.again(a_run(tmp_path, [cell], argv.split()), cell)
    assert command == f"{expected} -a 'ptsv[branching=16,skip_shadowed=false]' --frames 0"


def test_other_commands_run_a_cell_from_the_resolved_scene(tmp_path):
    command = commands.again(a_run(tmp_path, [a_cell()], ["shadowbench", "reproduce", "all"]), a_cell())
    assert command == f"shadowbench run {tmp_path}/config.resolved.yaml -a ptsv --frames 0"


def test_a_run_with_nothing_measured_still_has_a_page(tmp_path):
    from shadowbench.report.html import Pictures, render

    document = json.loads(json.dumps({
        "argv": ["shadowbench"], "scene": "s", "image": {"width": 4, "height": 4, "samples": 1}, "frames": [0], "threads": 1,
        "created": "2026-01-01T00:00:00Z", "status": "interrupted", "repeats": 1, "git": {"commit": None},
        "processor": {"model": "m", "cores": 1}, "threading_layer": "x", "packages": {}, "bias": 1e-5, "seeds": [],
        "digests": {}, "cells": {"planned": 2, "done": 0, "failed": 0, "unsupported": 0}}))
    for cells in ([], [a_cell(status="unsupported", reason="no")]):
        run = Run(tmp_path, "run", document, cells)
        assert "<h2>Summary</h2>" in render([run], series_of([run]), Pictures())


def test_summary_sentences_name_the_cheapest_right_method(run_folder):
    methods = [summarise(s) for s in series_of(read_runs([run_folder]))]
    assert [m.verdict for m in methods] == ["right", "wrong", "right"] and methods[1].worst_frame in (0, 1)
    told = sentences(methods)
    assert told[0].startswith("ptsv gives the reference's answer") and len(told) == 2


def test_short_names_tell_folders_apart(tmp_path):
    assert short_names([tmp_path / "a" / "x", tmp_path / "b" / "x"]) == ["a/x", "b/x"]
    assert short_names([tmp_path / "a", tmp_path / "b"]) == ["a", "b"]


def test_embedded_json_ends_no_script():
    text = embed({"a": "</script><!--"})
    assert "<" not in text and json.loads(text) == {"a": "</script><!--"}


def test_ticks_are_round_and_inside():
    for kind, values in (("linear", [3.7]), ("linear", [1e-4]), ("log", [3.0, 5.0]), ("log", [1.0, 1e9]),
                         ("symlog", [0, 7])):
        scale = svg.fit(kind, values, 0.0, 100.0)
        marks = svg.ticks(scale)
        assert 2 <= len(marks) <= 8 and all(-1e-9 <= scale(mark) <= 100 + 1e-9 for mark in marks)
        assert all(0 <= scale(value) <= 100 for value in values)
        assert sorted(marks) == marks


def test_triangle_work_sorts_into_classes():
    record = triangle_work(np.array([0, 1, 3, 2, 4, 0, 700]))
    assert record.triangles == [2, 1, 2, 1, 0, 0, 0, 0, 0, 0, 1] and record.work[2] == 5 and sum(record.work) == 710
    assert record.heaviest == [(6, 700), (4, 4), (2, 3), (3, 2), (1, 1)]
    assert triangle_work(np.zeros(0, np.int64)).triangles == [0]
