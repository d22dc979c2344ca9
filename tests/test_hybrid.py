"""The hybrid of shadow maps and volumes: exact on its mask, wrong elsewhere only where four comparisons agree wrongly."""

import hashlib
import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from shadowbench.algorithms import ALGORITHMS
from shadowbench.algorithms.base import Probe
from shadowbench.algorithms.hybrid import (
    LIT_BY_MAP,
    LIT_BY_VOLUMES,
    SHADOWED_BY_MAP,
    SHADOWED_BY_VOLUMES,
    Hybrid,
    computation_mask,
)
from shadowbench.algorithms.reference import reference_frame
from shadowbench.algorithms.shadow_map import ShadowMap
from shadowbench.algorithms.z_fail import ZFail
from shadowbench.geometry import Camera, ImageSize, Light
from shadowbench.jit import set_threads
from shadowbench.kernels.depth_maps import CELL_BORDER, Receivers, compare_corners, render_depth
from shadowbench.kernels.light_maps import fit_light_maps
from shadowbench.kernels.mask_runs import cut_spans, find_runs
from tests.hard_cases import HARD_CASES, Case, ground, mesh_of, soup
from tests.silhouette_twin import twin_silhouette_map
from tests.stencil_twin import stencil_counts
from tests.test_shadow_map import ABOVE, AMONG, PARALLEL, make_frame, scene, twin_fit, twin_locate
from tests.test_silhouette_map import scene_frame, wrong_samples


def run(frame, **params):
    """Run the counting build and the timing build; they must agree."""
    algorithm, counting, timing = Hybrid(Hybrid.Params(**params)), Probe(counting=True), Probe()
    buffer = algorithm.shadows(frame, counting)
    plain = algorithm.shadows(frame, timing)
    np.testing.assert_array_equal(buffer.shadow, plain.shadow)
    assert tuple(timing.stages) == Hybrid.stages and not timing.counts and not plain.images
    assert buffer.shadow.dtype == np.float32 and np.all(buffer.shadow[~frame.samples.candidate] == 0)
    return buffer, counting


def by_volumes(buffer):
    """Candidates that volumes decided about, read off the picture."""
    flat = buffer.images["classification"].reshape(-1, 3)
    return np.all(flat == SHADOWED_BY_VOLUMES, axis=1) | np.all(flat == LIT_BY_VOLUMES, axis=1)


# --- The slow twin -------------------------------------------------------------------------------------------------


def twin_mask(wanted, tile):
    """Mask and number of tiles rejected, tile by tile."""
    mask, n_rejected = np.zeros_like(wanted), 0
    for row in range(0, wanted.shape[0], tile):
        for column in range(0, wanted.shape[1], tile):
            block = (slice(row, row + tile), slice(column, column + tile))
            mask[block] = wanted[block].any()
            n_rejected += not wanted[block].any()
    return mask, n_rejected


@settings(deadline=None, max_examples=50)
@given(st.integers(1, 40), st.integers(1, 40), st.sampled_from([1, 8, 16]), st.integers(0, 99), st.floats(0, 0.1))
def test_mask_is_grown_to_tiles(rows, columns, tile, seed, share):
    wanted = np.random.default_rng(seed).random((rows, columns)) < share
    mask, n_rejected = computation_mask(wanted, tile)
    expected = twin_mask(wanted, tile)
    np.testing.assert_array_equal(mask, expected[0])
    assert n_rejected == expected[1] and mask.flags.c_contiguous


@settings(deadline=None, max_examples=50)
@given(st.integers(1, 6), st.integers(1, 30), st.integers(0, 10**6), st.floats(0, 1))
def test_spans_are_cut_to_the_mask(rows, columns, seed, share):
    """Sample by sample: a piece covers what both its span and the mask cover."""
    rng = np.random.default_rng(seed)
    mask = np.pad(rng.random((rows, columns)) < share, ((2, 1), (0, 0)), constant_values=True)
    spans, expected = [], np.zeros(mask.shape, int)
    for row in range(2, 2 + rows):
        cuts = np.sort(rng.integers(0, columns + 1, 4))
        for first, end, winding in ((cuts[0], cuts[1], 1), (cuts[2], cuts[3], -2)):
            if first < end:
                spans.append((row, first, end, winding))
                expected[row, first:end] = winding * mask[row, first:end]
    masked = find_runs(mask, 2, 1 + rows, 2)
    n = cut_spans(np.array(spans, np.int64).reshape(-1, 4), len(spans), masked)
    found = np.zeros(mask.shape, int)
    for row, first, end, winding in masked.pieces[:n]:
        assert first < end and not found[row, first:end].any()
        found[row, first:end] = winding
    np.testing.assert_array_equal(found, expected)
    assert find_runs(np.zeros((0, 0), bool), 0, 3, 2).runs.shape == (0, 2)


