"""Chan, Durand: "An Efficient Hybrid Shadow Rendering Algorithm", 2004: Figures 9 and 11.

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

from shadowbench.reproduce.items import Claim, Item, Measured, Measurement, Row, at_least, at_most
from shadowbench.reproduce.rows import cell_rows, mean

PAPER = "chan2004"
SCENES = ("cubes", "dragon_cage")
RESOLUTIONS = (256, 512, 1024)

SLACK = 1.1
"""A claim of "less" holds in part if it fails by less than this factor."""

SMALL_SHARE, QUARTER = 10.0, 25.0
"""A small share of the image is at most twice the 5 per cent of the paper's Figure 10; in part, a quarter. Per cent."""


def hybrids(size: int) -> tuple[Measurement, ...]:
    """The hybrid with maps of every resolution on both scenes."""
    methods = tuple(f"hybrid[resolution={resolution}]" for resolution in RESOLUTIONS)
    return tuple(Measurement(scene, size, (0,), methods, published_size=1024) for scene in SCENES)


def resolution_rows(measured: Sequence[Measured]) -> list[Row]:
    """One row per cell, with the resolution in a column of its own."""
    rows = cell_rows("wrong", "silhouette_samples", "mask_samples", "stencil_fragments")(measured)
    return [{**row, "resolution": int(each.cell.params["resolution"])} for row, each in zip(rows, measured, strict=True)]


def worst_step(scene: str) -> Callable[[Sequence[Row]], float]:
    """Wrong samples over those at half the resolution, the largest ratio of all steps."""
    def value(rows: Sequence[Row]) -> float:
        wrong = [mean(rows, "wrong", scene=scene, resolution=resolution) for resolution in RESOLUTIONS]
        return max(high / max(low, 1.0) for low, high in pairwise(wrong))
    return value


def largest_share(scene: str) -> Callable[[Sequence[Row]], float]:
    """Silhouette samples as a share of the image, the largest of all resolutions, in per cent."""
    return lambda rows: max(100.0 * mean(rows, "silhouette_samples", scene=scene, resolution=resolution)
                            / mean(rows, "size", scene=scene) ** 2 for resolution in RESOLUTIONS)


def share_fall(scene: str) -> Callable[[Sequence[Row]], float]:
    """Silhouette samples at the lowest resolution over those at the highest."""
    return lambda rows: (mean(rows, "silhouette_samples", scene=scene, resolution=RESOLUTIONS[0])
                         / mean(rows, "silhouette_samples", scene=scene, resolution=RESOLUTIONS[-1]))


F9 = Item(
    "Ch.F9", PAPER, "Wrong samples of the hybrid at three resolutions of the map", "Figure 9",
    "Samples whose answer differs from the certified reference, ambiguous ones left out; the light of `cubes` has six maps "
    "of the resolution given.", full=hybrids(1024), quick=hybrids(512), rows=resolution_rows,
    claims=tuple(Claim(f"{scene}: fewer wrong samples at twice the resolution (largest ratio of the steps)", "below 1x",
                       worst_step(scene), at_most(1.0), at_most(SLACK)) for scene in SCENES))

F11 = Item(
    "Ch.F11", PAPER, "Silhouette samples of the hybrid at three resolutions of the map", "Figure 11",
    "Samples whose four depths disagree, as a share of the image. One view of two scenes; the paper has nine views.",
    full=hybrids(1024), quick=hybrids(512), rows=resolution_rows,
    claims=tuple(claim for scene in SCENES for claim in (
        Claim(f"{scene}: silhouette samples are a small share of the image (largest of all resolutions)", "about 5 %",
              largest_share(scene), at_most(SMALL_SHARE), at_most(QUARTER), " %"),
        Claim(f"{scene}: a finer map has fewer silhouette samples (256 over 1024)", "above 1x", share_fall(scene),
              at_least(1.0), at_least(1.0 / SLACK)))))

ITEMS = (F9, F11)
