"""Hertel, Hormann, Westermann: "A Hybrid GPU Rendering Pipeline for Alias-Free Hard Shadows", 2009: Tables 1 and 2; the
figures are in `hertel2009_figures`.

The ranges below were fixed before anything was measured; the explanations were added afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from shadowbench.reproduce import hertel2009_figures
from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Range, Row, at_least, at_most
from shadowbench.reproduce.rows import cell_rows, mean

PAPER = "hertel2009"
SCENES = ("four_buildings", "village", "tree_on_snow", "kitchen")
DISCARD, POLYGON = "conservative_map", "conservative_map+raster=polygon"
ALL_RAYS, UNCERTAIN, SHORTENED = "ray_traced", "conservative_map+shorten=False", "conservative_map"

SLACK = 1.1
"""A claim of "less" holds in part if it fails by less than this factor."""

STAND_IN_FACTOR = 2.0
"""A ratio that hangs on the shapes of a scene holds within this factor of the published one."""

POLYGON_MS = {"village": (21, 13), "kitchen": (19, 13), "tree_on_snow": (8, 7)}
"""Table 1: milliseconds with polygons and with discarding."""

TRACED_MS = {"four_buildings": (158, 114, 95), "village": (422, 288, 217), "tree_on_snow": (3115, 2670, 2585),
             "kitchen": (956, 641, 610)}
"""Table 2: milliseconds with all rays, with uncertain ones alone, and with those shortened."""

RAYS = {"four_buildings": (55_294, 32_079), "village": (905_290, 236_350), "tree_on_snow": (623_890, 342_105),
        "kitchen": (967_655, 198_576)}
"""Table 2: rays without and with the scheme; the paper's two column heads are swapped."""

FEWER = {"village": 80_000, "kitchen": 24_000, "tree_on_snow": 60_000}
"""Triangles of the large scenes with ``--quick``."""

SMALL_TRIANGLES = (
    "Ruled out: the answer (no wrong sample) and the map's resolution (the paper's). A texel settles a sample in shadow "
    "only "
    "if one triangle covers it wholly, and a lit one only if nothing else touches it: where triangles are as small as "
    "texels, "
    "as the stand-in's leaves, tiles and fences are, few texels do")

CPU = "Times are of a CPU, the paper's of a graphics card: compare ratios alone. "

MAP_IS_DEAR = (
    "Ruled out: the scene (the paper's number of triangles), wrong answers (none), the number of rays and the kd-tree "
    "nodes met (both fall, see the other claims). What is left is the map: drawing it conservatively at 1024 x 1024 takes "
    "a CPU longer than tracing all rays (stage.map beside stage.trace in data.csv), while the paper's card drew it in 7 "
    "to 13 ms of hundreds")
NOISE = ("Fewer rays, nodes and tests are counted, in any case; what is left of the time is the machine's, which was "
         "shared, and the look-up of each sample's interval")
FRAGMENTS = (
    "Ruled out: the answer (no wrong sample), the number of triangles (the paper's), the work (discarding looks at more "
    "fragments, as it should). The paper's card is limited by the triangles it is sent, and polygons make more of them; a "
    "CPU is limited by fragments, and discarding makes more of those")


def measurements(size: int, height: int, scenes: Sequence[str], methods: tuple[str, ...], repeats: int
                 ) -> tuple[Measurement, ...]:
    """Frame 0 of every scene."""
    return tuple(Measurement(scene, size, (0,), methods, published_size=1280, repeats=repeats, height=height)
                 for scene in scenes)


def with_fewer_triangles(measured: Sequence[Measurement]) -> tuple[Measurement, ...]:
    """The same with smaller scenes, whose kd-trees are built in a moment."""
    return tuple(replace(m, triangles=FEWER.get(m.scene, 0)) for m in measured)


def ratio(column: str, a: str, b: str, scene: str) -> Callable[[Sequence[Row]], float]:
    """A column of method a over that of method b on a scene."""
    return lambda rows: mean(rows, column, scene=scene, method=a) / mean(rows, column, scene=scene, method=b)


