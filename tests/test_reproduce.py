"""Items to reproduce: what each is made of, from made-up cells to its folder; the committed results; verdicts; rows."""

import dataclasses
import json
import re
import zlib
from pathlib import Path

import numpy as np
import pytest

from shadowbench import image_io
from shadowbench.algorithm_specs import parse_algorithm_spec, validate_params
from shadowbench.algorithms import ALGORITHMS
from shadowbench.errors import InputError
from shadowbench.report.pictures import LEGEND_ROWS
from shadowbench.reproduce import ALL_PAPERS, all_items, find_items, tiles
from shadowbench.reproduce.items import Claim, Measured, Measurement, Range, about, at_least, at_most
from shadowbench.reproduce.mosaic import Tile
from shadowbench.reproduce.output import (
    Circumstances,
    latex_table,
    markdown_table,
    redraw,
    verdict_json,
    verdict_table,
    write_item,
)
from shadowbench.reproduce.overview import overall, reason, write_overview
from shadowbench.reproduce.rows import cell_rows, mean, read_csv, to_csv, values, variation
from shadowbench.reproduce.store import Origin
from shadowbench.results import AccuracyRecord, CellResult, make_label
from shadowbench.scenes import SCENES

RESULTS = Path(__file__).parent.parent / "results"
FAILING_ON_PURPOSE = ("eye_count=off", "stencil_bits=8")
DRAWN_TWICE = ("S11.F5", "Sen.F7")
ITEMS = pytest.mark.parametrize("item", all_items(), ids=lambda item: item.id)


class MadeUp(dict):
    """A dictionary with a number for every name, the same every time."""

    def __init__(self, seed):
        self.seed = seed

    def __missing__(self, name):
        return zlib.crc32(f"{self.seed} {name}".encode()) % 10**6 + 1

    def get(self, name, default=None):
        return self[name]


class MadeUpTimes(dict):
    """Times for every stage, each less than the whole."""

    def __init__(self, numbers):
        self.numbers = numbers

    def get(self, name, default=None):
        return [min(self.numbers[f"stage {name}"], self.numbers["seconds"]) * 0.5e-6]


def made_up(measurement):
    """Cells of a measurement with numbers that nobody measured."""
    cells = []
    for frame in measurement.frames:
        for method in measurement.methods:
            name, params = parse_algorithm_spec(method)
            label = make_label(name, validate_params(name, params).model_dump(exclude_defaults=True))
            numbers = MadeUp((measurement.scene, measurement.size, measurement.triangles, measurement.light, frame, label))
            levels = {"node_tests", "refinements"} | ({"fruitless_refinements"} if name == "ptsv" else set())
            cells.append(Measured(measurement, CellResult.model_construct(
                key=label, scene=measurement.scene, frame=frame, algorithm=name, label=label, status="done", params=params,
                counts=numbers, memory_bytes=numbers, stages=MadeUpTimes(numbers), total_seconds=[numbers["seconds"] * 1e-6],
                levels={kind: [numbers[f"{kind}{level}"] for level in range(3)] for kind in sorted(levels)},
                largest={"iterations": [10**7 - 1000 * i + numbers["job"] for i in range(20)]},
                accuracy=AccuracyRecord(samples=9, lit_candidates=9, shadowed=1, ambiguous=0, false_shadow=2, false_light=1,
                                        edge_tie=0))))
    return cells


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    """A file for every picture that an item asks for: a PNG file, or an EXR file with all channels."""
    rng, folder = np.random.default_rng(0), tmp_path_factory.mktemp("picture")
    image_io.write_png(folder / "picture.png", rng.integers(0, 255, (40, 30, 3), dtype=np.uint8))
    image_io.write_png(folder / "legend.png", rng.integers(0, 255, (40 + LEGEND_ROWS, 30, 3), dtype=np.uint8))
    image_io.write_exr(folder / "picture.exr", {
        "depth": np.where(np.arange(40)[:, None] < 10, 5.0, 1.0 + rng.random((40, 30))).astype(np.float32),
        "candidate": np.ones((40, 30), np.uint32), "tests": rng.integers(1, 9, (40, 30), np.uint32),
        "shadow": rng.integers(0, 2, (40, 30)).astype(np.float32), "error": rng.integers(0, 4, (40, 30), np.uint32)})
    return folder