@pytest.mark.parametrize(("light", "projection", "tile", "casters"), [
    (ABOVE, "auto", 1, "all"), (AMONG, "cube", 8, "all"), (AMONG, "spot", 16, "back_faces"), (PARALLEL, "auto", 8, "all")])
def test_counts_equal_the_twin(light, projection, tile, casters):
    frame = make_frame(scene(10, seed=4), light, ImageSize(24, 18))
    options = {"resolution": 11, "projection": projection, "bias": 0.7, "slope_bias": 0.9, "casters": casters}
    buffer, probe = run(frame, mask_tile=tile, **options)
    samples = frame.samples
    twin = twin_silhouette_map(frame, order="index", **options)
    silhouette = (twin.nearer > 0) & (twin.nearer < 15)
    mask, n_rejected = twin_mask(silhouette.reshape(samples.rows, samples.columns), tile)
    mask = mask.reshape(-1)
    casting = np.ones(frame.mesh.n_triangles, bool)
    if casters == "back_faces":
        casting = Hybrid(Hybrid.Params(casters=casters)).casters(frame)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        fragments, updates = stencil_counts(frame.mesh.corners, light.xyzw(), frame.bias, frame.camera, samples, casting,
                                            True, False)
    assert probe.counts == {
        "map_fragments": twin.counts["map_fragments"], "map_texels_written": twin.counts["map_texels_written"],
        "corner_reads": 4 * samples.candidate.sum(), "silhouette_samples": silhouette.sum(),
        "silhouette_samples_culled": 0, "mask_samples": mask.sum(), "mask_tiles_rejected": n_rejected,
        "stencil_fragments": fragments.sum(), "depth_tests": fragments[mask].sum(), "stencil_updates": updates[mask].sum(),
        "stencil_updates_on_silhouettes": updates[silhouette].sum(),
        "stencil_updates_beside": updates[mask & ~silhouette].sum()}
    assert (probe.counts["stencil_updates_beside"] == 0) == (tile == 1) and silhouette.any()
    np.testing.assert_array_equal(probe.heat, updates * mask)
    exact = ZFail(ZFail.Params(casters=casters)).shadows(frame, Probe()).shadow
    np.testing.assert_array_equal(buffer.shadow, np.where(mask, exact, twin.nearer == 15))


# --- Where it is right, and where it errs --------------------------------------------------------------------------


def check_errors(frame, **params):
    """Errors lie outside the mask where four comparisons agree; return their number and the share of the mask."""
    buffer, probe = run(frame, **params)
    truth, ambiguous = reference_frame(frame, Probe())
    wrong = (buffer.shadow != truth) & ~ambiguous & frame.samples.candidate
    drawn = by_volumes(buffer)
    assert not np.any(wrong & drawn)
    samples, options = frame.samples, Hybrid.Params(**params)
    maps = fit_light_maps(frame.light.xyzw(), samples.position, samples.candidate, "auto", options.resolution, CELL_BORDER)
    depth = render_depth(maps, frame.mesh.vertices, frame.mesh.triangles).depth
    nearer = compare_corners(maps, depth, Receivers(samples.position, samples.normal, samples.candidate, frame.bias, 1.0))
    assert np.all(np.isin(nearer[~drawn], (0, 15)))
    np.testing.assert_array_equal(nearer[wrong] == 15, buffer.shadow[wrong] == 1)
    assert probe.counts["silhouette_samples"] == np.count_nonzero(~np.isin(nearer, (0, 15)))
    every = ZFail(ZFail.Params()).shadows(frame, Probe()).shadow
    np.testing.assert_array_equal(buffer.shadow[drawn], every[drawn])
    return int(wrong.sum()), float(drawn.sum() / max(1, frame.samples.candidate.sum()))


