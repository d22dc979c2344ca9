"""Shadows of casters that let light through: against the certified reference, and against slow, obvious twins."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench import jit
from shadowbench.accuracy import ErrorClass
from shadowbench.algorithms.cluster import Cluster
from shadowbench.algorithms.cluster import Params as ClusterParams
from shadowbench.algorithms.ptsv import Params as PtsvParams
from shadowbench.algorithms.ptsv import Ptsv
from shadowbench.algorithms.reference import transparent_frame
from shadowbench.algorithms.z_fail import Params as ZFailParams
from shadowbench.algorithms.z_fail import ZFail
from shadowbench.geometry import Camera, ImageSize, Light, Material
from shadowbench.judge import LIGHT_TOLERANCE, Judge, classify, find_truth
from shadowbench.kernels import transparency
from shadowbench.probe import Probe
from shadowbench.surfaces import look_up, transmittance
from tests.transparent_examples import crossings, frame_of, materials, texture, transparent_mesh, transparent_soup

MODES = ("alpha", "constant", "color")
PLANES = ("none", "silhouette", "wedge", "outline", "outline+wedge")
SHARED = {"transparency": st.sampled_from(MODES), "casters": st.sampled_from(["all", "back_faces"]),
          "culling_planes": st.sampled_from(PLANES), "remove_unlit": st.booleans(), "skip_shadowed": st.booleans(),
          "group": st.sampled_from([1, 8])}
PTSV = st.builds(PtsvParams, branching=st.sampled_from([4, 8, 16, 32, 64]), **SHARED).map(Ptsv)
CLUSTER = st.builds(ClusterParams, bounds=st.sampled_from(["explicit", "implicit"]), **SHARED,
                    leaf=st.sampled_from(["tile", "cluster"]), layout=st.sampled_from(["full", "compact"]),
                    passes=st.sampled_from(["one", "two"])).map(Cluster)
Z_FAIL = st.builds(ZFailParams, transparency=st.just("constant"), extrude=st.sampled_from(["silhouette", "triangle"]),
                   casters=st.sampled_from(["all", "back_faces"])).map(ZFail)
BOTH = ((Ptsv, PtsvParams), (Cluster, ClusterParams))


def shadows(algorithm, frame, counting=True):
    """Run a method; returns its buffer and its probe."""
    prepared = replace(frame, prepared=algorithm.prepare(frame.mesh))
    probe = Probe(counting=counting)
    return algorithm.shadows(prepared, probe), probe


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.one_of(PTSV, CLUSTER, Z_FAIL))
def test_light_on_soups_is_that_of_the_reference(seed, algorithm):
    frame = transparent_soup(seed)
    buffer, probe = shadows(algorithm, frame)
    again, _ = shadows(algorithm, frame, counting=False)
    np.testing.assert_array_equal(buffer.shadow, again.shadow)
    truth = find_truth(frame, algorithm.casters(frame), algorithm.judged_as(frame))
    errors = classify(algorithm, buffer, truth, frame)
    assert np.all(errors[errors != ErrorClass.OK] == ErrorClass.EDGE_TIE)
    assert np.all(buffer.shadow[~frame.samples.candidate] == 0)
    assert set(probe.counts) <= set(algorithm.counters) and set(probe.stages) <= set(algorithm.stages)


@pytest.mark.parametrize("mode", MODES)
def test_the_reference_multiplies_all_crossed_triangles(mode):
    frame = transparent_soup(3, 30, ImageSize(24, 18))
    arriving, ambiguous = transparent_frame(frame, Probe(), mode)
    mesh = frame.mesh
    if mode == "constant":
        mesh = replace(mesh, materials=tuple(replace(m, alpha_texture=None, color_texture=None) for m in mesh.materials))
    light, expected = frame.light.xyzw(), np.ones(arriving.shape)
    for i in np.flatnonzero(frame.samples.candidate):
        for t, weights in zip(*crossings(mesh.corners, light, frame.samples.position[i], frame.bias), strict=True):
            uv = (weights @ mesh.uv[t])[None]
            expected[i] *= transmittance(mesh.materials[mesh.material[t]], uv, mode == "color")[0]
    assert 0.05 < expected[frame.samples.candidate].mean() < 0.95 and ambiguous.sum() < 5
    np.testing.assert_allclose(arriving[~ambiguous], expected[~ambiguous], atol=1e-9)


@settings(deadline=None, max_examples=100)
@given(st.integers(1, 5), st.integers(1, 5), st.tuples(*[st.sampled_from(["repeat", "clamp", "mirror"])] * 2),
       st.tuples(*[st.floats(-3, 3)] * 2))
def test_textures_are_looked_up_with_bilinear_filtering(rows, columns, wrap, uv):
    def texel(row, column):
        places = []
        for index, size, rule in ((row, rows, wrap[1]), (column, columns, wrap[0])):
            line = {"repeat": [*range(size)] * 40, "mirror": [*range(size), *range(size)[::-1]] * 20}.get(rule)
            places.append(min(max(index, 0), size - 1) if line is None else line[index % len(line)])
        return image.pixels[tuple(places)].astype(np.float64)

    image = texture(rows * 7 + columns, rows, columns, wrap)
    x, y = uv[0] * columns - 0.5, (1 - uv[1]) * rows - 0.5
    column, row = int(np.floor(x)), int(np.floor(y))
    expected = sum(texel(row + j, column + i) * (1 - abs(x - column - i)) * (1 - abs(y - row - j))
                   for i in (0, 1) for j in (0, 1))
    np.testing.assert_allclose(look_up(image, np.array([uv]))[0], expected, atol=1e-9)
    wraps = (("repeat", "clamp", "mirror").index(w) for w in wrap)
    *places, fx, fy = transparency.texel_places(columns, rows, *wraps, *uv)
    weights = np.array([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy])
    np.testing.assert_allclose(weights @ image.pixels.reshape(-1, 4)[places], expected, atol=1e-9)


@pytest.mark.parametrize(("method", "params"), BOTH)
def test_the_walk_is_that_of_opaque_casters(method, params):
    """With nothing to skip, a transparent caster is tested where an opaque one is: the same counts, twin-tested there."""
    frame = transparent_soup(5, 40, ImageSize(256, 192))
    surfaces = (Material(), Material("glass", alpha=0.5))
    frame = replace(frame, mesh=replace(frame.mesh, materials=surfaces, material=np.ones_like(frame.mesh.material)))
    _, glass = shadows(method(params(skip_shadowed=False)), frame)
    _, opaque = shadows(method(params(skip_shadowed=False, transparency="off")), frame)
    updates = glass.counts.pop("light_updates")
    assert glass.counts.pop("texture_lookups") == 0
    assert glass.counts == opaque.counts and glass.levels == opaque.levels and updates > glass.counts["trivial_accepts"] > 0
    np.testing.assert_array_equal(glass.heat, opaque.heat)
    np.testing.assert_array_equal(glass.triangle_counts["test_and_set"], opaque.triangle_counts["test_and_set"])


@pytest.mark.parametrize(("method", "params"), BOTH)
def test_a_texture_is_looked_up_once_for_each_crossing(method, params):
    frame = transparent_soup(9, 40)
    surfaces = (Material(), Material("leaf", alpha_texture=texture(1)))
    frame = replace(frame, mesh=replace(frame.mesh, materials=surfaces, material=np.ones_like(frame.mesh.material)))
    _, probe = shadows(method(params(skip_shadowed=False)), frame)
    light, candidates = frame.light.xyzw(), np.flatnonzero(frame.samples.candidate)
    n = sum(len(crossings(frame.mesh.corners, light, frame.samples.position[i], frame.bias)[0]) for i in candidates)
    assert probe.counts["texture_lookups"] == probe.counts["light_updates"] == n > 400


@pytest.mark.parametrize(("method", "params"), BOTH)
def test_light_does_not_depend_on_threads(method, params):
    frame, found = transparent_soup(2, 120), {}
    for mode in ("color", "stochastic"):
        for n_threads in (1, 2, 4):
            jit.set_threads(n_threads)
            buffer, probe = shadows(method(params(transparency=mode)), frame)
            found.setdefault(mode, []).append((buffer.shadow.tobytes(), probe.all_counts(), probe.levels, probe.largest,
                                               probe.heat.tobytes()))
        assert found[mode][0] == found[mode][1] == found[mode][2]


def chance_frame():
    """Panes of one to four layers over a floor, some of them textured."""
    corners, of_material, uv = [], [], []
    for k, (x, width) in enumerate([(-2.0, 4.0), (-1.0, 3.0), (0.0, 2.0), (1.0, 1.0)]):
        square = np.array([[x, -1.5, 1 + 0.3 * k], [x + width, -1.5, 1 + 0.3 * k], [x + width, 1.5, 1 + 0.3 * k],
                           [x, 1.5, 1 + 0.3 * k]])
        corners += [square[[0, 1, 2]], square[[0, 2, 3]]]
        uv += [np.array([[0, 0], [1, 0], [1, 1]]), np.array([[0, 0], [1, 1], [0, 1]])]
        of_material += [4 if k == 2 else 1] * 2
    floor = np.array([[-4, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0.0]])
    corners += [floor[[0, 1, 2]], floor[[0, 2, 3]]]
    mesh = transparent_mesh(corners, [*of_material, 0, 0], materials(11), [*uv, *np.zeros((2, 3, 2))])
    camera = Camera((0, -9, 7), (0, 0, 0.5), (0, 0, 1), 40, 0.1)
    return frame_of(mesh, Light.point(0.3, 0.2, 9.0), camera, ImageSize(24, 18))


@pytest.mark.parametrize(("method", "params"), BOTH)
def test_chance_is_right_on_average(method, params):
    frame, n_seeds = chance_frame(), 256
    arriving, ambiguous = transparent_frame(frame, Probe(), "alpha")
    lit = [1.0 - shadows(method(params(transparency="stochastic", seed=seed)), frame, False)[0].shadow
           for seed in range(n_seeds)]
    assert set(np.unique(lit)) == {0.0, 1.0}
    exact, mean = arriving[~ambiguous, 0], np.mean(lit, axis=0)[~ambiguous]
    standard_error = np.sqrt(exact * (1 - exact) / n_seeds)
    assert len(np.unique(exact.round(6))) > 20
    assert np.all(np.abs(mean - exact) <= 4 * standard_error)


@pytest.mark.parametrize(("method", "params"), BOTH)
def test_chance_takes_one_bit_per_sample(method, params):
    frame = chance_frame()
    by_chance, opaque, real = (shadows(method(params(transparency=mode)), frame)[1].memory_bytes
                               for mode in ("stochastic", "off", "alpha"))
    assert by_chance.keys() == opaque.keys()
    assert {k: v for k, v in by_chance.items() if k != "frustum_planes"} == {
        k: v for k, v in opaque.items() if k != "frustum_planes"}
    assert real["light_hierarchy"] >= 4 * len(frame.samples.depth)


def test_both_methods_draw_the_same_lot():
    frame = chance_frame()
    a, b = (shadows(method(params(transparency="stochastic", seed=7)), frame)[0].shadow for method, params in BOTH)
    np.testing.assert_array_equal(a, b)


def test_draws_are_even_and_unrelated():
    draws = np.array([[transparency.draw(np.uint64(3), i, triangle) for triangle in range(64)] for i in range(256)])
    assert draws.min() >= 0 and draws.max() < 1 and len(np.unique(draws)) == draws.size
    counts = np.histogram(draws, 16, (0, 1))[0]
    assert np.abs(counts - 1024).max() < 5 * 32
    assert np.abs(np.corrcoef(draws, rowvar=False) - np.eye(64)).max() < 0.35


def test_the_judge_finds_what_is_wrong():
    frame = chance_frame()
    judge, method = Judge(frame), Ptsv(PtsvParams())
    [truth] = judge.truths(None, "alpha")
    assert judge.knows(None, "stochastic") and judge.truths(None, "stochastic")[0] is truth and not judge.knows(None, "off")
    buffer, _ = shadows(method, frame)
    sample = np.flatnonzero(frame.samples.candidate & ~truth.ambiguous)[0]
    for change, expected in ((2 * LIGHT_TOLERANCE, ErrorClass.FALSE_SHADOW), (-2 * LIGHT_TOLERANCE, ErrorClass.FALSE_LIGHT)):
        wrong = buffer.shadow.copy()
        wrong[sample] += change
        errors = classify(method, replace(buffer, shadow=wrong), truth, frame)
        assert errors[sample] == expected and np.count_nonzero(errors) == 1
    by_chance = Ptsv(PtsvParams(transparency="stochastic"))
    lit = shadows(by_chance, frame)[0].shadow
    assert not classify(by_chance, replace(buffer, shadow=lit), truth, frame).any()
    lit[np.flatnonzero(frame.samples.candidate & (truth.arriving[:, 0] == 1.0))[0]] = 1.0
    assert np.count_nonzero(classify(by_chance, replace(buffer, shadow=lit), truth, frame)) == 1


def test_fully_opaque_materials_take_the_binary_path():
    frame = transparent_soup(4)
    opaque = tuple(replace(m, alpha=1.0, alpha_texture=None, alpha_cutoff=None) for m in frame.mesh.materials)
    frame = replace(frame, mesh=replace(frame.mesh, materials=opaque))
    for method, params in BOTH:
        (a, p), (b, q) = (shadows(method(params(transparency=mode)), frame) for mode in ("color", "off"))
        assert a.arriving is None and p.all_counts() == q.all_counts()
        np.testing.assert_array_equal(a.shadow, b.shadow)