class Pictures(dict):
    """The same picture for every view and kind: a name without a suffix is a view, which holds pictures."""

    def __init__(self, folder):
        self.folder = folder

    def __bool__(self):
        return True

    def __missing__(self, name):
        if "exr" in name:
            return self.folder / "picture.exr"
        if name in ("heatmap", "error"):
            return self.folder / "legend.png"
        return self if "/" in name or "+" in name or name in ALGORITHMS else self.folder / "picture.png"


@ITEMS
def test_item_says_what_it_is(item):
    assert item.paper in [paper.name for paper in ALL_PAPERS] and re.fullmatch(r"[A-Za-z0-9.]+", item.id)
    assert item.title and item.source and item.shows and item.claims
    for measurement in (*item.full, *item.quick):
        assert measurement.scene in SCENES and max(measurement.frames) < measurement.n_frames
    assert all(claim.partly.low <= claim.holds.low and claim.holds.high <= claim.partly.high for claim in item.claims)


def test_ids_are_unique():
    ids = [item.id for item in all_items()]
    assert len(set(ids)) == len(ids) > 0


@ITEMS
@pytest.mark.parametrize("size", ["full", "quick"])
def test_item_from_cells_to_folder(item, size, tmp_path, picture):
    """Every file is there, the verdicts follow from data.csv alone, and the same cells give the same bytes.

    Figures, which take a second each, are drawn once per item, and twice for a few.
    """
    if size == "full":
        item = dataclasses.replace(item, plot=None)
    cells = [cell for measurement in getattr(item, size) for cell in made_up(measurement)]
    folders = [tmp_path / "a", tmp_path / "b"] if size == "quick" and item.id in DRAWN_TWICE else [tmp_path / "a"]
    pictures = Pictures(picture)
    circumstances = Circumstances(f"shadowbench reproduce {item.paper}/{item.id}", [Origin("abc", "a processor", 2)])
    for folder in folders:
        verdicts = write_item(item, cells, pictures, folder, circumstances)
    files = {path.name for path in folders[0].iterdir()}
    assert {"data.csv", "table.md", "table.tex", "caption.md", "verdict.json", "thumbnail.png"} <= files
    assert ({"figure.svg", "figure.pdf", "figure.png"} <= files) == (item.plot is not None)
    check_folder(item, folders[0])
    assert item.judge(read_csv(folders[0] / "data.csv")) == verdicts
    text = verdict_table(item, verdicts)
    for claim, verdict in zip(item.claims, verdicts, strict=True):
        assert claim.text in text and claim.published in text and verdict.measured in text
    for folder in folders[1:]:
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == {
            path.name: path.read_bytes() for path in folders[0].iterdir()}


def check_folder(item, folder):
    """The verdicts and the table follow from the data; the caption names what a reader needs."""
    verdicts = item.judge(read_csv(folder / "data.csv"))
    assert (folder / "verdict.json").read_text() == verdict_json(item, verdicts)
    assert (folder / "table.md").read_text() == markdown_table(verdicts)
    assert (folder / "table.tex").read_text() == latex_table(verdicts)
    caption = (folder / "caption.md").read_text()
    for measurement in item.full:
        assert f"`{measurement.scene}`" in caption
    assert "stand-in" in caption and f"`shadowbench reproduce {item.paper}/{item.id}" in caption
    assert "commit " in caption and "thread" in caption and item.shows.strip() in caption
    assert all((verdict.verdict == "holds") != (f"{verdict.claim}: {verdict.why}." in caption) for verdict in verdicts)


