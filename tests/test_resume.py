"""Runs that survive: killed, out of disk space, without their folder, with cells that raise, hang or crash."""

import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shadowbench.errors import InputError
from shadowbench.results import read_run
from shadowbench.run_lock import NAME, RunLock
from tests.command_line import call, no_plugins_left

__all__ = ["no_plugins_left"]

RUN = ["run", "plane_box", "--size", "40x30", "--only", "counts"]
MANY = [*RUN, "-a", "reference", "-a", "ptsv", "-a", "z_fail", "-D", "frames=40"]
FILE_LIMIT = 40_000

PLUGIN = '''
"""Methods that go wrong."""
import os, signal, time
import numpy as np
from shadowbench.algorithms.base import Algorithm, ShadowBuffer


class Raises(Algorithm):
    """Raises."""
    name, title, paper, exact, stages, counters = "raises", "Raises", "tests", False, (), ()

    def shadows(self, frame, probe):
        if os.path.exists("mended"):
            return ShadowBuffer(np.zeros(frame.samples.candidate.shape, np.float32))
        raise RuntimeError("out of luck")


class Hangs(Raises):
    """Never ends."""
    name = "hangs"

    def shadows(self, frame, probe):
        time.sleep(600)


class Crashes(Raises):
    """Takes its process down."""
    name = "crashes"

    def shadows(self, frame, probe):
        os.kill(os.getpid(), signal.SIGSEGV)
'''


def start(*arguments, cwd, **more):
    return subprocess.Popen([sys.executable, "-m", "shadowbench", *map(str, arguments)], cwd=cwd, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, **more)


def finish(process):
    output, errors = process.communicate(timeout=300)
    assert "Traceback" not in errors, errors
    return process.returncode, output, errors


def statuses(out: Path) -> dict:
    return {cell.label: (cell.status, cell.reason) for cell in read_run(out)[1]}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> bytes:
    """counts.csv of a run that nobody disturbs."""
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    assert call(*MANY, "--out", out).code == 0
    return (out / "counts.csv").read_bytes()


def kill_and_resume(n_kills: int, seed: int, folder: Path) -> Path:
    """Kill a run again and again, then let it finish; returns its folder."""
    rng = random.Random(seed)
    for _ in range(n_kills):
        process = start(*MANY, "--out", "out", "--resume", cwd=folder)
        lines = rng.randrange(1, 40)
        for line in process.stderr:
            lines -= line.startswith("[")
            if lines <= 0:
                break
        time.sleep(rng.uniform(0, 0.03))
        process.send_signal(signal.SIGKILL)
        process.communicate()
    code, _, _ = finish(start(*MANY, "--out", "out", "--resume", cwd=folder))
    assert code == 0
    return folder / "out"


@pytest.mark.slow
def test_a_run_killed_three_times_ends_with_the_same_counts(undisturbed, tmp_path):
    out = kill_and_resume(3, 1, tmp_path)
    assert (out / "counts.csv").read_bytes() == undisturbed
    assert not (out / NAME).exists() and json.loads((out / "run.json").read_text())["status"] == "done"
    keys = [json.loads(line)["key"] for line in (out / "results.jsonl").read_text().splitlines()]
    assert len(keys) == len(set(keys)) == 120          # no cell was measured twice


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_a_run_killed_twenty_times_ends_with_the_same_counts(seed, undisturbed, tmp_path):
    assert (kill_and_resume(20, seed, tmp_path) / "counts.csv").read_bytes() == undisturbed


def test_a_torn_line_is_dropped_with_a_note(tmp_path):
    assert call(*RUN, "-a", "ptsv", "-a", "reference", "--out", tmp_path / "out").code == 0
    expected, results = (tmp_path / "out" / "counts.csv").read_bytes(), tmp_path / "out" / "results.jsonl"
    data = results.read_bytes()
    results.write_bytes(data[:-20])
    done = call(*RUN, "-a", "ptsv", "-a", "reference", "--out", tmp_path / "out", "--resume")
    assert done.code == 0 and "cut short" in done.errors
    assert "frame 0 ptsv: kept" in done.errors and "frame 0 reference: runs: not measured yet" in done.errors
    assert (tmp_path / "out" / "counts.csv").read_bytes() == expected and len(read_run(tmp_path / "out")[1]) == 2


def test_what_is_kept_and_what_runs_again_is_told(tmp_path):
    out, first = tmp_path / "out", ["run", "plane_box", "-a", "ptsv", "--size", "40x30", "--repeats", "1"]
    assert call(*first, "--only", "counts,timings", "--out", out).code == 0

    def plan(*options):
        done = call(*first, "--out", out, "--resume", "--dry-run", *options)
        assert done.code == 0
        return done.output

    assert "kept from before" in plan("--only", "counts,timings") and "nothing to do" in plan("--only", "counts")
    assert "has 1 of 2 timings" in plan("--only", "counts,timings", "--repeats", "2")
    assert "another number of threads" in plan("--only", "timings", "--threads", "7")
    assert "has no pictures" in plan()
    assert "have changed" in plan("--only", "counts", "-D", "bias=0.01")
    assert "not measured yet" in plan("--only", "counts", "-a", "z_fail")
    assert re.search(r"1 to run: about \d+ s", plan("--only", "counts", "-D", "bias=0.01"))
    assert "of unknown duration" in plan("--only", "counts", "-a", "z_fail")


