"""New comparisons, which none of the papers has. Nothing was published, so the claims are expectations to be tested."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Row, at_least
from shadowbench.reproduce.rows import cell_rows, mean, values

PLANES = ("none", "silhouette", "wedge", "outline", "outline+wedge")
SCENES = ("citadel", "gate")


def label(planes: str) -> str:
    """Label of PTSV with back-face casters and a set of culling planes."""
    return "ptsv+casters=back_faces" + (f"+culling_planes={planes}" if planes != "silhouette" else "")


def ratio(a: str, b: str, scene: str, column: str = "test_and_set") -> Callable[[Sequence[Row]], float]:
    """One set of planes over another on a scene, means over the frames."""
    return lambda rows: (mean(rows, column, method=label(a), scene=scene)
                         / mean(rows, column, method=label(b), scene=scene))


def false_positives(rows: Sequence[Row], planes: str, scene: str, level: int) -> float:
    """Share of the tiles refined at a level that hold nothing to put in shadow, in per cent."""
    fruitless, refined = (sum(values(rows, f"{name}.{level}", method=label(planes), scene=scene))
                          for name in ("fruitless_refinements", "refinements"))
    return 100.0 * fruitless / refined


def plot_culling_planes(evidence: Evidence, folder: Path) -> None:
    """Operations and time by scene; false positives by level on each scene."""
    from shadowbench.reproduce import plots

    rows, (figure, axes) = evidence.rows, plots.panels(4, 3.2, 3.4)
    for panel, column, unit, scale in ((axes[0], "test_and_set", "million operations", 1e-6),
                                       (axes[1], "seconds", "milliseconds", 1e3)):
        series = {planes: [scale * mean(rows, column, method=label(planes), scene=scene) for scene in SCENES]
                  for planes in PLANES}
        plots.draw_groups(panel, SCENES, series, unit, unit, logarithmic=True)
    levels = sorted(int(name.rpartition(".")[2]) for name in rows[0] if name.startswith("refinements."))
    for panel, scene in zip(axes[2:], SCENES, strict=True):
        shares = {planes: [false_positives(rows, planes, scene, level) for level in levels] for planes in PLANES}
        plots.draw_groups(panel, [f"level {level}" for level in levels], shares, f"false positives, {scene}",
                        "% of refined tiles")
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


def culling_planes(size: int, citadel: tuple[int, ...], gate: tuple[int, ...], repeats: int) -> tuple[Measurement, ...]:
    """PTSV with every set of culling planes on both scenes."""
    methods = tuple(f"ptsv[casters=back_faces,culling_planes={planes}]" for planes in PLANES)
    return (Measurement("citadel", size, citadel, methods, repeats=repeats),
            Measurement("gate", size, gate, methods, repeats=repeats))


N5 = Item(
    "N5", "new", "Culling planes of PTSV: operations, time, false positives per level", "not published",
    "PTSV with back-face casters and each set of culling planes: none; silhouette (Sintorn et al. 2011); wedge (Sintorn "
    "et al. 2014); outline, every supporting plane through the eye; outline and wedge. A false positive is a refined tile "
    "in which the frustum then puts nothing in shadow that was not yet; level 0 are the root's children. `gate` stands in "
    "for the villa.",
    full=culling_planes(1024, (4, 28), (0, 24), 3), quick=culling_planes(512, (28,), (0,), 1),
    rows=cell_rows("test_and_set", "all_work", "wrong", "seconds", "stage.frustum_setup", "stage.traversal",
                   "node_tests.level", "refinements.level", "fruitless_refinements.level"),
    claims=tuple(claim for scene in SCENES for claim in (
        Claim(f"{scene}: silhouette planes save operations", "none; expected above 1x", ratio("none", "silhouette", scene),
              at_least(1.1), at_least(1.0)),
        Claim(f"{scene}: wedge planes save operations", "none; expected above 1x", ratio("none", "wedge", scene),
              at_least(1.1), at_least(1.0)),
        Claim(f"{scene}: outline planes need fewer operations than silhouette planes", "none; expected above 1x",
              ratio("silhouette", "outline", scene), at_least(1.1), at_least(1.0)),
        Claim(f"{scene}: outline planes need fewer operations than wedge planes", "none; expected above 1x",
              ratio("wedge", "outline", scene), at_least(1.1), at_least(1.0)),
        Claim(f"{scene}: outline planes are faster than silhouette planes", "none; expected above 1x",
              ratio("silhouette", "outline", scene, "seconds"), at_least(1.1), at_least(1.0),
              otherwise="Setting up more planes per frustum takes what the traversal saves"),
        Claim(f"{scene}: wedge planes beside outline planes save operations", "none; expected above 1x",
              ratio("outline", "outline+wedge", scene), at_least(1.1), at_least(1.0)))),
    plot=plot_culling_planes)

ITEMS = (N5,)
