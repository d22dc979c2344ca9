import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

import shadowbench
from shadowbench import jit
from tests.counting_example import count_evens, visit_all

PACKAGE = Path(shadowbench.__file__).parent
PROGRAM = "from shadowbench.kernels.caller import answer; print(answer())"


@pytest.fixture
def package_copy(tmp_path):
    """A copy of the package with two more modules: a kernel, and a helper in another file that it calls."""
    copy = tmp_path / "shadowbench"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "kernels" / "helper.py").write_text(
        "from shadowbench.jit import kernel\n\n@kernel\ndef value():\n    return 1\n")
    (copy / "kernels" / "caller.py").write_text(
        "from shadowbench.jit import kernel\nfrom shadowbench.kernels.helper import value\n\n"
        "@kernel\ndef answer():\n    return value()\n")
    return copy


def run_copy(copy: Path, cache: Path, *arguments: str) -> subprocess.CompletedProcess:
    environment = {**os.environ, "PYTHONPATH": str(copy.parent), "NUMBA_CACHE_DIR": str(cache)}
    return subprocess.run([sys.executable, *(arguments or ("-c", PROGRAM))], env=environment, cwd=copy.parent,
                          capture_output=True, text=True, check=True)


def test_editing_a_helper_in_another_file_runs_the_new_code(package_copy, tmp_path):
    cache = tmp_path / "cache"
    assert run_copy(package_copy, cache).stdout == "1\n"
    helper = package_copy / "kernels" / "helper.py"
    helper.write_text(helper.read_text().replace("return 1", "return 2"))
    assert run_copy(package_copy, cache).stdout == "2\n"


def test_second_process_loads_from_the_cache(package_copy, tmp_path):
    program = ("from shadowbench.kernels.caller import answer; answer(); "
               "print(sum(answer.stats.cache_hits.values()))")
    first = run_copy(package_copy, tmp_path / "cache", "-c", program)
    second = run_copy(package_copy, tmp_path / "cache", "-c", program)
    assert (first.stdout, second.stdout) == ("0\n", "1\n")


def test_unwritable_cache_is_no_error(package_copy, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("a file where the cache folder should be")
    done = run_copy(package_copy, blocked)
    assert done.stdout == "1\n" and done.stderr == ""


def test_decorators_never_allow_inexact_arithmetic():
    @jit.kernel
    def add(a, b):
        return a + b

    assert add.targetoptions["fastmath"] is False
    assert add.targetoptions["error_model"] == "numpy"


def test_timing_build_carries_no_counting():
    counts = np.zeros(1, np.int64)
    assert count_evens(10, None) == count_evens(10, counts) == 5
    assert counts[0] == 10
    fresh = numba.njit(error_model="numpy")(count_evens.py_func)     # a cached build keeps no code to look at
    fresh(10, None), fresh(10, counts)
    code = {"array" in str(signature).lower(): text for signature, text in fresh.inspect_llvm().items()}
    assert len(code[False]) < len(code[True])


def test_compile_watch_announces_once_and_measures():
    announced = []

    @numba.njit          # without the cache, so that it compiles here
    def double(x):
        return x + x

    with jit.CompileWatch(lambda: announced.append(True)) as watch:
        double(1)
        double(1.0)
    assert announced == [True] and watch.seconds > 0
    with jit.CompileWatch(lambda: announced.append(True)) as watch:
        double(2)
    assert announced == [True] and watch.seconds == 0


def test_set_threads_refuses_none():
    with pytest.raises(ValueError, match="1 or more"):
        jit.set_threads(0)


@pytest.mark.parametrize("n_threads", [1, 2, 3, 7])
@pytest.mark.parametrize("n_workers", [0, 1, 5, 64])
def test_every_worker_runs_once_for_any_number_of_threads(n_threads, n_workers):
    jit.set_threads(n_threads)
    visits = np.zeros(n_workers, np.int64)
    visit_all(visits)
    assert visits.tolist() == [1] * n_workers


def test_an_error_in_a_worker_reaches_the_caller():
    jit.set_threads(3)
    with pytest.raises(numba.TypingError):
        visit_all(("no", "array"))


def test_a_parallel_kernel_is_one_loop_over_workers():
    def sums(a):
        total = 0.0
        for i in jit.prange(len(a)):
            total += a[i]
        return total

    with pytest.raises(TypeError, match="one prange whose body calls serial kernels"):
        jit.parallel_kernel(sums)
