"""The gate on operation counts: what it calls better or worse, its files, and the command from end to end."""

import os
import re
from pathlib import Path

import pytest

from shadowbench.algorithms import ALL_ALGORITHMS, PEERS
from shadowbench.check import baseline as baselines
from shadowbench.check.baseline import Place, baseline_text, read_baseline
from shadowbench.check.compare import ALL_NAMES, Verdict, compare
from shadowbench.check.report import LISTED, Outcome, markdown_report, text_report
from shadowbench.check.run import parse_tolerances
from shadowbench.check.suite import load_suite
from shadowbench.config import ConfigErrors
from shadowbench.errors import InputError
from tests.command_line import call

ROOT = Path(__file__).parent.parent
SUITE = """\
name: small
algorithms: [reference, ptsv]
scenes:
  - scene: plane_box
    set: {image.width: 40, image.height: 30}
  - scene: plane_box
    set: {image.width: 30, image.height: 40, name: tall}
    algorithms: [ptsv: {branching: 8}]
"""


def place(counter="node_tests", label="ptsv"):
    return Place("s", 0, label, counter)


def verdicts(before: dict, after: dict, **tolerances) -> dict:
    changes = compare({place(k): v for k, v in before.items()}, {place(k): v for k, v in after.items()}, tolerances)
    return {change.place.counter: change.verdict for change in changes}


def test_fewer_operations_are_an_improvement_and_more_a_regression():
    before = {"node_tests": 10, "sample_tests": 10, "samples": 5}
    assert verdicts(before, before) == {}
    assert verdicts(before, {**before, "node_tests": 9}) == {"node_tests": Verdict.IMPROVEMENT}
    assert verdicts(before, {**before, "node_tests": 11}) == {"node_tests": Verdict.REGRESSION}
    assert verdicts(before, {**before, "node_tests": 9, "sample_tests": 11}) == {
        "node_tests": Verdict.IMPROVEMENT, "sample_tests": Verdict.REGRESSION}


def test_a_count_that_is_no_cost_may_only_move_with_an_improvement():
    before = {"node_tests": 10, "refinements": 4, "samples": 5, "false_light": 2}
    assert verdicts(before, {**before, "refinements": 3}) == {"refinements": Verdict.REGRESSION}
    assert verdicts(before, {**before, "refinements": 5, "node_tests": 8})["refinements"] is Verdict.IMPROVEMENT
    assert verdicts(before, {**before, "samples": 6, "node_tests": 8})["samples"] is Verdict.REGRESSION
    assert verdicts(before, {**before, "refinements": 5, "node_tests": 8, "false_light": 3})["refinements"] is \
        Verdict.REGRESSION


def test_counts_that_one_side_lacks_fail():
    assert verdicts({"node_tests": 1}, {}) == {"node_tests": Verdict.MISSING}
    assert verdicts({}, {"node_tests": 1}) == {"node_tests": Verdict.ADDED}
    assert {v for v in Verdict if v.fails} == {Verdict.REGRESSION, Verdict.ADDED, Verdict.MISSING}


@pytest.mark.parametrize(("after", "percent", "verdict"), [
    (101, 1.0, Verdict.TOLERATED), (102, 1.0, Verdict.REGRESSION), (99, 1.0, Verdict.IMPROVEMENT)])
def test_tolerance_is_a_percentage_of_the_baseline(after, percent, verdict):
    assert verdicts({"node_tests": 100}, {"node_tests": after}, node_tests=percent) == {"node_tests": verdict}
    assert verdicts({"node_tests": 100}, {"node_tests": 101}, sample_tests=50.0) == {"node_tests": Verdict.REGRESSION}


@pytest.mark.parametrize(("text", "words"), [("node_test=1", "did you mean 'node_tests'"), ("node_tests", "COUNTER=PERCENT"),
                                             ("node_tests=-1", "COUNTER=PERCENT"), ("node_tests=nan", "COUNTER=PERCENT"),
                                             ("node_tests=inf", "COUNTER=PERCENT"), ("zzz=1", "list counters")])
def test_bad_tolerances(text, words):
    with pytest.raises(InputError, match=re.escape(words)):
        parse_tolerances([text])
    assert parse_tolerances(["node_tests=0.5%", "all_work=2"]) == {"node_tests": 0.5, "all_work": 2.0}
    assert {"test_and_set", "false_light", "shadowed"} <= set(ALL_NAMES)


