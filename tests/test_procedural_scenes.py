"""Scenes like citadel, gate and villa: exact counts, repeatability, sound triangles, a camera path clear of geometry."""

import hashlib
from collections.abc import Sequence
from functools import cache
from importlib import import_module

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes import SCENES, fuzzy, lost_edges, villa
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.paths import curve_position
from shadowbench.scenes.procedural import GRID_STEPS, ProceduralScene
from shadowbench.scenes.tubes import ring, tube, tube_triangles, tubes

LARGE = ("village", "tree_on_snow", "kitchen")
FIGURES = ("crowd", "jeep", "castle", "tree", "four_buildings", "solids", "sheets", *LARGE)
EARLIER = ("citadel", "gate", "villa", "fuzzy", "cubes", "strike", "dragon_cage")
NAMES = (*EARLIER, *(pytest.param(name, marks=pytest.mark.slow) if name in LARGE else name for name in FIGURES))
"""The large scenes of figures are tested among the slow tests; `EARLIER` are those whose counts go up to half a million."""
MODELS = ("citadel", "gate", "villa")
FRAMES = 24


@cache
def default_scene(name: str) -> ProceduralScene:
    """Make a scene at its default count and seed 1, once."""
    return SCENES[name].load()(SCENES[name].triangles, 1)


def corners(scene: ProceduralScene) -> np.ndarray:
    """float64 (n_triangles, 3 corners, 3)."""
    return scene.mesh.vertices[scene.mesh.triangles]


