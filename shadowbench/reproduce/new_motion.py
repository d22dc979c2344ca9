"""N4: how steady every method's counts are when the camera moves, and when the light does.

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from pathlib import Path

from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Row, at_least, at_most
from shadowbench.reproduce.rows import cell_rows
from shadowbench.reproduce.variants import Variant, variant

SCENE = "citadel"
METHODS: dict[str, Variant] = {
    "shadow map": variant("shadow_map"), "silhouette map": variant("silhouette_map"), "hybrid": variant("hybrid"),
    "z-pass": variant("z_pass"), "z-fail": variant("z_fail"), "PTSV": variant("ptsv"),
    "PTSV, back faces": variant("ptsv", casters="back_faces"), "PTSV, outline": variant("ptsv", culling_planes="outline"),
    "clusters": variant("cluster"), "conservative map": variant("conservative_map"), "ray traced": variant("ray_traced")}
CAMERA, LIGHT = "camera moves", "light moves"
LIGHTS = ((-150.0, 75.0, 90.0), (-60.0, 75.0, 165.0), (60.0, 75.0, 165.0), (150.0, 75.0, 90.0), (175.0, 75.0, -20.0),
          (110.0, 75.0, -140.0), (0.0, 75.0, -175.0), (-110.0, 75.0, -140.0), (-175.0, 75.0, -20.0))
"""Positions round the town, at about one height and distance."""


def measurements(size: int, frames: tuple[int, ...], lights: Sequence[tuple[float, float, float]]) -> tuple[Measurement,
                                                                                                            ...]:
    """Frames along the path; and the first of them under every light."""
    methods = tuple(method.spec for method in METHODS.values())
    return (Measurement(SCENE, size, frames, methods, verify=False),
            *(Measurement(SCENE, size, frames[:1], methods, verify=False, light=light) for light in lights))


def counts(rows: Sequence[Row], name: str, motion: str, column: str) -> list[float]:
    """A count over the frames, or over the lights."""
    label = METHODS[name].label
    return [float(row[column]) for row in rows if row["method"] == label and ("light" in row) == (motion == LIGHT)]


def average(rows: Sequence[Row], name: str, motion: str, column: str = "all_work") -> float:
    """Mean of `counts`."""
    return statistics.fmean(counts(rows, name, motion, column))


def variation(rows: Sequence[Row], name: str, motion: str, column: str = "all_work") -> float:
    """Coefficient of variation of `counts`, in per cent."""
    return 100.0 * statistics.pstdev(counts(rows, name, motion, column)) / average(rows, name, motion, column)


def steadier(name: str, than: str, motion: str) -> Callable[[Sequence[Row]], float]:
    """Variation of a method's test-and-set operations over that of another's."""
    return lambda rows: variation(rows, name, motion, "test_and_set") / variation(rows, than, motion, "test_and_set")


def plot(evidence: Evidence, folder: Path) -> None:
    """Means and variations of all operations, by method, for both motions."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(2, 5.6, 4.0)
    names = list(METHODS)
    for panel, value, title, unit in ((axes[0], average, "mean", "operations"),
                                      (axes[1], variation, "coefficient of variation", "%")):
        series = {motion: [value(evidence.rows, name, motion) for name in names] for motion in (CAMERA, LIGHT)}
        plots.draw_groups(panel, names, series, f"all operations: {title}", unit, logarithmic=value is average)
        panel.tick_params("x", rotation=60, labelsize=8)
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


N4 = Item(
    "N4", "new", "Camera and light move: mean and variation of every method's counts", "not published",
    "All operations along the path through the citadel, and at its first frame with the light at nine places round the "
    "town. Sintorn et al. claim steadiness for PTSV when the camera moves; nobody says what a moving light does.",
    full=measurements(512, (0, 6, 12, 18, 24, 30, 36, 42), LIGHTS), quick=measurements(96, (0, 16, 32), LIGHTS[::4]),
    rows=cell_rows("test_and_set", "all_work"),
    claims=(
        *(Claim(f"{motion}: {name}'s operations vary less than z-pass's (ratio of variations)", "none; expected below 1x",
                steadier(name, "z-pass", motion), at_most(1.0), at_most(1.25),
                otherwise="Variation is relative: the mean of z-pass is many times larger, so its range in operations is, "
                          "too (data.csv)")
          for motion in (CAMERA, LIGHT) for name in ("PTSV, back faces", "clusters")),
        Claim("The light moves z-pass's operations more than the camera does (ratio of variations)",
              "none; expected above 1x",
              lambda rows: variation(rows, "z-pass", LIGHT, "test_and_set") / variation(rows, "z-pass", CAMERA,
                                                                                        "test_and_set"),
              at_least(1.0), at_least(0.75),
              otherwise="Walking among walls changes how many volumes lie before the eye more than the sun's place does")),
    plot=plot)
