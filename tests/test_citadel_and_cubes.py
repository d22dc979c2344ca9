"""Citadel, cubes, strike and dragon cage: exact counts, same bytes every time, sound triangles, a path clear of geometry."""

import hashlib
import subprocess
import sys
import time
from typing import NamedTuple

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes import ALL_SCENES, SCENES, citadel, cubes, dragon_cage, strike
from shadowbench.scenes.hill import YARD, Hill
from shadowbench.scenes.paths import curve_position
from shadowbench.scenes.procedural import GRID_STEPS, SmoothNoise, snap


class Expected(NamedTuple):
    """What a scene promises: fewest triangles, and the sha256 of its smallest mesh for seed 1 (16 digits)."""

    minimum: int
    digest: str


PROMISES = {"citadel": Expected(citadel.MINIMUM, "be2149d50f7d880a"),
            "cubes": Expected(cubes.MINIMUM, "d8e2daf5a01ee005"),
            "strike": Expected(strike.MINIMUM, "d06f0f5ef12a39b1"),
            "dragon_cage": Expected(dragon_cage.MINIMUM, "049fb103a76acbd8")}
N_FRAMES = 48


def generate(name, triangles=None, seed=1):
    return SCENES[name].load()(SCENES[name].triangles if triangles is None else triangles, seed)


def mesh_bytes(mesh):
    arrays = (mesh.vertices, mesh.triangles, mesh.part, mesh.material)
    return b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)


def closed_parts(mesh):
    """True for each part in which every directed edge has its opposite equally often."""
    closed = []
    order = np.argsort(mesh.part, kind="stable")
    cuts = np.searchsorted(mesh.part[order], np.arange(1, mesh.part.max() + 1))
    for index in np.split(order, cuts):
        t = mesh.triangles[index].astype(np.int64)
        edges = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
        forward, backward = np.sort(edges[:, 0] << 32 | edges[:, 1]), np.sort(edges[:, 1] << 32 | edges[:, 0])
        closed.append(np.array_equal(forward, backward))
    return np.array(closed)


def first_hits(mesh, origins, directions):
    """Distance and triangle of the nearest hit of every ray from every origin, by brute force; inf and -1 for none.

    Returns two arrays (n_origins, n_directions).
    """
    distance = np.full((len(origins), len(directions)), np.inf)
    triangle = np.full(distance.shape, -1)
    for j, d in enumerate(directions):
        # Look along the ray: only triangles whose flat bounding box holds the origin can be hit.
        across = np.cross(d, [0.3, 0.5, 0.8])
        axes = np.stack([across, np.cross(d, across)], axis=1)
        flat = mesh.corners @ axes
        low, high = flat.min(axis=1), flat.max(axis=1)
        for i, origin in enumerate(origins):
            point = origin @ axes
            near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
            a = mesh.corners[near, 0]
            e1, e2, s = mesh.corners[near, 1] - a, mesh.corners[near, 2] - a, origin - a
            p, q = np.cross(d, e2), np.cross(s, e1)
            det = (e1 * p).sum(axis=1)
            det = np.where(np.abs(det) < 1e-12, np.nan, det)
            u, v, t = (s * p).sum(axis=1) / det, q @ d / det, (q * e2).sum(axis=1) / det
            t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
            if len(t) and np.isfinite(t.min()):
                distance[i, j], triangle[i, j] = t.min(), near[t.argmin()]
    return distance, triangle


@pytest.mark.parametrize("name", PROMISES)
def test_count_is_exact(name):
    least = PROMISES[name].minimum
    for seed, triangles in ((1, least), (2, least + 1), (3, 3 * least - 7), (1, SCENES[name].triangles), (9, 123_457)):
        mesh = generate(name, triangles, seed).mesh
        assert mesh.n_triangles == triangles
        assert len(mesh.part) == len(mesh.material) == triangles
        assert mesh.material.max() < len(mesh.materials)
        assert np.array_equal(np.unique(mesh.part), np.arange(mesh.part.max() + 1))


@pytest.mark.parametrize("name", PROMISES)
def test_too_few_triangles_are_refused(name):
    least = PROMISES[name].minimum
    with pytest.raises(InputError, match=f"{name} needs at least {least} triangles, not {least - 1}"):
        generate(name, least - 1)


@pytest.mark.parametrize("name", PROMISES)
def test_every_generation_gives_the_same_bytes(name):
    """Twice here, and the same on the machine where the digest was noted."""
    least = PROMISES[name].minimum
    data = mesh_bytes(generate(name, least).mesh)
    assert data == mesh_bytes(generate(name, least).mesh)
    assert data != mesh_bytes(generate(name, least, seed=2).mesh)
    assert hashlib.sha256(data).hexdigest()[:16] == PROMISES[name].digest


@pytest.mark.parametrize("name", PROMISES)
@pytest.mark.parametrize("seed", [1, 7])
def test_triangles_are_sound(name, seed):
    """On the grid, no two corners alike, and an area that is not zero in exact integers."""
    mesh = generate(name, seed=seed).mesh
    steps = mesh.vertices * GRID_STEPS
    assert np.isfinite(steps).all()
    whole = np.rint(steps).astype(np.int64)
    assert np.array_equal(whole, steps)
    corners = whole[mesh.triangles]
    assert np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).any(axis=1).all()


