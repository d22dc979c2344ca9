"""Chan, Durand: "An Efficient Hybrid Shadow Rendering Algorithm", 2004: Figures 11 and 12 and section 6.3; the figures with
pictures are in `chan2004_figures`.

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from shadowbench.reproduce import chan2004_figures
from shadowbench.reproduce.chan2004_figures import (
    PAPER,
    RESOLUTIONS,
    SCENES,
    VOLUMES,
    hybrid,
    per_cent,
    shadow_map,
    share,
)
from shadowbench.reproduce.items import (
    Claim,
    Evidence,
    Item,
    Measurement,
    Pictures,
    Range,
    Row,
    at_least,
    at_most,
    view_key,
)
from shadowbench.reproduce.rows import cell_rows, mean
from shadowbench.reproduce.variants import Variant, variant

VIEWS = (0, 16, 32)
"""Frames that stand for the paper's views A, B and C of each scene."""

SMALL_SHARE, QUARTER = 10.0, 25.0
"""A small share of the image is at most twice the 5 per cent of the paper's Figure 10; in part, a quarter. Per cent."""

HYBRIDS = tuple(map(hybrid, RESOLUTIONS))


def nine_views(size: int) -> tuple[Measurement, ...]:
    """Hybrids and volumes in every view of every scene; pictures of the volumes, for their coverage."""
    volumes = tuple(Measurement(scene, size, VIEWS, (VOLUMES.spec,), published_size=1024, images=True) for scene in SCENES)
    hybrids = tuple(replace(m, methods=tuple(method.spec for method in HYBRIDS), images=False) for m in volumes)
    return (*volumes, *hybrids)


def add_coverage(rows: Sequence[Row], found: Pictures) -> list[Row]:
    """Add the share of the image with a stencil update to the rows of shadow volumes, in per cent."""
    from shadowbench.reproduce import tiles

    def coverage(row: Row) -> float:
        files = found[view_key(str(row["scene"]), int(row["frame"]), VOLUMES.label)]
        return round(100.0 * tiles.share_tested(files["shadow_exr"]), 3)
    return [{**row, "coverage": coverage(row)} if row["method"] == VOLUMES.label else row for row in rows]


def views_of(rows: Sequence[Row]) -> list[tuple[str, int]]:
    """Scene and frame of every view."""
    return list(dict.fromkeys((str(row["scene"]), int(row["frame"])) for row in rows))


def largest_share(scene: str) -> Callable[[Sequence[Row]], float]:
    """Silhouette samples as a share of the image, the largest of all resolutions and views, in per cent."""
    return lambda rows: max(per_cent("silhouette_samples", method, scene=scene, frame=frame)(rows)
                            for method in HYBRIDS for where, frame in views_of(rows) if where == scene)


def least_gain(rows: Sequence[Row]) -> float:
    """Coverage of shadow volumes over silhouette samples at 256, the smallest of all views."""
    return min(mean(rows, "coverage", method=VOLUMES.label, scene=scene, frame=frame)
               / per_cent("silhouette_samples", hybrid(256), scene=scene, frame=frame)(rows) for scene,
               frame in views_of(rows))


def share_fall(scene: str) -> Callable[[Sequence[Row]], float]:
    """Silhouette samples at the lowest resolution over those at the highest."""
    return lambda rows: (mean(rows, "silhouette_samples", scene=scene, method=HYBRIDS[0].label)
                         / mean(rows, "silhouette_samples", scene=scene, method=HYBRIDS[-1].label))


