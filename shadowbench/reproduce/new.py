"""New comparisons, which none of the papers has. Nothing was published, so the claims are expectations to be tested.

The ranges below were fixed before anything was measured at full size; the explanations were added afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Row, at_least
from shadowbench.reproduce.rows import cell_rows, mean, values
from shadowbench.reproduce.variants import Value, Variant, ratio, variant

PLANES = ("none", "silhouette", "wedge", "outline", "outline+wedge")
DEFAULT_PLANES = {"ptsv": "silhouette", "cluster": "wedge"}
SCENES = ("citadel", "gate", "villa")
HIERARCHIES = ("ptsv", "cluster")


def with_planes(hierarchy: str, planes: str) -> Variant:
    """Name a hierarchy with back-face casters and a set of culling planes."""
    if planes == DEFAULT_PLANES[hierarchy]:
        return variant(hierarchy, casters="back_faces")
    return variant(hierarchy, casters="back_faces", culling_planes=planes)


def planes_ratio(hierarchy: str, a: str, b: str, scene: str, column: str = "test_and_set") -> Value:
    """One set of planes over another on a scene, means over the frames."""
    return ratio(with_planes(hierarchy, a), with_planes(hierarchy, b), column, scene=scene)


def false_positives(rows: Sequence[Row], planes: str, scene: str, level: int) -> float:
    """Share of the tiles that `ptsv` refines at a level that hold nothing to put in shadow, in per cent."""
    label = with_planes("ptsv", planes).label
    fruitless, refined = (sum(values(rows, f"{name}.{level}", method=label, scene=scene))
                          for name in ("fruitless_refinements", "refinements"))
    return 100.0 * fruitless / max(refined, 1.0)


def plot_culling_planes(evidence: Evidence, folder: Path) -> None:
    """Operations and time by hierarchy and scene; false positives by level on each scene."""
    from shadowbench.reproduce import plots

    rows, (figure, axes) = evidence.rows, plots.panels(7, 3.0, 3.6)
    panels = [(hierarchy, *what) for hierarchy in HIERARCHIES
              for what in (("test_and_set", "million operations", 1e-6), ("seconds", "milliseconds", 1e3))]
    for panel, (hierarchy, column, unit, scale) in zip(axes[:4], panels, strict=True):
        series = {planes: [scale * mean(rows, column, method=with_planes(hierarchy, planes).label, scene=scene)
                           for scene in SCENES] for planes in PLANES}
        plots.draw_groups(panel, SCENES, series, f"{hierarchy}: {unit}", unit, logarithmic=True)
    levels = sorted(int(name.rpartition(".")[2]) for name in rows[0] if name.startswith("fruitless_refinements."))
    for panel, scene in zip(axes[4:], SCENES, strict=True):
        shares = {planes: [false_positives(rows, planes, scene, level) for level in levels] for planes in PLANES}
        plots.draw_groups(panel, [f"level {level}" for level in levels], shares, f"ptsv: false positives, {scene}",
                          "% of refined tiles")
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


def culling_planes(size: int, frames: dict[str, tuple[int, ...]], repeats: int) -> tuple[Measurement, ...]:
    """Both hierarchies with every set of planes on each scene."""
    methods = tuple(with_planes(hierarchy, planes).spec for hierarchy in HIERARCHIES for planes in PLANES)
    return tuple(Measurement(scene, size, frames[scene], methods, published_size=1024, repeats=repeats, verify=False)
                 for scene in SCENES)


def planes_claims(hierarchy: str, scene: str) -> tuple[Claim, ...]:
    """Claims about one hierarchy on one scene."""
    name = f"{hierarchy}, {scene}"
    return (
        Claim(f"{name}: silhouette planes save operations", "none; expected above 1x",
              planes_ratio(hierarchy, "none", "silhouette", scene), at_least(1.1), at_least(1.0)),
        Claim(f"{name}: wedge planes save operations", "none; expected above 1x",
              planes_ratio(hierarchy, "none", "wedge", scene), at_least(1.1), at_least(1.0)),
        Claim(f"{name}: outline planes need fewer operations than silhouette planes", "none; expected above 1x",
              planes_ratio(hierarchy, "silhouette", "outline", scene), at_least(1.1), at_least(1.0)),
        Claim(f"{name}: outline planes need fewer operations than wedge planes", "none; expected above 1x",
              planes_ratio(hierarchy, "wedge", "outline", scene), at_least(1.1), at_least(1.0)),
        Claim(f"{name}: outline planes are faster than the paper's own", "none; expected above 1x",
              planes_ratio(hierarchy, DEFAULT_PLANES[hierarchy], "outline", scene, "seconds"), at_least(1.1), at_least(1.0),
              otherwise="Setting up more planes per frustum takes what the traversal saves"),
        Claim(f"{name}: wedge planes beside outline planes save operations", "none; expected above 1x",
              planes_ratio(hierarchy, "outline", "outline+wedge", scene), at_least(1.1), at_least(1.0)))


N5 = Item(
    "N5", "new", "Culling planes of PTSV and clusters: operations, time, false positives per level", "not published",
    "PTSV and the cluster hierarchy with back-face casters and each set of culling planes: none; silhouette (Sintorn et al. "
    "2011); wedge (Sintorn et al. 2014); outline, every supporting plane through the eye; outline and wedge. A false "
    "positive is a refined tile in which the frustum then puts nothing in shadow that was not yet; level 0 are the root's "
    "children. Only PTSV counts them; of both, data.csv has the tests and refinements per level.",
    full=culling_planes(1024, {"citadel": (4, 28), "gate": (0, 24), "villa": (0, 36)}, 2),
    quick=culling_planes(256, {"citadel": (28,), "gate": (0,), "villa": (0,)}, 1),
    rows=cell_rows("test_and_set", "all_work", "seconds", "stage.frustum_setup", "stage.traversal", "node_tests.level",
                   "refinements.level", "fruitless_refinements.level"),
    claims=tuple(claim for hierarchy in HIERARCHIES for scene in SCENES for claim in planes_claims(hierarchy, scene)),
    plot=plot_culling_planes)

GROUPS = (1, 8, 16, 32, 64)
DENSITIES = (25_000, 100_000, 400_000)
"""Triangles of the dense closed bodies."""


def grouped(group: int) -> Variant:
    """Name the cluster hierarchy with back-face casters, outline planes and groups of frusta."""
    options = {"casters": "back_faces", "culling_planes": "outline"}
    return variant("cluster", **options) if group == 1 else variant("cluster", **options, group=group)


def group_series(column: str, scale: float) -> Callable[[Sequence[Row]], dict[str, list[float]]]:
    """Column over the group sizes, a series per scene and density."""
    def series(rows: Sequence[Row]) -> dict[str, list[float]]:
        found = {scene: [scale * mean(rows, column, method=grouped(group).label, scene=scene) for group in GROUPS]
                 for scene in ("citadel", "gate")}
        return found | {f"fuzzy, {n:,}": [scale * mean(rows, column, method=grouped(group).label, scene="fuzzy", triangles=n)
                                          for group in GROUPS] for n in DENSITIES}
    return series


def plot_groups(evidence: Evidence, folder: Path) -> None:
    """Operations and time over the size of the groups."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(2, 4.6, 3.6)
    for panel, column, unit, scale in ((axes[0], "test_and_set", "million operations", 1e-6),
                                       (axes[1], "seconds", "milliseconds", 1e3)):
        for color, (name, y) in zip(plots.COLORS, group_series(column, scale)(evidence.rows).items(), strict=False):
            plots.draw_line(panel, GROUPS, y, name, color)
        panel.set(title=unit, xlabel="frusta per group", ylabel=unit, xscale="log", yscale="log", xticks=GROUPS)
        panel.set_xticklabels([str(group) for group in GROUPS])
        panel.minorticks_off()
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


