"""Figures 1, 6 and 8 of Sintorn, Olsson, Assarsson 2011: casters that let light through.

The ranges below were fixed before anything was measured at full size; the explanations were added afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Pictures, Range, Row, about, at_least, at_most
from shadowbench.reproduce.rows import cell_rows, mean

PAPER = "sintorn2011"

TIME_FACTOR = 2.0
"""A ratio of times holds within this factor: of a CPU and a stand-in scene, against a GTX 480 and the paper's."""

MEMORY_SHARE = 0.05
"""Memory is arithmetic: it holds within the rounding of the published numbers."""

MEAN_TOLERANCE = 0.002
"""Stochastic and real-valued shadows agree on average within this share of the light: four standard errors of a million
draws at a half."""

GAME, CLEAR, GLASS = "ptsv+casters=back_faces", "ptsv", "ptsv+transparency=color"
BINARY, UNSKIPPED = "ptsv+transparency=off", "ptsv+skip_shadowed=False+transparency=off"
CONSTANT, CHANCE = "ptsv+transparency=constant", "ptsv+transparency=stochastic"

GPU = "Times are of a CPU, the paper's of a GTX 480: compare ratios alone. "
PRODUCTS = ("Shares of light are multiplied as 32-bit floats, where the paper adds logarithms; the textured modes walk "
            "below an accepted tile down to its samples, as in the paper. ")

ROWS = cell_rows("test_and_set", "all_work", "wrong", "seconds", "light_updates", "texture_lookups",
                 "memory.light_hierarchy", "memory.shadow_hierarchy")


def slower(published: float) -> Range:
    """A ratio of times near the published one, and not below 1: what the paper found slower is slower."""
    return Range(max(1.0, published / TIME_FACTOR), published * TIME_FACTOR)


def method(label: str) -> str:
    """As on the command line."""
    name, *options = label.split("+")
    return f"{name}[{','.join(options)}]" if options else name


def time_ratio(a: str, b: str, scene_a: str, scene_b: str) -> Callable[[Sequence[Row]], float]:
    """Time of method a on one scene over that of method b on another."""
    return lambda rows: mean(rows, "seconds", method=a, scene=scene_a) / mean(rows, "seconds", method=b, scene=scene_b)


def plot_pictures(*panels: tuple[str, str]) -> Callable[[Evidence, Path], None]:
    """Make the plot of shaded pictures side by side, with the time of each in its title.

    Parameters
    ----------
    *panels : label and caption.
    """
    def plot(evidence: Evidence, folder: Path) -> None:
        from shadowbench.reproduce import plots

        figure, axes = plots.panels(len(panels), 3.4, 3.8)
        for panel, (label, caption) in zip(axes, panels, strict=True):
            seconds = mean(evidence.rows, "seconds", method=label)
            plots.draw_picture(panel, evidence.pictures[label]["shaded"], f"{caption}: {1e3 * seconds:.0f} ms")
        plots.save(figure, folder)
    return plot


def three_images(size: int, repeats: int) -> tuple[Measurement, ...]:
    """The paper's first picture: a game scene, alpha-textured leaves, and coloured glass in eight layers."""
    small = 0 if size == 1024 else 1024
    return (Measurement("citadel", size, (40,), (method(GAME),), published_size=small, repeats=repeats, images=True),
            Measurement("alpha_tree", size, (0,), (method(CLEAR),), published_size=small, repeats=repeats, images=True),
            Measurement("stained_glass", size, (0,), (method(GLASS),), published_size=small, repeats=repeats, images=True,
                        settings=("image.layers=8",)))