def test_baseline_is_sorted_lines_and_reads_back(tmp_path):
    counts = {Place("b", 0, "z", "x"): 1, Place("a", 10, "ptsv+b=8", "y"): 2, Place("a", 2, "ptsv", "y"): 3}
    file = tmp_path / "counts.lock"
    file.write_text(baseline_text("ci", counts))
    assert file.read_text().splitlines()[1:3] == ["suite ci", f"schema {baselines.SCHEMA}"]
    assert file.read_text().splitlines()[4:] == ["a 2 ptsv y 3", "a 10 ptsv+b=8 y 2", "b 0 z x 1"]
    assert read_baseline(file, "ci") == counts


@pytest.mark.parametrize(("edit", "words"), [
    (lambda t: t.replace("suite ci", "suite other"), "made for the suite other"),
    (lambda t: t.replace("schema 1", "schema 9"), "schema 9"), (lambda t: "", "schema unknown"),
    (lambda t: t + "<<<<<<< HEAD\n", ":6: '<<<<<<< HEAD'"),
    (lambda t: t + "a 0 ptsv y 3\n", ":6: this count stands there twice"),
    (lambda t: t.replace(" 3\n", " 3.5\n"), ":5: 'a 0 ptsv y 3.5'")])
def test_a_damaged_baseline_is_one_clear_error(edit, words, tmp_path):
    (tmp_path / "b").write_text(edit(baseline_text("ci", {Place("a", 0, "ptsv", "y"): 3})))
    with pytest.raises(InputError, match=re.escape(words)):
        read_baseline(tmp_path / "b", "ci")


BAD_SUITES = {
    "empty": ("", "a suite file is a mapping"),
    "unknown key": ("scnes: []\nscenes: [{scene: plane_box}]\nalgorithms: [ptsv]\n", "1:1 scnes unknown key; did you mean"),
    "no scenes": ("algorithms: [ptsv]\n", "needs 'scenes:'"),
    "unknown scene": ("algorithms: [ptsv]\nscenes:\n  - scene: plane_bxo\n", "3:12 scenes[0].scene no such scene file"),
    "unknown algorithm": (
        "algorithms: [ptvs]\nscenes: [{scene: plane_box}]\n", "1:14 algorithms[0] unknown algorithm 'ptvs'; did"),
    "no algorithms": ("scenes: [{scene: plane_box}]\n", "has no algorithms"),
    "a peer": ("algorithms: [embree]\nscenes: [{scene: plane_box}]\n", "is a peer"),
    "bad override": ("algorithms: [ptsv]\nscenes: [{scene: plane_box, set: {image.widht: 3}}]\n", "did you mean 'width'"),
    "bad value": (
        "algorithms: [ptsv]\nscenes:\n- scene: plane_box\n  set: {image.width: wide}\n", "4:22 scenes[0].set.image.width"),
    "frame too far": ("algorithms: [ptsv]\nscenes:\n- {scene: plane_box, frames: [0, 3]}\n", "frames 0 to 0"),
    "same name": (
        "algorithms: [ptsv]\nscenes: [{scene: plane_box}, {scene: plane_box}]\n", "two scenes are called plane_box"),
    "entry key": ("algorithms: [ptsv]\nscenes: [{scene: plane_box, sett: {}}]\n", "did you mean 'set'"),
}


@pytest.mark.parametrize("case", BAD_SUITES)
def test_a_bad_suite_is_told_with_its_place(case, tmp_path):
    text, words = BAD_SUITES[case]
    (tmp_path / "s.yaml").write_text(text)
    with pytest.raises(ConfigErrors) as caught:
        load_suite(tmp_path / "s.yaml")
    assert words in str(caught.value)
    assert all(line.startswith(str(tmp_path / "s.yaml")) for line in caught.value.lines)


def test_the_committed_suite_and_baseline_cover_every_method():
    text = (ROOT / "configs" / "ci.yaml").read_text()
    methods = set(re.findall(r"^  - (\w+)(?::|$)", text, re.MULTILINE))
    assert methods - {"scene"} == {entry.name for entry in ALL_ALGORITHMS} - PEERS
    counts = read_baseline(ROOT / "results" / "counts.lock", "ci")
    assert {p.label.partition("+")[0] for p in counts} == methods - {"scene"}
    assert {p.scene for p in counts} == set(re.findall(r"^  - scene: (\w+)", text, re.MULTILINE))


def test_validate_knows_a_suite(tmp_path):
    (tmp_path / "s.yaml").write_text(SUITE)
    assert call("validate", tmp_path / "s.yaml").code == 0
    (tmp_path / "s.yaml").write_text(SUITE.replace("plane_box", "plane_bxo"))
    done = call("validate", tmp_path / "s.yaml")
    assert done.code == 2 and "s.yaml:4:12 scenes[0].scene no such scene file or built-in scene; did you mean" in done.errors


