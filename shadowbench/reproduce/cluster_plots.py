"""The figures of Sintorn et al. 2014."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shadowbench.reproduce.cluster_methods import (
    ALL_CASTERS,
    CLUSTER,
    COMPACT,
    IMPLICIT,
    ONE_PASS,
    PTSV,
    SPLIT_3,
    SPLIT_4,
    STAGES,
    STEP_NAMES,
    STEPS,
    WEDGE,
    Z_PASS,
)
from shadowbench.reproduce.items import Evidence, Row
from shadowbench.reproduce.rows import mean, values
from shadowbench.reproduce.variants import by_frame


def scenes_of(rows: Sequence[Row]) -> list[str]:
    """Scenes in the order of the rows."""
    return list(dict.fromkeys(str(row["scene"]) for row in rows))


def gate_view(evidence: Evidence, folder: Path) -> None:
    """Draw the view, the levels of the tree, and operations and time of the three methods; the pictures also as files."""
    from shadowbench.reproduce import plots

    pictures, names = evidence.pictures[CLUSTER.label], ("clusters", "PTSV", "z-pass")
    figure, axes = plots.panels(4, 3.4, 3.6)
    plots.draw_picture(axes[0], pictures["shaded"], "gate (stand-in)")
    plots.draw_picture(axes[1], pictures["levels"], "last four levels of the tree")
    for panel, column, unit, scale in ((axes[2], "test_and_set", "million operations", 1e-6),
                                       (axes[3], "seconds", "milliseconds", 1e3)):
        series = {name: [scale * mean(evidence.rows, column, method=method.label)]
                  for name, method in zip(names, (CLUSTER, PTSV, Z_PASS), strict=True)}
        plots.draw_groups(panel, [""], series, unit, unit, logarithmic=True)
    plots.legend_below(figure, axes[2])
    for kind in ("shaded", "levels"):
        (folder / f"{kind}.png").write_bytes(pictures[kind].read_bytes())
    plots.save(figure, folder)


def heat_maps(evidence: Evidence, folder: Path) -> None:
    """Draw the view and both heat maps, and write each as a file of its own."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(3, 4.4, 4.9)
    plots.draw_picture(axes[0], evidence.pictures[CLUSTER.label]["shaded"], "gate (stand-in)")
    for panel, method, name in ((axes[1], PTSV, "PTSV"), (axes[2], CLUSTER, "clusters")):
        near, elsewhere = (mean(evidence.rows, f"tests_{where}", method=method.label) for where in ("near", "elsewhere"))
        file = evidence.pictures[method.label]["heatmap"]
        plots.draw_picture(panel, file, f"{name}: {near:.0f} near steps of depth, {elsewhere:.0f} elsewhere")
        (folder / f"heatmap-{method.label}.png").write_bytes(file.read_bytes())
    plots.save(figure, folder)


def stage_times(evidence: Evidence, folder: Path) -> None:
    """Draw one panel per scene: stages and whole times over the frames."""
    from shadowbench.reproduce import plots

    scenes = scenes_of(evidence.rows)
    lines = [*((CLUSTER, f"stage.{stage}", name) for stage, name in STAGES.items()), (CLUSTER, "seconds", "clusters"),
             (ALL_CASTERS, "seconds", "clusters without FFC"), (PTSV, "seconds", "PTSV"), (Z_PASS, "seconds", "z-pass")]
    figure, axes = plots.panels(len(scenes))
    for panel, scene in zip(axes, scenes, strict=True):
        methods = {row["method"] for row in evidence.rows if row["scene"] == scene}
        for color, (method, column, name) in zip(plots.COLORS, lines, strict=True):
            if method.label not in methods:
                continue
            found = by_frame(evidence.rows, method, column, scene=scene)
            style = "--" if method is Z_PASS else "-"
            plots.draw_line(panel, list(found), [1e3 * seconds for seconds in found.values()], name, color, style)
        panel.set(title=f"{scene} (stand-in)", xlabel="frame of the fly-through", ylabel="milliseconds", yscale="log")
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