def test_resume_refuses_what_is_another_run(tmp_path):
    out = tmp_path / "out"
    assert call(*RUN, "-a", "ptsv", "-a", "reference", "--out", out).code == 0
    before = (out / "results.jsonl").read_bytes()
    for arguments, words in (([*RUN, "-a", "ptsv", "--out", out], "add --resume"),
                             ([*RUN, "-a", "ptsv", "--out", out, "--resume"], "does not ask for"),
                             (["run", "plane_disc", "-a", "ptsv", "--out", out, "--resume"], "the scene plane_box"),
                             ([*RUN, "--resume"], "--out DIR")):
        done = call(*arguments)
        assert done.code == 2 and words in done.errors
    assert (out / "results.jsonl").read_bytes() == before


def test_a_disk_that_fills_up_keeps_what_was_finished(undisturbed, tmp_path):
    limited = start(*MANY, "--out", "out", cwd=tmp_path,
                    preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_LIMIT, FILE_LIMIT)))
    code, _, errors = finish(limited)
    assert code == 4 and "results.jsonl" in errors and "are kept" in errors
    assert (tmp_path / "out" / "results.jsonl").stat().st_size <= FILE_LIMIT
    assert 0 < len(read_run(tmp_path / "out")[1]) < 120
    assert call(*MANY, "--out", tmp_path / "out", "--resume").code == 0
    assert (tmp_path / "out" / "counts.csv").read_bytes() == undisturbed


def test_an_output_folder_that_vanishes_is_one_clear_message(tmp_path, monkeypatch):
    from shadowbench.algorithms.z_fail import ZFail

    right = ZFail.shadows

    def shadows(self, frame, probe):
        shutil.rmtree(tmp_path / "out")
        return right(self, frame, probe)

    monkeypatch.setattr(ZFail, "shadows", shadows)
    done = call(*RUN, "-a", "ptsv", "-a", "z_fail", "-a", "reference", "--out", tmp_path / "out")
    assert done.code == 4 and "has vanished" in done.errors and not (tmp_path / "out").exists()


@pytest.mark.usefixtures("no_plugins_left")
def test_a_method_that_raises_loses_no_other_and_is_never_reused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("wrong.py").write_text(PLUGIN)
    arguments = [*RUN, "--plugin", "wrong.py", "-a", "ptsv", "-a", "raises", "-a", "z_fail", "--out", "out"]
    assert call(*arguments).code == 4
    assert statuses(Path("out")) == {"ptsv": ("done", None), "raises": ("failed", "RuntimeError: out of luck"),
                                     "z_fail": ("done", None)}
    Path("mended").touch()
    done = call(*arguments, "--resume")
    assert done.code == 0 and "raises: runs: failed before: RuntimeError: out of luck" in done.errors
    assert set(statuses(Path("out")).values()) == {("done", None)}


def test_cells_that_hang_or_crash_lose_no_other(tmp_path):
    (tmp_path / "wrong.py").write_text(PLUGIN)
    arguments = [*RUN, "--plugin", "wrong.py", "-a", "ptsv", "-a", "hangs", "-a", "crashes", "-a", "raises", "-a", "z_fail",
                 "--out", "out", "--timeout", "8"]
    code, output, _ = finish(start(*arguments, cwd=tmp_path))
    assert code == 4 and "timeout: not finished after 8 s" in output
    assert statuses(tmp_path / "out") == {
        "ptsv": ("done", None), "hangs": ("failed", "timeout: not finished after 8 s"),
        "crashes": ("failed", "the worker process ended with signal SIGSEGV"),
        "raises": ("failed", "RuntimeError: out of luck"), "z_fail": ("done", None)}


@pytest.mark.slow
def test_with_a_time_limit_counts_are_the_same(undisturbed, tmp_path):
    code, _, errors = finish(start(*MANY, "--out", "out", "--timeout", "120", cwd=tmp_path))
    assert code == 0 and "[120/120]" in errors
    assert (tmp_path / "out" / "counts.csv").read_bytes() == undisturbed


@pytest.mark.slow
def test_interrupting_a_run_with_a_time_limit_ends_the_worker(tmp_path):
    (tmp_path / "wrong.py").write_text(PLUGIN)
    process = start(*RUN, "--plugin", "wrong.py", "-a", "ptsv", "-a", "hangs", "--out", "out", "--timeout", "500",
                    cwd=tmp_path)
    for line in process.stderr:
        if line.startswith("[1/2]"):
            break
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    process.send_signal(signal.SIGINT)
    code, _, _ = finish(process)
    assert code == 130 and statuses(tmp_path / "out") == {"ptsv": ("done", None)}
    for _ in range(100):                    # multiprocessing's own helper ends a moment later
        if not any(Path(f"/proc/{child}").exists() for child in children):
            break
        time.sleep(0.1)
    else:
        raise AssertionError(f"still running: {children}")
    assert children


def test_two_processes_on_one_folder(tmp_path):
    with RunLock(tmp_path / "out") as lock:
        assert lock.stale is None
        done = call(*RUN, "-a", "ptsv", "--out", tmp_path / "out")
        assert done.code == 2 and f"in use by process {os.getpid()} on" in done.errors
        with pytest.raises(InputError, match="in use"), RunLock(tmp_path / "out"):
            pass
    assert list((tmp_path / "out").iterdir()) == []


def test_a_stale_lock_is_recognised(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / NAME).write_text("4711 on here\n")
    done = call(*RUN, "-a", "ptsv", "--out", tmp_path / "out")
    assert done.code == 0 and "process 4711 on here) was killed" in done.errors
    assert not (tmp_path / "out" / NAME).exists()
