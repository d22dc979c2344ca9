"""Measuring for `reproduce`: through the same code as `run`, kept cell by cell, resumed after a kill."""

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from shadowbench import image_io, plan, runner
from shadowbench.cli import cli
from shadowbench.reproduce import sintorn2011
from shadowbench.reproduce.items import Claim, Item, Measurement, at_least, at_most
from shadowbench.reproduce.measure import MeasurementError, _scene, measure, pictures_of
from shadowbench.reproduce.rows import cell_rows, mean, read_csv
from shadowbench.reproduce.store import CellStore, Origin
from shadowbench.scenes import villa
from shadowbench.scenes.loader import load_scene

HERE = Origin("abc", "a processor", 1)
SMALL = Measurement("plane_box", 32, (0, 1), ("reference", "ptsv"), n_frames=2, repeats=1)
ITEM = Item("S11.test", "sintorn2011", "A box", "nowhere", "A box.", full=(SMALL,), quick=(SMALL,),
            rows=cell_rows("test_and_set", "seconds"),
            claims=(Claim("takes time", "some", lambda rows: mean(rows, "seconds", method="ptsv"), at_least(0.0),
                          at_least(0.0), " s"),
                    Claim("takes none", "none", lambda rows: mean(rows, "test_and_set", method="ptsv"), at_most(0.0),
                          at_most(0.0), "", "It does work")))


@pytest.fixture
def measured_cells(monkeypatch):
    """Frames and labels of the cells that are measured, in order."""
    done = []
    plain = runner.Measurer._run_cell

    def run_cell(self, cell, *rest):
        done.append((cell.frame, cell.label))
        return plain(self, cell, *rest)

    monkeypatch.setattr(runner.Measurer, "_run_cell", run_cell)
    return done


def test_cells_are_measured_once(tmp_path, measured_cells):
    first = measure([SMALL], CellStore(tmp_path, HERE))
    assert measured_cells == [(0, "reference"), (0, "ptsv"), (1, "reference"), (1, "ptsv")]
    assert [(m.cell.frame, m.cell.label) for m in first.measured] == measured_cells and first.origins == [HERE]
    assert all(m.cell.counts["test_and_set"] and len(m.cell.total_seconds) == 1 and m.cell.accuracy for m in first.measured)
    again = measure([SMALL], CellStore(tmp_path, HERE))
    assert len(measured_cells) == 4 and again == first


def test_a_killed_measurement_goes_on(tmp_path, measured_cells, monkeypatch):
    """Stopped after three cells, the third of which only half reached the file: two are reused."""
    plain = CellStore.add

    def stop_at_third(self, cell, warm_up):
        plain(self, cell, warm_up)
        if len(measured_cells) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(CellStore, "add", stop_at_third)
    with pytest.raises(KeyboardInterrupt):
        measure([SMALL], CellStore(tmp_path, HERE))
    file = tmp_path / "cells.jsonl"
    file.write_text(file.read_text()[:-20])
    monkeypatch.setattr(CellStore, "add", plain)
    measured_cells.clear()
    measure([SMALL], CellStore(tmp_path, HERE))
    assert measured_cells == [(1, "reference"), (1, "ptsv")]
    measured_cells.clear()
    measure([SMALL], CellStore(tmp_path, HERE))
    assert measured_cells == [] and len(file.read_text().splitlines()) == 5


def test_a_kept_cell_serves_only_what_it_has(tmp_path, measured_cells):
    one = dataclasses.replace(SMALL, frames=(0,), methods=("ptsv",), repeats=0, verify=False)
    for origin, wanted, fresh in (
            (HERE, one, True), (Origin("other commit", "another", 4), one, False),             # counts are counts
            (HERE, dataclasses.replace(one, verify=True), True), (HERE, one, False),
            (HERE, dataclasses.replace(one, repeats=1, warm_up=False), True),
            (HERE, dataclasses.replace(one, repeats=1), True),                                 # timed without warm-up
            (Origin("abc", "another", 1), dataclasses.replace(one, repeats=1), True),          # another machine's time
            (HERE, dataclasses.replace(one, repeats=1), False), (HERE, dataclasses.replace(one, repeats=2), True),
            (HERE, dataclasses.replace(one, verify=True, images=True), True),
            (HERE, dataclasses.replace(one, verify=True, images=True), False)):
        measured_cells.clear()
        cells = measure([wanted], CellStore(tmp_path, origin)).measured
        assert bool(measured_cells) == fresh, (origin, wanted)
    pictures = pictures_of(cells, CellStore(tmp_path, HERE))
    assert {"heatmap", "shaded", "shadow_exr", "gbuffer_exr"} <= set(pictures["ptsv"])
    assert all(file.exists() for file in pictures["ptsv"].values())
    pictures["ptsv"]["heatmap"].unlink()
    measured_cells.clear()
    measure([wanted], CellStore(tmp_path, HERE))
    assert measured_cells