def test_errors_are_missed_casters_alone():
    n_wrong = 0
    for i, (name, case) in enumerate(HARD_CASES.items()):
        frame = case.frame()
        wrong, share = check_errors(frame, resolution=24, mask_tile=(1, 8)[i % 2])
        n_wrong += wrong
        assert share < 1.0 or wrong == 0, name
    for seed in range(6):
        n_wrong += check_errors(soup(seed, kind=("random", "slivers", "grid")[seed % 3]).frame(), resolution=16)[0]
    assert n_wrong > 0, "small casters must be missed somewhere, or this test can't fail"


@pytest.mark.parametrize(("name", "size"), [("cubes", 192), ("dragon_cage", 192)])
def test_errors_on_scenes(name, size):
    wrong, share = check_errors(scene_frame(name, size), resolution=64)
    assert 0 < wrong < 0.01 * size * size and 0.005 < share < 0.4


def test_a_caster_smaller_than_a_texel_is_missed():
    """Both parents show: the map misses a small plate altogether, and where it is seen its edge is exact."""
    plate = np.array([[[0, 2, 0], [0, 2, 0.3], [0.3, 2, 0.3]], [[0, 2, 0], [0.3, 2, 0.3], [0.3, 2, 0]]])
    frame = Case(mesh_of(ground(), plate + [1.1, 0, 0.7]), Camera((3, 3, 4), (0.5, 0, 0.5)),
                 Light.directional(0.3, -1, 0.2), ImageSize(96, 96)).frame()
    truth, ambiguous = reference_frame(frame, Probe())
    assert truth.sum() > 20
    lost = run(frame, resolution=8)[0].shadow
    assert not lost.any()
    assert np.array_equal(run(frame, resolution=1024)[0].shadow[~ambiguous], truth[~ambiguous])


@pytest.mark.slow
def test_errors_on_cubes_fall_tenfold():
    frame = scene_frame("cubes", 1024)
    truth = reference_frame(frame, Probe())
    wrong = {n: wrong_samples(frame, truth, run(frame, resolution=n)[0].shadow) for n in (64, 256, 4096)}
    print(wrong)
    assert 10 * wrong[4096] <= wrong[256] < 0.1 * wrong[64]


def twin_ratio(frame, fitted, resolution, i):
    """Stamminger and Drettakis 2002, eq. 1: size of a texel of the map over that of a pixel, seen at sample i."""
    faces, eye, spot = fitted
    parallel, position, normal = frame.light.is_directional, frame.samples.position[i], frame.samples.normal[i]
    face, _, _, depth = twin_locate(faces, eye, spot, parallel, position)
    texel = 2 * faces[face][1] / resolution * (1 if parallel else depth)
    to_light = np.array(frame.light.position[:3]) - (0 if parallel else position)
    to_eye = frame.camera.eye - position
    light_angle, eye_angle = (v @ normal / np.linalg.norm(v) for v in (to_light, to_eye))
    return texel * eye_angle / light_angle / (frame.pixel_footprint * frame.samples.depth[i])


@pytest.mark.parametrize("light", [ABOVE, AMONG, PARALLEL])
def test_undersampled_only_leaves_out_texels_smaller_than_a_pixel(light):
    frame, n_culled = make_frame(scene(), light), []
    fitted = twin_fit(frame, "auto")
    for resolution in (16, 40, 1024):
        plain, every = run(frame, resolution=resolution)
        buffer, probe = run(frame, resolution=resolution, undersampled_only=True)
        counts, silhouette = probe.counts, by_volumes(plain)
        culled = silhouette & ~by_volumes(buffer)
        assert counts["silhouette_samples"] == every.counts["silhouette_samples"] == silhouette.sum()
        assert counts["silhouette_samples_culled"] == culled.sum()
        assert counts["mask_samples"] == silhouette.sum() - culled.sum()
        ratios = np.array([twin_ratio(frame, fitted, resolution, i) for i in np.flatnonzero(silhouette)])
        assert np.abs(ratios - 1).min() > 1e-9
        np.testing.assert_array_equal(culled[silhouette], ratios < 1)
        n_culled.append(culled.sum() / silhouette.sum())
        # There the nearest texel decides, as in a shadow map
        by_map = ShadowMap(ShadowMap.Params(resolution=resolution)).shadows(frame, Probe()).shadow
        np.testing.assert_array_equal(buffer.shadow[culled], by_map[culled])
    assert n_culled[0] < n_culled[1] <= n_culled[2] == 1.0