def point_triangle_distance(point: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Distance of one point to (n, 3, 3) triangles: to the plane where the foot lies inside, else to an edge."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    best = np.full(len(triangles), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        t = np.clip(((point - start) * along).sum(1) / (along * along).sum(1), 0.0, 1.0)
        offset = start + t[:, None] * along - point
        best = np.minimum(best, np.sqrt((offset * offset).sum(1)))
    normal = np.cross(b - a, c - a)
    length = np.sqrt((normal * normal).sum(1))
    height = ((point - a) * normal).sum(1)
    foot = point - normal * (height / (length * length))[:, None]
    sides = [(np.cross(end - start, foot - start) * normal).sum(1) >= 0.0 for start, end in ((a, b), (b, c), (c, a))]
    return np.where(sides[0] & sides[1] & sides[2], np.abs(height) / length, best)


def within(reach: float, point: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Numbers of the boxes that come that near to a point along every axis: all that may be so near."""
    return np.flatnonzero((low < point + reach).all(1) & (high > point - reach).all(1))


def is_closed(triangles: np.ndarray, points: np.ndarray) -> bool:
    """True if every edge between positions is met as often in one direction as in the other."""
    used, local = np.unique(triangles, return_inverse=True)
    _, index = np.unique(points[used], axis=0, return_inverse=True)
    t = index.reshape(-1)[local.reshape(triangles.shape)]
    start, end = t.ravel(), t[:, [1, 2, 0]].ravel()
    forward, backward = (np.sort(p * (len(points) + 1) + q) for p, q in ((start, end), (end, start)))
    return bool(np.array_equal(forward, backward))


def closed_parts(scene: ProceduralScene) -> Sequence[bool]:
    """Say of each part whether it is closed."""
    mesh = scene.mesh
    borders = np.flatnonzero(np.diff(mesh.part)) + 1
    return [is_closed(t, mesh.vertices) for t in np.split(mesh.triangles.astype(np.int64), borders)]


def test_distance_on_known_points():
    triangle = np.array([[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 3.0]]])
    for point, expected in (((1.0, 2.0, 1.0), 2.0), ((-3.0, 4.0, 0.0), 5.0), ((2.0, 0.0, -1.5), 1.5),
                            ((5.0, 0.0, 0.0), 1.0), ((4.0, 0.0, 3.0), 2.4), ((1.0, 0.0, 1.0), 0.0)):
        assert point_triangle_distance(np.array(point), triangle)[0] == pytest.approx(expected)


def test_closed_is_recognised():
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    solid = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    assert is_closed(solid, points)
    assert not is_closed(solid[:3], points)
    assert not is_closed(np.vstack([solid[:3], solid[3:, ::-1]]), points)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", [0, 7])
def test_count_is_exact(name, seed):
    default = SCENES[name].triangles
    for triangles in (default - 1, default + 12_345, 2 * default + 1, *((500_000,) if name in EARLIER else ())):
        mesh = SCENES[name].load()(triangles, seed).mesh
        assert mesh.triangles.shape == (triangles, 3)
        assert len(mesh.part) == len(mesh.material) == triangles


@pytest.mark.parametrize("name", (*MODELS, "fuzzy", *NAMES[len(EARLIER):]))
def test_minimum_is_enough(name):
    generate = SCENES[name].load()
    minimum = import_module(SCENES[name].target.partition(":")[0]).MINIMUM
    for triangles, seed in ((minimum, 5), (minimum + 777, 3)):
        assert len(generate(triangles, seed).mesh.triangles) == triangles
    with pytest.raises(InputError, match=f"at least {minimum} triangles"):
        generate(minimum - 1, 0)


@pytest.mark.parametrize("name", NAMES)
def test_too_few_triangles_are_refused(name):
    with pytest.raises(InputError, match=name):
        SCENES[name].load()(3, 0)


@pytest.mark.parametrize("name", NAMES)
def test_generation_repeats_and_follows_the_seed(name):
    first = default_scene(name)
    again, other = (SCENES[name].load()(SCENES[name].triangles, seed) for seed in (1, 2))
    for key in ("vertices", "triangles", "part", "material"):
        np.testing.assert_array_equal(getattr(first.mesh, key), getattr(again.mesh, key))
    assert (first.eyes, first.targets, first.light) == (again.eyes, again.targets, again.light)
    assert not np.array_equal(first.mesh.vertices, other.mesh.vertices)


@pytest.mark.parametrize(("name", "triangles", "digest"), [("villa", villa.MINIMUM, "49bb70a9b62e078c"),
                                                           ("fuzzy", 5_000, "9e9425c58e2a4b38")])
def test_bytes_are_those_of_the_machine_where_the_digest_was_noted(name, triangles, digest):
    mesh = SCENES[name].load()(triangles, 1).mesh
    data = b"".join(array.tobytes() for array in (mesh.vertices, mesh.triangles, mesh.part, mesh.material))
    assert hashlib.sha256(data).hexdigest()[:16] == digest


@pytest.mark.parametrize("name", NAMES)
def test_vertices_are_finite_and_on_the_grid(name):
    vertices = default_scene(name).mesh.vertices
    assert np.isfinite(vertices).all()
    steps = vertices * GRID_STEPS
    np.testing.assert_array_equal(steps, np.rint(steps))
    assert not (np.signbit(vertices) & (vertices == 0.0)).any()


@pytest.mark.parametrize("name", NAMES)
def test_indices_are_in_range(name):
    mesh = default_scene(name).mesh
    assert mesh.triangles.min() >= 0 and mesh.triangles.max() < len(mesh.vertices)
    assert mesh.material.min() >= 0 and mesh.material.max() < len(mesh.materials)
    assert mesh.part[0] == 0 and set(np.diff(mesh.part)) <= {0, 1}


@pytest.mark.parametrize("name", NAMES)
def test_no_triangle_has_zero_area(name):
    steps = np.rint(corners(default_scene(name)) * GRID_STEPS)  # whole, below 2^25: exact in int64
    u, v = (steps[:, 1] - steps[:, 0]).astype(np.int64), (steps[:, 2] - steps[:, 0]).astype(np.int64)
    normal = np.stack([u[:, i] * v[:, j] - u[:, j] * v[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
    flat = np.flatnonzero(~normal.any(axis=1))
    names = {default_scene(name).mesh.materials[m].name for m in default_scene(name).mesh.material[flat]}
    assert len(flat) == 0, f"{len(flat)} triangles without area in {names}"


@pytest.mark.parametrize("name", MODELS)
def test_closed_and_open_parts_are_both_there(name):
    closed = closed_parts(default_scene(name))
    assert sum(closed) >= 20
    assert len(closed) - sum(closed) >= 20


def test_fuzzy_bodies_and_their_fur_are_closed():
    scene = SCENES["fuzzy"].load()(fuzzy.MINIMUM + 4_321, 3)
    closed = closed_parts(scene)
    assert closed == [True] * 12 + [False]
    sizes = np.bincount(scene.mesh.part)
    assert sizes[:6].sum() > 0.4 * sizes.sum() and sizes[6:12].sum() > 0.2 * sizes.sum()


def test_cubes_are_there_as_closed_parts():
    assert sum(closed_parts(default_scene("cubes"))) >= 20


def test_strike_has_ten_closed_pins_of_450_triangles_and_a_ball():
    scene = default_scene("strike")
    mesh = scene.mesh
    pins = [p for p in range(mesh.part.max() + 1) if mesh.materials[mesh.material[mesh.part == p][0]].name == "pin"]
    sizes = np.bincount(mesh.part)
    assert len(pins) == 10 and np.all(sizes[pins] == 450)
    closed = closed_parts(scene)
    assert sum(closed) == 11 and all(closed[p] for p in pins)
    # They stand on the lane, and no two meet
    points = [np.unique(corners(scene)[mesh.part == p].reshape(-1, 3), axis=0) for p in pins]
    assert all(abs(p[:, 1].min()) < 1e-4 and 3.5 < p[:, 1].max() < 3.9 for p in points)
    gaps = [np.sqrt(((a[:, None] - b) ** 2).sum(axis=2)).min() for i, a in enumerate(points) for b in points[:i]]
    assert min(gaps) > 0.1


def test_dragon_cage_holds_a_closed_body_clear_of_the_bars():
    scene = default_scene("dragon_cage")
    mesh, closed = scene.mesh, closed_parts(scene)
    name = [mesh.materials[mesh.material[mesh.part == p][0]].name for p in range(mesh.part.max() + 1)]
    assert all(closed[p] == (name[p] in ("hide", "iron")) for p in range(len(name)))
    body = corners(scene)[mesh.part == name.index("hide")].reshape(-1, 3)
    radius = np.sqrt(body[:, 0] ** 2 + body[:, 2] ** 2)
    assert 1.0 < radius.min() < radius.max() < 5.3 and body[:, 1].min() > 2.0 and len(body) > 3 * 5000


@pytest.mark.parametrize("name", NAMES)
def test_path_stays_clear_of_geometry(name):
    scene = default_scene(name)
    assert len(scene.eyes) == len(scene.targets) >= 2
    triangles = corners(scene)
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    for frame in range(FRAMES):
        eye = np.array(curve_position(scene.eyes, frame, FRAMES, scene.closed))
        target = np.array(curve_position(scene.targets, frame, FRAMES, scene.closed))
        assert np.sqrt(((target - eye) ** 2).sum()) > 1.0
        near = within(2.0 * scene.near, eye, low, high)
        distance = point_triangle_distance(eye, triangles[near])
        names = [scene.mesh.materials[m].name for m in scene.mesh.material[near[distance <= scene.near]]]
        assert not names, f"frame {frame} at {eye}: {distance.min():.3f} m from one of {names}"


@pytest.mark.parametrize("name", NAMES)
def test_light_stands_clear_of_geometry(name):
    x, y, z, w = default_scene(name).light.position
    assert w == 1.0
    assert point_triangle_distance(np.array([x, y, z]), corners(default_scene(name))).min() > default_scene(name).near


OPEN_MATERIALS = {"crowd": {"paving"}, "jeep": {"sand"}, "castle": {"grass"}, "tree": {"floor"},
                  "four_buildings": {"asphalt"},
                  "solids": {"ground"}, "tree_on_snow": {"snow", "fir"}, "kitchen": {"floor", "wall", "tile", "china",
                                                                                     "green"}}
"""What is open in the scenes of figures: the ground, a room, and single-sided details; all other bodies are closed."""


def volume(triangles: np.ndarray) -> float:
    """Signed volume of a closed body, float64 (n, 3, 3): positive if its triangles face outwards."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    return float((np.cross(a, b) * c).sum() / 6.0)


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) if name in LARGE else name
                                  for name in OPEN_MATERIALS])