def operations(evidence: Evidence, folder: Path) -> None:
    """Draw one panel per scene: operations over the frames."""
    from shadowbench.reproduce import plots

    scenes = scenes_of(evidence.rows)
    ways = ((IMPLICIT, "test_and_set", "implicit"), (WEDGE, "test_and_set", "implicit + wedge"),
            (CLUSTER, "test_and_set", "explicit + wedge"), (PTSV, "test_and_set", "PTSV"),
            (PTSV, "open_tests", "PTSV, open tests"))
    figure, axes = plots.panels(len(scenes))
    for panel, scene in zip(axes, scenes, strict=True):
        for (method, column, name), color in zip(ways, (3, 2, 0, 6, 6), strict=True):
            style = "--" if column == "open_tests" else "-"
            found = by_frame(evidence.rows, method, column, scene=scene)
            plots.draw_line(panel, list(found), [1e-6 * count for count in found.values()], name,
                            plots.COLORS[color], style)
        panel.set(title=f"{scene} (stand-in)", xlabel="frame of the fly-through", ylabel="million operations",
                  ylim=(0, None))
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


def jobs(evidence: Evidence, folder: Path) -> None:
    """Draw the iterations of the largest jobs by rank."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(1, 5.5, 3.6)
    lines = ((ONE_PASS, "one pass", 2), (CLUSTER, "two passes, split at level 2", 0), (SPLIT_3, "at level 3", 1),
             (SPLIT_4, "at level 4", 4))
    for method, name, color in lines:
        ranks, iterations = (values(evidence.rows, column, method=method.label) for column in ("rank", "iterations"))
        plots.draw_line(axes[0], ranks, iterations, name, plots.COLORS[color], marker="")
    axes[0].set(title="gate (stand-in)", xlabel="job, from the largest down", ylabel="iterations", yscale="log")
    axes[0].legend(frameon=False)
    plots.save(figure, folder)


def traversal(evidence: Evidence, folder: Path) -> None:
    """Draw one panel per scene: the traversal's time over the frames, step by step."""
    from shadowbench.reproduce import plots

    scenes = scenes_of(evidence.rows)
    figure, axes = plots.panels(len(scenes))
    for panel, scene in zip(axes, scenes, strict=True):
        for color, method, name in zip((3, 2, 1, 0), STEPS, STEP_NAMES, strict=True):
            found = by_frame(evidence.rows, method, "stage.traversal", scene=scene)
            plots.draw_line(panel, list(found), [1e3 * seconds for seconds in found.values()], name,
                            plots.COLORS[color])
        panel.set(title=f"{scene} (stand-in)", xlabel="frame of the fly-through", ylabel="milliseconds", ylim=(0, None))
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


def resolutions(evidence: Evidence, folder: Path) -> None:
    """Draw stages at 1920 x 1080 over the frames, and the whole at each resolution."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(2)
    lines: list[tuple[int, str, str]] = [*((1920, f"stage.{stage}", name) for stage, name in STAGES.items()),
                                         (1920, "seconds", "1920 x 1080"), (1280, "seconds", "1280 x 720"),
                                         (1024, "seconds", "1024 x 1024")]
    for color, (size, column, name) in zip(plots.COLORS, lines, strict=False):
        found = by_frame(evidence.rows, COMPACT, column, published_size=size)
        panel = axes[1] if column == "seconds" else axes[0]
        plots.draw_line(panel, list(found), [1e3 * seconds for seconds in found.values()], name, color)
    for panel, title in zip(axes, ("citadel (stand-in): stages at 1920 x 1080", "the whole"), strict=True):
        panel.set(title=title, xlabel="frame of the fly-through", ylabel="milliseconds",
                  ylim=(0, 1.35 * panel.get_ylim()[1]))
        panel.legend(frameon=False, loc="upper left", ncols=2)
    plots.save(figure, folder)

