"""Stencil shadow volumes: classical failures on demand, counts against a slow twin, switches, determinism.

That no sample is wrong with robust settings is tested together with the other exact methods.
"""

import hashlib
import html
import json
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.algorithms.reference import reference_frame
from shadowbench.algorithms.z_fail import ZFail
from shadowbench.algorithms.z_pass import ZPass
from shadowbench.geometry import Camera, Frame, ImageSize, Light
from shadowbench.jit import set_threads
from shadowbench.kernels import stencil_volumes
from shadowbench.kernels.edges import edge_multiplicities
from shadowbench.kernels.shadow_volumes import find_casters
from shadowbench.kernels.volume_extrusion import VolumeKind, make_faces
from shadowbench.kernels.volume_limits import no_limits
from shadowbench.kernels.volume_polygons import volume_view
from shadowbench.plan import RunOptions, describe, plan_cells
from shadowbench.probe import Probe
from shadowbench.progress import Progress
from shadowbench.report.html import write_report
from shadowbench.report.table import summary
from shadowbench.results import RunFolder
from shadowbench.runner import Runner
from shadowbench.scenes.loader import load_scene
from tests.hard_cases import HARD_CASES, Case, box, ground, mesh_of, soup
from tests.stencil_twin import shadow_counts, stencil_counts

METHODS = pytest.mark.parametrize("method", [ZPass, ZFail])


def run(method, frame, **params):
    """Shadow and probe of a counting run."""
    probe = Probe(counting=True)
    return method(method.Params(**params)).shadows(frame, probe).shadow, probe


def wrong(shadow, frame):
    """Samples that differ from the reference and are no ties."""
    truth, ambiguous = reference_frame(frame, Probe())
    return int(np.count_nonzero((shadow != truth) & ~ambiguous & frame.samples.candidate))


def small_soup(seed, directional):
    """Few triangles of two parts, some of which share edges, over a floor, in general position."""
    rng = np.random.default_rng(seed)
    loose = rng.normal(size=(4, 3, 3)) * 1.5
    fan = rng.normal(size=(5, 3))
    bound = fan[[[0, 1, 2], [1, 2, 3], [0, 2, 4], [3, 2, 1]]]
    floor = ground(6.0) @ np.linalg.qr(rng.normal(size=(3, 3)))[0] * 1.01 + [0, -3, 0]
    light = Light(tuple(rng.normal(size=3) * 4 + [0, 3, 0]) + (0.0 if directional else 1.0,))
    camera = Camera(tuple(rng.normal(size=3) * 3), tuple(rng.normal(size=3)), (0.1, 1.0, 0.2), 75.0, 0.05)
    case = Case(mesh_of(floor, loose, bound), camera, light, ImageSize(int(rng.integers(1, 30)), 17))
    frame = case.frame()
    return Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, 1e-3)


@METHODS
@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32), directional=st.booleans(), per_triangle=st.booleans())
def test_counts_equal_the_twin(method, seed, directional, per_triangle):
    frame = small_soup(seed, directional)
    shadow, probe = run(method, frame, extrude="triangle" if per_triangle else "silhouette")
    assert probe.counts.get("sample_tests", 0) == 0
    casting = np.ones(frame.mesh.n_triangles, np.bool_)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        fragments, updates = stencil_counts(frame.mesh.corners, frame.light.xyzw(), frame.bias, frame.camera,
                                            frame.samples, casting, method is ZFail, per_triangle)
    assert probe.counts["stencil_fragments"] == probe.counts["depth_tests"] == fragments.sum()
    assert probe.counts["stencil_updates"] == updates.sum() == probe.all_counts()["test_and_set"]
    assert np.array_equal(probe.heat, updates)
    assert probe.triangle_counts["stencil_updates"].sum() == updates.sum()
    samples, light = frame.samples, frame.light.xyzw()
    surface = samples.triangle >= 0
    count = shadow_counts(frame.mesh.corners, light, frame.bias, samples.position)
    assert probe.counts["peak_stencil"] == count[surface].max(initial=0)
    assert np.array_equal(shadow > 0, (count > 0) & samples.candidate)
    if method is ZPass:
        eye = shadow_counts(frame.mesh.corners, light, frame.bias, frame.camera.eye[None])[0]
        assert (probe.counts["eye_volumes"], probe.counts["eye_volumes_ignored"]) == (eye, 0)