def test_bodies_of_figures_are_closed_and_face_outwards(name):
    scene = default_scene(name)
    mesh, points = scene.mesh, corners(scene)
    names = [mesh.materials[mesh.material[start]].name for start in np.flatnonzero(np.diff(mesh.part, prepend=-1))]
    closed = closed_parts(scene)
    assert {n for n, c in zip(names, closed, strict=True) if not c} == OPEN_MATERIALS[name]
    assert closed.count(False) <= len(OPEN_MATERIALS[name])
    borders = np.flatnonzero(np.diff(mesh.part)) + 1
    for body, name_of, is_whole in zip(np.split(points, borders), names, closed, strict=True):
        assert not is_whole or volume(body) > 0.0, name_of


def test_figures_that_the_papers_count_have_the_papers_numbers_of_triangles():
    assert {name: SCENES[name].triangles for name in FIGURES if name not in ("solids", "sheets")} == {
        "crowd": 14_836, "jeep": 1_732, "castle": 1_204, "tree": 40_000, "four_buildings": 11_154, "village": 247_432,
        "tree_on_snow": 78_646, "kitchen": 103_351}


def test_the_crowd_has_24_figures():
    mesh = default_scene("crowd").mesh
    heads = [p for p in range(mesh.part.max() + 1) if mesh.materials[mesh.material[mesh.part == p][0]].name == "skin"]
    assert len(heads) == 24 * 3                                 # a head and two hands each


