"""Twenty-four figures before a distant wall, the light low behind them (a stand-in for "crowd" of Sen et al. 2003).

Every figure is made of closed bodies that run into one another, as game models are. Lengths are metres.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import FloatArray, Light
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, Site, fit_detail, require_triangles
from shadowbench.scenes.shapes import Shape, box, join, lathe
from shadowbench.scenes.tubes import tube, tubes

N_FIGURES = 24
MINIMUM = 11_000
"""Fewest triangles: the figures in their coarsest form, the wall and a little ground."""

_DEFAULT = 14_836
_FEWEST_GROUND = 48
_WALL_Z, _WALL_HALF, _WALL_HIGH = -13.0, 16.0, 6.5
_ROWS = ((4.6, 8), (2.2, 9), (-0.4, 7))         # z and number of the figures of a row

_COLORS = {"skin": (0.62, 0.42, 0.3), "hair": (0.12, 0.08, 0.05), "shoe": (0.08, 0.07, 0.06), "steel": (0.5, 0.52, 0.55),
           "wood": (0.36, 0.24, 0.13), "red": (0.6, 0.14, 0.1), "blue": (0.13, 0.22, 0.47), "green": (0.16, 0.36, 0.18),
           "ochre": (0.68, 0.48, 0.16), "linen": (0.72, 0.68, 0.6), "slate": (0.24, 0.25, 0.29), "wall": (0.7, 0.66, 0.58),
           "paving": (0.5, 0.48, 0.45)}
_CLOTHES = ("red", "blue", "green", "ochre", "linen", "slate")


def _sides(detail: float, sides: int) -> int:
    """Sides of a limb: `sides` at detail 1."""
    return max(4, round(sides * detail))


def _pose(rng: np.random.Generator, phase: int) -> dict[str, FloatArray]:
    """Joints of a figure that faces +z, 1.8 m tall: each float64 (n_points, 3)."""
    swing = 0.24 * (1.0 if phase % 2 else -1.0) * rng.uniform(0.4, 1.0)
    joints: dict[str, FloatArray] = {}
    for side, name in ((-1.0, "left"), (1.0, "right")):
        step = side * swing
        hip, foot = (0.11 * side, 0.94, 0.0), (0.13 * side, 0.08, 1.35 * step)
        knee = (0.13 * side, 0.5, 0.55 * step + 0.05)
        joints[f"{name} leg"] = np.array([hip, knee, foot])
        shoulder = np.array((0.22 * side, 1.46, 0.0))
        if phase % 3 == 0 and side > 0:                          # a raised arm
            elbow = shoulder + np.array((0.19, 0.2 + 0.1 * rng.uniform(), 0.1))
            hand = elbow + np.array((rng.uniform(-0.06, 0.1), 0.3, 0.06))
        elif phase % 4 == 1:                                      # hands before the body
            elbow, hand = shoulder + np.array((0.1 * side, -0.28, 0.06)), shoulder + np.array((-0.08 * side, -0.3, 0.34))
        else:
            elbow = shoulder + np.array((0.1 * side, -0.3, -0.5 * step))
            hand = elbow + np.array((0.03 * side, -0.26, 0.12 - 0.6 * step))
        joints[f"{name} arm"] = np.array([shoulder, elbow, hand])
    return joints


def _body(site: Site, joints: dict[str, FloatArray], clothes: tuple[str, str], detail: float) -> None:
    """Trunk, head, limbs, hands and shoes."""
    trunk = [(0.0, 0.86, 0.0), (0.0, 0.98, 0.0), (0.0, 1.14, 0.0), (0.0, 1.38, 0.0), (0.0, 1.51, 0.0)]
    site.add(tube(trunk, (0.15, 0.17, 0.15, 0.2, 0.1), _sides(detail, 10)).scaled(1.2, 1.0, 0.75), clothes[0])
    head = [(0.05, 1.48), (0.055, 1.56), (0.095, 1.62), (0.108, 1.7), (0.09, 1.78), (0.0, 1.82)]
    site.add(lathe(head, _sides(detail, 10), bottom=True).scaled(0.92, 1.0, 1.08), "skin")
    legs, arms = (np.stack([joints[f"left {limb}"], joints[f"right {limb}"]]) for limb in ("leg", "arm"))
    site.add(tubes(legs, np.tile([0.105, 0.075, 0.055], (2, 1)), _sides(detail, 8)), clothes[1])
    site.add(tubes(arms, np.tile([0.065, 0.052, 0.038], (2, 1)), _sides(detail, 7)), clothes[0])
    for leg, arm in zip(legs, arms, strict=True):
        x, y, z = leg[2]
        site.add(box((x - 0.05, y - 0.08, z - 0.08), (x + 0.05, y + 0.03, z + 0.18)), "shoe")
        reach = arm[2] + (arm[2] - arm[1]) * 0.4
        site.add(tube([arm[2], 0.4 * arm[2] + 0.6 * reach, reach], (0.036, 0.048, 0.03), _sides(detail, 6)), "skin")


def _outfit(site: Site, kind: int, hand: FloatArray, colour: str, detail: float) -> None:
    """What tells figures apart: hat, helmet and spear, skirt, hood and staff, shield."""
    if kind == 0:
        hat = [(0.2, 1.73), (0.2, 1.75), (0.11, 1.76), (0.1, 1.9), (0.0, 1.91)]
        site.add(lathe(hat, _sides(detail, 10), bottom=True), "hair")
    elif kind == 1:
        site.add(lathe([(0.13, 1.68), (0.125, 1.76), (0.06, 1.86), (0.0, 1.95)], _sides(detail, 10), bottom=True), "steel")
        x, y, z = hand
        site.add(tube([(x, 0.05, z + 0.05), (x, 2.5, z + 0.05)], (0.018, 0.018), 5), "wood")
        site.add(lathe([(0.045, 2.48), (0.0, 2.75)], 5, bottom=True).moved(x, 0.0, z + 0.05), "steel")
    elif kind == 2:
        skirt = [(0.36, 0.12), (0.3, 0.5), (0.18, 1.0)]
        site.add(lathe(skirt, _sides(detail, 12), bottom=True, top=True), colour)
        site.add(lathe([(0.06, 1.5), (0.125, 1.62), (0.12, 1.76), (0.0, 1.85)], _sides(detail, 8), bottom=True)
                 .moved(0.0, 0.0, -0.035), "hair")
    elif kind == 3:
        cloak = [(0.34, 0.25), (0.3, 0.7), (0.25, 1.3), (0.13, 1.52)]
        site.add(lathe(cloak, _sides(detail, 10), bottom=True, top=True).moved(0.0, 0.0, -0.07), colour)
        x, y, z = hand
        site.add(tube([(x, 0.02, z), (x + 0.02, 0.9, z + 0.02), (x, 1.9, z)], (0.02, 0.02, 0.024), 5), "wood")
    else:
        shield = lathe([(0.3, 0.0), (0.3, 0.02), (0.18, 0.07), (0.0, 0.1)], _sides(detail, 10), bottom=True)
        x, y, z = shield.vertices.T
        site.add(Shape(np.stack([x, -z, y], axis=1), shield.triangles).moved(-0.26, 1.15, 0.2), colour)
        site.add(lathe([(0.115, 1.66), (0.12, 1.74), (0.07, 1.83), (0.0, 1.85)], _sides(detail, 8), bottom=True), "hair")


def _build(detail: float, seed: int) -> MeshBuilder:
    """Build the figures and the wall."""
    rng = np.random.default_rng(seed)
    builder, phase = MeshBuilder(_COLORS), 0
    for z, n in _ROWS:
        for k in range(n):
            x = (k - 0.5 * (n - 1)) * 1.35 + rng.uniform(-0.22, 0.22)
            turn = int(rng.integers(-55, 56)) + (180 if phase % 2 else 0)
            place = Site.at(builder, x, 0.0, z + rng.uniform(-0.45, 0.45), turn)
            top, bottom, extra = (_CLOTHES[int(i)] for i in rng.integers(0, len(_CLOTHES), 3))
            joints = _pose(rng, phase)
            _body(place, joints, (top, bottom), detail)
            _outfit(place, phase % 5, joints["right arm"][2], extra, detail)
            phase += 1
    high = _WALL_HIGH
    builder.add(box((-_WALL_HALF, -0.2, _WALL_Z - 0.6), (_WALL_HALF, high, _WALL_Z)), "wall")
    builder.add(box((-_WALL_HALF - 0.3, high, _WALL_Z - 0.8), (_WALL_HALF + 0.3, high + 0.5, _WALL_Z + 0.25)), "slate")
    plinths = [box((x - 0.6, -0.2, _WALL_Z - 0.1), (x + 0.6, high, _WALL_Z + 0.22)) for x in (-_WALL_HALF, _WALL_HALF)]
    builder.add(join(plinths), "slate")
    return builder


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the crowd with exactly `triangles` triangles; `seed` places and poses the figures.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("crowd", triangles, MINIMUM)
    builder = fit_detail(lambda detail: _build(detail, seed), triangles - _FEWEST_GROUND, (triangles / _DEFAULT) ** 0.5)
    builder.add(ground((-22.0, 22.0), (_WALL_Z, 16.0), triangles - builder.n_triangles), "paving")
    eyes = [(7.5, 3.1, 7.6), (1.0, 2.6, 9.5), (-7.5, 2.0, 4.0), (-11.0, 3.0, -6.0), (-4.0, 3.4, -10.5), (8.0, 2.2, -8.5)]
    targets = [(-1.6, 1.9, -6.0), (-0.5, 1.8, -5.0), (0.0, 1.6, -1.0), (2.0, 1.4, 1.0), (0.0, 1.4, 3.0), (-1.0, 1.4, 2.0)]
    return ProceduralScene(builder.mesh(), eyes, targets, closed=False, fov_y=48.0, near=0.1, far=150.0,
                           light=Light.point(2.0, 1.25, 15.0))