def test_an_edge_is_drawn_as_often_as_its_multiplicity():
    """A closed box has 6 silhouette edges: drawn twice with all casters, once with back faces."""
    frame = Case(mesh_of(ground(), box((-1, 1, -1), (1, 2, 1))), Camera((5, 6, 7), (0, 0, 0)),
                 Light.point(4, 9, 3)).frame()
    adjacency = stencil_volumes.prepare_volumes(frame.mesh, "all", False).adjacency
    view = volume_view(frame.camera, frame.samples, 0.05)
    for casters, times in (("all", 2), ("back_faces", 1)):
        chosen = stencil_volumes.choose_casters(frame.mesh.corners, frame.light.xyzw(), casters, None)
        facing = find_casters(adjacency, frame.light.xyzw(), chosen, frame.bias, view).facing.copy()
        facing[:2] = 0                                                      # the ground
        multiplicity = np.abs(edge_multiplicities(adjacency, facing))
        assert sorted(multiplicity[multiplicity > 0].tolist()) == [times] * 6


@pytest.mark.parametrize("name", ["camera in a shadow volume", "camera in many shadow volumes"])
def test_z_pass_without_eye_count_fails_everywhere(name):
    frame = HARD_CASES[name].frame()
    shadow, probe = run(ZPass, frame, eye_count="off")
    assert wrong(shadow, frame) > 0.3 * frame.samples.candidate.sum()
    assert probe.counts["eye_volumes_ignored"] > 0 and probe.counts["eye_tests"] == 0
    shadow, probe = run(ZPass, frame)
    assert wrong(shadow, frame) == 0
    assert probe.counts["eye_volumes_ignored"] == 0 < probe.counts["eye_volumes"]


def stack(n):
    """A floor under n parallel plates, all above one another, seen from the side."""
    plate = np.array([[[-2.0, 2, -2], [2, 2, 2], [2, 2, -2]], [[-2.0, 2, -2], [-2, 2, 2], [2, 2, 2]]])
    return Case(mesh_of(ground(), *[plate + [0, 0.01 * i, 0] for i in range(n)]), Camera((6, 1.5, 5), (0, 0, 0)),
                Light.directional(0.1, -1, 0.05))


@METHODS
def test_eight_bits_overflow_from_256_volumes_on(method):
    for n, lost in ((255, False), (256, True), (257, False)):
        frame = stack(n).frame()
        shadow, probe = run(method, frame, stencil_bits=8)
        assert probe.counts["peak_stencil"] == n
        assert (probe.counts["stencil_overflows"] > 0) == (n > 255)
        assert (probe.counts["stencil_overflows_lit"] > 20) == lost == (wrong(shadow, frame) > 20)
        if lost:
            assert probe.counts["stencil_overflows_lit"] == wrong(shadow, frame)
        for bits in (16, 32):
            shadow, probe = run(method, frame, stencil_bits=bits)
            assert wrong(shadow, frame) == probe.counts["stencil_overflows"] == 0
            assert probe.memory_bytes["stencil"] == frame.samples.depth.size * bits // 8