F1 = Item(
    "S11.F1", PAPER, "Game scene, alpha-textured casters, coloured casters with 8 peeled layers", "Figure 1",
    "Shaded pictures and the time to make their shadow buffers. " + GPU + PRODUCTS + "The game scene casts with back faces. "
    "The third picture composites what 8 layers of depth peeling show, each with a shadow pass of its own; its time is that "
    "of all passes. Peeling stops when no layer is left.",
    full=three_images(1024, 3), quick=three_images(320, 1), rows=ROWS,
    claims=(
        Claim("Alpha-textured casters take this much longer than the game scene", "1.8x",
              time_ratio(CLEAR, GAME, "alpha_tree", "citadel"), slower(1.8), at_least(1.0),
              otherwise="The tree is much the harder stand-in: all its casters count, nine times the test-and-set "
              "operations, and shares of light must be multiplied to the end, where binary shadows skip what is dark "
              "already"),
        Claim("Coloured casters with 8 layers take this much longer than the game scene", "10.4x",
              time_ratio(GLASS, GAME, "stained_glass", "citadel"), slower(10.4),
              at_least(1.0), otherwise="The view has three layers, and the deeper ones hold few samples"),
        Claim("No sample is wrong", "none", lambda rows: sum(mean(rows, "wrong", method=label) for label in
                                                             (GAME, CLEAR, GLASS)), Range(0.0, 0.0), Range(0.0, 0.0), "")),
    plot=plot_pictures((GAME, "(a) game scene"), (CLEAR, "(b) alpha-textured"), (GLASS, "(c) coloured, peeled")))


def memory_at_4096(label: str, structure: str) -> Callable[[Sequence[Row]], float]:
    """Memory of a structure in MiB, scaled to 4096 x 4096 samples; rows of pictures have four samples per pixel."""
    def value(rows: Sequence[Row]) -> float:
        row = next(row for row in rows if row["method"] == label and row["scene"] == "alpha_tree")
        samples = 16 * float(row["size"]) ** 2 if row["published_size"] == 4096 else 4 * float(row["size"]) ** 2
        return float(row[f"memory.{structure}"]) * 4096.0**2 / samples / 2**20
    return value