def grouping(size: int, frames: tuple[int, ...], densities: Sequence[int], repeats: int) -> tuple[Measurement, ...]:
    """Every size of group on each scene, and on the dense bodies with each number of triangles."""
    methods = tuple(grouped(group).spec for group in GROUPS)
    where = [("citadel", 0), ("gate", 0), *(("fuzzy", n) for n in densities)]
    return tuple(Measurement(scene, size, frames, methods, published_size=1024, repeats=repeats, verify=False, triangles=n)
                 for scene, n in where)


N6 = Item(
    "N6", "new", "Grouped frusta in the cluster hierarchy: operations and time against the size of the groups",
    "not published",
    "The cluster hierarchy with back-face casters and outline planes. The frusta of a group share a bounding frustum down "
    "to the parents of the clusters; its tests count as operations. `fuzzy`, dense closed bodies with fur, has three "
    "numbers of triangles.",
    full=grouping(1024, (0, 24), DENSITIES, 2), quick=grouping(256, (0,), DENSITIES, 1),
    rows=cell_rows("test_and_set", "node_tests", "group_tests", "sample_tests", "seconds", "stage.frustum_setup",
                   "stage.traversal"),
    claims=(
        *(Claim(f"{scene}: groups of 16 save operations", "none; expected above 1x",
                ratio(grouped(1), grouped(16), scene=scene), at_least(1.1), at_least(1.0)) for scene in ("citadel", "gate")),
        *(Claim(f"fuzzy, {n:,} triangles: groups of 16 save operations", "none; expected above 1x",
                ratio(grouped(1), grouped(16), scene="fuzzy", triangles=n), at_least(1.1), at_least(1.0))
          for n in DENSITIES),
        *(Claim(f"{scene}: groups of 16 do not pay in time", "none; expected above 1x",
                ratio(grouped(16), grouped(1), "seconds", scene=scene), at_least(1.0), at_least(0.9))
          for scene in ("citadel", "gate")),
        *(Claim(f"fuzzy, {n:,} triangles: groups of 16 are faster", "none; expected above 1x",
                ratio(grouped(1), grouped(16), "seconds", scene="fuzzy", triangles=n), at_least(1.1), at_least(1.0))
          for n in DENSITIES)),
    plot=plot_groups)

ITEMS = (N5, N6)
