"""Per-triangle shadow volumes: exactness against the certified reference, and counts against a slow twin."""

import json
import os
import subprocess
import sys
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.algorithms.ptsv import EYE_EDGES, Params, Ptsv
from shadowbench.algorithms.reference import reference_frame
from shadowbench.geometry import Camera, Frame, ImageSize, Light, Mesh
from shadowbench.jit import set_threads
from shadowbench.kernels.depth_hierarchy import tile_levels
from shadowbench.kernels.frustum_groups import group_triangles
from shadowbench.kernels.group_frustum import make_groups
from shadowbench.kernels.shadow_frustum import View, casting_triangles, find_facing, make_frusta
from shadowbench.probe import Probe
from shadowbench.view_samples import render_view_samples
from tests.ptsv_twin import Twin

BRANCHINGS = (4, 8, 16, 32, 64)
PLANES = tuple(EYE_EDGES)
SEEDS = st.integers(0, 10**6)
OPTIONS = st.builds(Params, branching=st.sampled_from(BRANCHINGS), culling_planes=st.sampled_from(PLANES),
                    casters=st.sampled_from(["all", "back_faces", "auto"]), remove_unlit=st.booleans(),
                    skip_shadowed=st.booleans(), group=st.sampled_from([1, 1, 8, 16, 64]))


def make_frame(corners, light, camera, image=None, bias=None):
    """Render the view samples of loose triangles, float (n, 3, 3), or of a mesh."""
    if not isinstance(corners, Mesh):
        corners = Mesh.from_arrays(np.reshape(corners, (-1, 3)), np.arange(3 * len(corners)).reshape(-1, 3))
    image = image or ImageSize(48, 40)
    samples = render_view_samples(corners, camera, light, image)
    bias = 1e-5 * corners.diagonal() if bias is None else bias
    return Frame(corners, light, camera.basis(image.width / image.height), image, samples, bias)


def random_frame(seed, kind, n=60, image=None):
    """A soup above and through a floor, lit and seen from somewhere."""
    rng = np.random.default_rng(seed)
    if kind == "grid":
        corners = rng.integers(-3, 4, (n, 3, 3)).astype(float)
        eye, position = rng.integers(-4, 5, 3) + 0.5, rng.integers(-4, 5, 3).astype(float)
    else:
        corners = rng.normal(size=(n, 1, 3)) * 2 + rng.normal(size=(n, 3, 3)) * rng.choice([0.1, 0.6, 2], (n, 1, 1))
        eye, position = rng.normal(size=3) * 5, rng.normal(size=3) * 4
    if kind == "degenerate":
        corners[::3, 2] = corners[::3, 1]
        corners[1::3, 2] = (corners[1::3, 0] + corners[1::3, 1]) / 2
        corners[2::6] = corners[5::6][: len(corners[2::6])]
        position = corners[0, 0].copy()
    floor = np.array([[[-9, -9, -3], [9, -9, -3], [9, 9, -3]], [[-9, -9, -3], [9, 9, -3], [-9, 9, -3.0]]])
    light = Light.directional(*rng.normal(size=3)) if rng.random() < 0.3 else Light.point(*position)
    camera = Camera(tuple(eye), tuple(rng.normal(size=3) + [0, 0, -1]), (0.1, 0.2, 1), rng.uniform(30, 110), 0.05)
    # With the small bias, every sample is too close to its own triangle's cap plane for float32
    return make_frame(np.concatenate([corners, floor]), light, camera, image, 30 * rng.choice([1e-5, 1e-8]))


def wrong_samples(frame, params):
    """Run with counts and without; return the samples that differ from the reference and are no ties."""
    algorithm = Ptsv(params)
    shadow = algorithm.shadows(frame, Probe(counting=True)).shadow
    assert np.array_equal(shadow, algorithm.shadows(frame, Probe()).shadow)
    truth, ambiguous = reference_frame(frame, Probe(), algorithm.casters(frame))
    assert not shadow[~frame.samples.candidate].any()
    return int(np.count_nonzero((shadow != truth) & ~ambiguous))