def compare_pictures(rows: Sequence[Row], pictures: Pictures) -> list[Row]:
    """Add to the rows of pictures how far stochastic shadows are from real ones: on average, and from pixel to pixel."""
    import numpy as np

    from shadowbench import image_io

    def shares(label: str) -> np.ndarray:
        shadow = image_io.read_exr(pictures[label]["shadow_exr"])["shadow"].astype(np.float64)
        height, width = (n // 2 for n in shadow.shape)
        pixels: np.ndarray = shadow[:2 * height, :2 * width].reshape(height, 2, width, 2).mean(axis=(1, 3))
        return pixels

    difference = shares(CHANCE) - shares(CLEAR)
    of_all = {"mean_difference": round(float(difference.mean()), 9),
              "pixel_deviation": round(float(np.sqrt((difference * difference).mean())), 9)}
    return [{**row, **(of_all if row["published_size"] != 4096 else {})} for row in rows]


def resolved(size: int, pixels: int, repeats: int) -> tuple[Measurement, ...]:
    """Sixteen samples per pixel for memory and time, and a verified picture with four."""
    both = (method(CHANCE), method(CLEAR))
    return (Measurement("alpha_tree", size, (0,), both, published_size=4096, repeats=repeats, verify=False,
                        settings=("image.samples=16",)),
            Measurement("alpha_tree", pixels, (0,), both, repeats=repeats, images=True, settings=("image.samples=4",)))


def plot_zoomed(evidence: Evidence, folder: Path) -> None:
    """Both pictures whole, and a part of both enlarged: the noise is hardly seen otherwise."""
    from shadowbench import image_io
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(4, 3.4, 3.8)
    for k, (label, caption) in enumerate(((CHANCE, "(a) stochastic"), (CLEAR, "(b) real-valued"))):
        picture = image_io.read_png(evidence.pictures[label]["shaded"])
        rows, columns = picture.shape[:2]
        plots.draw_picture(axes[2 * k], evidence.pictures[label]["shaded"], caption)
        axes[2 * k + 1].imshow(picture[7 * rows // 10:, columns // 4:max(columns // 4 + 3 * rows // 10, columns // 4 + 1)],
                               interpolation="nearest")
        axes[2 * k + 1].set_title("enlarged")
        axes[2 * k + 1].set_axis_off()
    plots.save(figure, folder)


F6 = Item(
    "S11.F6", PAPER, "Stochastic against real-valued transparency", "Figure 6; sec. 3.2 and 4",
    "The same view with light or shadow drawn for each sample, and with real shares of light. Memory and time are of 16 "
    "samples per pixel (4096 x 4096 at full size); the pictures have four. Memory is of the shadow buffer and its "
    "hierarchy: a bit, or a 32-bit float. " + GPU,
    full=resolved(1024, 1024, 1), quick=resolved(160, 256, 1), rows=ROWS, from_pictures=compare_pictures,
    claims=(
        Claim("Shadow buffer of the stochastic mode", "about 2 MB", memory_at_4096(CHANCE, "shadow_hierarchy"),
              about(2.1, MEMORY_SHARE), about(2.1, 0.25), " MiB"),
        Claim("Shadow buffer of real shares of light", "about 64 MB", memory_at_4096(CLEAR, "light_hierarchy"),
              about(64.0, MEMORY_SHARE), about(64.0, 0.25), " MiB"),
        Claim("The stochastic shadow is right on average (mean difference)", "0",
              lambda rows: abs(mean([row for row in rows if "mean_difference" in row], "mean_difference")),
              at_most(MEAN_TOLERANCE), at_most(5.0 * MEAN_TOLERANCE), ""),
        Claim("The stochastic mode is slightly faster", "below 1x",
              lambda rows: (mean(rows, "seconds", method=CHANCE, published_size=4096)
                            / mean(rows, "seconds", method=CLEAR, published_size=4096)), at_most(1.0), at_most(1.1))),
    plot=plot_zoomed)


def variants(size: int, repeats: int) -> tuple[Measurement, ...]:
    """The tree in all modes."""
    small = 0 if size == 1024 else 1024
    pictures = (BINARY, CONSTANT, CLEAR, CHANCE, GLASS)
    return (Measurement("alpha_tree", size, (0,), tuple(map(method, pictures)), published_size=small, repeats=repeats,
                        images=True),
            Measurement("alpha_tree", size, (0,), (method(UNSKIPPED),), published_size=small, repeats=repeats))


def against_binary(label: str) -> Callable[[Sequence[Row]], float]:
    """Time of a mode over that of binary visibility."""
    return time_ratio(label, BINARY, "alpha_tree", "alpha_tree")


_SKIPPING = ("Binary shadows skip what is in shadow already, which a leafy tree makes the most of; against binary shadows "
             "that skip nothing, a row of data.csv, the ratio is smaller")

F8 = Item(
    "S11.F8", PAPER, "The tree in five modes: binary, alpha 0.5, textured, stochastic, coloured", "Figure 8",
    "Shaded pictures and times. " + GPU + PRODUCTS + "The leaves have alpha 0.5, and their texture covers about a "
    "third; coloured leaves are textured too, unlike the paper's. data.csv also has binary shadows that skip nothing.",
    full=variants(1024, 3), quick=variants(320, 1), rows=ROWS,
    claims=(
        *(Claim(f"{name} against binary visibility", f"{published / 7.9:.2f}x", against_binary(label),
                slower(published / 7.9), at_least(1.0), otherwise=_SKIPPING)
          for name, label, published in (("Constant alpha 0.5", CONSTANT, 8.6), ("Textured", CLEAR, 12.9),
                                         ("Stochastic, textured", CHANCE, 12.9), ("Coloured", GLASS, 10.4))),
        Claim("Textured against binary visibility that skips nothing", "1.63x",
              time_ratio(CLEAR, UNSKIPPED, "alpha_tree", "alpha_tree"), slower(1.63), at_least(1.0)),
        Claim("No sample is wrong", "none",
              lambda rows: sum(mean(rows, "wrong", method=label) for label in (BINARY, CONSTANT, CLEAR, CHANCE, GLASS)),
              Range(0.0, 0.0), Range(0.0, 0.0), "")),
    plot=plot_pictures((BINARY, "binary"), (CONSTANT, "alpha 0.5"), (CLEAR, "textured"), (CHANCE, "stochastic"),
                       (GLASS, "coloured")))

ITEMS = (F1, F6, F8)