@ITEMS
def test_committed_results_are_whole(item):
    """The results in the repository are of full size, and every verdict is recomputed from the data beside it."""
    folder = RESULTS / item.paper / item.id
    check_folder(item, folder)
    caption = (folder / "caption.md").read_text()
    assert "--quick" not in caption and "dirty" not in caption
    for suffix in ("svg", "pdf", "png"):
        assert (folder / f"figure.{suffix}").exists() == (item.plot is not None)
    assert f"]({item.paper}/{item.id}/caption.md)" in (RESULTS / "README.md").read_text()
    assert all(path.stat().st_size < 2 * 2**20 for path in folder.iterdir())
    rows = read_csv(folder / "data.csv")
    expected = {(m.scene, m.size, frame) for m in item.full for frame in m.frames}
    assert {(row["scene"], row["size"], row["frame"]) for row in rows} == expected
    assert all(row.get("wrong", 0) == 0 for row in rows if ALGORITHMS[row["method"].partition("+")[0]].exact
               and not row["method"].endswith(FAILING_ON_PURPOSE))
    verdicts = json.loads((folder / "verdict.json").read_text())["verdicts"]
    assert [v["claim"] for v in verdicts] == [claim.text for claim in item.claims]
    unexplained = [v["claim"] for v, claim in zip(verdicts, item.claims, strict=True)
                   if v["verdict"] != "holds" and not claim.otherwise]
    assert not unexplained


@pytest.mark.parametrize(("value", "verdict"), [(2.0, "holds"), (4.0, "holds"), (1.9, "holds in part"),
                                                (8.0, "holds in part"), (8.1, "does not hold"),
                                                (float("nan"), "does not hold")])
def test_verdict_by_two_ranges(value, verdict):
    claim = Claim("text", "2 to 4x", lambda rows: value, Range(2, 4), Range(1, 8), otherwise="Because.")
    result = claim.judge([])
    assert result.verdict == verdict and result.measured == f"{value:.3g}x"
    assert "within 2 to 4" in result.why
    assert ("Because." in result.why) == (verdict != "holds")


def test_ranges():
    assert 1.9 not in at_least(2.0) and 2.0 in at_least(2.0) and str(at_least(2.0)) == "at least 2"
    assert 2.1 not in at_most(2.0) and 2.0 in at_most(2.0) and str(at_most(2.0)) == "at most 2"
    assert 1.5 in about(2.0, 0.25) and 2.5 in about(2.0, 0.25) and 1.49 not in about(2.0, 0.25)
    claim = Claim("", "", lambda rows: 1.0, at_least(2.0), at_least(2.0))
    assert claim.judge([]).why == "1x is not at least 2"


def test_rows_hold_what_was_asked_for():
    cell = made_up(Measurement("citadel", 64, (3,), ("ptsv[branching=16]",), published_size=1024))[0]
    cell.cell.total_seconds, cell.cell.stages = [3.0, 1.0, 2.0], {"merge": [0.5, 0.25, 0.75]}
    row, = cell_rows("seconds", "stage.merge", "stage.none", "wrong", "memory.x", "node_tests.level", "sample_tests")([cell])
    counts = cell.cell.counts
    assert row == {"scene": "citadel", "size": 64, "published_size": 1024, "frame": 3, "method": "ptsv+branching=16",
                   "seconds": 2.0, "stage.merge": 0.5, "stage.none": 0.0, "wrong": 3, "memory.x": counts["x"],
                   "node_tests.0": counts["node_tests0"], "node_tests.1": counts["node_tests1"],
                   "node_tests.2": counts["node_tests2"], "sample_tests": counts["sample_tests"]}


