"""Casters before a wall whose edges one point per texel can't tell apart (Sen et al. 2003, Fig. 7), side by side.

A light at infinity shines along -z past the camera onto the wall z = 0. The casters hang behind the camera, so the image,
36 by 12 units of the wall, shows their shadows alone. Left: edges that cross. Middle: two edges side by side, closer than
a texel of a map with 36 texels across. Right: a corner that ends between two rows of depths.
"""

from __future__ import annotations

import numpy as np

from shadowbench.errors import InputError
from shadowbench.geometry import Light
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene
from shadowbench.scenes.shapes import Point, Shape

WIDTH, HEIGHT = 36.0, 12.0
"""Of the part of the wall that the image shows, its middle at the origin."""

PANELS = ("crossing", "parallel", "corner")
"""What the three thirds of the image show, from the left."""

MINIMUM = 12
_FAR = 40.0             # distance of the nearer casters from the wall

_COLORS = {"wall": (0.75, 0.73, 0.68), "upper": (0.5, 0.2, 0.2), "lower": (0.2, 0.3, 0.5)}


def _panel(points: list[Point], z: float, panel: int) -> Shape:
    """Convex polygon before a panel; its points, anticlockwise, count from the panel's lower left corner."""
    corners = np.array([(x + 12.0 * panel - 0.5 * WIDTH, y - 0.5 * HEIGHT, z) for x, y in points])
    return Shape(corners, np.array([(0, i, i + 1) for i in range(1, len(points) - 1)], np.int64))


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the wall with exactly `triangles` triangles in all; `seed` leaves everything as it is.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    if triangles < MINIMUM:
        raise InputError(f"lost_edges needs at least {MINIMUM} triangles, not {triangles}: raise 'triangles'")
    builder = MeshBuilder(_COLORS)
    near, far = _FAR, _FAR + 1.0
    builder.add(_panel([(4.2, 1.2), (7.3, 1.2), (7.3, 10.6), (4.2, 10.6)], far, 0), "upper")
    builder.add(_panel([(1.3, 4.2), (10.7, 4.2), (10.7, 7.3), (1.3, 7.3)], near, 0), "lower")
    builder.add(_panel([(2.6, 1.6), (6.7, 1.6), (6.7, 10.4), (2.6, 10.4)], far, 1), "upper")
    builder.add(_panel([(2.8, 2.2), (7.15, 2.2), (7.15, 9.7), (2.8, 9.7)], near, 1), "lower")
    builder.add(_panel([(1.2, 4.75), (9.4, 6.02), (1.2, 7.25)], far, 2), "upper")
    floor = ground((-20.0, 20.0), (-8.0, 8.0), triangles - builder.n_triangles)
    x, y, z = floor.vertices.T
    builder.add(Shape(np.stack([x, -z, y], axis=1), floor.triangles), "wall")
    # At an angle of view of 60 degrees, the image is exactly HEIGHT high at this distance
    distance = 0.5 * HEIGHT * 3.0**0.5
    return ProceduralScene(builder.mesh(), [(0.0, 0.0, distance)], [(0.0, 0.0, 0.0)], closed=False, fov_y=60.0, near=0.1,
                           far=100.0, light=Light.directional(0.0, 0.0, -1.0))
