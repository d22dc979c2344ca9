"""N3: how every method's counts grow with the resolution of the image and with the number of triangles.

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Range, Row, at_most
from shadowbench.reproduce.rows import cell_rows, mean, values
from shadowbench.reproduce.variants import Variant, variant

METHODS: dict[str, Variant] = {
    "shadow map": variant("shadow_map"), "silhouette map": variant("silhouette_map"), "hybrid": variant("hybrid"),
    "z-pass": variant("z_pass"), "z-fail": variant("z_fail"), "PTSV": variant("ptsv"),
    "PTSV, outline": variant("ptsv", culling_planes="outline"), "clusters": variant("cluster", layout="compact"),
    "conservative map": variant("conservative_map"), "ray traced": variant("ray_traced")}
BY_SIZE, BY_TRIANGLES = "castle", "cubes"
"""The scene that is drawn at several resolutions, and the one that is made with several numbers of triangles."""

LINEAR, SUBLINEAR = Range(0.9, 1.1), 0.75
"""Exponents: in proportion, within a tenth; clearly slower than in proportion."""


def measurements(sizes: tuple[int, ...], triangles: tuple[int, ...], size: int) -> tuple[Measurement, ...]:
    """One frame at every resolution, and one with every number of triangles."""
    methods = tuple(method.spec for method in METHODS.values())
    return (*(Measurement(BY_SIZE, s, (0,), methods, verify=False) for s in sizes),
            *(Measurement(BY_TRIANGLES, size, (0,), methods, verify=False, triangles=n) for n in triangles))


def points(rows: Sequence[Row], name: str, scene: str, column: str) -> list[tuple[float, float]]:
    """Samples or triangles, and a count."""
    label = METHODS[name].label
    across = "size" if scene == BY_SIZE else "triangles"
    xs = sorted(set(values(rows, across, scene=scene)))
    return [(x * x if scene == BY_SIZE else x, mean(rows, column, method=label, scene=scene, **{across: int(x)}))
            for x in xs]


def exponent(name: str, scene: str, column: str) -> Callable[[Sequence[Row]], float]:
    """Slope of a straight line through the logarithms, by least squares."""
    def value(rows: Sequence[Row]) -> float:
        logs = [(math.log(x), math.log(max(y, 1.0))) for x, y in points(rows, name, scene, column)]
        mean_x, mean_y = (sum(column) / len(logs) for column in zip(*logs, strict=True))
        return (sum((x - mean_x) * (y - mean_y) for x, y in logs) / sum((x - mean_x) ** 2 for x, _ in logs))
    return value


def plot(evidence: Evidence, folder: Path) -> None:
    """All operations over samples and over triangles; the exponents in the legend."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(2, 6.0, 4.2)
    palette = (*plots.COLORS, "#1b1b1b", "#c77cff")
    for panel, scene, unit in ((axes[0], BY_SIZE, "samples of the image"), (axes[1], BY_TRIANGLES, "triangles")):
        for color, name in zip(palette, METHODS, strict=True):
            x, y = zip(*points(evidence.rows, name, scene, "all_work"), strict=True)
            slope = exponent(name, scene, "all_work")(evidence.rows)
            plots.draw_line(panel, x, y, f"{name}: {slope:.2f}", color)
        panel.set(title=f"{scene}: exponents of all operations", xlabel=unit, ylabel="operations", xscale="log",
                  yscale="log")
        panel.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    plots.save(figure, folder)


N3 = Item(
    "N3", "new", "Growth of every method's counts with resolution and with triangles", "not published",
    "All operations of one frame: the castle at several resolutions of the image (maps keep 1024 texels), the cubes made "
    "with several numbers of triangles. Exponents are slopes through the logarithms. The cubes' silhouettes hardly grow "
    "with their triangles, which is the best case for stencil volumes.",
    full=measurements((256, 512, 1024, 2048, 4096), (1_000, 10_000, 100_000, 1_000_000), 512),
    quick=measurements((64, 128, 256), (1_000, 10_000), 96),
    rows=cell_rows("test_and_set", "all_work"),
    claims=(
        *(Claim(f"{name}: stencil updates grow in proportion to the samples (exponent)", "none; expected 1",
                exponent(name, BY_SIZE, "test_and_set"), LINEAR, Range(0.75, 1.25), "") for name in ("z-pass", "z-fail")),
        *(Claim(f"{name}: operations grow more slowly than the samples (exponent)", "none; expected at most 0.75",
                exponent(name, BY_SIZE, "test_and_set"), at_most(SUBLINEAR), at_most(1.0), "",
                otherwise="Large triangles in view have shadow edges everywhere, and at an edge every sample is tested")
          for name in ("PTSV", "PTSV, outline", "clusters")),
        *(Claim(f"{name}: operations grow no faster than the triangles (exponent)", "none; expected at most 1",
                exponent(name, BY_TRIANGLES, "all_work"), at_most(1.05), at_most(1.25), "") for name in METHODS)),
    plot=plot)