def test_images_of_any_shape_and_scenes_of_any_count(tmp_path):
    """The view samples belong to their own frame; the image is as wide and as high as asked for."""
    wanted = dataclasses.replace(SMALL, scene="villa", frames=(0, 1), methods=("ptsv",), repeats=0, size=32, height=16,
                                 triangles=villa.MINIMUM, verify=False)
    cells = measure([wanted], CellStore(tmp_path, HERE)).measured
    assert [each.cell.frame for each in cells] == [0, 1] and cells[0].cell.key != cells[1].cell.key
    scene, _ = _scene("villa", 32, 16, 2, villa.MINIMUM)
    assert (scene.image.width, scene.image.height) == (32, 16) and scene.mesh(0).n_triangles == villa.MINIMUM
    box = dataclasses.replace(SMALL, methods=("ptsv",), height=16, images=True)
    kept = CellStore(tmp_path, HERE)
    files = [pictures_of([each], kept)["ptsv"]["gbuffer_exr"] for each in measure([box], kept).measured]
    depths = [image_io.read_exr(file)["depth"] for file in files]
    assert depths[0].shape == (16, 32) and files[0] != files[1]


def test_a_failed_cell_is_told_and_not_kept(tmp_path, monkeypatch):
    from shadowbench.algorithms.ptsv import Ptsv

    monkeypatch.setattr(Ptsv, "shadows", lambda self, frame, probe: 1 // 0)
    with pytest.raises(MeasurementError, match="plane_box frame 0 ptsv: failed: ZeroDivisionError"):
        measure([SMALL], CellStore(tmp_path, HERE))
    assert [json.loads(line)["cell"]["label"] for line in (tmp_path / "cells.jsonl").read_text().splitlines()] == [
        "reference", "reference"]


def test_a_key_depends_on_the_generators_source(monkeypatch):
    def key():
        scene = load_scene("plane_box")
        return plan.plan_cells(scene, [("reference", plan.ALGORITHMS["reference"].load().Params())], [0])[0].key

    before, plain = key(), plan.source_digest
    assert key() == before
    monkeypatch.setattr(plan, "source_digest", lambda path: plain(path) + path.name * (path.name == "analytic.py"))
    assert key() != before


def test_pictures_need_the_reference():
    with pytest.raises(ValueError, match="pictures show errors"):
        plan.RunOptions((0,), verify=False)


@pytest.fixture
def one_item(monkeypatch):
    """The command with one small item, and one whose cells fail."""
    fails = dataclasses.replace(SMALL, frames=(0,), methods=("embree",))
    broken = dataclasses.replace(ITEM, id="S11.broken", quick=(fails,))
    monkeypatch.setattr(sintorn2011, "ITEMS", (broken, ITEM))
    return CliRunner()


def test_command_prints_published_beside_measured(one_item, tmp_path):
    done = one_item.invoke(cli, ["reproduce", "sintorn2011/S11.test", "--quick", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    folder = tmp_path / "out" / "sintorn2011" / "S11.test"
    rows = read_csv(folder / "data.csv")
    work = mean(rows, "test_and_set", method="ptsv")
    assert work > 0
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["takes", "none", "none", f"{work:.3g}", "does", "not", "hold"] in lines
    assert f"does not hold: takes none: {work:.3g} is not at most 0. It does work" in done.stdout
    assert "--quick`" in (folder / "caption.md").read_text() and "`plane_box` (62 triangles)" in (
        folder / "caption.md").read_text()
    assert (tmp_path / "out" / "runs" / "reproduce" / "cells.jsonl").exists()


def test_command_keeps_other_items_when_one_fails(one_item, tmp_path, monkeypatch):
    from shadowbench.algorithms.embree import Embree

    monkeypatch.setattr(Embree, "unsupported", lambda self, scene: "not today")
    done = one_item.invoke(cli, ["reproduce", "sintorn2011", "--quick", "--out", str(tmp_path)])
    assert done.exit_code == 4
    assert "error: S11.broken: plane_box frame 0 embree: unsupported: not today" in done.stderr
    assert (tmp_path / "sintorn2011" / "S11.test" / "verdict.json").exists()
    assert not (tmp_path / "sintorn2011" / "S11.broken").exists()


def test_command_interrupted(one_item, tmp_path, monkeypatch):
    def stop(*rest):
        raise KeyboardInterrupt

    monkeypatch.setattr(runner.Measurer, "_run_cell", stop)
    done = one_item.invoke(cli, ["reproduce", "S11.test", "--quick", "--out", str(tmp_path)])
    assert done.exit_code == 130 and "goes on from there" in done.stderr


def test_list_and_help_are_light():
    """`reproduce list` shows every item and imports neither Numba nor matplotlib; unknown names are input errors."""
    script = ("import sys; from shadowbench.cli import cli; cli.main(sys.argv[1:], standalone_mode=False); "
              "print(sorted({'numba', 'matplotlib', 'numpy'} & set(sys.modules)), file=sys.stderr)")
    for arguments in (["reproduce", "list"], ["reproduce", "--help"]):
        done = subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=True)
        assert done.stderr == "[]\n"
    done = subprocess.run([sys.executable, "-m", "shadowbench", "reproduce", "sintorn20111"], capture_output=True, text=True)
    assert done.returncode == 2 and "did you mean 'sintorn2011'?" in done.stderr and "Traceback" not in done.stderr


def test_completion_offers_papers_and_items():
    from shadowbench.cli import ItemArgument

    offered = [item.value for item in ItemArgument().shell_complete(None, None, "sintorn2011")]
    assert offered[0] == "sintorn2011" and "sintorn2011/S11.F5" in offered


def test_results_runs_are_ignored_by_git():
    assert "results/runs/" in (Path(__file__).parent.parent / ".gitignore").read_text().split()