def plot_rasters(evidence: Evidence, folder: Path) -> None:
    """Polygons over discarding: published and measured times, and fragments."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(1, 6.0, 3.2)
    scenes, rows = list(POLYGON_MS), evidence.rows
    series = {"time, published": [a / b for a, b in POLYGON_MS.values()],
              "time, measured": [ratio("stage.map", POLYGON, DISCARD, scene)(rows) for scene in scenes],
              "fragments, measured": [ratio("conservative_fragments", POLYGON, DISCARD, scene)(rows) for scene in scenes]}
    plots.draw_groups(axes[0], scenes, series, "polygons over discarding (stand-ins)", "ratio")
    axes[0].axhline(1.0, color="#5c5c5c", linewidth=0.8)
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


RASTERS = ("conservative_map[raster=polygon]", "conservative_map")

T1 = Item(
    "He.T1", PAPER, "Conservative rasterisation: polygons of up to nine corners against discarding", "Table 1",
    "Time of the stage that draws the conservative map of 1024 texels along the side, or of each face of a cube in the "
    "kitchen, whose light hangs in the room, and the fragments that it looks at. " + CPU,
    full=measurements(1280, 1024, tuple(POLYGON_MS), RASTERS, 3), quick=with_fewer_triangles(measurements(320, 256,
                                                                                                          tuple(POLYGON_MS),
                                                                                                          RASTERS, 1)),
    rows=cell_rows("conservative_fragments", "fragments_discarded", "map_texels_written", "wrong", "stage.map"),
    claims=(
        *(Claim(f"{scene}: polygons take longer than discarding", f"{a} over {b} ms: {a / b:.2f}x",
                ratio("stage.map", POLYGON, DISCARD, scene), at_least(1.0), at_least(1.0 / SLACK), otherwise=FRAGMENTS)
          for scene, (a, b) in POLYGON_MS.items()),
        *(Claim(f"{scene}: discarding looks at more fragments than polygons do", "none; expected above 1x",
                ratio("conservative_fragments", DISCARD, POLYGON, scene), at_least(1.0), at_least(1.0 / SLACK))
          for scene in POLYGON_MS)),
    plot=plot_rasters)

VARIANTS = ("ray_traced", "conservative_map[shorten=false]", "conservative_map")
LABELS = (ALL_RAYS, UNCERTAIN, SHORTENED)


def plot_rays(evidence: Evidence, folder: Path) -> None:
    """Rays, the stage that traces them, and the whole: each as a share of all rays, published beside measured."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(3, 4.2, 3.4)
    rows = evidence.rows
    casts = {"published": [100.0 * b / a for a, b in RAYS.values()],
             "measured": [100.0 / ratio("rays_cast", ALL_RAYS, UNCERTAIN, scene)(rows) for scene in SCENES]}
    plots.draw_groups(axes[0], SCENES, casts, "uncertain rays", "% of all rays")
    for panel, title, column in ((axes[1], "tracing alone", "stage.trace"), (axes[2], "whole frame", "seconds")):
        series = {}
        for k, name in ((1, "uncertain"), (2, "shortened")):
            if column == "seconds":
                series[f"{name}, published"] = [100.0 * TRACED_MS[scene][k] / TRACED_MS[scene][0] for scene in SCENES]
            series[f"{name}, measured"] = [100.0 * ratio(column, LABELS[k], ALL_RAYS, scene)(rows) for scene in SCENES]
        plots.draw_groups(panel, SCENES, series, title, "% of the time with all rays", logarithmic=column == "seconds")
        panel.legend(frameon=False, fontsize=7)
    axes[0].legend(frameon=False, fontsize=7)
    for panel in axes:
        panel.tick_params("x", labelsize=7)
    plots.save(figure, folder)


T2 = Item(
    "He.T2", PAPER, "All rays, uncertain rays, uncertain rays with short intervals", "Table 2",
    "Whole time of a frame without building the kd-tree, the stage that traces, rays cast, inner kd-tree nodes met and "
    "triangle tests. " + CPU + "The heads of the last two columns of Table 2 are swapped in the paper: fewer rays are cast "
    "with the scheme than without.",
    full=measurements(1280, 1024, SCENES, VARIANTS, 2), quick=with_fewer_triangles(measurements(320, 256, SCENES, VARIANTS,
                                                                                                1)),
    rows=cell_rows("rays_cast", "kd_nodes", "triangle_tests", "wrong", "seconds", "stage.map", "stage.trace"),
    claims=tuple(claim for scene in SCENES for claim in (
        Claim(f"{scene}: all rays over uncertain rays, number",
              f"{RAYS[scene][0]:,} over {RAYS[scene][1]:,}: {RAYS[scene][0] / RAYS[scene][1]:.2f}x",
              ratio("rays_cast", ALL_RAYS, UNCERTAIN, scene),
              Range(max(RAYS[scene][0] / RAYS[scene][1] / STAND_IN_FACTOR, 1.0),
                    RAYS[scene][0] / RAYS[scene][1] * STAND_IN_FACTOR),
              at_least(1.0), otherwise=SMALL_TRIANGLES),
        Claim(f"{scene}: all rays over uncertain rays, time",
              f"{TRACED_MS[scene][0]} over {TRACED_MS[scene][1]} ms: {TRACED_MS[scene][0] / TRACED_MS[scene][1]:.2f}x",
              ratio("seconds", ALL_RAYS, UNCERTAIN, scene), at_least(1.0), at_least(1.0 / SLACK), otherwise=MAP_IS_DEAR),
        Claim(f"{scene}: all rays over uncertain rays, time of the tracing alone", "not published; expected above 1x",
              ratio("stage.trace", ALL_RAYS, UNCERTAIN, scene), at_least(1.0), at_least(1.0 / SLACK), otherwise=NOISE),
        Claim(f"{scene}: whole over shortened intervals, time",
              f"{TRACED_MS[scene][1]} over {TRACED_MS[scene][2]} ms: {TRACED_MS[scene][1] / TRACED_MS[scene][2]:.2f}x",
              ratio("seconds", UNCERTAIN, SHORTENED, scene), at_least(1.0), at_least(1.0 / SLACK),
              otherwise="The map takes most of either time, and its time varies more than the tracing gains"),
        Claim(f"{scene}: whole over shortened intervals, time of the tracing alone", "not published; expected above 1x",
              ratio("stage.trace", UNCERTAIN, SHORTENED, scene), at_least(1.0), at_least(1.0 / SLACK), otherwise=NOISE),
        Claim(f"{scene}: whole over shortened intervals, kd-tree nodes met", "not published; expected above 1x",
              ratio("kd_nodes", UNCERTAIN, SHORTENED, scene), at_least(1.0), at_least(1.0 / SLACK)),
        Claim(f"{scene}: wrong samples of all three", "none", lambda rows, scene=scene: mean(  # type: ignore[misc]
            rows, "wrong", scene=scene), at_most(0.0), at_most(0.0), ""))),
    plot=plot_rays)

ITEMS = (*hertel2009_figures.ITEMS, T1, T2)