@settings(deadline=None, max_examples=80)
@given(SEEDS, st.sampled_from(["random", "grid", "degenerate"]), OPTIONS)
def test_no_wrong_sample_on_soups(seed, kind, params):
    assert wrong_samples(random_frame(seed, kind), params) == 0


@pytest.mark.slow
@settings(deadline=None, max_examples=500)
@given(SEEDS, st.sampled_from(["random", "grid", "degenerate"]), OPTIONS)
def test_no_wrong_sample_on_many_soups(seed, kind, params):
    assert wrong_samples(random_frame(seed, kind, n=200, image=ImageSize(100, 80)), params) == 0


def test_soups_have_shadows():
    """The frames above test something: both answers occur, and some samples reach the float64 test."""
    shadowed = retries = 0
    for seed, kind in product(range(10), ("random", "grid")):
        frame, probe = random_frame(seed, kind), Probe(counting=True)
        shadow = Ptsv().shadows(frame, probe).shadow
        shadowed += 0 < np.count_nonzero(shadow) < np.count_nonzero(frame.samples.candidate)
        retries += probe.counts["float64_sample_tests"]
    assert shadowed >= 10
    assert retries > 0


@settings(deadline=None, max_examples=25)
@given(SEEDS, st.sampled_from(["random", "grid"]), OPTIONS)
def test_counts_equal_the_twin(seed, kind, params):
    rng = np.random.default_rng(seed)
    image = ImageSize(int(rng.integers(1, 40)), int(rng.integers(1, 36)), int(rng.choice([1, 1, 4])))
    frame = random_frame(seed, kind, 12, image)
    probe = Probe(counting=True)
    algorithm = Ptsv(params)
    shadow = algorithm.shadows(frame, probe).shadow
    twin = Twin(frame, params, *frusta_of(frame, params)).run()
    assert np.array_equal(shadow.astype(bool), twin.in_shadow)
    assert probe.levels["node_tests"] == twin.counts["tests"][:-1].tolist()
    assert probe.counts["sample_tests"] == twin.counts["tests"][-1]
    for name in ("group_tests", "trivial_accepts", "trivial_rejects", "refinements", "fruitless_refinements"):
        assert probe.levels[name] == twin.counts[name][:-1].tolist()
    assert probe.counts["float64_sample_tests"] == twin.retries
    assert np.array_equal(probe.triangle_counts["test_and_set"], twin.per_triangle)
    assert np.array_equal(probe.heat, twin.heat)
    assert probe.all_counts()["test_and_set"] == twin.per_triangle.sum()


def frusta_of(frame, params):
    """The frusta and groups that the method sets up."""
    samples, corners, light = frame.samples, frame.mesh.corners, frame.light.xyzw()
    included = samples.candidate | (not params.remove_unlit)
    r = np.float32(1) / samples.depth[included].astype(np.float32)
    reach = np.array([np.abs(samples.plane_x).max(), np.abs(samples.plane_y).max(), r.max(initial=0)])
    sides = np.empty(frame.mesh.n_triangles, np.int8)
    find_facing(corners, light, sides)
    view = View(*frame.camera[:4], light, frame.bias, reach)
    triangles, groups = casting_triangles(sides, Ptsv(params).casters(frame)), None
    if params.group > 1 and len(tile_levels(samples.columns, samples.rows, params.branching)) >= 3:
        units, faces = group_triangles(corners, triangles, light, params.group)
        groups, triangles = make_groups(corners, units, faces, view), units.order
    frusta = make_frusta(corners, sides, triangles, view, EYE_EDGES[params.culling_planes],
                         "wedge" in params.culling_planes)
    return frusta, None if groups is None else (groups.rows, groups.first)


def everything(frame, params):
    """Shadow bits and all counts, in a form that can be compared."""
    probe = Probe(counting=True)
    shadow = Ptsv(params).shadows(frame, probe).shadow
    return [np.packbits(shadow.astype(bool)).tobytes().hex(), probe.all_counts(), probe.levels,
            int((probe.heat * np.arange(1, len(shadow) + 1)).sum())]


