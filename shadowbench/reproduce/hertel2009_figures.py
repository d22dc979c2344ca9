"""The figures of Hertel et al. 2009: 3, 4 and 5.

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Row, at_least, at_most, view_key
from shadowbench.reproduce.mosaic import MARKED, Crop, Tile, mosaic, wrong_of
from shadowbench.reproduce.rows import cell_rows, mean
from shadowbench.reproduce.variants import Variant, variant

PAPER = "hertel2009"
MAP, CONSERVATIVE, TRACED = variant("shadow_map"), variant("conservative_map"), variant("ray_traced")

ROWS = cell_rows("wrong", "false_shadow", "triangle_tests", "stored_triangle_tests", "rays_cast", "test_and_set")


def view(scene: str, size: int, *methods: Variant) -> Measurement:
    """One view with pictures."""
    return Measurement(scene, size, (0,), tuple(method.spec for method in methods), published_size=1280, images=True)


def smaller(*full: Measurement) -> tuple[Measurement, ...]:
    """The same at three eighths of the size, and with a smaller village."""
    return tuple(replace(m, size=3 * m.size // 8, triangles=80_000 if m.scene == "village" else 0) for m in full)


def wrong(method: Variant, **where: str | int) -> Callable[[Sequence[Row]], float]:
    """Wrong samples of a method."""
    return lambda rows: mean(rows, "wrong", method=method.label, **where)


VILLAGE: Crop = (0.32, 0.5, 0.92, 1.0)
F3_FULL = view("village", 1024, MAP, CONSERVATIVE, TRACED)

F3 = Item(
    "He.F3", PAPER, "Ray-traced shadows against the hybrid with a conservative map", "Figure 3",
    "Part of the village with a shadow map, by tracing every ray, and with a conservative map, maps of 1024 texels along "
    "the side. The paper compares the last two by eye at 2 and 7 frames per second; ours are compared sample by sample. "
    + MARKED,
    full=(F3_FULL,), quick=smaller(F3_FULL), rows=ROWS,
    claims=(Claim("Ray traced: wrong samples", "none", wrong(TRACED), at_most(0.0), at_most(0.0), ""),
            Claim("Conservative map: wrong samples", "the same accuracy", wrong(CONSERVATIVE), at_most(0.0), at_most(0.0),
                  ""),
            Claim("Shadow map of the same resolution: wrong samples", "aliasing", wrong(MAP), at_least(1.0), at_least(1.0),
                  "")),
    plot=mosaic([[Tile(MAP.label, wrong_of(MAP.label, "shadow map"), crop=VILLAGE, marks=True),
                         Tile(TRACED.label, wrong_of(TRACED.label, "ray traced"), crop=VILLAGE),
                         Tile(CONSERVATIVE.label, wrong_of(CONSERVATIVE.label, "conservative map"), crop=VILLAGE)]],
                       (3.8, 3.4)))


def plot_tests(evidence: Evidence, folder: Path) -> None:
    """The view, and the tests of both methods."""
    from shadowbench.reproduce import plots, tiles

    figure, axes = plots.panels(3, 3.8, 4.0)
    tiles.draw(axes[0], tiles.tile_pixels(Tile(TRACED.label, ""), evidence.pictures), "tree_on_snow (stand-in)")
    for panel, method, name in ((axes[1], TRACED, "all rays"), (axes[2], CONSERVATIVE, "conservative map")):
        files = evidence.pictures[method.label]
        millions = mean(evidence.rows, "triangle_tests", method=method.label) / 1e6
        tiles.draw(panel, tiles.color_tests(files["shadow_exr"], files["gbuffer_exr"]), f"{name}: {millions:.2f} M tests")
    plots.save(figure, folder)


F4_FULL = view("tree_on_snow", 1024, TRACED, CONSERVATIVE)


def tests_saved(rows: Sequence[Row]) -> float:
    """Ray-triangle tests of all rays over those with the conservative map, its tests of stored triangles included."""
    ours = sum(mean(rows, column, method=CONSERVATIVE.label) for column in ("triangle_tests", "stored_triangle_tests"))
    return mean(rows, "triangle_tests", method=TRACED.label) / ours


F4 = Item(
    "He.F4", PAPER, "Ray-triangle tests per sample: all rays against the conservative map", "Figure 4",
    "Brightness is the number of tests on a logarithmic scale, red are samples in shadow and green lit ones, as in the "
    "paper; black faces away from the light or is background. The paper does not name its scene for this figure.",
    full=(F4_FULL,), quick=smaller(F4_FULL), rows=ROWS,
    claims=(Claim("All rays over the conservative map: triangle tests of rays", "fewer", lambda rows: (
                mean(rows, "triangle_tests", method=TRACED.label) / mean(rows, "triangle_tests", method=CONSERVATIVE.label)),
                at_least(1.25), at_least(1.0), otherwise="Branches finer than a texel leave nearly every sample "
                "uncertain, so nearly all rays are cast, with shorter intervals"),
            Claim("The same, with one test of the stored triangle per sample counted", "fewer", tests_saved, at_least(1.25),
                  at_least(1.0), otherwise="Where branches are finer than a texel nearly every sample stays uncertain, so "
                                           "the test of the stored triangle comes on top")),
    plot=plot_tests)

COARSE_MAP, COARSE = variant("shadow_map", resolution=32), variant("conservative_map", resolution=32)
GAP: Crop = (0.0, 0.25, 0.6, 0.85)
BRANCHES: Crop = (0.3, 0.6, 0.95, 1.0)
F5_FULL = (view("slit", 768, COARSE_MAP, COARSE), view("tree_on_snow", 1024, MAP, CONSERVATIVE))

F5 = Item(
    "He.F5", PAPER, "A gap that the shadow map misses, and a tree", "Figure 5",
    "Above: the light through a gap between two walls; the gap is a texel wide in maps of 32, where the paper's is in "
    "maps of 1024. Below: branches on snow with maps of 1024. Left a shadow map, right a conservative map. " + MARKED,
    full=F5_FULL, quick=smaller(*F5_FULL), rows=ROWS,
    claims=(Claim("Gap: samples that the shadow map darkens wrongly", "the gap is missed completely",
                  lambda rows: mean(rows, "false_shadow", scene="slit", method=COARSE_MAP.label), at_least(1.0),
                  at_least(1.0), ""),
            Claim("Gap: wrong samples with the conservative map", "clearly visible", wrong(COARSE, scene="slit"),
                  at_most(0.0),
                  at_most(0.0), ""),
            Claim("Tree: wrong samples with the shadow map", "aliasing", wrong(MAP, scene="tree_on_snow"), at_least(1.0),
                  at_least(1.0), ""),
            Claim("Tree: wrong samples with the conservative map", "none", wrong(CONSERVATIVE, scene="tree_on_snow"),
                  at_most(0.0), at_most(0.0), "")),
    plot=mosaic([[Tile(view_key(scene, 0, method.label), wrong_of(method.label, name, scene=scene), crop=crop, marks=marks)
                         for method, name, marks in ((a, "shadow map", False), (a, "shadow map, marked", True),
                                                     (b, "conservative map", False))]
                        for scene, crop, a, b in (("slit", GAP, COARSE_MAP, COARSE),
                                                  ("tree_on_snow", BRANCHES, MAP, CONSERVATIVE))], (3.6, 3.3)))

ITEMS = (F3, F4, F5)
