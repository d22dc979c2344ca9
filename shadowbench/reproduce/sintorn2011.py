"""Sintorn, Olsson, Assarsson: "An Efficient Alias-free Shadow Algorithm for Opaque and Transparent Objects using
per-triangle Shadow Volumes", 2011: Figures 5 and 7, the numbers of section 4, and from `transparency_rows` Figures 1, 6, 8.

The ranges below were fixed before anything was measured at full size; the explanations were added afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from shadowbench.reproduce import transparency_rows
from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Range, Row, about, at_least, at_most
from shadowbench.reproduce.rows import cell_rows, mean, values, variation
from shadowbench.reproduce.sintorn2011_robustness import C3

PAPER = "sintorn2011"
CULLED, ALL = "ptsv+casters=back_faces", "ptsv"
STENCIL, HIERARCHY = ("z_pass", "z_fail"), ("ptsv[casters=back_faces]", "ptsv")

STAND_IN_FACTOR = 2.0
"""A total that hangs on the shapes of a scene holds within this factor: the stand-in has the paper's triangle count only."""

EXPONENT_SHARE = 0.25
"""A ratio of two totals of one scene holds within this share: most of what the stand-in does differently cancels."""

MEMORY_SHARE = 0.05
"""Memory is arithmetic: it holds within the rounding of the published numbers."""

SETTINGS = ("z-pass and z-fail draw the silhouettes of all casters, an edge of a closed body twice, as in the paper; z-pass "
            "also draws light caps, which the paper leaves out. PTSV has 32 children a tile and the paper's two silhouette "
            "planes; back faces alone cast where front-face culling (FFC) is on. ")

GPU = "Times are of a CPU, the paper's of a GTX 480 that rasterises shadow quads in hardware: compare ratios alone. "

AMONG_SHADOWS = 28
"""A frame at which the eye stands in two shadow volumes, among those of walls and houses."""

ALONG, HALF, FEW = tuple(range(0, 48, 4)), tuple(range(0, 48, 8)), (8, 24, 40)
"""Frames along the whole path."""


def fly_through(low: int, low_frames: tuple[int, ...], high: int, high_frames: tuple[int, ...], repeats: int
                ) -> tuple[Measurement, ...]:
    """Citadel at the two resolutions of Figure 7. The higher one is not verified again, and z-pass and z-fail, which take
    many seconds there, are timed once."""
    above = Measurement("citadel", high, high_frames, STENCIL, published_size=4096, repeats=1, warm_up=False, verify=False)
    return (Measurement("citadel", low, low_frames, STENCIL, published_size=1024, repeats=repeats),
            Measurement("citadel", low, low_frames, HIERARCHY, published_size=1024, repeats=repeats),
            above, replace(above, methods=HIERARCHY, repeats=repeats, warm_up=True))


FULL, QUICK = fly_through(1024, ALONG, 4096, HALF, 3), fly_through(256, FEW, 1024, FEW, 1)
ROWS = cell_rows("test_and_set", "all_work", "wrong", "seconds", "stage.eye_count")


def total(method: str, column: str = "test_and_set", size: int = 1024) -> Callable[[Sequence[Row]], float]:
    """Mean over the frames, in millions."""
    return lambda rows: mean(rows, column, method=method, published_size=size) / 1e6


def ratio(a: str, b: str, size: int, column: str = "test_and_set") -> Callable[[Sequence[Row]], float]:
    """Method a over method b, means over the frames."""
    return lambda rows: (mean(rows, column, method=a, published_size=size)
                         / mean(rows, column, method=b, published_size=size))


def growth(method: str) -> Callable[[Sequence[Row]], float]:
    """Test-and-set at the higher resolution over the lower one, over the frames that both have."""
    def value(rows: Sequence[Row]) -> float:
        frames = sorted({int(f) for f in values(rows, "frame", published_size=4096)})
        low, high = (sum(mean(rows, "test_and_set", method=method, published_size=size, frame=f) for f in frames)
                     for size in (1024, 4096))
        return high / low
    return value


def time_of(rows: Sequence[Row], method: str, size: int) -> list[float]:
    """Seconds per frame; as in the paper, without the time to count the volumes around the eye."""
    seconds, eye = (values(rows, column, method=method, published_size=size) for column in ("seconds", "stage.eye_count"))
    return [a - b for a, b in zip(seconds, eye, strict=True)]


def time_ratio(a: str, b: str, size: int) -> Callable[[Sequence[Row]], float]:
    """Time of method a over that of method b, summed over the frames."""
    return lambda rows: sum(time_of(rows, a, size)) / sum(time_of(rows, b, size))


def steadiness(a: str, b: str, size: int, column: str) -> Callable[[Sequence[Row]], float]:
    """Coefficient of variation of method a over that of method b."""
    return lambda rows: (variation(rows, column, method=a, published_size=size)
                         / variation(rows, column, method=b, published_size=size))