def digest():
    """Results of a few frames under several options, as text."""
    results = []
    for seed, kind in product(range(2), ("random", "grid")):
        frame = random_frame(seed, kind, image=ImageSize(90, 70))
        results += [everything(frame, Params(branching=b, culling_planes=p, casters=c))
                    for b, p, c in ((32, "outline+wedge", "all"), (8, "silhouette", "auto"))]
    return json.dumps(results)


def test_same_results_for_any_number_of_threads():
    expected = digest()
    for n_threads in (1, 2, 3, 4):
        set_threads(n_threads)
        assert digest() == expected


def test_same_results_on_a_generic_cpu_in_another_process(tmp_path):
    environment = dict(os.environ, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(tmp_path))
    root = os.path.dirname(os.path.dirname(__file__))
    code = f"import sys; sys.path.insert(0, {root!r}); from tests import test_ptsv; print(test_ptsv.digest())"
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert out.stdout.strip() == digest()


@settings(deadline=None, max_examples=15)
@given(SEEDS, st.sampled_from(PLANES))
def test_order_winding_and_scale_do_not_matter(seed, planes):
    """Shuffled triangles, flipped windings (with all casters) and a scale by a power of two give the same shadow."""
    frame, params = random_frame(seed, "random"), Params(culling_planes=planes)
    shadow, mesh = Ptsv(params).shadows(frame, Probe()).shadow, frame.mesh
    rng = np.random.default_rng(seed)
    triangles = mesh.triangles[rng.permutation(mesh.n_triangles)].copy()
    flip = rng.random(len(triangles)) < 0.5
    triangles[flip] = triangles[flip][:, ::-1]
    changed = Frame(Mesh.from_arrays(mesh.vertices, triangles), frame.light, frame.camera, frame.image,
                    frame.samples, frame.bias)
    assert np.array_equal(Ptsv(params).shadows(changed, Probe()).shadow, shadow)
    scale = 2.0**-10
    x, y, z, w = frame.light.position
    light = Light((x * scale, y * scale, z * scale, 1.0) if w else (x, y, z, 0.0))
    camera = frame.camera._replace(eye=frame.camera.eye * scale)
    samples = frame.samples._replace(position=frame.samples.position * scale, depth=frame.samples.depth * scale)
    scaled = Frame(Mesh.from_arrays(mesh.vertices * scale, mesh.triangles), light, camera, frame.image, samples,
                   frame.bias * scale)
    assert np.array_equal(Ptsv(params).shadows(scaled, Probe()).shadow, shadow)


FLOOR = np.array([[[-9, -9, 0], [9, -9, 0], [9, 9, 0]], [[-9, -9, 0], [9, 9, 0], [-9, 9, 0.0]]])
ROOF = np.array([[[-1, -1, 2], [1, -1, 2], [0, 1, 2.0]]])
TOP, ABOVE = Camera((0, -6, 6), (0, 0, 0), (0, 0, 1)), Light.point(0.3, 0.2, 7)
CASES = {
    "light in the plane of a triangle": (np.concatenate([FLOOR, ROOF]), Light.point(5, 5, 2), TOP),
    "light on a vertex": (np.concatenate([FLOOR, ROOF, ROOF + [0, 0, 1]]), Light.point(-1, -1, 3), TOP),
    "light behind the camera": (np.concatenate([FLOOR, ROOF]), Light.point(0, -12, 12), TOP),
    "light at the eye": (np.concatenate([FLOOR, ROOF]), Light.point(0, -6, 6), TOP),
    "camera in a shadow volume": (np.concatenate([FLOOR, ROOF]), ABOVE, Camera((0, 0, 1), (2, 2, 0), (0, 0, 1))),
    "triangle behind the eye": (np.concatenate([FLOOR, ROOF - [0, 9, 0]]), Light.point(0, -20, 8), TOP),
    "triangle through the eye": (np.concatenate([FLOOR, ROOF * 3 + [0, -6, 0]]), ABOVE, TOP),
    "vertex at the eye": (np.concatenate([FLOOR, ROOF - ROOF[0, 0] + [0, -6, 6]]), Light.point(0, 0, 20), TOP),
    "edge-on to the eye": (np.concatenate([FLOOR, ROOF + [0, 0, 4]]), ABOVE, TOP),
    "directional": (np.concatenate([FLOOR, ROOF]), Light.directional(0.2, 0.1, -1), TOP),
    "directional along the view": (np.concatenate([FLOOR, ROOF]), Light.directional(0, 6, -6), TOP),
    "directional towards the eye": (np.concatenate([FLOOR, ROOF]), Light.directional(0, -6, 6), TOP),
    "duplicates": (np.concatenate([FLOOR, FLOOR, ROOF, ROOF]), ABOVE, TOP),
    "one triangle": (FLOOR[:1], ABOVE, TOP),
}


