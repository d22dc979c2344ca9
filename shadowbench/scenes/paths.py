"""Motion: a smooth curve through key positions, and rigid poses between key frames.

Everything is evaluated in plain IEEE operations in a fixed order, so a frame is the same on every machine, and a
frame that falls on a key frame gives that key frame's values bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from shadowbench.geometry import Vector


def curve_position(keys: Sequence[Vector], frame: int, n_frames: int, closed: bool = False) -> Vector:
    """Evaluate a uniform Catmull-Rom curve at a frame (Catmull and Rom 1974, tension 1/2).

    The key frames are spread evenly over the frames. The uniform parametrisation needs no roots or powers; it may
    overshoot where key frames are very unevenly spaced, which a fly-through can avoid by its choice of key frames.

    Parameters
    ----------
    keys : key positions, world.
    frame : 0 to `n_frames` - 1.
    n_frames : length of the sequence.
    closed : True if the curve returns to its first key; the frame after the last would be frame 0 again. An open
        curve has its first key at frame 0 and its last key at the last frame, and starts and ends straight.

    Returns
    -------
    World position; the first key if there is only one key or one frame.
    """
    n_keys = len(keys)
    segments, steps = (n_keys, n_frames) if closed else (n_keys - 1, n_frames - 1)
    if n_keys == 1 or steps == 0:
        return keys[0]
    segment, rest = divmod(frame * segments, steps)
    if rest == 0:
        return keys[segment % n_keys]
    t = rest / steps
    p0, p1, p2, p3 = (_key(keys, segment + offset, closed) for offset in (-1, 0, 1, 2))
    x, y, z = (_cubic(a, b, c, d, t) for a, b, c, d in zip(p0, p1, p2, p3, strict=True))
    return x, y, z


def _key(keys: Sequence[Vector], index: int, closed: bool) -> Vector:
    """Look up a key; beyond the ends of an open curve, the mirror image of the key inside."""
    if closed:
        return keys[index % len(keys)]
    if 0 <= index < len(keys):
        return keys[index]
    end, inside = (keys[0], keys[1]) if index < 0 else (keys[-1], keys[-2])
    return 2.0 * end[0] - inside[0], 2.0 * end[1] - inside[1], 2.0 * end[2] - inside[2]


def _cubic(a: float, b: float, c: float, d: float, t: float) -> float:
    """Catmull-Rom polynomial between b (t = 0) and c (t = 1)."""
    linear, square, cube = c - a, 2.0 * a - 5.0 * b + 4.0 * c - d, 3.0 * b - a - 3.0 * c + d
    return b + 0.5 * t * (linear + t * (square + t * cube))


class Pose(NamedTuple):
    """A rigid pose: degrees about x, then y, then z, and then a translation in world units."""

    rotate: Vector
    translate: Vector


def pose_at(moments: Sequence[float], poses: Sequence[Pose], frame: float) -> Pose:
    """Interpolate a rigid pose: angles and translation linearly between key frames, held before and after them.

    Interpolating the angles keeps every pose rigid and lets a key frame turn by more than half a turn.

    Parameters
    ----------
    moments : frame numbers of the poses, rising; they need not be whole.
    poses : one for each moment.
    frame : the frame asked for.
    """
    if frame <= moments[0]:
        return poses[0]
    for i in range(1, len(moments)):
        if frame < moments[i]:
            t = (frame - moments[i - 1]) / (moments[i] - moments[i - 1])
            before, after = poses[i - 1], poses[i]
            return Pose(_mix(before.rotate, after.rotate, t), _mix(before.translate, after.translate, t))
    return poses[-1]


def _mix(a: Vector, b: Vector, t: float) -> Vector:
    """Interpolate linearly; exactly `a` at t = 0."""
    return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