def run_in_words(case, method, folder, **params):
    """The summary table, the report's text and the warnings of a run of a case through a scene file."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in case.mesh.vertices.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in case.mesh.triangles.tolist()]
    (folder / "mesh.obj").write_text("\n".join(lines))
    camera, light = case.camera, case.light.xyzw().tolist()
    where = f"{{position: {light[:3]}}}" if light[3] else f"{{direction: {[-x for x in light[:3]]}}}"
    (folder / "case.yaml").write_text(
        f"geometry: [{{mesh: mesh.obj}}]\nlight: {where}\n"
        f"camera: {{eye: {list(camera.eye)}, target: {list(camera.target)}, near: {camera.near}}}\n"
        f"image: {{width: {case.image.width}, height: {case.image.height}}}\n")
    scene = load_scene(folder / "case.yaml")
    cells = plan_cells(scene, [(method.name, method.Params(**params))], [0])
    options = RunOptions((0,), only=frozenset({"counts"}))
    run = RunFolder(folder / "run", describe(scene, options, ["shadowbench"]), len(cells))
    with Progress(len(cells), quiet=True) as progress:
        result = Runner(scene, 0.0, cells, options, run, progress).run([cell.key for cell in cells])
    write_report(run)
    return summary(result.cells), html.unescape((folder / "run" / "report.html").read_text()), result


@METHODS
def test_table_and_report_name_an_overflow(method, tmp_path):
    table, report, result = run_in_words(stack(256), method, tmp_path, stencil_bits=8)
    n_lost = result.cells[0].accuracy.false_light
    sentence = f"a count of 256 wrapped to 0; {n_lost:,} samples lit that should be dark"
    assert n_lost > 20 and "the 8-bit stencil overflowed" in table
    assert sentence in table and sentence in report and any(sentence in text for text in result.warnings)
    assert not any("meant to be exact" in text for text in result.warnings)


def test_table_and_report_name_volumes_around_the_eye(tmp_path):
    case = HARD_CASES["camera in many shadow volumes"]
    for setting in ("off", "robust"):
        folder = tmp_path / setting
        folder.mkdir()
        table, report, result = run_in_words(case, ZPass, folder, eye_count=setting)
        n_around, a = result.cells[0].counts["eye_volumes"], result.cells[0].accuracy
        sentence = (f"the eye is in {n_around} shadow volumes that were not counted (eye_count=off); "
                    f"{a.false_shadow + a.false_light:,} samples wrong")
        assert n_around > 1
        assert (sentence in table) == (sentence in report) == (setting == "off")
        assert (sentence in " ".join(result.warnings)) == bool(result.warnings) == (setting == "off")


def test_overflow_spoils_the_whole_screen():
    """256 plates between light and scene, out of sight: with 8 bits the shadow is lost everywhere."""
    plate = np.array([[[-90.0, 30, -90], [90, 30, 90], [90, 30, -90]], [[-90.0, 30, -90], [-90, 30, 90], [90, 30, 90]]])
    frame = Case(mesh_of(ground(), *[plate + [0, i / 64, 0] for i in range(256)]), Camera((6, 4, 5), (0, 0, 0)),
                 Light.directional(0.1, -1, 0.05)).frame()
    for method in (ZPass, ZFail):
        shadow, probe = run(method, frame, stencil_bits=8)
        assert wrong(shadow, frame) == frame.samples.candidate.sum() == probe.counts["stencil_overflows_lit"] > 500
        assert wrong(run(method, frame)[0], frame) == 0


@METHODS
def test_scissor_and_depth_bounds_save_work_and_change_nothing(method):
    boxes = [box((x, 0.5, z), (x + 0.5, 1, z + 0.5)) for x in (-4, 0, 3) for z in (-4, 0, 3)]
    frame = Case(mesh_of(ground(), *boxes), Camera((7, 4, 8), (0, 0, 0)), Light.point(1, 6, 2)).frame()
    plain, probe = run(method, frame)
    previous = probe.counts
    for switches in ({"scissor": True}, {"scissor": True, "depth_bounds": True}):
        shadow, probe = run(method, frame, **switches)
        assert np.array_equal(shadow, plain)
        assert probe.counts["depth_tests"] < previous["depth_tests"]
        previous = probe.counts
    bounded = run(method, frame, depth_bounds=True)[1].counts
    assert bounded["depth_tests"] < bounded["stencil_fragments"]


def test_mask_draws_on_its_samples_alone():
    frame = soup(3).frame()
    light, samples = frame.light.xyzw(), frame.samples
    adjacency = stencil_volumes.prepare_volumes(frame.mesh, "all", False).adjacency
    view = volume_view(frame.camera, samples, 0.5 * frame.camera.near)
    casters = find_casters(adjacency, light, None, frame.bias, view)
    faces = make_faces(view, adjacency, light, casters, edge_multiplicities(adjacency, casters.facing), frame.bias,
                       VolumeKind(False, not frame.light.is_directional))
    mask = np.random.default_rng(0).random((samples.rows, samples.columns)) < 0.3
    results = []
    for chosen in (stencil_volumes.NO_MASK, mask):
        target = stencil_volumes.empty_stencil(samples)
        limits = no_limits(frame.mesh.n_triangles, samples)
        drawn = stencil_volumes.draw_volumes(view, faces, True, target, limits, chosen, counting=True)
        results.append((target.stencil, drawn.per_sample))
    (whole, all_counts), (masked, mask_counts) = results
    assert np.array_equal(masked, whole * mask) and masked.any()
    assert np.array_equal(mask_counts.depth_tests, all_counts.depth_tests * mask)
    assert np.array_equal(mask_counts.fragments, all_counts.fragments)


def fingerprint():
    """Digest of shadows, heat maps and counts of both methods on a few frames, at several thread counts."""
    digest = hashlib.sha256()
    for threads in (1, 2, 4):
        set_threads(threads)
        part = hashlib.sha256()
        for case in (soup(5), soup(6, kind="grid"), HARD_CASES["camera in many shadow volumes"]):
            frame = case.frame()
            for method in (ZPass, ZFail):
                shadow, probe = run(method, frame, scissor=True, casters="auto")
                part.update(shadow.tobytes() + probe.heat.tobytes())
                part.update(probe.triangle_counts["stencil_updates"].tobytes())
                part.update(json.dumps(probe.all_counts()).encode())
        digest.update(part.digest())
        print(part.hexdigest())
    set_threads(1)
    return digest.hexdigest()


def test_same_bits_at_any_thread_count(capsys):
    fingerprint()
    assert len(set(capsys.readouterr().out.split())) == 1


@pytest.mark.slow
def test_same_bits_with_generic_code(capsys):
    own = fingerprint()
    capsys.readouterr()
    environment = {**os.environ, "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    script = "from tests.test_z_pass_z_fail import fingerprint; print(fingerprint())"
    other = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert other.stdout.split()[-1] == own
