"""The manual: generated pages are current, links lead somewhere, and the README's commands work as printed."""

import importlib.util
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from shadowbench.cli import cli
from shadowbench.config import load_config

ROOT = Path(__file__).parent.parent
SPEC = importlib.util.spec_from_file_location("make_pages", ROOT / "docs" / "make_pages.py")
MANUAL = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")])

A_MESH = """
v -6 0 -6
v 6 0 -6
v 6 0 6
v -6 0 6
v -1 0 0
v 1 0 0
v 0 3 0.5
f 1 3 2
f 1 4 3
f 5 6 7
"""


@pytest.fixture(scope="module")
def make_pages():
    module = importlib.util.module_from_spec(SPEC)
    SPEC.loader.exec_module(module)
    return module


def test_generated_pages_are_current(make_pages):
    texts = make_pages.pages()
    assert len(texts) >= 15
    stale = [str(path) for path, text in texts.items()
             if not (ROOT / path).is_file() or (ROOT / path).read_text(encoding="utf-8") != text]
    assert not stale, f"run `make docs`: {stale}"
    there = {path.relative_to(ROOT) for path in (ROOT / "docs" / "algorithms").iterdir()}
    assert there <= set(texts), "pages of methods that are gone"


def test_scene_file_page_has_every_key_and_a_valid_example(make_pages, tmp_path):
    text = make_pages.scene_page()
    for key in ("alpha_cutoff", "fov_y", "frames", "matrix", "translate", "closed"):
        assert f"| `{key}` |" in text
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "courtyard.obj").write_text(A_MESH)
    (tmp_path / "scene.yaml").write_text(make_pages.EXAMPLE_SCENE)
    assert load_config(tmp_path / "scene.yaml").frames == 24


def test_missing_marks_are_an_error(make_pages):
    with pytest.raises(ValueError, match="no marks for costs"):
        make_pages.with_parts("text", {"costs": ""})


def headings(text):
    """Anchors of a page."""
    found = re.findall(r"^#+ (.+)$", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in found}


@pytest.mark.parametrize("page", MANUAL, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"https?:|mailto:", target):
            continue
        file, _, anchor = target.partition("#")
        linked = (page.parent / file).resolve() if file else page
        assert linked.exists(), f"{page.name}: {target}"
        if anchor:
            assert anchor in headings(linked.read_text(encoding="utf-8")), f"{page.name}: {target}"


def test_pictures_of_the_manual_are_small():
    pictures = list((ROOT / "docs").rglob("*.png"))
    assert pictures and all(picture.stat().st_size < 600_000 for picture in pictures)


def test_synopsis_names_real_commands_and_options():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```\w*\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    synopsis = next(block for block in blocks if "shadowbench run SCENE" in block and "shadowbench check [SUITE" in block)
    words = re.split(r"shadowbench (?=[a-z])", synopsis)[1:]
    assert {part.split()[0] for part in words} == set(cli.commands)
    for part in words:
        command = cli.commands[part.split()[0]]
        known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
        used = set(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", part))
        assert used <= known, f"{part.split()[0]}: {used - known}"


def transcript():
    """Commands of the README's console block with what each prints."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    steps = re.search(r"```console\n(.*?)```", text, re.DOTALL)[1].split("$ ")[1:]
    return [(step.split("\n")[0], [line for line in step.split("\n")[1:] if line]) for step in steps]


def follow(steps, folder, environment):
    """Run the commands as a newcomer does, and look for every line that the README promises."""
    for command, promised in steps:
        done = subprocess.run(shlex.split(command), cwd=folder, env=environment, capture_output=True, text=True, timeout=900)
        assert done.returncode == 0, f"{command}\n{done.stderr}"
        for line in promised:
            assert line in done.stdout.splitlines(), f"{command} prints\n{done.stdout}"


def test_a_newcomer_gets_to_the_report_of_their_own_mesh(tmp_path):
    steps = transcript()
    assert steps[0] == ("make demo", []) and len(steps) == 5
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    launcher = tmp_path / ".venv" / "bin" / "shadowbench"          # what `make demo` installs
    launcher.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m shadowbench "$@"\n')
    launcher.chmod(0o755)
    (tmp_path / "courtyard.obj").write_text(A_MESH)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    init, validate, run, report = steps[1:]
    follow([init, validate, (f"{run[0]} --size 160x120 --repeats 1", run[1]), report], tmp_path, environment)
    page = (tmp_path / "courtyard.html").read_text(encoding="utf-8")
    assert "✓ all right" in page and '"beside":[]' in page
    shadowed = [int(n) for n in re.findall(r'"shadowed":(\d+)', (tmp_path / "my_run" / "results.jsonl").read_text())]
    assert len(shadowed) == 5 and min(shadowed) > 0                # the camera sees the mesh, and the light throws a shadow


@pytest.mark.slow
def test_a_newcomer_starts_from_a_clone(tmp_path):
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(tmp_path / "clone")], check=True)
    (tmp_path / "clone" / "courtyard.obj").write_text(A_MESH)
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    follow(transcript(), tmp_path / "clone", environment)
    assert "✓ all right" in (tmp_path / "clone" / "courtyard.html").read_text(encoding="utf-8")


def test_init_does_not_overwrite_and_tells_bad_meshes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mesh.obj").write_text(A_MESH)
    assert CliRunner().invoke(cli, ["init", "mine", "--mesh", "mesh.obj"]).exit_code == 0
    assert "already" in str(CliRunner().invoke(cli, ["init", "mine", "--mesh", "mesh.obj"]).exception)
    assert "no_such.obj" in str(CliRunner().invoke(cli, ["init", "other", "--mesh", "no_such.obj"]).exception)
    assert not (tmp_path / "other.yaml").exists()