@pytest.mark.parametrize("name", PROMISES)
@pytest.mark.parametrize("seed", [1, 4])
def test_path_stays_clear_of_geometry(name, seed):
    """From every frame, the nearest surface in 14 directions is beyond the near plane and shows its outer side."""
    scene = generate(name, seed=seed)
    eyes = np.array([curve_position(scene.eyes, i, N_FRAMES, scene.closed) for i in range(N_FRAMES)])
    ways = [np.array([x, y, z]) / np.sqrt(x * x + y * y + z * z)
            for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) for z in (-1.0, 0.0, 1.0)
            if abs(x) + abs(y) + abs(z) in (1.0, 3.0)]
    distance, triangle = first_hits(scene.mesh, eyes, ways)
    assert distance.min() > 0.5 > scene.near
    normals = np.cross(scene.mesh.corners[:, 1] - scene.mesh.corners[:, 0],
                       scene.mesh.corners[:, 2] - scene.mesh.corners[:, 0])
    outer = ((normals[triangle] * np.array(ways)).sum(axis=2) < 0) | (triangle < 0)
    assert outer.mean(axis=1).min() >= 0.7, "some frame looks at inner sides: it lies in a body or underground"
    assert len(scene.eyes) == len(scene.targets)


def test_clearance_test_sees_a_camera_in_a_body():
    """Twin of the test above that must fail: inside a cube, all directions meet inner sides."""
    mesh = generate("cubes", cubes.MINIMUM).mesh
    cube = mesh.corners[mesh.part == 1].reshape(-1, 3)
    _, triangle = first_hits(mesh, cube.mean(axis=0)[None], [np.array([0.0, 1.0, 0.0])])
    a, b, c = mesh.corners[triangle[0, 0]]
    assert np.cross(b - a, c - a)[1] > 0


def test_citadel_is_the_game_level_that_it_stands_in_for():
    scene = generate("citadel")
    low, high = scene.mesh.bounds()
    assert 190 < high[0] - low[0] < 230 and 190 < high[2] - low[2] < 230 and 35 < high[1] - low[1] < 70
    closed = closed_parts(scene.mesh)
    assert closed.sum() > 150 and (~closed).sum() > 300
    by_closed = np.bincount(closed[scene.mesh.part].astype(int)) / scene.mesh.n_triangles
    assert by_closed.min() > 0.1, "open and closed bodies both take a fair share of the triangles"
    assert scene.closed and len(scene.eyes) >= 6
    assert scene.light.position[1] > high[1] + 50


def test_cubes_are_closed_apart_and_in_the_room():
    scene = generate("cubes")
    closed = closed_parts(scene.mesh)
    assert closed.sum() == cubes.N_CUBES and (~closed).sum() == 2
    low, high = scene.mesh.bounds()
    assert np.array_equal(low, [-10, 0, -10]) and np.array_equal(high, [10, 20, 10])
    centres, radii = [], []
    for part in np.flatnonzero(closed):
        points = scene.mesh.corners[scene.mesh.part == part].reshape(-1, 3)
        centres.append((points.min(axis=0) + points.max(axis=0)) / 2)
        radii.append(np.sqrt(((points - centres[-1]) ** 2).sum(axis=1).max()))
    centres, radii = np.array(centres), np.array(radii)
    gaps = np.sqrt(((centres[:, None] - centres) ** 2).sum(axis=2)) - radii[:, None] - radii
    assert (gaps + 100 * np.eye(len(gaps)) > 0).all()
    assert (np.sqrt(((centres - scene.light.position[:3]) ** 2).sum(axis=1)) > radii).all()


def test_ground_follows_the_hill():
    ground = Hill(3)
    assert abs(float(ground(10.0, -20.0)) - YARD) < 0.3
    assert float(ground(0.0, 102.0)) < 2.0 < float(ground(0.0, 80.0)) < YARD
    places = ground.around(np.random.default_rng(1), 500, 70.0, 90.0, clear=20.0)
    assert (np.abs(places[places[:, 2] > 0, 0]) >= 20.0).all()
    assert np.allclose(places[:, 1], ground(places[:, 0], places[:, 2]) - 0.05)


def test_snap_rounds_to_the_grid():
    assert snap(np.array([1 / 65536 * 2.4, -1e-9, 0.5])).tolist() == [2 / 65536, 0.0, 0.5]
    assert not np.signbit(snap(np.array([-1e-9])))[0]


def test_noise_is_smooth_and_bounded():
    noise = SmoothNoise(np.random.default_rng(5), 10.0)
    x = np.linspace(-300.0, 300.0, 60_001)
    values = noise(x, 0.37 * x)
    assert np.abs(values).max() < 1.75
    assert np.abs(np.diff(values)).max() < 0.02


def test_every_scene_is_listed_without_importing_any():
    """The list answers before Numba, Matplotlib or a scene's module is there."""
    code = ("import sys, shadowbench.scenes as s; assert len(s.SCENES) == len(s.ALL_SCENES); "
            "print([m for m in ('numba', 'matplotlib', 'numpy', 'shadowbench.scenes.citadel') if m in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    assert all(entry.summary and entry.triangles > 0 for entry in ALL_SCENES)


@pytest.mark.bench
@pytest.mark.parametrize("triangles, seconds", [(60_000, 0.5), (1_000_000, 5.0)])
def test_citadel_is_generated_fast(triangles, seconds):
    generate("citadel", 9_200)
    start = time.process_time()
    generate("citadel", triangles)
    assert time.process_time() - start < seconds