@pytest.mark.parametrize("planes", PLANES)
@pytest.mark.parametrize("case", CASES)
def test_hard_cases(case, planes):
    corners, light, camera = CASES[case]
    for scale, origin in ((1.0, 0.0), (1e-3, 0.0), (1e5, 0.0), (1.0, 1e5)):
        def move(v, scale=scale, origin=origin):
            return tuple(np.asarray(v) * scale + origin)
        position = light.position
        moved = Light((*move(position[:3]), 1.0)) if position[3] else light
        seen = Camera(move(camera.eye), move(camera.target), camera.up, 60.0, 0.1 * scale, 1000.0 * scale)
        frame = make_frame(corners * scale + origin, moved, seen, ImageSize(40, 30))
        assert wrong_samples(frame, Params(culling_planes=planes)) == 0, (scale, origin)


def cube():
    """A closed box from -1 to 1, wound outwards."""
    corner = np.array(list(product((-1.0, 1.0), repeat=3)))
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corner, np.array([(a, b, c) for f in faces for a, b, c in ((f[0], f[1], f[2]), (f[0], f[2], f[3]))])


def test_light_inside_a_closed_mesh():
    corner, triangles = cube()
    for casters in ("all", "back_faces", "auto"):
        frame = make_frame(Mesh.from_arrays(corner * 3, triangles), Light.point(0, 0, 0), TOP)
        inside = make_frame(Mesh.from_arrays(np.concatenate([corner * 3, corner * 0.5 + [1, 1, 1]]),
                                             np.concatenate([triangles, triangles + 8])),
                            Light.point(0, 0, 0), Camera((-2.5, -2.5, -2.5), (1, 1, 1), (0, 0, 1), 90.0))
        for f in (frame, inside):
            assert wrong_samples(f, Params(casters=casters)) == 0


def test_caster_choice():
    corner, triangles = cube()
    floor = np.array([[-9, -9, -2], [9, -9, -2], [9, 9, -2.0]])
    vertices = np.concatenate([corner, floor, corner + [4, 0, 0]])
    # A floor, a closed cube and a cube with a hole
    mesh = Mesh.from_arrays(vertices, np.concatenate([triangles, [[8, 9, 10]], triangles[:-1] + 11]))
    frame = make_frame(mesh, Light.point(1, 2, 6), TOP)
    away = np.concatenate([[exact < 0 for exact in facing_values(mesh, frame.light)]])
    assert Ptsv(Params(casters="all")).casters(frame) is None
    assert np.array_equal(Ptsv(Params(casters="back_faces")).casters(frame), away)
    chosen = Ptsv(Params(casters="auto")).casters(frame)
    assert np.array_equal(chosen[:12], away[:12])
    assert chosen[12:].all()
    # On closed bodies back faces alone give the same shadow
    shadows = [Ptsv(Params(casters=c)).shadows(frame, Probe()).shadow for c in ("all", "auto")]
    _, ambiguous = reference_frame(frame, Probe())
    assert np.array_equal(shadows[0][~ambiguous], shadows[1][~ambiguous])


def facing_values(mesh, light):
    a, b, c = (mesh.corners[:, k] for k in range(3))
    return ((np.array(light.position[:3]) - a) * np.cross(b - a, c - a)).sum(axis=1)