def plot_shares(evidence: Evidence, folder: Path) -> None:
    """One panel per scene: bars of coverage and silhouettes by view; the overdraw is written over the first bar."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(len(SCENES), 4.0, 3.4)
    rows, letters = evidence.rows, "ABC"
    for panel, scene in zip(axes, SCENES, strict=True):
        frames = [frame for where, frame in views_of(rows) if where == scene]
        series = {"covered by volumes": [mean(rows, "coverage", method=VOLUMES.label, scene=scene, frame=f) for f in frames]}
        series |= {f"silhouettes, {r}": [per_cent("silhouette_samples", hybrid(r), scene=scene, frame=f)(rows)
                                         for f in frames]
                   for r in RESOLUTIONS}
        plots.draw_groups(panel, [f"view {letters[i]}" for i in range(len(frames))], series, f"{scene} (stand-in)",
                          "% of image")
        for i, frame in enumerate(frames):
            overdraw = share("stencil_fragments", VOLUMES, scene=scene, frame=frame)(rows)
            panel.text(i - 0.3, series["covered by volumes"][i], f"{overdraw:.0f}", ha="center", va="bottom")
        panel.set_ylim(0, 112)
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


F11 = Item(
    "Ch.F11", PAPER, "Coverage and overdraw of volumes, silhouette samples of the hybrid, nine views", "Figure 11",
    "Shares of the image: samples that shadow volumes update, the overdraw (fragments over samples) above the bar; "
    "samples whose four depths disagree at three resolutions. Three frames of each scene's path stand for the paper's "
    "views A, B and C. The paper's coverage counts pixels with any fragment, ours only those with a stencil update, so it "
    "is less.",
    full=nine_views(1024), quick=nine_views(256), from_pictures=add_coverage,
    rows=cell_rows("wrong", "silhouette_samples", "mask_samples", "stencil_fragments", "stencil_updates"),
    claims=(*(claim for scene in SCENES for claim in (
        Claim(f"{scene}: silhouette samples are a small share of the image (largest of all views and resolutions)",
              "small", largest_share(scene), at_most(SMALL_SHARE), at_most(QUARTER), " %",
              otherwise="At 256 a texel of the map spans several pixels on the screen, and edges lie close together"),
        Claim(f"{scene}: a finer map has fewer silhouette samples (256 over 1024)", "above 1x", share_fall(scene),
              at_least(1.0), at_least(1.0 / 1.1)))),
        Claim("Volumes cover far more of the image than silhouette samples at 256 do (smallest ratio of the views)",
              "much larger", least_gain, at_least(2.0), at_least(1.0))),
    plot=plot_shares)

PARTS = {"map": ("fit", "map"), "classification": ("classify", "mask"),
         "volumes": ("casters", "edges", "silhouette", "volumes", "stencil"), "shadow": ("lookup", "resolve")}
"""Parts of Figure 12 and the stages that belong to them."""

TIMED = (shadow_map(1024), hybrid(1024), VOLUMES)


def timed_views(size: int, frames: tuple[int, ...], repeats: int) -> tuple[Measurement, ...]:
    """The three methods in some views of each scene."""
    return tuple(Measurement(scene, size, frames, tuple(method.spec for method in TIMED), published_size=1024,
                             repeats=repeats, verify=False) for scene in SCENES)


def part_seconds(rows: Sequence[Row], method: Variant, part: str, **where: str | int) -> float:
    """Seconds of a part of a method."""
    return sum(mean(rows, f"stage.{stage}", method=method.label, **where) for stage in PARTS[part])


def speed_up(scene: str) -> Callable[[Sequence[Row]], float]:
    """Time of shadow volumes over that of the hybrid, means over the views."""
    return lambda rows: (mean(rows, "seconds", method=VOLUMES.label, scene=scene)
                         / mean(rows, "seconds", method=hybrid(1024).label, scene=scene))


def plot_parts(evidence: Evidence, folder: Path) -> None:
    """One panel per scene: a bar per method, stacked by part, means over the views."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(len(SCENES), 3.4, 3.4)
    for panel, scene in zip(axes, SCENES, strict=True):
        bottom = [0.0] * len(TIMED)
        for color, part in zip(plots.COLORS, PARTS, strict=False):
            heights = [1e3 * part_seconds(evidence.rows, method, part, scene=scene) for method in TIMED]
            panel.bar(range(len(TIMED)), heights, 0.6, bottom, label=part, color=color)
            bottom = [a + b for a, b in zip(bottom, heights, strict=True)]
        panel.set(title=f"{scene} (stand-in)", ylabel="milliseconds", xticks=range(len(TIMED)))
        panel.set_xticklabels(["shadow map", "hybrid", "volumes"])
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


ROWS_ARE_WALKED = (
    "Ruled out: the mask (few samples are on it, see Ch.F11) and the answer (Ch.F8). What is left, by part in data.csv: the "
    "maps on six faces round the light and the classification, which a card does in passing, take up to half of the "
    "hybrid's "
    "time; and the mask saves fragments alone, while a CPU still walks the rows of every volume, which is most of its work "
    "for thin branches")

F12 = Item(
    "Ch.F12", PAPER, "Time by part: shadow map, hybrid, shadow volumes", "Figure 12; sec. 5.2",
    "Milliseconds per frame, one view of each scene; the paper shows three. Times are of a CPU, the paper's of a graphics "
    "card that rasterises volumes "
    "in hardware: compare ratios alone. Maps have 1024 texels along the side.",
    full=timed_views(1024, VIEWS[:1], 1), quick=timed_views(256, VIEWS[:1], 1),
    rows=cell_rows("seconds", *(f"stage.{stage}" for stages in PARTS.values() for stage in stages)),
    claims=tuple(Claim(f"{scene}: the hybrid is faster than shadow volumes", "1.3x to over 2x", speed_up(scene),
                       at_least(1.3), at_least(1.0), otherwise=ROWS_ARE_WALKED) for scene in SCENES),
    plot=plot_parts)

def culled(resolution: int) -> Variant:
    """Name the hybrid that leaves out well-sampled silhouettes."""
    options: dict[str, str | int] = {} if resolution == 1024 else {"resolution": resolution}
    return variant("hybrid", undersampled_only=True, **options)


def culled_views(size: int, frames: tuple[int, ...]) -> tuple[Measurement, ...]:
    """It, with maps of every resolution, in the views of every scene."""
    methods = tuple(culled(resolution).spec.lower() for resolution in RESOLUTIONS)
    return tuple(Measurement(scene, size, frames, methods, published_size=1024) for scene in SCENES)


def saved(resolution: int) -> Callable[[Sequence[Row]], float]:
    """Share of the silhouette samples that is left out, over all views, in per cent."""
    label = culled(resolution).label
    return lambda rows: 100.0 * (mean(rows, "silhouette_samples_culled", method=label)
                                 / mean(rows, "silhouette_samples", method=label))


C1 = Item(
    "Ch.C1", PAPER, "Leaving out silhouette samples that are not undersampled", "sec. 6.3",
    "Silhouette samples where a texel of the map is smaller than a pixel, which need no volumes, over all silhouette "
    "samples, with maps of three resolutions: the paper does not say which it used for this number.",
    full=culled_views(1024, VIEWS), quick=culled_views(256, VIEWS[:1]),
    rows=cell_rows("wrong", "silhouette_samples", "silhouette_samples_culled"),
    claims=tuple(Claim(f"Silhouette samples left out with maps of {resolution}", "5 %, resolution not given",
                       saved(resolution), Range(0.0, 10.0), Range(0.0, 25.0), " %",
                       otherwise="Ruled out: the formula (r as in Stamminger and Drettakis 2002, tested on its own). What "
                                 "is left are the views: the lights of cubes and cage have six maps, so texels are small "
                                 "on the screen, and views from afar need none of them finer")
                 for resolution in RESOLUTIONS))

ITEMS = (*chan2004_figures.ITEMS, F11, F12, C1)
