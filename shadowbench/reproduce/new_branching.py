"""N1: the branching factor of PTSV's hierarchy, which Sintorn et al. 2011 (sec. 4) leave unexplored.

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Row, at_least, at_most
from shadowbench.reproduce.rows import cell_rows, mean
from shadowbench.reproduce.variants import Variant, variant

BRANCHING = (4, 8, 16, 32, 64)
PUBLISHED = 32
SCENES = ("citadel", "gate", "villa")
CLUSTER = variant("cluster", casters="back_faces")
MEMORY = ("memory.depth_hierarchy", "memory.shadow_hierarchy")
QUANTITIES = (("test_and_set", "million operations", 1e-6), ("seconds", "milliseconds", 1e3),
              ("memory", "KiB of hierarchies", 2.0**-10))


def branching(n: int) -> Variant:
    """Name PTSV with a branching factor."""
    if n == PUBLISHED:
        return variant("ptsv", casters="back_faces")
    return variant("ptsv", branching=n, casters="back_faces")


def memory(rows: Sequence[Row], n: int, scene: str) -> float:
    """Bytes of both hierarchies."""
    return sum(mean(rows, column, method=branching(n).label, scene=scene) for column in MEMORY)


def quantity(rows: Sequence[Row], column: str, n: int, scene: str) -> float:
    """A column, or the memory."""
    return memory(rows, n, scene) if column == "memory" else mean(rows, column, method=branching(n).label, scene=scene)


def over_best(column: str, scene: str) -> Callable[[Sequence[Row]], float]:
    """The published factor's value over the least of all factors."""
    return lambda rows: (quantity(rows, column, PUBLISHED, scene)
                         / min(quantity(rows, column, n, scene) for n in BRANCHING))


def plot(evidence: Evidence, folder: Path) -> None:
    """Operations, time and memory over the branching factor; clusters beside them."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(len(QUANTITIES), 3.8, 3.4)
    for panel, (column, unit, scale) in zip(axes, QUANTITIES, strict=True):
        for color, scene in zip(plots.COLORS, SCENES, strict=False):
            y = [scale * quantity(evidence.rows, column, n, scene) for n in BRANCHING]
            plots.draw_line(panel, BRANCHING, y, f"PTSV, {scene}", color)
            if column != "memory":
                cluster = scale * mean(evidence.rows, column, method=CLUSTER.label, scene=scene)
                panel.plot([PUBLISHED], [cluster], "x", color=color, label=f"clusters, {scene}")
        panel.set(title=unit, xlabel="children per node", ylabel=unit, xscale="log", yscale="log")
        panel.set_xticks(BRANCHING, [str(n) for n in BRANCHING], minor=False)
        panel.minorticks_off()
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


def measurements(size: int, frames: tuple[int, ...], repeats: int) -> tuple[Measurement, ...]:
    """Every factor, and clusters, on every scene."""
    methods = (*(branching(n).spec for n in BRANCHING), CLUSTER.spec)
    return tuple(Measurement(scene, size, frames, methods, published_size=1024, repeats=repeats, verify=False)
                 for scene in SCENES)


N1 = Item(
    "N1", "new", "Branching factor 4 to 64 of PTSV: operations, time, memory", "not published; left open in Sintorn et "
                                                                               "al. 2011",
    "PTSV with back-face casters and silhouette planes. Clusters have one branching factor, 32, which their keys and a "
    "machine word of 32 children fix; they are marked by crosses.",
    full=measurements(1024, (4, 28), 2), quick=measurements(256, (28,), 1),
    rows=cell_rows("test_and_set", "node_tests", "sample_tests", "seconds", *MEMORY),
    claims=tuple(claim for scene in SCENES for claim in (
        Claim(f"{scene}: operations with 32 children over the best factor's", "none; expected at most 1.25x",
              over_best("test_and_set", scene), at_most(1.25), at_most(2.0),
              otherwise="A node of few children is rejected before its samples are looked at, so narrow trees need fewer "
                        "tests, but more steps that do not run side by side"),
        Claim(f"{scene}: time with 32 children over the best factor's", "none; expected at most 1.1x",
              over_best("seconds", scene), at_most(1.1), at_most(1.5),
              otherwise="8 lanes test 8 children at once on this processor, so fewer than 32 children fill it as well"),
        Claim(f"{scene}: memory with 4 children over that with 64", "none; expected above 1x",
              lambda rows, scene=scene: memory(rows, 4, scene) / memory(rows, 64, scene),  # type: ignore[misc]
              at_least(1.0), at_least(0.9)))),
    plot=plot)
