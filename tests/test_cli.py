"""The command line, run as a user runs it: in its own process, or through `main` where no process is needed."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from shadowbench import image_io

SMALL = ["--size", "64x48", "--repeats", "1"]


def shadowbench(*arguments, cwd, **environment):
    """Run the command; returns the finished process with its texts."""
    return subprocess.run([sys.executable, "-m", "shadowbench", *map(str, arguments)], cwd=cwd, text=True,
                          capture_output=True, env={**os.environ, **environment}, timeout=600)


def clear_error(done, *words):
    """True if the command ended with exit code 2, one clear message and no traceback."""
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr, done.stderr
    return True


@pytest.fixture(scope="module")
def finished_run(tmp_path_factory):
    """One run of two algorithms on two analytic scenes."""
    folder = tmp_path_factory.mktemp("run")
    done = shadowbench("run", "plane_box", "-a", "reference", "-a", "shadow_map[resolution=256]", *SMALL,
                       "--out", "out", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "out", done


def test_run_writes_every_file_of_the_contract(finished_run):
    out, done = finished_run
    names = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    label = "shadow_map+resolution=256"
    assert {"run.json", "config.input.yaml", "config.resolved.yaml", "results.jsonl", "counts.csv", "timings.csv",
            "report.html", "frames/0000/gbuffer.exr", f"frames/0000/{label}/shadow.exr",
            f"frames/0000/{label}/shaded.png", f"frames/0000/{label}/shadow.png", f"frames/0000/{label}/heatmap.png",
            f"frames/0000/{label}/error.png"} <= names
    assert not [name for name in names if name.endswith(".part")]
    assert str(out.name) in done.stdout and "test_and_set" in done.stdout


def test_run_tells_where_it_took_place(finished_run):
    document = json.loads((finished_run[0] / "run.json").read_text())
    assert document["status"] == "done" and document["cells"] == {"planned": 2, "done": 2, "unsupported": 0,
                                                                   "failed": 0}
    assert {"schema", "argv", "seeds", "packages", "git", "processor", "threads", "threading_layer",
            "digests"} <= set(document)


def test_reference_is_never_wrong_about_itself(finished_run):
    lines = [json.loads(line) for line in (finished_run[0] / "results.jsonl").read_text().splitlines()]
    reference = next(line for line in lines if line["algorithm"] == "reference")
    assert reference["accuracy"]["false_shadow"] == reference["accuracy"]["false_light"] == 0
    assert 0 < reference["accuracy"]["shadowed"] < reference["accuracy"]["lit_candidates"]
    assert reference["stages"].keys() <= {"setup", "hierarchy", "traversal", "exact", "merge"}


def test_images_have_the_channels_of_the_contract(finished_run):
    frame = finished_run[0] / "frames" / "0000"
    gbuffer = image_io.read_exr(frame / "gbuffer.exr")
    assert set(gbuffer) == {"P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "depth", "triangle", "candidate"}
    assert gbuffer["triangle"].dtype == gbuffer["candidate"].dtype == np.uint32
    assert gbuffer["depth"].shape == (48, 64)
    shadow = image_io.read_exr(frame / "reference" / "shadow.exr")
    assert set(shadow) == {"shadow", "tests", "error"} and shadow["tests"].dtype == np.uint32
    line = json.loads((finished_run[0] / "results.jsonl").read_text().splitlines()[0])
    assert np.count_nonzero(shadow["shadow"]) == line["accuracy"]["shadowed"]
    assert np.count_nonzero(gbuffer["candidate"]) == line["accuracy"]["lit_candidates"]


def test_counts_are_the_same_again_with_other_threads_and_generic_code(finished_run, tmp_path):
    expected = (finished_run[0] / "counts.csv").read_bytes()
    for n, environment in (("1", {}), ("4", {}), ("2", {"NUMBA_CPU_NAME": "generic"})):
        out = tmp_path / f"{n}{len(environment)}"
        done = shadowbench("run", "plane_box", "-a", "reference", "-a", "shadow_map[resolution=256]", "--threads", n,
                           "--size", "64x48", "--only", "counts", "--out", out, cwd=tmp_path, **environment)
        assert done.returncode == 0, done.stderr
        assert (out / "counts.csv").read_bytes() == expected
        assert not (out / "frames").exists()
        assert len((out / "timings.csv").read_text().splitlines()) == 1


def test_progress_is_plain_lines_off_a_terminal(finished_run):
    lines = finished_run[1].stderr.splitlines()
    assert any(line.startswith("[1/2] ") for line in lines) and any(line.startswith("[2/2] ") for line in lines)
    assert "\x1b" not in finished_run[1].stderr


def test_report_is_one_file_that_needs_no_network(finished_run):
    text = (finished_run[0] / "report.html").read_text()
    assert "http" not in text.replace("http-equiv", "").replace("http://www.w3.org/2000/svg", "")     # a name, no address
    assert text.count("iVBORw0KGgo") >= 4        # how a PNG file begins, in base 64


def test_resolved_configuration_runs_again(finished_run, tmp_path):
    done = shadowbench("run", finished_run[0] / "config.resolved.yaml", "-a", "reference", "--size", "64x48", "--only",
                       "counts", "--out", "again", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = [[row for row in csv.reader((folder / "counts.csv").read_text().splitlines()) if row[2] == "reference"]
            for folder in (finished_run[0], tmp_path / "again")]
    assert rows[0] == rows[1]


def test_init_writes_a_scene_that_runs(tmp_path):
    assert shadowbench("init", "mine", cwd=tmp_path).stdout == "mine.yaml\n"
    assert clear_error(shadowbench("init", "mine", cwd=tmp_path), "mine.yaml exists already")
    assert shadowbench("validate", "mine.yaml", cwd=tmp_path).stdout == "mine.yaml: ok\n"
    done = shadowbench("run", "mine.yaml", "--quick", "-a", "reference", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "results" / "runs").iterdir())) == 1


def test_dry_run_lists_cells_and_writes_nothing(tmp_path):
    done = shadowbench("run", "plane_box", "--dry-run", "-a", "reference", "-a", "shadow_map", cwd=tmp_path)
    assert done.returncode == 0 and "2 cells" in done.stdout and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["algorithms", "scenes", "counters"])
def test_list(kind, tmp_path):
    plain, as_json = shadowbench("list", kind, cwd=tmp_path), shadowbench("list", kind, "--json", cwd=tmp_path)
    rows = json.loads(as_json.stdout)
    assert len(plain.stdout.splitlines()) == len(rows) >= 3
    assert all(row["name"] in plain.stdout for row in rows)


@pytest.mark.parametrize("arguments", [["--help"], ["list", "algorithms"], ["list", "scenes"], ["run", "--help"]])
def test_help_and_list_import_nothing_heavy(arguments, tmp_path):
    program = ("import sys\nfrom shadowbench.cli import cli\ntry:\n    cli.main(sys.argv[1:], standalone_mode=False)\n"
               "finally:\n    print(sorted({'numba', 'matplotlib', 'numpy', 'pydantic'} & set(sys.modules)))")
    done = subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout.splitlines()[-1] == "[]", done.stderr


def test_show(finished_run, tmp_path):
    manual = shadowbench("show", "shadow_map", cwd=tmp_path).stdout
    assert "resolution" in manual and "Stages: " in manual
    assert "triangles" in shadowbench("show", "citadel", cwd=tmp_path).stdout
    assert "shadow_map+resolution=256" in shadowbench("show", finished_run[0], cwd=tmp_path).stdout
    assert clear_error(shadowbench("show", "refrence", cwd=tmp_path), "did you mean reference?")


@pytest.mark.parametrize("kind", ["scene", "result"])
def test_schema_is_json(kind, tmp_path):
    document = json.loads(shadowbench("schema", kind, cwd=tmp_path).stdout)
    assert document["type"] == "object" and document["additionalProperties"] is False


def test_shell_completion_offers_scenes_and_algorithms(tmp_path):
    environment = {"_SHADOWBENCH_COMPLETE": "bash_complete", "COMP_CWORD": "2"}
    program = "from shadowbench.cli import cli; cli.main(prog_name='shadowbench')"

    def complete(words):
        return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path,
                              env={**os.environ, **environment, "COMP_WORDS": words,
                                   "COMP_CWORD": str(len(words.split()) - 1)}).stdout

    assert "plain,citadel" in complete("shadowbench run cit")
    assert "plain,shadow_map" in complete("shadowbench run -a shad")


BAD_SCENES = {
    "unknown key": ("geometry:\n- generate: plane_box\nimgae: {width: 8}\n", "bad.yaml:3:1", "did you mean"),
    "wrong type": ("geometry:\n- generate: plane_box\nimage: {width: wide}\n", "bad.yaml:3:16", "image.width"),
    "duplicate key": ("geometry:\n- generate: plane_box\nframes: 1\nframes: 2\n", "bad.yaml:4:1", "frames"),
    "missing mesh": ("geometry:\n- mesh: none.obj\ncamera: {eye: [0,0,5], target: [0,0,0]}\n"
                     "light: {position: [0,9,0]}\n", "bad.yaml:2:", "none.obj"),
    "unreadable mesh": ("geometry:\n- mesh: junk.ply\ncamera: {eye: [0,0,5], target: [0,0,0]}\n"
                        "light: {position: [0,9,0]}\n", "junk.ply"),
    "NaN vertices": ("geometry:\n- mesh: nan.obj\ncamera: {eye: [0,0,5], target: [0,0,0]}\n"
                     "light: {position: [0,9,0]}\n", "nan.obj", "NaN"),
    "empty scene": ("geometry: []\n", "bad.yaml:1:", "geometry"),
    "zero-sized image": ("geometry:\n- generate: plane_box\nimage: {width: 0}\n", "bad.yaml:3:16", "image.width"),
    "eye equal to target": ("geometry:\n- generate: plane_box\ncamera: {eye: [1,2,3], target: [1,2,3]}\n",
                            "bad.yaml:3:", "target"),
    "light on the camera": ("geometry:\n- generate: plane_box\ncamera: {eye: [0,1,9], target: [0,0,0]}\n"
                            "light: {position: [0,1,9]}\n", "bad.yaml:4:", "light"),
}


@pytest.mark.parametrize("case", BAD_SCENES)
def test_bad_scene_is_one_clear_error_and_no_folder(case, tmp_path):
    text, *words = BAD_SCENES[case]
    (tmp_path / "bad.yaml").write_text(text)
    (tmp_path / "junk.ply").write_text("this is no mesh")
    (tmp_path / "nan.obj").write_text("v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n")
    before = set(tmp_path.iterdir())
    assert clear_error(shadowbench("run", "bad.yaml", "--out", "out", cwd=tmp_path), *words)
    assert set(tmp_path.iterdir()) == before


def test_all_problems_of_a_file_are_told_at_once(tmp_path):
    (tmp_path / "bad.yaml").write_text("geometry:\n- generate: citadle\nframes: none\ncolour: red\n")
    done = shadowbench("run", "bad.yaml", cwd=tmp_path)
    assert clear_error(done, "bad.yaml:2:", "bad.yaml:3:", "bad.yaml:4:")


@pytest.mark.parametrize(("arguments", "words"), [
    (["-a", "shadowmap"], "shadow_map"), (["-a", "shadow_map[resolution=0]"], "resolution"),
    (["-a", "shadow_map[size=3]"], "size"), (["-D", "image.widht=3"], "width"), (["--frames", "5:9"], "frame"),
    (["--frames", "x"], "x"), (["--size", "0x4"], "0x4"), (["--only", "pictures"], "pictures"),
    (["--repeats", "0"], "repeats")])
def test_bad_options_are_clear_errors(arguments, words, tmp_path):
    assert clear_error(shadowbench("run", "plane_box", *arguments, "--out", "out", cwd=tmp_path), words)
    assert list(tmp_path.iterdir()) == []


def test_unwritable_output_is_told_before_anything_is_computed(tmp_path):
    (tmp_path / "file").write_text("")
    start = time.perf_counter()
    done = shadowbench("run", "citadel", "--out", "file/out", cwd=tmp_path)
    assert clear_error(done, "file is not a folder") and time.perf_counter() - start < 30


def test_interrupt_keeps_what_was_finished(tmp_path):
    command = [sys.executable, "-m", "shadowbench", "run", "plane_box", "-a", "reference", "-a", "shadow_map",
               "-D", "frames=500", "--size", "64x48", "--out", "out"]
    # Where the tests run in the background, SIGINT is ignored, and so it would be here
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    try:
        for line in process.stderr:
            if line.startswith("[5/1000]"):
                process.send_signal(signal.SIGINT)
                break
        output, errors = process.communicate(timeout=120)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130 and "Traceback" not in errors
    document = json.loads((tmp_path / "out" / "run.json").read_text())
    lines = (tmp_path / "out" / "results.jsonl").read_text().splitlines()
    assert document["status"] == "interrupted" and 5 <= len(lines) == document["cells"]["done"] < 1000
    assert (tmp_path / "out" / "counts.csv").exists() and "interrupted" in output


def test_a_full_disk_ends_with_a_clear_error(tmp_path):
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    out = tmp_path / "out"
    out.mkdir()
    (out / "results.jsonl").symlink_to("/dev/full")
    done = shadowbench("run", "plane_box", "-a", "reference", "--size", "32x32", "--only", "counts", "--out", out,
                       cwd=tmp_path)
    assert done.returncode == 4 and "No space left" in done.stderr and "Traceback" not in done.stderr
