"""A stack of 256 sheets over a floor: one more than an 8-bit stencil buffer can count (Sintorn et al. 2011, sec. 4).

The camera looks at the floor from below the stack, so that the whole image lies in 256 shadow volumes at once, and the eye
with it.
"""

from __future__ import annotations

import numpy as np

from shadowbench.geometry import Light
from shadowbench.scenes.grounds import ground
from shadowbench.scenes.procedural import MeshBuilder, ProceduralScene, require_triangles
from shadowbench.scenes.shapes import box, copies

N_SHEETS = 256
_POSTS = 4 * 12
MINIMUM = 2 * N_SHEETS + _POSTS + 2

_COLORS = {"sheet": (0.7, 0.68, 0.6), "post": (0.3, 0.24, 0.18), "floor": (0.5, 0.5, 0.48)}


def generate(triangles: int, seed: int) -> ProceduralScene:
    """Generate the stack with exactly `triangles` triangles; `seed` shifts the sheets.

    Raises
    ------
    InputError
        If `triangles` is below `MINIMUM`.
    """
    require_triangles("sheets", triangles, MINIMUM)
    rng = np.random.default_rng(seed)
    builder = MeshBuilder(_COLORS)
    sheet = box((-4.0, 0.0, -4.0), (4.0, 1.0, 4.0), ("-x", "+x", "+y", "-z", "+z"))
    offsets = np.stack([rng.uniform(-0.1, 0.1, N_SHEETS), 4.0 + 0.01 * np.arange(N_SHEETS), rng.uniform(-0.1, 0.1,
                                                                                                        N_SHEETS)],
                       axis=1)
    builder.add(copies(sheet, offsets), "sheet")
    for x in (-1.6, 1.6):
        for z in (-1.6, 1.6):
            builder.add(box((x - 0.2, 0.0, z - 0.2), (x + 0.2, 2.2, z + 0.2)), "post")
    builder.add(ground((-12.0, 12.0), (-12.0, 12.0), triangles - builder.n_triangles), "floor")
    return ProceduralScene(builder.mesh(), [(0.6, 3.2, 2.6), (-2.2, 3.0, 1.4)], [(0.0, 0.2, 0.0), (0.0, 0.4, 0.0)],
                           closed=False,
                           fov_y=60.0, near=0.1, far=60.0, light=Light.point(0.5, 14.0, 0.3))
