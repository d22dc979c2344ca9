"""Slow twins of the stencil shadow volumes: ray against face, one face at a time, in world space.

Faces come from the definition (edge multiplicities from a dictionary, biased caps from the light), a face is hit where
the ray of a sample meets its plane between its borders, and every hit is counted. No projection, no clipping, no rows.
"""

from collections import defaultdict

import numpy as np


def facing(triangle, light):
    """+1 if the winding normal faces the light, -1 if it faces away, 0 if edge-on."""
    a, b, c = triangle
    return int(np.sign(np.dot(np.cross(b - a, c - a), light[:3] - light[3] * a)))


def multiplicities(corners, light, casting):
    """Signed multiplicity per edge, keyed by its two positions in order."""
    result = defaultdict(int)
    for triangle, casts in zip(corners, casting, strict=True):
        turn = facing(triangle, light) if casts else 0
        for k in range(3):
            u, v = tuple(triangle[k]), tuple(triangle[(k + 1) % 3])
            result[min(u, v), max(u, v)] += turn if u < v else -turn
    return result


def shift_of(triangle, light, bias):
    """How far the biased cap's vertices are moved along `away`, from the triangle's height over the light."""
    a, b, c = triangle
    normal = np.cross(b - a, c - a)
    return bias * np.linalg.norm(normal) / abs(np.dot(normal, light[:3] - light[3] * a))


def shadow_counts(corners, light, bias, points, casting=None):
    """Number of shadow frusta that contain each point, by the definition."""
    count = np.zeros(len(points), np.int64)
    for i, triangle in enumerate(corners):
        turn = facing(triangle, light)
        if turn == 0 or (casting is not None and not casting[i]):
            continue
        a, b, c = triangle
        normal = np.cross(b - a, c - a) * -turn
        inside = (points - a) @ normal > bias * np.linalg.norm(normal)
        for k in range(3):
            u, v = triangle[k], triangle[(k + 1) % 3]
            side = np.cross(light[3] * u - light[:3], v - u) * -turn
            inside &= (points - u) @ side >= 0
        count += inside
    return count


def _side_hits(u, v, light, near_shift, far_shift, eye, rays):
    """Ray parameter where each ray meets the side quad of edge uv, nan where it misses."""
    away = light[3] * u - light[:3]
    normal = np.cross(away, v - u)
    t = np.dot(normal, u - eye) / (rays @ normal)
    points = eye + t[:, None] * rays
    # In the quad's plane, points are u + along (v - u) scaled by the light, moved away by `shift`
    basis = np.stack([v - u, away], axis=1)
    along, shift = np.linalg.lstsq(basis, (points - u).T, rcond=None)[0]
    if light[3] != 0.0:
        along = along / (1.0 + shift)
    hit = (t > 0) & (along > 0) & (along < 1) & (shift > near_shift) & (shift < far_shift)
    return np.where(hit, t, np.nan)


def _cap_hits(triangle, eye, rays):
    """Ray parameter where each ray meets a triangle, nan where it misses."""
    a, b, c = triangle
    normal = np.cross(b - a, c - a)
    t = np.dot(normal, a - eye) / (rays @ normal)
    points = eye + t[:, None] * rays
    s, r = np.linalg.lstsq(np.stack([b - a, c - a], axis=1), (points - a).T, rcond=None)[0]
    return np.where((t > 0) & (s > 0) & (r > 0) & (s + r < 1), t, np.nan)


def _faces(corners, light, bias, casting, per_triangle, dark_caps, eye, rays):
    """Yield (ray parameters, times drawn) of every face."""
    if not per_triangle:
        for (u, v), times in multiplicities(corners, light, casting).items():
            if times:
                yield _side_hits(np.array(u), np.array(v), light, 0.0, np.inf, eye, rays), abs(times)
    for triangle, casts in zip(corners, casting, strict=True):
        if not casts or facing(triangle, light) == 0:
            continue
        shift = shift_of(triangle, light, bias)
        away = light[3] * triangle - light[:3]
        near, far = (shift, np.inf) if per_triangle else (0.0, shift)
        for k in range(3):
            yield _side_hits(triangle[k], triangle[(k + 1) % 3], light, near, far, eye, rays), 1
        yield _cap_hits(triangle + shift * away, eye, rays), 1
        if dark_caps:
            inside = np.all(np.linalg.solve(away.T, rays.T) > 0, axis=0)
            yield np.where(inside, np.inf, np.nan), 1


def stencil_counts(corners, light, bias, camera, samples, casting, z_fail, per_triangle):
    """Fragments and stencil updates per sample, int64 (n_samples,) each."""
    rays = camera.forward + samples.plane_x[:, None] * camera.right + samples.plane_y[:, None] * camera.up
    fragments, updates = np.zeros(len(rays), np.int64), np.zeros(len(rays), np.int64)
    nearest = 0.5 * camera.near if z_fail else 0.0
    dark_caps = z_fail and light[3] != 0.0
    for t, times in _faces(corners, light, bias, casting, per_triangle, dark_caps, camera.eye, rays):
        hit = t > nearest
        fragments += times * hit
        with np.errstate(invalid="ignore"):
            updates += times * (hit & ((t > samples.depth) if z_fail else (t < samples.depth)))
    return fragments, updates