@pytest.mark.parametrize("n", [2, 3, 7, 100, 101, 136, 999])
@pytest.mark.parametrize(("x", "z"), [((-5.0, 5.0), (-3.0, 8.0)), ((-50.0, 50.0), (0.0, 1.0)), ((0.0, 1.0), (-30.0, 8.0))])
def test_ground_is_whole_for_any_number_of_triangles(n, x, z):
    shape = ground(x, z, n)
    assert len(shape.triangles) == n
    points = shape.vertices[shape.triangles]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    assert (normals[:, 1] > 0.0).all()
    assert normals[:, 1].sum() / 2.0 == pytest.approx((x[1] - x[0]) * (z[1] - z[0]))
    # Every inner edge belongs to two triangles, so there are no cracks between the rows
    t = shape.triangles
    edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    single = [edge for edge, count in zip(*np.unique(edges, axis=0, return_counts=True), strict=True) if count == 1]
    for a, b in single:
        ends = shape.vertices[[a, b]]
        assert any(np.all(ends[:, axis] == limit) for axis, limits in ((0, x), (2, z)) for limit in limits)


def test_tubes_and_rings_are_closed_and_face_outwards():
    bent = tube([(0, 0, 0), (0.1, 1, 0.2), (0, 2, 0.5)], (0.3, 0.2, 0.1), 7)
    assert len(bent.triangles) == tube_triangles(3, 7)
    upright = np.array([[[0, 0, 0], [0, 3, 0]], [[2, 0, 0], [2, 0, 3]], [[5, 0, 0], [8, 1, 0]]], np.float64)
    many = tubes(upright, np.full((3, 2), 0.25), 5)
    for shape in (bent, many, ring(1.0, 0.2, 12, 6)):
        assert is_closed(shape.triangles, np.round(shape.vertices, 9)) and volume(shape.vertices[shape.triangles]) > 0.0
    pentagon = 2.5 * 0.25**2 * np.sin(2.0 * np.pi / 5.0)
    assert volume(many.vertices[many.triangles]) == pytest.approx(pentagon * (3.0 + 3.0 + np.sqrt(10.0)))


def test_lost_edges_show_exactly_their_wall():
    """The image is 36 by 12 units of the wall, so texels of a map with 36 across are one unit, as the casters assume."""
    scene = default_scene("lost_edges")
    assert len(scene.mesh.triangles) == SCENES["lost_edges"].triangles
    (x, y, z), = scene.eyes
    half = z * np.tan(np.radians(0.5 * scene.fov_y))
    assert (x, y) == (0.0, 0.0) and 2.0 * half == pytest.approx(lost_edges.HEIGHT) and scene.light.position[3] == 0.0
    casters = corners(scene)[[scene.mesh.materials[m].name != "wall" for m in scene.mesh.material]]
    assert casters[..., 2].min() > z
    for triangles in (12, 13, 500):
        assert len(SCENES["lost_edges"].load()(triangles, 3).mesh.triangles) == triangles
    with pytest.raises(InputError, match="lost_edges needs at least 12"):
        SCENES["lost_edges"].load()(11, 0)