def test_rows_say_what_is_unusual_about_the_image():
    plain, tall, few = (made_up(Measurement("gate", 64, (0,), ("ptsv",), height=height, triangles=triangles))[0]
                        for height, triangles in ((0, 0), (36, 0), (0, 9)))
    assert [cell.measurement.shape for cell in (plain, tall, few)] == [(64, 64), (64, 36), (64, 64)]
    first, second, third = cell_rows("sample_tests")([plain, tall, few])
    assert second == {**first, "height": 36} and third["triangles"] == 9 and "height" not in third
    assert values([first, third], "sample_tests", triangles=9) == [third["sample_tests"]]


def test_csv_comes_back(tmp_path):
    rows = [{"a": 1, "b": "x, y", "c": 0.5}, {"a": 2**60, "d": 1e-9}]
    (tmp_path / "data.csv").write_text(to_csv(rows))
    assert read_csv(tmp_path / "data.csv") == rows


def test_sums_over_rows():
    rows = [{"m": "a", "s": 1, "v": 2}, {"m": "a", "s": 1, "v": 4}, {"m": "b", "s": 1, "v": 9}]
    assert values(rows, "v", m="a") == [2.0, 4.0] and mean(rows, "v", m="a", s=1) == 3.0
    assert variation(rows, "v", m="a") == pytest.approx(1 / 3)
    with pytest.raises(LookupError, match="no row with"):
        mean(rows, "v", m="c")


def test_items_are_found_by_paper_and_name():
    assert [item.id for item in find_items("all")] == [item.id for item in all_items()]
    assert {item.paper for item in find_items("sintorn2011")} == {"sintorn2011"}
    assert [i.id for i in find_items("sintorn2011/S11.F5")] == [i.id for i in find_items("S11.F5")] == ["S11.F5"]


@pytest.mark.parametrize(("what", "meant"), [("sintorn20111", "'sintorn2011'"), ("sintorn2011/F5", "'sintorn2011/S11.F5'"),
                                             ("s11.f5", "'S11.F5'"), ("al", "'all'"), ("new/N66", "'new/N6'")])
def test_unknown_items_are_told_what_was_meant(what, meant):
    with pytest.raises(InputError, match=f"did you mean {re.escape(meant)}"):
        find_items(what)


def test_results_fit_the_repository():
    sizes = [path.stat().st_size for path in RESULTS.rglob("*") if path.is_file() and "runs" not in path.parts]
    assert sum(sizes) < 60 * 2**20


def small_item(item_id="S14.C1"):
    item, = find_items(item_id)
    return item, [cell for measurement in item.quick for cell in made_up(measurement)]


def test_redrawing_measures_nothing_and_keeps_the_origin(tmp_path):
    item, cells = small_item()
    write_item(item, cells, {}, tmp_path, Circumstances("shadowbench reproduce x", [Origin("abc", "a processor", 2)]))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    (tmp_path / "table.tex").unlink()
    (tmp_path / "verdict.json").write_text("{}")
    assert redraw(item, tmp_path) == item.judge(read_csv(tmp_path / "data.csv"))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    with pytest.raises(OSError, match="caption"):
        redraw(item, tmp_path / "elsewhere")


def test_latex_escapes_what_it_would_read():
    claim = Claim("a_b & 5 % of {x} ~ #1", "$2 ^ 3$", lambda rows: 1.0, at_most(1.0), at_most(1.0), " %")
    line = latex_table([claim.judge([])]).splitlines()[4]
    assert line == (r"a\_b \& 5 \% of \{x\} \textasciitilde{} \#1 & \$2 \textasciicircum{} 3\$ & 1 \% & holds \\")


def verdicts_of(*outcomes):
    return [{"verdict": o, "claim": f"claim {i}", "measured": "1x", "published": "2x", "why": f"because {i}"}
            for i, o in enumerate(outcomes)]


@pytest.mark.parametrize(("outcomes", "summary", "line"), [
    (("holds", "holds"), "**holds**", "claim 0: 1x (published: 2x)"),
    (("holds", "holds in part"), "**holds in part**: 1 of 2 claims", "claim 1: because 1"),
    (("holds in part", "does not hold"), "**holds in part**: 0 of 2 claims", "claim 1: because 1"),
    (("does not hold",), "**does not hold**", "claim 0: because 0")])
