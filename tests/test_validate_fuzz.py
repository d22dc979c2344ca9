"""Mutated scene files: whatever is in them, `validate` ends with 0 or 2, says where, and neither hangs nor crashes."""

import random
import re
import signal
from contextlib import contextmanager
from pathlib import Path

import pytest

from shadowbench.templates import template
from tests.command_line import call

ROOT = Path(__file__).parent.parent
SECONDS = 20
RICH = """\
name: rich
geometry:
  - generate: plane_box
    scale: [1, 2, 3]
    triangles: 62
    seed: 1
    material: {alpha: 1.0, color: [1, 1, 1], alpha_cutoff: 0.5}
    animate: {path: [{frame: 0}, {frame: 3, rotate: [0, 90, 0], translate: [1, 2, 3]}]}
camera: {path: [{eye: [0, 0, 5], target: [0, 0, 0]}, {eye: [1, 1, 5], target: [0, 0, 0]}], up: [0, 1, 0], near: 0.1, far: 99}
light: {path: [[3, 6, 2], [-3, 6, 2]], closed: true}
image: {width: 64, height: 48, samples: 4}
frames: 4
bias: 1e-4
algorithms: [reference, ptsv: {branching: 16, casters: back_faces}, cluster: {bounds: implicit}]
matrix: {ptsv.branching: [8, 32], image.width: [16, 32], light.direction: [[0, -1, 0]]}
"""
SOURCES = [RICH, template(), *(path.read_text() for path in sorted((ROOT / "configs").glob("*.yaml")) if path.stem != "ci")]
ODD = ["-1", "0", "1e400", "-1e400", ".nan", ".inf", "1e-4", "0x10", "1_000", "99999999999999999999999", "null", "~", "true",
       "no", "''", "[]", "{}", "[[]]", "[1, 2]", "{a: b}", "&a [*a]", "*a", "!!int x", "!!binary aa",
       "!!python/object:os.system x",
       "<<: {a: 1}", "2001-01-01", "\"\\ud800\"", "|\n  text", "? x", "- -", "'", "\"", "#", "%", "@", "`", "\t", "\u2028",
       "é",
       "[" * 60, "{a: " * 40, "x" * 5000, "1" * 400, "../../../etc/passwd", "\0"]


def mutate(text: str, rng: random.Random) -> bytes:
    """Damage a scene file in one to four places, and sometimes its encoding."""
    for _ in range(rng.randint(1, 4)):
        place = rng.randrange(len(text) + 1)
        lines = text.split("\n")
        line = rng.randrange(len(lines))
        kind = rng.randrange(8)
        if kind == 0:
            text = text[:place] + rng.choice(ODD) + text[place:]
        elif kind == 1:
            text = text[:place] + text[place + rng.randint(1, 9):]
        elif kind == 2:
            text = "\n".join(lines[:line] + lines[line + 1:])
        elif kind == 3:
            text = "\n".join([*lines[:line], lines[line], *lines[line:]])
        elif kind == 4:
            text = "\n".join([*lines[:line], " " * rng.randrange(5) + lines[line].lstrip(), *lines[line + 1:]])
        else:
            pattern = r"[-\d.]+" if kind < 7 else r"\w+(?=:)"
            found = list(re.finditer(pattern, text)) or list(re.finditer(r".", text))
            if found:
                match = rng.choice(found)
                text = text[:match.start()] + rng.choice([*ODD, "widht", "generat", "64.5"]) + text[match.end():]
    data = text.encode("utf-8", "surrogatepass")
    kind = rng.randrange(20)
    if kind == 0:
        place = rng.randrange(len(data) + 1)
        return data[:place] + rng.randbytes(rng.randint(1, 8)) + data[place:]
    return {1: lambda: text.encode("utf-16", "surrogatepass"), 2: lambda: b"\xef\xbb\xbf" + data,
            3: lambda: text.encode("latin-1", "replace"), 4: lambda: data.replace(b"\n", b"\r\n"),
            5: lambda: rng.randbytes(200)}.get(kind, lambda: data)()


@contextmanager
def at_most(seconds: int):
    """Raise if the block takes longer."""
    def give_up(*_):
        raise TimeoutError(f"still running after {seconds} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def validate_mutants(seeds: range, folder: Path) -> dict[int, int]:
    """Validate one mutant per seed; returns how often each exit code came."""
    codes: dict[int, int] = {}
    file = folder / "scene.yaml"
    for seed in seeds:
        rng = random.Random(seed)
        file.write_bytes(mutate(rng.choice(SOURCES), rng))
        try:
            with at_most(SECONDS):
                done = call("validate", file)
        except Exception as error:
            raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}") from error
        codes[done.code] = codes.get(done.code, 0) + 1
        if done.code == 0:
            assert done.output == f"{file}: ok\n", seed
        else:
            assert done.code == 2 and done.errors.startswith("error: ") and str(file) in done.errors, seed
            assert re.search(r"\w", done.errors.replace(str(file), "").removeprefix("error: ")), seed
    return codes


def test_a_hundred_mutated_scene_files(tmp_path):
    codes = validate_mutants(range(100), tmp_path)
    assert codes[2] > 20 and codes[0] > 5          # neither all damaged nor all harmless


@pytest.mark.slow
def test_a_thousand_mutated_scene_files(tmp_path):
    validate_mutants(range(1000, 2000), tmp_path)