def test_classification_picture():
    frame = soup(2).frame()
    buffer, probe = run(frame, resolution=32)
    flat, candidate = buffer.images["classification"].reshape(-1, 3), frame.samples.candidate
    colors = {c: np.all(flat == c, axis=1) for c in (SHADOWED_BY_MAP, LIT_BY_MAP, SHADOWED_BY_VOLUMES, LIT_BY_VOLUMES)}
    assert all(found.any() for found in colors.values())
    assert np.array_equal(np.any(list(colors.values()), axis=0), candidate)
    dark = colors[SHADOWED_BY_MAP] | colors[SHADOWED_BY_VOLUMES]
    assert np.array_equal(dark, buffer.shadow > 0)
    assert by_volumes(buffer).sum() == probe.counts["mask_samples"]


# --- Threads, machines, speed --------------------------------------------------------------------------------------


def fingerprint():
    """Digest of shadows, heat maps and counts on a few frames, at several thread counts."""
    digest = hashlib.sha256()
    for threads in (1, 2, 4):
        set_threads(threads)
        part = hashlib.sha256()
        for case in (soup(5), soup(6, kind="grid"), HARD_CASES["camera in many shadow volumes"]):
            for undersampled_only in (False, True):
                frame = case.frame()
                buffer, probe = run(frame, resolution=64, mask_tile=8, undersampled_only=undersampled_only, casters="auto")
                part.update(buffer.shadow.tobytes() + probe.heat.tobytes() + buffer.images["classification"].tobytes())
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
@pytest.mark.slow
def test_same_bits_with_generic_code(capsys):
    own = fingerprint()
    capsys.readouterr()
    environment = {**os.environ, "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    script = "from tests.test_hybrid import fingerprint; print(fingerprint())"
    other = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert other.stdout.split()[-1] == own


def test_parameters_and_memory():
    for bad in ({"resolution": 0}, {"mask_tile": 4}, {"stencil_bits": 8}, {"bias": -1.0}):
        with pytest.raises(ValidationError):
            Hybrid.Params(**bad)
    entry = ALGORITHMS["hybrid"]
    assert entry.load() is Hybrid
    assert (entry.title, entry.paper, entry.exact) == (Hybrid.title, Hybrid.paper, Hybrid.exact)
    probe = run(make_frame(scene(), ABOVE), resolution=100)[1]
    assert set(probe.counts) == set(Hybrid.counters)
    n_samples = 48 * 36
    assert probe.memory_bytes["maps"] == 104 * 104 * 12 and probe.memory_bytes["mask"] == n_samples
    assert probe.memory_bytes["stencil"] == 4 * n_samples


def best_of(algorithm, frame, repeats=3):
    """Smallest wall time in seconds of several calls."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        algorithm.shadows(frame, Probe())
        times.append(time.perf_counter() - start)
    return min(times)


@pytest.mark.bench
@pytest.mark.parametrize("name", ["cubes", "dragon_cage"])
def test_updates_shrink_with_the_mask(name, capsys):
    frame = scene_frame(name, 1024)
    set_threads(1)
    z_fail, whole = ZFail(ZFail.Params()), Probe(counting=True)
    z_fail.shadows(frame, whole)
    n_samples, seconds = len(frame.samples.candidate), best_of(z_fail, frame)
    for tile in (1, 8, 16):
        hybrid = Hybrid(Hybrid.Params(resolution=1024, mask_tile=tile))
        probe = Probe(counting=True)
        hybrid.shadows(frame, probe)
        updates = probe.counts["stencil_updates"] / whole.counts["stencil_updates"]
        mask = probe.counts["mask_samples"] / n_samples
        with capsys.disabled():
            print(f"\n{name}, tiles of {tile}: mask {mask:.1%} of the samples, {updates:.1%} of the updates of z_fail, "
                  f"{best_of(hybrid, frame) / seconds:.2f} of its time; overdraw "
                  f"{whole.counts['stencil_fragments'] / n_samples:.1f}")
        # Shadow edges lie where volumes overlap, so the mask's samples cost more than the average
        assert updates < 3 * mask < 1