@pytest.fixture
def gate(tmp_path, monkeypatch):
    """A folder with a small suite and its baseline; returns a function that runs the check there."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    Path("suite.yaml").write_text(SUITE)

    def check(*options):
        return call("check", "suite.yaml", "--baseline", "counts.lock", *options)

    assert check("--update").code == 0
    return check


def rewrite(pattern: str, change) -> str:
    """Change the count of the line that starts so, in the baseline; returns the count that is measured."""
    file = Path("counts.lock")
    match = re.search(rf"^{re.escape(pattern)} (\d+)$", file.read_text(), re.MULTILINE)
    file.write_text(file.read_text().replace(match.group(0), f"{pattern} {change(int(match.group(1)))}"))
    return f"{int(match.group(1)):,}"


def test_check_passes_until_a_count_grows(gate, monkeypatch):
    assert gate().code == 0
    measured = rewrite("plane_box 0 ptsv node_tests", lambda n: n - 64)
    done = gate()
    assert done.code == 3
    assert re.search(rf"plane_box frame 0 ptsv +node_tests +\S+ -> {measured} +\+64 \(\+", done.output)
    assert "shadowbench run plane_box -D image.width=40 -D image.height=30 --frames 0 -a ptsv" in done.output
    assert gate("--tolerance", "node_tests=50").code == 0
    assert gate("--tolerance", "sample_tests=50").code == 3
    monkeypatch.setenv("CI", "true")
    refused = gate("--update")
    assert refused.code == 2 and "refused where CI is set" in refused.errors
    monkeypatch.delenv("CI")
    update = gate("--update")
    assert update.code == 0 and "node_tests" in update.output and "1 of them changed" in update.output
    before = Path("counts.lock").read_bytes()
    assert gate("--update").code == 0 and Path("counts.lock").read_bytes() == before


def test_improvements_are_listed_apart_and_do_not_fail(gate):
    rewrite("plane_box 0 ptsv node_tests", lambda n: n + 64)
    done = gate()
    assert done.code == 0 and "improvements (1)" in done.output and "--update" in done.output


def test_missing_and_added_counts_fail(gate):
    text = Path("counts.lock").read_text()
    Path("counts.lock").write_text(text.replace("tall 0 ptsv+branching=8 all_work", "tall 0 ptsv+branching=16 all_work"))
    done = gate()
    assert done.code == 3 and "not in the baseline (1)" in done.output and "not measured (1)" in done.output


def test_no_baseline_and_no_suite(gate):
    os.remove("counts.lock")
    done = gate()
    assert done.code == 5 and "no baseline counts.lock" in done.errors
    done = call("check", "none.yaml")
    assert done.code == 2 and "none.yaml: no such suite file" in done.errors


def test_markdown_goes_to_the_ci_summary(gate, monkeypatch, tmp_path):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    rewrite("plane_box 0 ptsv node_tests", lambda n: n - 64)
    done = gate("--format", "md")
    assert done.code == 3 and "| plane_box frame 0 ptsv | `node_tests` |" in done.output
    assert (tmp_path / "summary.md").read_text().startswith("### Operation counts: failed")


def test_a_long_summary_is_cut_but_the_text_is_whole():
    before = {place(label=f"m{i}"): 1 for i in range(LISTED + 5)}
    outcome = Outcome("ci", [], 0, compare(before, {p: 2 for p in before}, {}), [])
    assert "and 5 more" in markdown_report(outcome)
    assert text_report(outcome).count("+1 (+100 %)") == LISTED + 5


def test_a_method_that_fails_is_told_and_is_no_baseline(gate, monkeypatch):
    from shadowbench.algorithms.ptsv import Ptsv

    def shadows(self, frame, probe):
        raise RuntimeError("out of luck")

    monkeypatch.setattr(Ptsv, "shadows", shadows)
    before = Path("counts.lock").read_bytes()
    done = gate("--update")
    assert done.code == 3 and "RuntimeError: out of luck" in done.output and Path("counts.lock").read_bytes() == before


def test_a_wrong_sample_of_an_exact_method_always_fails(gate, monkeypatch):
    from shadowbench.algorithms.base import ShadowBuffer
    from shadowbench.algorithms.ptsv import Ptsv

    right = Ptsv.shadows

    def shadows(self, frame, probe):
        return ShadowBuffer(1 - right(self, frame, probe).shadow)

    monkeypatch.setattr(Ptsv, "shadows", shadows)
    done = gate("--update", "--tolerance", "false_shadow=1000")
    assert done.code == 3 and "wrong samples of exact methods (2)" in done.output
    assert "left as it is" in done.errors
