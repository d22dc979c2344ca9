"""Methods of one's own: the documented example, wrong ones that `verify` catches, broken ones that break nothing."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shadowbench.algorithms import ALL_ALGORITHMS
from shadowbench.algorithms.base import ShadowBuffer
from shadowbench.conformance.cases import CLEAR_CASES
from shadowbench.conformance.interface import check_class, check_counts
from shadowbench.conformance.suite import THREADED, Cases, examine
from shadowbench.probe import Probe
from tests.command_line import call, no_plugins_left

__all__ = ["no_plugins_left"]

pytestmark = pytest.mark.usefixtures("no_plugins_left")

PAGE = (Path(__file__).parent.parent / "docs" / "add_a_method.md").read_text()
EXAMPLE = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL).group(1)


def test_every_command_of_the_page_works(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("brute_force.py").write_text(EXAMPLE)
    commands = re.findall(r"^shadowbench (.*)$", PAGE, re.MULTILINE)
    assert len(commands) == 4
    for command in commands:
        words = [word.strip("'") for word in command.split()]
        words += ["--quick"] if words[0] == "verify" else []
        words += ["--size", "32x24", "--only", "counts", "--out", "out"] if words[0] == "run" else []
        done = call(*words)
        assert done.code == 0, done.output + done.errors
        assert "brute_force" in done.output or "Brute force" in done.output
    lines = [json.loads(line) for line in Path("out/results.jsonl").read_text().splitlines()]
    assert [line["label"] for line in lines] == ["ptsv", "brute_force+stop_at_first=False"]
    assert [line["accuracy"]["false_shadow"] + line["accuracy"]["false_light"] for line in lines] == [0, 0]
    assert "unsupported: 400,000 triangles: 400,002 triangles would take minutes" in call(
        "verify", "brute_force", "--case", "400,000 triangles", "--plugin", "brute_force.py").output


WRONG_METHOD = '''
"""A method that goes wrong."""
import numpy as np
from pydantic import Field
from shadowbench.algorithms.base import AlgorithmParams, ShadowBuffer
from shadowbench.algorithms.ptsv import Ptsv


class Params(AlgorithmParams):
    CLASS_OF_PARAMS


class Wrong(Ptsv):
    name = "wrong"
    DECLARATION

    def shadows(self, frame, probe):
        shadow, samples, random = super().shadows(frame, probe).shadow, frame.samples, np.random.default_rng()
        STATEMENT
        return ShadowBuffer(shadow)
'''
WRONG = {
    "moved by one pixel": (
        "STATEMENT", "shadow = np.roll(shadow.reshape(-1, samples.columns), 1, 1).reshape(-1) * samples.candidate",
        r"lit candidates are wrong \(.*, the first at column \d+, row \d+; the shadow looks moved by one sample to the"),
    "not deterministic": ("STATEMENT", "shadow[frame.samples.candidate] = random.random()",
                          "not deterministic: a second call on the same input gives other shadows"),
    "counts that vary": ("STATEMENT", "probe.count('sample_tests', int(random.integers(1000)))",
                         r"not deterministic: a second call on the same input counts otherwise \(sample_tests: "),
    "negative counts": ("STATEMENT", "probe.count('sample_tests', -1)",
                        "counter sample_tests takes integers from 0 up, not -1"),
    "negative counts past the probe": ("STATEMENT", "probe.counts['sample_tests'] = -5",
                                       "the count of sample_tests is -5: counts are integers from 0 up"),
    "undeclared counter": ("STATEMENT", "probe.count('rays_cast', 1)", "it counts rays_cast, which its `counters` do not"),
    "counter never filled": ("DECLARATION", "counters = (*Ptsv.counters, 'rays_cast')",
                             "declares the counter rays_cast, but no case filled it"),
    "unknown counter": ("DECLARATION", "counters = ('tests',)", "the counter 'tests' is not in the registry"),
    "a total": ("DECLARATION", "counters = ('all_work',)", "all_work is a total: declare its terms"),
    "stage never passed": ("DECLARATION", "stages = (*Ptsv.stages, 'rest')", "the stage 'rest', but no case"),
    "undeclared stage": ("DECLARATION", "stages = Ptsv.stages[1:]", "passes the stage 'hierarchy', which its"),
    "stages that are no tuple": ("DECLARATION", "stages = 'abc'", "`stages` must be a tuple of different names"),
    "exact that is no bool": ("DECLARATION", "exact = 1", "`exact` must be True or False"),
    "no title": ("DECLARATION", "title = ' '", "`title` must be a text"),
    "double precision": ("STATEMENT", "shadow = shadow.astype(float)", "the shadow buffer is float64"),
    "out of range": ("STATEMENT", "shadow = shadow * np.float32(2)", "values outside 0 to 1"),
    "not a number": ("STATEMENT", "shadow[:1] = np.nan", "values outside 0 to 1"),
    "dark where unlit": ("STATEMENT", "shadow[~samples.candidate] = 1", "samples that are no lit candidates are not 0"),
    "changes its inputs": ("STATEMENT", "samples.depth.setflags(write=True); samples.depth[:1] += 1", "changes its inputs"),
    "other shadows when timed": ("STATEMENT", "shadow[:] = shadow if probe.counting else 0",
                                 "other shadows when it does not count"),
    "depends on threads": ("STATEMENT",
                           "import shadowbench.jit as jit; probe.count('float64_sample_tests', jit.n_threads())",
                           r"its counts depend on the number of threads \(float64_sample_tests: "),
    "no help": ("CLASS_OF_PARAMS", "size: int = 3", "the parameter size has no line of help"),
    "no default": ("CLASS_OF_PARAMS", "size: int = Field(description='size')", "the key 'size' is missing"),
    "raises": ("STATEMENT", "raise RuntimeError('out of luck')", "it raises RuntimeError: out of luck"),
    "says no wrongly": ("DECLARATION", "unsupported = lambda self, scene: ''", "must return None or one sentence, not ''"),
}


@pytest.mark.parametrize("case", WRONG)
def test_verify_catches_a_wrong_method_and_says_what_is_wrong(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    slot, text, words = WRONG[case]
    source = WRONG_METHOD.replace(slot, text)
    if slot == "CLASS_OF_PARAMS":
        source = source.replace("DECLARATION", "Params = Params")
    for rest in ("CLASS_OF_PARAMS", "DECLARATION", "STATEMENT"):
        source = source.replace(rest, "pass")
    Path("wrong.py").write_text(source)
    monkeypatch.setattr("shadowbench.conformance.run._in_another_process", lambda *_: None)
    done = call("verify", "wrong", "--quick", "--plugin", "wrong.py")
    assert re.search(words, done.output + done.errors), done.output
    assert done.code == 3
    again = re.search(r"again: shadowbench verify wrong --case (.*) --plugin ", done.output)
    if again:
        assert call("verify", "wrong", "--case", again.group(1).strip("'")).code == 3


def test_verify_catches_what_differs_between_processes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = WRONG_METHOD.replace("STATEMENT", "probe.count('float64_sample_tests', hash('x') % 97)")
    Path("wrong.py").write_text(source.replace("CLASS_OF_PARAMS", "pass").replace("DECLARATION", "pass"))
    done = call("verify", "wrong", "--quick", "--plugin", "wrong.py")
    assert done.code == 3 and "differ between two processes" in done.output


def test_unknown_case_and_method():
    done = call("verify", "ptsv", "--case", "sunn")
    assert done.code == 2 and "did you mean 'sun'" in done.errors
    done = call("verify", "ptvs")
    assert done.code == 2 and "did you mean 'ptsv'" in done.errors


@pytest.mark.parametrize("entry", [e for e in ALL_ALGORITHMS if e.extra is None], ids=lambda e: e.name)
def test_every_built_in_method_passes_on_some_cases(entry):
    """All cases of all exact methods are in test_exact_methods.py; `shadowbench verify` runs the whole suite."""
    outcome = examine(entry.load()(), Cases([*THREADED, "1x1 image", "empty mesh"]))
    assert [f for f in outcome.findings if "no case" not in f.message] == [] and outcome.passed == 6


def test_the_light_that_casters_let_through_is_verified():
    method = next(entry for entry in ALL_ALGORITHMS if entry.name == "ptsv").load()

    class Brighter(method):
        def shadows(self, frame, probe):
            shadow = super().shadows(frame, probe).shadow
            return ShadowBuffer(np.where(shadow < 1, np.float32(0.99) * shadow, shadow))

    name, = CLEAR_CASES
    assert examine(method(), Cases([name])).findings == []
    found, = examine(Brighter(), Cases([name])).findings
    assert found.case == name and "(0 dark that are lit" in found.message


def test_sums_that_do_not_agree_are_told():
    method = ALL_ALGORITHMS[0].load()
    frame = Cases(["sun"]).get("sun")[1]
    probe = Probe(counting=True)
    probe.count_levels("node_tests", np.array([1, 2]))
    probe.levels["node_tests"] = [1, 3]
    probe.count_triangles("node_tests", np.zeros(frame.mesh.n_triangles))
    probe.count_triangles("sample_tests", np.zeros(3))
    probe.heat = np.full(5, -1)
    found = "\n".join(check_counts(method, probe, frame))
    for words in ("levels of node_tests sum to 4, but its total is 3", "node_tests sums to 0 over the triangles",
                  "sample_tests have the shape (3,)", "heat map has the shape (5,)"):
        assert words in found
    assert list(check_class(method)) == []


BROKEN = {
    "raises": ("raise RuntimeError('no luck')", "RuntimeError: no luck"),
    "syntax": ("def (", "SyntaxError"),
    "exits": ("import sys; sys.exit(3)", "SystemExit: 3"),
    "imports": ("import no_such_package", "No module named 'no_such_package'"),
    "no class": ("x = 1", "holds no class derived from"),
    "no shadows": (EXAMPLE.replace("def shadows(", "def shadow("), "lacks the method shadows"),
    "lacks": (EXAMPLE.replace('    title = "Brute force"\n', ""), "lacks title"),
    "taken": (EXAMPLE.replace('name = "brute_force"', 'name = "ptsv"'), "the name ptsv is taken"),
    "bad name": (EXAMPLE.replace('name = "brute_force"', 'name = "Brute Force"'), "is no word of small letters"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_file_is_unavailable_with_its_reason_and_breaks_nothing(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("broken.py").write_text(BROKEN[case][0])
    listed = call("list", "algorithms", "--plugin", "broken.py")
    assert listed.code == 0 and "unavailable (broken.py): " in listed.output
    assert BROKEN[case][1] in listed.output and len(listed.output.splitlines()) == len(ALL_ALGORITHMS) + 1
    done = call("run", "plane_box", "-a", "ptsv", "--size", "32x24", "--only", "counts", "--plugin", "broken.py",
                "--out", "out")
    assert done.code == 0 and "is unavailable" in done.errors


def test_a_file_that_is_not_there(tmp_path):
    assert "no such file" in call("list", "algorithms", "--plugin", tmp_path / "none.py").output


@pytest.fixture
def installed(tmp_path):
    """Packages with entry points, as an installer leaves them; returns a function that runs the command beside them."""
    site = tmp_path / "site"
    entries = {"brute_force": "good_package.method:BruteForce", "gone": "no_such_package:Gone",
               "ptsv": "good_package.method:P", "odd": "good_package", "late": "bad_package:Late"}
    for folder, text in (("good_package/__init__.py", ""), ("good_package/method.py", EXAMPLE),
                         ("bad_package.py", "raise RuntimeError('no luck')"),
                         ("plug-1.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: plug\nVersion: 1.0\n"),
                         ("plug-1.0.dist-info/entry_points.txt", "[shadowbench.algorithms]\n" + "".join(
                             f"{name} = {target}\n" for name, target in entries.items()))):
        (site / folder).parent.mkdir(parents=True, exist_ok=True)
        (site / folder).write_text(text)

    def run(*words, program="from shadowbench.cli import main; main()"):
        path = os.pathsep.join([str(site), *sys.path])
        return subprocess.run([sys.executable, "-c", program, *words], cwd=tmp_path, capture_output=True, text=True,
                              env={**os.environ, "PYTHONPATH": path}, timeout=300)

    return run


def test_installed_plugins_are_listed_without_being_imported(installed):
    program = ("import sys\nfrom shadowbench.cli import cli\ntry:\n    cli.main(sys.argv[1:], standalone_mode=False)\n"
               "finally:\n    print(sorted({'numba', 'numpy', 'matplotlib', 'good_package'} & set(sys.modules)))")
    lines = installed("list", "algorithms", program=program).stdout.splitlines()
    assert lines[-1] == "[]"
    found = {line.split()[0]: line for line in lines[len(ALL_ALGORITHMS):-1]}
    assert "plug-in of plug" in found["brute_force"] and "plug-in of plug" in found["late"]
    assert "no module no_such_package" in found["gone"] and "the name ptsv is taken" in found["ptsv"]
    assert "is no module:Class" in found["odd"]


def test_installed_plugins_run_and_a_broken_one_is_told(installed):
    done = installed("run", "plane_box", "--size", "32x24", "--only", "counts", "-a", "brute_force", "-a", "reference",
                     "--out", "out")
    assert done.returncode == 0 and "brute_force" in done.stdout
    done = installed("run", "plane_box", "-a", "late")
    assert done.returncode == 2 and "plug-in late (plug) can't be loaded: RuntimeError: no luck" in done.stderr
    assert "Traceback" not in done.stderr
