import csv
import json
import os

import pytest

from shadowbench import results
from shadowbench.errors import InputError
from shadowbench.results import AccuracyRecord, CellResult, RunFolder, RunFolderError


def cell(frame=0, label="shadow_map", **more):
    accuracy = AccuracyRecord(samples=100, lit_candidates=50, shadowed=20, ambiguous=1, false_shadow=2, false_light=3,
                              edge_tie=1)
    fields = {"key": "k", "scene": "s", "frame": frame, "algorithm": label.partition("+")[0], "label": label,
              "params": {}, "status": "done", "counts": {"all_work": 12, "test_and_set": 5},
              "stages": {"map": [0.25, 0.5]}, "total_seconds": [0.3, 0.6], "accuracy": accuracy}
    return CellResult(**{**fields, **more})


def test_run_folder_round_trip(tmp_path):
    folder = RunFolder(tmp_path / "run", {"scene": "s"}, planned=2)
    cells = [cell(0), cell(1, status="failed", reason="ValueError: no")]
    for each in cells:
        folder.append(each)
    folder.write_status("partial")
    document, back = results.read_run(tmp_path / "run")
    assert back == cells
    assert document["status"] == "partial"
    assert document["cells"] == {"planned": 2, "done": 1, "unsupported": 0, "failed": 1}


def test_results_line_has_the_published_fields(tmp_path):
    folder = RunFolder(tmp_path / "run", {}, planned=1)
    folder.append(cell())
    line = json.loads((tmp_path / "run" / "results.jsonl").read_text())
    assert set(line) == {"schema", "key", "scene", "frame", "algorithm", "label", "params", "status", "reason",
                         "counts", "levels", "largest", "stages", "total_seconds", "jit_seconds", "wall_seconds",
                         "memory_bytes", "accuracy", "files", "triangles"}
    assert {"samples", "lit_candidates", "shadowed", "false_shadow", "false_light", "edge_tie"} <= set(line["accuracy"])


def test_counts_table_is_sorted_integers_whatever_the_order_of_cells():
    cells = [cell(1), cell(0), cell(0, "reference")]
    counts, _ = results.tables(cells)
    assert counts == results.tables(cells[::-1])[0]
    rows = list(csv.reader(counts.splitlines()))
    assert rows[0] == ["scene", "frame", "algorithm", "label", "counter", "value"]
    assert all(row[5].isdecimal() for row in rows[1:]) and rows[1:] == sorted(rows[1:])
    assert ["s", "0", "shadow_map", "shadow_map", "false_shadow", "2"] in rows


def test_a_peers_answers_stay_out_of_the_counts_table():
    counts, _ = results.tables([cell(0, "embree")])
    assert "test_and_set" in counts and "false_shadow" not in counts


def test_timings_table_has_a_row_per_stage_and_repeat():
    _, timings = results.tables([cell()])
    rows = list(csv.reader(timings.splitlines()))
    assert rows[0] == ["scene", "frame", "algorithm", "label", "stage", "repeat", "seconds"]
    assert [row[4:] for row in rows[1:]] == [["map", "0", "0.250000000"], ["map", "1", "0.500000000"],
                                             ["total", "0", "0.300000000"], ["total", "1", "0.600000000"]]


def test_a_line_cut_short_by_a_kill_is_left_out(tmp_path):
    folder = RunFolder(tmp_path / "run", {}, planned=2)
    folder.append(cell())
    with (tmp_path / "run" / "results.jsonl").open("a") as file:
        file.write('{"schema": 1, "key": "k", "sce')
    assert len(results.read_run(tmp_path / "run")[1]) == 1
    file = tmp_path / "run" / "results.jsonl"
    assert results.drop_torn_line(file) and file.read_text().count("\n") == 1
    assert not results.drop_torn_line(file) and not results.drop_torn_line(tmp_path / "none")


def test_of_a_cell_that_ran_again_the_last_result_counts(tmp_path):
    folder = RunFolder(tmp_path / "run", {}, planned=2)
    for each in (cell(status="failed", reason="no"), cell(1), cell()):
        folder.append(each)
    assert [(c.frame, c.status) for c in results.read_run(tmp_path / "run")[1]] == [(1, "done"), (0, "done")]


def test_a_line_that_is_no_cell_is_told_with_its_number(tmp_path):
    folder = RunFolder(tmp_path / "run", {}, planned=1)
    folder.append(cell())
    with (tmp_path / "run" / "results.jsonl").open("a") as file:
        file.write("\0\0\0\n")
    with pytest.raises(InputError, match=r"results\.jsonl:2: no result of a cell"):
        results.read_run(tmp_path / "run")


def test_a_run_folder_that_vanished_is_not_made_anew(tmp_path):
    folder = RunFolder(tmp_path / "run", {}, planned=1)
    (tmp_path / "run" / "run.json").unlink()
    (tmp_path / "run").rmdir()
    for step in (lambda: folder.append(cell()), lambda: folder.image_folder(0)):
        with pytest.raises(RunFolderError, match="vanished"):
            step()
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(("changed", "label"), [
    ({}, "ptsv"), ({"branching": 16}, "ptsv+branching=16"),
    ({"b": "x", "a": 1.5}, "ptsv+a=1.5+b=x"), ({"path": "a/b c"}, "ptsv+path=a-b-c")])
def test_labels_are_file_names(changed, label):
    assert results.make_label("ptsv", changed) == label


def test_long_labels_stay_short_and_distinct():
    labels = {results.make_label("ptsv", {f"parameter_{i}": i + extra for i in range(30)}) for extra in (0, 1)}
    assert len(labels) == 2 and all(len(label) <= 120 for label in labels)


def test_keys_depend_on_every_part():
    keys = {results.make_key(scene="a", frame=0), results.make_key(scene="a", frame=1),
            results.make_key(scene="b", frame=0)}
    assert len(keys) == 3 and results.make_key(frame=0, scene="a") in keys


def test_two_default_folders_in_one_second_differ(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first = results.default_folder("my scene/1")
    first.mkdir(parents=True)
    assert results.default_folder("my scene/1") != first and "/" not in first.name


def test_check_writable_leaves_nothing_behind(tmp_path):
    results.check_writable(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []


def test_check_writable_refuses_another_run(tmp_path):
    RunFolder(tmp_path / "run", {}, planned=0)
    with pytest.raises(InputError, match="already holds a run"):
        results.check_writable(tmp_path / "run")


def test_check_writable_refuses_a_path_through_a_file(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="not a folder"):
        results.check_writable(tmp_path / "file" / "run")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_check_writable_refuses_a_read_only_folder(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="cannot write"):
        results.check_writable(tmp_path / "run")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_disk_is_told_with_the_file_and_keeps_what_was_there(tmp_path):
    folder = RunFolder(tmp_path / "run", {}, planned=1)
    (tmp_path / "run" / "results.jsonl").symlink_to("/dev/full")
    with pytest.raises(RunFolderError, match=r"results\.jsonl: No space left on device"):
        folder.append(cell())
    assert (tmp_path / "run" / "run.json").exists()


@pytest.mark.parametrize(("content", "words"), [(None, "holds no run"), ("{", "cannot read"),
                                                ('{"schema": 99}', "schema 99")])
def test_reading_what_is_no_run(tmp_path, content, words):
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    with pytest.raises(InputError, match=words):
        results.read_run(tmp_path)
