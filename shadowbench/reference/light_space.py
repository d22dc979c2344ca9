"""Light space: coordinates in which the side planes of a shadow frustum have no depth term.

Planes stay planes. With ``C = p - o`` (see `frusta`), the *face* is the axis of largest magnitude (of C for a
point light, of the direction d towards the light for a directional one) with its sign s, the other two axes
follow cyclically:

* point light: ``z = s C_axis > 0``, ``x = C_1 / z``, ``y = C_2 / z``, ``r = 1 / z``. Three, three and two
  roundings. |x| and |y| are at most 1, since z is the largest component and rounding is monotone;
* directional: ``z = s C_axis``, ``x = C_1 - z q_1``, ``y = C_2 - z q_2``, ``r = z`` with ``q = d / (s
  d_axis)``, |q| <= 1: a shear along d. With S the largest component of a C, x is off by ``u S`` (C_1), ``4 u
  S`` (z, q, their product) and ``2 u S`` (the subtraction), less than 12 u S.

Where a coordinate overflows, or the reciprocal may underflow, the sample gets NaN coordinates; every test
then answers "not decided", so nothing is lost. A sample at the light itself has C = 0: it is in front of
every cap, and is dropped here.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange

LARGEST_COORDINATE = 2.0**1000
"""Largest component along the face's axis: its reciprocal is far from underflow."""
N_WORKERS = 64
"""Blocks of samples that `map_to_light_space` deals out."""


class LightSpace(NamedTuple):
    """The light and the map from world to light space.

    Attributes
    ----------
    light : float64 (4,), homogeneous, world.
    origin : float64 (3,), world.
    shear : float64 (2,), q of the module's text; zero for a point light.
    face : face of a directional light, 2 * axis + (1 if the axis is negative).
    extent : largest |component| of a sample relative to the origin.
    """

    light: np.ndarray
    origin: np.ndarray
    shear: np.ndarray
    face: int
    extent: float


def make_light_space(light, positions):
    """Choose origin and axes of light space for a light and float64 (n, 3) samples, n > 0."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    if light[3] != 0.0:
        origin, shear, face = light[:3].copy(), np.zeros(2), 0
    else:
        origin = 0.5 * low + 0.5 * high
        axis = int(np.argmax(np.abs(light[:3])))
        face = 2 * axis + int(light[axis] < 0)
        shear = light[[(axis + 1) % 3, (axis + 2) % 3]] / abs(light[axis])
    with np.errstate(over="ignore"):
        extent = float(np.maximum(np.abs(low - origin), np.abs(high - origin)).max())
    return LightSpace(light, origin, shear, face, extent)


@kernel
def _map_block(positions, space, coordinate, faces, block, n_blocks):
    """Map one block of samples; see `map_to_light_space`."""
    is_point = space.light[3] != 0.0
    n = len(positions)
    for i in range(block * n // n_blocks, (block + 1) * n // n_blocks):
        c0, c1, c2 = (positions[i, 0] - space.origin[0], positions[i, 1] - space.origin[1],
                      positions[i, 2] - space.origin[2])
        face = space.face
        if is_point:
            if c0 == 0.0 and c1 == 0.0 and c2 == 0.0:
                faces[i] = -1
                continue
            face = 0 if abs(c0) >= abs(c1) and abs(c0) >= abs(c2) else (2 if abs(c1) >= abs(c2) else 4)
        # Bring the face's axis to the front, the other two after it in cyclic order.
        if face // 2 == 1:
            c0, c1, c2 = c1, c2, c0
        elif face // 2 == 2:
            c0, c1, c2 = c2, c0, c1
        if is_point:
            face += 1 if c0 < 0.0 else 0
            x, y, r = c1 / abs(c0), c2 / abs(c0), 1.0 / abs(c0)
        else:
            r = -c0 if face % 2 == 1 else c0
            x, y = c1 - r * space.shear[0], c2 - r * space.shear[1]
        if not (abs(x) < np.inf and abs(y) < np.inf and abs(r) < np.inf and abs(c0) < LARGEST_COORDINATE):
            x = y = r = np.nan
        coordinate[i, 0], coordinate[i, 1], coordinate[i, 2] = x, y, r
        faces[i] = face


@parallel_kernel
def map_to_light_space(positions, space, coordinate, faces):
    """Map samples to light space.

    Parameters
    ----------
    positions : float64 (n, 3), world.
    space : `LightSpace`.
    coordinate : float64 (n, 3), written: x, y and r.
    faces : int64 (n,), written: the face, or -1 for a sample at the light itself.
    """
    for block in prange(N_WORKERS):
        _map_block(positions, space, coordinate, faces, block, N_WORKERS)