def plot_heat_maps(evidence: Evidence, folder: Path) -> None:
    """Scene and heat maps side by side, and each heat map as a file of its own."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(4, 3.4, 3.8)
    plots.draw_picture(axes[0], evidence.pictures[CULLED]["shaded"], "scene")
    for panel, method in zip(axes[1:], (*STENCIL, CULLED), strict=True):
        millions = mean(evidence.rows, "test_and_set", method=method) / 1e6
        plots.draw_picture(panel, evidence.pictures[method]["heatmap"], f"{method}: {millions:.1f} M")
        (folder / f"heatmap-{method}.png").write_bytes(evidence.pictures[method]["heatmap"].read_bytes())
    plots.save(figure, folder)


def plot_fly_through(y_label: str, value: Callable[[Sequence[Row], str, int], list[float]]
                     ) -> Callable[[Evidence, Path], None]:
    """Make the plot of a quantity per frame: one panel per resolution, one line per method."""
    def plot(evidence: Evidence, folder: Path) -> None:
        from shadowbench.reproduce import plots

        figure, axes = plots.panels(2)
        for panel, size in zip(axes, (1024, 4096), strict=True):
            frames = values(evidence.rows, "frame", method=ALL, published_size=size)
            measured = int(values(evidence.rows, "size", published_size=size)[0])
            series = {method: value(evidence.rows, method, size) for method in (*STENCIL, ALL, CULLED)}
            plots.draw_lines(panel, frames, series, f"citadel (stand-in), {measured} x {measured}", y_label)
        plots.legend_below(figure, axes[0])
        plots.save(figure, folder)
    return plot


F5 = Item(
    "S11.F5", PAPER, "Overdraw of one view: z-pass, z-fail, PTSV", "Figure 5",
    "Tests per pixel on one logarithmic scale, test-and-set operations in all in the titles. " + SETTINGS
    + "The view is among the shadows: the eye is in two shadow volumes.",
    full=(Measurement("citadel", 1024, (AMONG_SHADOWS,), (*STENCIL, *HIERARCHY), images=True),),
    quick=(Measurement("citadel", 512, (AMONG_SHADOWS,), (*STENCIL, *HIERARCHY), published_size=1024, images=True),),
    rows=cell_rows("test_and_set", "all_work", "wrong", "eye_volumes"),
    claims=(
        *(Claim(f"{name}: test-and-set operations in all", f"{published} M", total(method),
                Range(published / STAND_IN_FACTOR, published * STAND_IN_FACTOR),
                Range(published / STAND_IN_FACTOR**2, published * STAND_IN_FACTOR**2), " M",
                "The scene and the view are stand-ins: the ratios say more")
          for name, method, published in (("z-pass", "z_pass", 19.7), ("z-fail", "z_fail", 18.3), ("PTSV", CULLED, 1.2))),
        *(Claim(f"{name} needs {published:.0f} times the test-and-set operations of PTSV", f"{published:.1f}x",
                ratio(method, CULLED, 1024), at_least(published / STAND_IN_FACTOR), at_least(1.0))
          for name, method, published in (("z-pass", "z_pass", 19.7 / 1.2), ("z-fail", "z_fail", 18.3 / 1.2)))),
    plot=plot_heat_maps)

F7T = Item(
    "S11.F7t", PAPER, "Fly-through: time of z-pass, z-fail and PTSV at 1024 and 4096", "Figure 7, above; sec. 4",
    "Seconds per frame. " + GPU + SETTINGS + "The time of z-pass leaves out the count of the volumes around the eye.",
    full=FULL, quick=QUICK, rows=ROWS,
    claims=(
        Claim("With FFC, PTSV is faster than z-fail at 1024", "below 1x", time_ratio(CULLED, "z_fail", 1024),
              at_most(1.0), at_most(1.0)),
        Claim("With FFC, PTSV is faster than z-fail at 4096", "below 1x", time_ratio(CULLED, "z_fail", 4096),
              at_most(1.0), at_most(1.0)),
        Claim("With FFC, PTSV takes about the time of z-pass at 4096", "about 1x", time_ratio(CULLED, "z_pass", 4096),
              Range(1.0 / STAND_IN_FACTOR, STAND_IN_FACTOR), at_most(STAND_IN_FACTOR),
              otherwise="z-pass has no rasterisation hardware here"),
        Claim("Without FFC, z-pass is faster than PTSV at 4096", "above 1x", time_ratio(ALL, "z_pass", 4096),
              at_least(1.0), at_least(1.0), otherwise="z-pass has no rasterisation hardware here"),
        Claim("With FFC, PTSV's times vary much less than those of z-pass at 4096 (coefficient of variation)",
              "far below 1x", steadiness(CULLED, "z_pass", 4096, "seconds"), at_most(0.5), at_most(1.0),
              otherwise="z-pass pays for every fragment here, and their number is steadier than that of stencil updates")),
    plot=plot_fly_through("seconds", time_of))

F7O = Item(
    "S11.F7o", PAPER, "Fly-through: test-and-set operations of z-pass, z-fail and PTSV at 1024 and 4096",
    "Figure 7, below; sec. 4", "Test-and-set operations per frame. " + SETTINGS,
    full=FULL, quick=QUICK, rows=ROWS,
    claims=(
        Claim("16 times the samples cost PTSV (FFC) 2 to 4 times the operations", "2 to 4x", growth(CULLED),
              Range(2.0, 4.0), Range(1.0, 8.0), otherwise="Below the range, PTSV scales better than published"),
        Claim("16 times the samples cost z-pass about 16 times the operations", "16x", growth("z_pass"),
              about(16.0, MEMORY_SHARE), about(16.0, EXPONENT_SHARE)),
        Claim("PTSV (FFC) needs fewer operations than z-pass at 1024", "above 1x", ratio("z_pass", CULLED, 1024),
              at_least(1.0), at_least(1.0)),
        Claim("PTSV (FFC) needs fewer operations than z-pass at 4096", "far above 1x", ratio("z_pass", CULLED, 4096),
              at_least(4.0), at_least(1.0)),
        Claim("PTSV's operations (FFC) vary less than those of z-pass at 1024 (coefficient of variation)", "below 1x",
              steadiness(CULLED, "z_pass", 1024, "test_and_set"), at_most(1.0), at_most(1.0))),
    plot=plot_fly_through("test-and-set operations", lambda rows, method, size: values(
        rows, "test_and_set", method=method, published_size=size)))

C1 = Item(
    "S11.C1", PAPER, "Front-face culling off: PTSV's test-and-set operations", "sec. 4",
    "Test-and-set operations of PTSV with all casters over those with back faces alone, over the fly-through. " + SETTINGS,
    full=(FULL[1], FULL[3]), quick=(QUICK[1], QUICK[3]), rows=cell_rows("test_and_set", "wrong"),
    claims=tuple(Claim(f"Without front-face culling at {size}", f"{published}x", ratio(ALL, CULLED, size),
                       about(published, EXPONENT_SHARE), at_least(1.0),
                       otherwise="Front faces in view are refined down to every sample, so the ratio grows with resolution")
                 for size, published in ((1024, 2.2), (4096, 2.4))))


def memory_at_4096(method: str, *structures: str) -> Callable[[Sequence[Row]], float]:
    """Memory of structures that grow with the samples, in MiB, scaled to 4096 x 4096 samples."""
    def value(rows: Sequence[Row]) -> float:
        size = values(rows, "size", method=method)[0]
        return sum(mean(rows, f"memory.{name}", method=method) for name in structures) * (4096.0 / size) ** 2 / 2**20
    return value


BITS8, CUBE = "z_pass+stencil_bits=8", "shadow_map+projection=cube+resolution=4096"
HIERARCHIES = ("depth_hierarchy", "shadow_hierarchy")

# The light hangs in the middle of the cubes, so that all six faces of the map are in use.
OMNIDIRECTIONAL = Measurement("cubes", 256, (0,), ("shadow_map[projection=cube,resolution=4096]",), published_size=4096,
                              verify=False)

C2 = Item(
    "S11.C2", PAPER, "Memory at 4096 x 4096", "sec. 4",
    "Bytes of the structures that grow with the samples, in MiB; the planes of PTSV's frusta and the faces of the shadow "
    "volumes are left out, as in the paper. PTSV's are modelled as the paper stores them: a bit per sample and tile, and "
    "two 16-bit depths per tile. Other sizes are scaled to 4096 x 4096 samples; the map has 6 x 4096 x 4096 texels.",
    full=(Measurement("citadel", 4096, (40,), (HIERARCHY[0], "z_pass[stencil_bits=8]"), verify=False),
          OMNIDIRECTIONAL),
    quick=(Measurement("citadel", 1024, (40,), (HIERARCHY[0], "z_pass[stencil_bits=8]"), published_size=4096, verify=False),
           OMNIDIRECTIONAL),
    rows=cell_rows(*(f"memory.{name}" for name in (*HIERARCHIES, "stencil", "maps"))),
    claims=(
        Claim("Hierarchical shadow buffer", "2.1 MB", memory_at_4096(CULLED, "shadow_hierarchy"),
              about(2.1, MEMORY_SHARE), about(2.1, EXPONENT_SHARE), " MiB"),
        Claim("Hierarchical depth buffers", "2.1 MB", memory_at_4096(CULLED, "depth_hierarchy"),
              about(2.1, MEMORY_SHARE), about(2.1, EXPONENT_SHARE), " MiB"),
        Claim("Both hierarchies", "4.2 MB", memory_at_4096(CULLED, *HIERARCHIES),
              about(4.2, MEMORY_SHARE), about(4.2, EXPONENT_SHARE), " MiB"),
        Claim("Stencil buffer of 8 bits", "16 MB", memory_at_4096(BITS8, "stencil"),
              about(16.0, MEMORY_SHARE), about(16.0, EXPONENT_SHARE), " MiB"),
        Claim("Omnidirectional shadow map of 4096 x 4096", "384 MB",
              lambda rows: mean(rows, "memory.maps", method=CUBE) / 2**20,
              about(384.0, MEMORY_SHARE), about(384.0, EXPONENT_SHARE), " MiB",
              "The map here has 8 bytes per texel, a float64 depth, and triangle numbers of one face; the paper counts 4")))

ITEMS = (*transparency_rows.ITEMS, F5, F7T, F7O, C1, C2, C3)