def test_an_items_verdict_sums_up_its_claims(outcomes, summary, line):
    assert overall(verdicts_of(*outcomes)) == summary and reason(verdicts_of(*outcomes)) == line


def test_the_overview_lists_what_is_there_and_names_what_is_not(tmp_path):
    item, cells = small_item()
    write_item(item, cells, {}, tmp_path / item.paper / item.id, Circumstances("x", [Origin("abc", "a processor", 2)]))
    write_overview(tmp_path)
    text = (tmp_path / "README.md").read_text()
    assert f"**[{item.id}]({item.paper}/{item.id}/caption.md)** {item.title}" in text
    assert f'src="{item.paper}/{item.id}/thumbnail.png"' in text and f"{len(item.claims)} claims: " in text
    missing = re.search(r"Not reproduced here: (.*)\.", text)[1].split(", ")
    assert missing == [other.id for other in all_items() if other.id != item.id]


def test_every_published_item_is_listed():
    """The ids of the list of figures, tables and claims that the project set out to reproduce."""
    ids = {item.id for item in all_items()}
    expected = {"sintorn2011": "F5 F7t F7o C1 C2 C3", "sintorn2014": "F1 F3 F5 F6 F7 F8 F9 C1",
                "sen2003": "F1 T1 C1 F6 F7 F8 F9 F10 C2", "chan2004": "F5 F6 F8 F9 F10 F11 F12 C1",
                "hertel2009": "T1 T2 F3 F4 F5"}
    prefix = {"sintorn2011": "S11", "sintorn2014": "S14", "sen2003": "Sen", "chan2004": "Ch", "hertel2009": "He"}
    wanted = {f"{prefix[paper]}.{name}" for paper, names in expected.items() for name in names.split()}
    assert wanted | {f"N{k}" for k in range(1, 7)} <= ids


def test_tiles_cut_and_mark(tmp_path):
    pixels = np.zeros((10, 20, 3), np.uint8)
    errors = np.zeros((10, 20), np.uint32)
    errors[2, 5], errors[7, 15], errors[0, 0] = 1, 2, 3
    image_io.write_png(tmp_path / "a.png", pixels)
    image_io.write_exr(tmp_path / "s.exr", {"error": errors, "tests": errors})
    files = {"v": {"shaded": tmp_path / "a.png", "shadow_exr": tmp_path / "s.exr"}}
    left = tiles.tile_pixels(Tile("v", "", crop=(0.0, 0.0, 0.5, 1.0), marks=True), files)
    assert left.shape == (10, 10, 3) and left[2, 5].tolist() == [230, 28, 36] and left.sum() == 230 + 28 + 36
    assert tiles.count_errors(tmp_path / "s.exr", (0.5, 0.5, 1.0, 1.0)) == (0, 1)
    assert tiles.count_errors(tmp_path / "s.exr", (0.0, 0.0, 1.0, 1.0)) == (1, 1)
    assert tiles.share_tested(tmp_path / "s.exr") == pytest.approx(3 / 200)


def test_triangle_tests_are_coloured_by_answer(tmp_path):
    shadow = np.array([[1.0, 0.0, 0.0]], np.float32)
    image_io.write_exr(tmp_path / "s.exr", {"shadow": shadow, "tests": np.array([[63, 0, 9]], np.uint32)})
    image_io.write_exr(tmp_path / "g.exr", {"candidate": np.array([[1, 1, 0]], np.uint32)})
    red, green, black = tiles.color_tests(tmp_path / "s.exr", tmp_path / "g.exr")[0].astype(int)
    assert red[0] > 240 > 100 > red[1] and green[1] > green[0] and green.max() < 40 and black.max() == 0
