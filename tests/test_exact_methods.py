"""Every exact method against the certified reference: hard cases, random soups, built-in scenes, threads."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench import accuracy, jit
from shadowbench.algorithms import ALL_ALGORITHMS
from shadowbench.algorithms.reference import reference_frame
from shadowbench.geometry import Frame
from shadowbench.judge import classify, find_truth
from shadowbench.probe import Probe
from shadowbench.scenes import SCENES
from shadowbench.scenes.loader import load_scene
from shadowbench.view_samples import render_view_samples
from tests.hard_cases import HARD_CASES, soup

SMALL_MAP = 96
EXACT = [entry.name for entry in ALL_ALGORITHMS if entry.exact and entry.name != "reference"]
LOADED = {entry.name: entry.load() for entry in ALL_ALGORITHMS if entry.name in EXACT}


def variants(name: str) -> list[dict]:
    """Every value of every enumerated parameter, one at a time, the others at their defaults."""
    found = [{}]
    for key, info in LOADED[name].Params.model_fields.items():
        values = getattr(info.annotation, "__args__", (True, False) if info.annotation is bool else ())
        found += [{key: value} for value in values if value != info.default]
    return found


VARIANTS = [(name, changed) for name in EXACT for changed in variants(name)]
IDS = [f"{name}-{'-'.join(f'{k}={v}' for k, v in changed.items()) or 'default'}" for name, changed in VARIANTS]
BROKEN_ON_PURPOSE = {("z_pass", "eye_count", "off"), ("z_pass", "stencil_bits", 8), ("z_fail", "stencil_bits", 8)}


def make(name: str, changed: dict):
    """An algorithm with small maps, if it has maps: exactness does not depend on their size, but time does."""
    parameters = LOADED[name].Params
    small = {"resolution": SMALL_MAP} if "resolution" in parameters.model_fields else {}
    return LOADED[name](parameters(**small | changed))


def mismatches(name: str, changed: dict, frame: Frame) -> tuple[int, int]:
    """Wrong samples and edge ties of one method on one frame."""
    algorithm = make(name, changed)
    prepared = Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, frame.bias,
                     algorithm.prepare(frame.mesh))
    buffer = algorithm.shadows(prepared, Probe(counting=True))
    truth = find_truth(frame, algorithm.casters(prepared), algorithm.judged_as(prepared))
    errors = classify(algorithm, buffer, truth, frame)
    measured = accuracy.measure(buffer.shadow, errors, truth.ambiguous, frame.samples.candidate)
    assert np.all(buffer.shadow[~frame.samples.candidate] == 0)
    return measured.wrong, measured.edge_tie


@pytest.fixture(scope="module")
def frames():
    """All hard cases, rendered once."""
    return {name: case.frame() for name, case in HARD_CASES.items()}


def test_hard_cases_are_not_trivial(frames):
    mixed = 0
    for frame in frames.values():
        truth, _ = reference_frame(frame, Probe())
        mixed += 0 < truth.sum() < frame.samples.candidate.sum()
    assert mixed >= 0.7 * len(frames)


@pytest.mark.parametrize(("name", "changed"), VARIANTS, ids=IDS)
def test_no_sample_of_the_hard_cases_is_wrong(name, changed, frames):
    if any((name, key, value) in BROKEN_ON_PURPOSE for key, value in changed.items()):
        pytest.skip("reproduces a classical failure, tested with the method")
    wrong = {case: mismatches(name, changed, frame)[0] for case, frame in frames.items()}
    assert {case: n for case, n in wrong.items() if n} == {}


LARGE = ("village", "tree_on_snow", "kitchen", "tree")


@pytest.mark.parametrize("scene_name", [pytest.param(name, marks=pytest.mark.slow) if name in LARGE else name
                                        for name in SCENES])
def test_no_sample_of_a_built_in_scene_is_wrong(scene_name):
    fewer = ["geometry.0.triangles=20000"] if scene_name == "fuzzy" else []
    scene = load_scene(scene_name, ["image.width=160", "image.height=120", *fewer])
    mesh, camera, light = scene.mesh(0), scene.camera(0), scene.light(0)
    samples = render_view_samples(mesh, camera, light, scene.image)
    frame = Frame(mesh, light, camera.basis(4 / 3), scene.image, samples, scene.bias)
    assert {name: mismatches(name, {}, frame)[0] for name in EXACT} == dict.fromkeys(EXACT, 0)


@pytest.mark.parametrize("name", EXACT)
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(["random", "grid", "slivers"]), data=st.data())
def test_no_sample_of_a_random_soup_is_wrong(name, seed, kind, data):
    options = [c for n, c in VARIANTS if n == name and not any((n, k, v) in BROKEN_ON_PURPOSE for k, v in c.items())]
    changed = data.draw(st.sampled_from(options))
    assert mismatches(name, changed, soup(seed, kind=kind).frame())[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), [*product(EXACT, ["random", "grid", "slivers"])])
def test_no_sample_of_500_soups_is_wrong(name, kind):
    options = [c for n, c in VARIANTS if n == name and not any((n, k, v) in BROKEN_ON_PURPOSE for k, v in c.items())]
    wrong = {}
    for seed in range(170):
        changed = options[seed % len(options)]
        n = mismatches(name, changed, soup(seed, kind=kind).frame())[0]
        if n:
            wrong[seed] = (changed, n)
    assert wrong == {}


@pytest.mark.parametrize("name", EXACT)
def test_counts_and_shadows_do_not_depend_on_threads(name):
    frame = soup(7, 200).frame()
    algorithm = make(name, {})
    prepared = Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, frame.bias,
                     algorithm.prepare(frame.mesh))
    results = []
    for n_threads in (1, 2, 4):
        jit.set_threads(n_threads)
        probe = Probe(counting=True)
        results.append((algorithm.shadows(prepared, probe).shadow, probe.all_counts(), probe.heat, probe.levels))
    for other in results[1:]:
        assert np.array_equal(other[0], results[0][0]) and other[1] == results[0][1]
        assert np.array_equal(other[2], results[0][2]) and other[3] == results[0][3]


@pytest.mark.parametrize("name", EXACT)
def test_a_timing_probe_gives_the_same_shadows(name):
    frame = soup(11, 100).frame()
    algorithm = make(name, {})
    prepared = Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, frame.bias,
                     algorithm.prepare(frame.mesh))
    counting, timing = Probe(counting=True), Probe()
    assert np.array_equal(algorithm.shadows(prepared, counting).shadow, algorithm.shadows(prepared, timing).shadow)
    assert set(timing.stages) <= set(algorithm.stages) and set(counting.counts) <= set(algorithm.counters)


