"""Hertel, Hormann, Westermann: "A Hybrid GPU Rendering Pipeline for Alias-Free Hard Shadows", 2009: Tables 1 and 2.

The ranges below were fixed before anything was measured; the explanations were added afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from shadowbench.reproduce.items import Claim, Item, Measurement, Row, at_least
from shadowbench.reproduce.rows import cell_rows, mean

PAPER = "hertel2009"
SCENES = ("citadel", "gate", "cubes", "strike")
DISCARD, POLYGON = "conservative_map", "conservative_map+raster=polygon"
ALL_RAYS, UNCERTAIN, SHORTENED = "ray_traced", "conservative_map+shorten=False", "conservative_map"

SLACK = 1.1
"""A claim of "less" holds in part if it fails by less than this factor."""

RATIO_SHARE = 0.25
"""The smallest published ratio is reached if it is missed by at most this share: the scenes are stand-ins."""

CPU = ("Times are of a CPU, the paper's of a graphics card: compare ratios alone. The paper's scenes are others, so its "
       "ratios span a range. ")


def measurements(size: int, methods: tuple[str, ...], repeats: int) -> tuple[Measurement, ...]:
    """Frame 0 of every scene."""
    return tuple(Measurement(scene, size, (0,), methods, published_size=1024, repeats=repeats) for scene in SCENES)


def ratio(column: str, a: str, b: str, scene: str) -> Callable[[Sequence[Row]], float]:
    """A column of method a over that of method b on a scene."""
    return lambda rows: mean(rows, column, scene=scene, method=a) / mean(rows, column, scene=scene, method=b)


RASTERS = ("conservative_map[raster=polygon]", "conservative_map")

T1 = Item(
    "He.T1", PAPER, "Conservative rasterisation: polygons of up to nine corners against discarding", "Table 1",
    "Time of the stage that draws the conservative map of 1024 texels along the side, or of each face of a cube, and the "
    "fragments that it looks at. " + CPU + "Published: 21, 19, 8 ms with polygons, 13, 13, 7 ms with discarding.",
    full=measurements(1024, RASTERS, 5), quick=measurements(512, RASTERS, 3),
    rows=cell_rows("conservative_fragments", "fragments_discarded", "map_texels_written", "wrong", "stage.map"),
    claims=(
        *(Claim(f"{scene}: polygons take longer than discarding", "1.14x to 1.62x",
                ratio("stage.map", POLYGON, DISCARD, scene), at_least(1.0), at_least(1.0 / SLACK),
                otherwise="Each fragment costs time on a CPU, and discarding looks at more of them")
          for scene in SCENES),
        *(Claim(f"{scene}: discarding looks at more fragments than polygons do", "none; expected above 1x",
                ratio("conservative_fragments", DISCARD, POLYGON, scene), at_least(1.0), at_least(1.0 / SLACK))
          for scene in SCENES)))

RAYS = ("ray_traced", "conservative_map[shorten=false]", "conservative_map")

T2 = Item(
    "He.T2", PAPER, "All rays, uncertain rays, uncertain rays with short intervals", "Table 2",
    "Whole time of a frame without building the kd-tree, rays cast, inner kd-tree nodes met and triangle tests. " + CPU
    + "Published: 158/114/95, 422/288/217, 3115/2670/2585, 956/641/610 ms with all rays, with uncertain ones alone, and "
    "with those shortened; 55,294 to 32,079, 905,290 to 236,350, 623,890 to 342,105 and 967,655 to 198,576 rays. The heads "
    "of the last two columns of Table 2 are swapped in the paper: fewer rays are cast with the scheme than without.",
    full=measurements(1024, RAYS, 3), quick=measurements(512, RAYS, 1),
    rows=cell_rows("rays_cast", "kd_nodes", "triangle_tests", "wrong", "seconds", "stage.trace"),
    claims=tuple(claim for scene in SCENES for claim in (
        Claim(f"{scene}: all rays over uncertain rays, number", "1.7x to 4.9x",
              ratio("rays_cast", ALL_RAYS, UNCERTAIN, scene), at_least(55294 / 32079 * (1.0 - RATIO_SHARE)), at_least(1.0)),
        Claim(f"{scene}: all rays over uncertain rays, time", "1.2x to 1.5x", ratio("seconds", ALL_RAYS, UNCERTAIN, scene),
              at_least(1.0), at_least(1.0 / SLACK)),
        Claim(f"{scene}: whole over shortened intervals, time", "1.03x to 1.33x",
              ratio("seconds", UNCERTAIN, SHORTENED, scene), at_least(1.0), at_least(1.0 / SLACK)),
        Claim(f"{scene}: whole over shortened intervals, kd-tree nodes met", "none; expected above 1x",
              ratio("kd_nodes", UNCERTAIN, SHORTENED, scene), at_least(1.0), at_least(1.0 / SLACK)))))

ITEMS = (T1, T2)