def test_inverted_cube_is_not_closed():
    from shadowbench.kernels.caster_selection import closed_triangles
    corner, triangles = cube()
    assert closed_triangles(corner[triangles]).all()
    assert not closed_triangles(corner[triangles[:, ::-1]]).any()
    assert not closed_triangles(corner[triangles[:-1]]).any()
    # A closed body that is used twice is closed still; vertices are joined by position, not by index
    assert closed_triangles(np.concatenate([corner[triangles]] * 2)).all()
    assert closed_triangles(np.zeros((0, 3, 3))).shape == (0,)


def test_nothing_to_do():
    empty = Mesh.from_arrays(np.zeros((0, 3)), np.zeros((0, 3), int))
    for casters, remove in product(("all", "back_faces", "auto"), (True, False)):
        probe = Probe(counting=True)
        shadow = Ptsv(Params(casters=casters, remove_unlit=remove)).shadows(make_frame(empty, ABOVE, TOP), probe).shadow
        assert not shadow.any()
        assert probe.all_counts()["test_and_set"] == 0
    # Triangles, but no lit candidate: the light is below the floor
    probe = Probe(counting=True)
    assert not Ptsv().shadows(make_frame(FLOOR, Light.point(0, 0, -4), TOP), probe).shadow.any()
    assert probe.all_counts()["test_and_set"] == 0


@pytest.mark.parametrize("branching", BRANCHINGS)
@pytest.mark.parametrize("size", [(1, 1), (1, 700), (333, 2), (1921, 1081)])
def test_image_sizes(size, branching):
    scene = np.concatenate([FLOOR, ROOF, ROOF[:, ::-1] * 0.7 + [2, 1, 0]])
    frame = make_frame(scene, ABOVE, TOP, ImageSize(*size))
    assert wrong_samples(frame, Params(branching=branching, culling_planes="outline")) == 0


def test_samples_per_pixel():
    frame = make_frame(np.concatenate([FLOOR, ROOF]), ABOVE, TOP, ImageSize(30, 20, 8))
    assert wrong_samples(frame, Params()) == 0


def test_large_shadows_are_accepted_and_skipped():
    """A tile wholly in shadow is settled by one test, and later triangles leave it alone."""
    big = np.array([[[-40, -40, 2], [40, -40, 2], [0, 60, 2.0]]])
    corners = np.concatenate([big, FLOOR, *[ROOF * 0.2 + [0, 0, 0.1 * i] for i in range(15)]])
    counts = {}
    for skip in (False, True):
        probe = Probe(counting=True)
        frame = make_frame(corners, Light.point(0, 0, 30), Camera((0, -5, 1.9), (0, 0, 0), (0, 0, 1)))
        assert Ptsv(Params(skip_shadowed=skip)).shadows(frame, probe).shadow[frame.samples.candidate].any()
        counts[skip] = probe.all_counts()
    assert counts[True]["trivial_accepts"] > 0
    assert counts[True]["test_and_set"] < counts[False]["test_and_set"]


def test_memory_at_4096_is_what_the_paper_states():
    """Sintorn et al. 2011, sec. 4: 2.1 MB for each hierarchy."""
    n = 4096
    grid = np.linspace(-1, 1, n)
    template = make_frame(FLOOR, ABOVE, TOP, ImageSize(1, 1))
    samples = template.samples._replace(
        rows=n, columns=n, depth=np.ones(n * n), candidate=np.ones(n * n, bool),
        plane_x=np.broadcast_to(grid, (n, n)).reshape(-1), plane_y=np.repeat(grid, n))
    frame = Frame(template.mesh, ABOVE, template.camera, ImageSize(n, n), samples, 1e-4)
    probe = Probe()
    Ptsv().shadows(frame, probe)
    assert probe.memory_bytes["shadow_hierarchy"] == pytest.approx(2.1e6, rel=0.04)
    assert probe.memory_bytes["depth_hierarchy"] == pytest.approx(2.1e6, rel=0.04)
    assert set(probe.stages) == set(Ptsv.stages)
