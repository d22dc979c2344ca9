"""Comparing two runs: what counts as a change, and what as noise."""

import csv
import io
import json
import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench import image_io
from shadowbench.compare.times import DRIFT, compare_times, spread_text
from tests.command_line import call


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A run of two methods on two frames, and a copy of it to be changed."""
    folder = tmp_path_factory.mktemp("runs")
    done = call("run", "plane_box", "-D", "frames=2", "--size", "48x32", "--repeats", "3", "-a", "ptsv",
                "-a", "shadow_map[resolution=64]", "--out", folder / "a")
    assert done.code == 0, done.errors
    return folder


@pytest.fixture
def changed(runs, tmp_path):
    """A copy of the run, with a function that changes its cells."""
    shutil.copytree(runs / "a", tmp_path / "b")

    def change(edit, document=None):
        lines = [json.loads(line) for line in (tmp_path / "b" / "results.jsonl").read_text().splitlines()]
        kept = [cell for cell in lines if edit(cell) is not False]
        (tmp_path / "b" / "results.jsonl").write_text("".join(json.dumps(cell) + "\n" for cell in kept))
        run = json.loads((tmp_path / "b" / "run.json").read_text()) | (document or {})
        (tmp_path / "b" / "run.json").write_text(json.dumps(run))
        return tmp_path / "b"

    return change


def times(factor):
    """An edit that sets every cell's times to a factor of plain ones."""
    def edit(cell):
        cell["total_seconds"] = [factor * seconds for seconds in (0.010, 0.0101, 0.0102)]
    return edit


def test_a_run_is_the_same_as_itself(runs):
    done = call("compare", runs / "a", runs / "a" / ".." / "a")
    assert done.code == 2                                                # the same folder twice is a mistake
    shutil.copytree(runs / "a", runs / "same")
    done = call("compare", runs / "a", runs / "same")
    assert done.code == 0 and done.output.count(" same ") == 2 and done.output.count(" noise ") == 2
    assert "0 of 2" in done.output and "changed, " not in done.output and "Pictures that changed" not in done.output
    rows = list(csv.DictReader(io.StringIO(call("compare", runs / "a", runs / "same", "--format", "csv").output)))
    assert {row["verdict"] for row in rows} == {"same", "noise"}
    assert {row["kind"] for row in rows} == {"status", "count", "accuracy", "memory", "time", "picture"}


def test_a_changed_count_is_told_with_its_share(runs, changed):
    def edit(cell):
        if cell["algorithm"] == "ptsv" and cell["frame"] == 1:
            cell["counts"]["node_tests"] *= 2
    folder = changed(edit)
    text = call("compare", runs / "a", folder).output
    row = next(line for line in text.splitlines() if " node_tests " in line)
    assert row.split()[0] == "ptsv" and row.split()[-1] == "1" and "+50.00 %" in row
    assert "1 changed" in text
    markdown = call("compare", runs / "a", folder, "--format", "md").output
    assert "| `ptsv` | node_tests |" in markdown and "### Counts that changed" in markdown


@pytest.mark.parametrize("factor, verdict", [(0.5, "faster"), (2.0, "slower"), (1.0 + 0.9 * DRIFT, "noise")])
def test_times_are_judged_by_spread_and_drift(runs, changed, tmp_path, factor, verdict):
    changed(times(1.0))
    shutil.copytree(tmp_path / "b", tmp_path / "a")
    folder = changed(times(factor))
    text = call("compare", tmp_path / "a", folder).output
    assert text.count(f" {verdict} ") == 2 and f"{100 * (factor - 1):+.1f} %" in text


def test_changed_pictures_and_answers(runs, changed):
    def edit(cell):
        if cell["algorithm"] == "shadow_map" and cell["frame"] == 0:
            cell["accuracy"]["false_light"] += 7
    folder = changed(edit)
    file = folder / "frames" / "0000" / "shadow_map+resolution=64" / "shadow.exr"
    channels = image_io.read_exr(file)
    channels["shadow"][3, 4:9] = 1.0 - channels["shadow"][3, 4:9]
    image_io.write_exr(file, {name: values.astype(np.int64) if name != "shadow" else values
                              for name, values in channels.items()})
    shaded = folder / "frames" / "0000" / "shadow_map+resolution=64" / "shaded.png"
    image_io.write_png(shaded, np.zeros((4, 4, 3), np.uint8))
    text = call("compare", runs / "a", folder).output
    assert "1 of 2" in text
    rows = [line.split() for line in text.splitlines()]
    assert ["shadow_map+resolution=64", "0", "shadow", "buffer", "5"] in [[w for w in row if w] for row in rows]
    assert "other size" in text and "false_light" in text


def test_cells_of_one_run_and_other_circumstances_are_told(runs, changed):
    folder = changed(lambda cell: cell["algorithm"] == "ptsv", {"threads": 99})
    text = call("compare", runs / "a", folder).output
    assert "the number of threads differs: times can't be compared" in text
    assert "Cells of one run only" in text
    assert text.rstrip().splitlines()[-3].split() == ["shadow_map+resolution=64", "2", "A"]
    nothing = changed(lambda cell: cell.update(scene="other"))
    done = call("compare", runs / "a", nothing)
    assert done.code == 5 and "in common" in done.errors


def test_failed_cells_are_told(runs, changed):
    folder = changed(lambda cell: cell.update(status="failed", reason="x", counts={}, accuracy=None, total_seconds=[]))
    text = call("compare", runs / "a", folder).output
    assert "Outcomes that changed" in text and "not timed" in text and "not counted" in text


@settings(deadline=None, max_examples=60)
@given(st.lists(st.floats(1e-4, 10.0), max_size=5), st.lists(st.floats(1e-4, 10.0), max_size=5))
def test_time_verdicts_are_antisymmetric_and_never_claim_too_much(a, b):
    one, other = compare_times(a, b), compare_times(b, a)
    mirrored = {"faster": "slower", "slower": "faster"}
    assert other.verdict == mirrored.get(one.verdict, one.verdict)
    if one.verdict in mirrored:
        assert min(len(a), len(b)) >= 3 and (max(a) < min(b) or max(b) < min(a))
        assert (one.change > 0) == (one.verdict == "slower")


def test_spread_text():
    assert spread_text([0.001, 0.002, 0.004]) == "2.00 ±1.50" and spread_text([]) == ""
