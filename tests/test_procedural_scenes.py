"""Citadel, gate, cubes, strike and dragon cage: exact counts, repeatability, sound triangles, a path clear of geometry."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes import SCENES, citadel, gate
from shadowbench.scenes.paths import curve_position
from shadowbench.scenes.procedural import GRID_STEPS, ProceduralScene

NAMES = ("citadel", "gate", "cubes", "strike", "dragon_cage")
MODELS = ("citadel", "gate")
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
    for triangles in (default - 1, default + 12_345, 2 * default + 1, 500_000):
        mesh = SCENES[name].load()(triangles, seed).mesh
        assert mesh.triangles.shape == (triangles, 3)
        assert len(mesh.part) == len(mesh.material) == triangles


@pytest.mark.parametrize("name", MODELS)
def test_minimum_is_enough(name):
    generate = SCENES[name].load()
    minimum = {"citadel": citadel.MINIMUM, "gate": gate.MINIMUM}[name]
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
    for frame in range(FRAMES):
        eye = np.array(curve_position(scene.eyes, frame, FRAMES, scene.closed))
        target = np.array(curve_position(scene.targets, frame, FRAMES, scene.closed))
        assert np.sqrt(((target - eye) ** 2).sum()) > 1.0
        distance = point_triangle_distance(eye, triangles)
        nearest = int(distance.argmin())
        material = scene.mesh.materials[scene.mesh.material[nearest]].name
        assert distance[nearest] > scene.near, f"frame {frame} at {eye}: {distance[nearest]:.3f} m from {material}"


@pytest.mark.parametrize("name", NAMES)
def test_light_stands_clear_of_geometry(name):
    x, y, z, w = default_scene(name).light.position
    assert w == 1.0
    assert point_triangle_distance(np.array([x, y, z]), corners(default_scene(name))).min() > default_scene(name).near
