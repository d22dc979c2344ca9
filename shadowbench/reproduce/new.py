"""New comparisons, which none of the papers has. Nothing was published, so the claims are expectations to be tested.

The ranges below were fixed before anything was measured at full size; the explanations were added afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shadowbench.reproduce.items import Claim, Evidence, Item, Measurement, Row, at_least, at_most
from shadowbench.reproduce.new_branching import N1
from shadowbench.reproduce.new_growth import N3
from shadowbench.reproduce.new_motion import N4
from shadowbench.reproduce.new_pareto import N2
from shadowbench.reproduce.rows import cell_rows, mean, values
from shadowbench.reproduce.variants import Value, Variant, ratio, variant

PLANES = ("none", "silhouette", "wedge", "outline", "outline+wedge")
DEFAULT_PLANES = {"ptsv": "silhouette", "cluster": "wedge"}
SCENES = ("citadel", "gate", "villa")
HIERARCHIES = ("ptsv", "cluster")
BESIDE = ("A cluster's box is tight on the screen: what is left to reject lies before or behind the volume, where planes "
          "through the eye cannot cut")


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
              planes_ratio(hierarchy, "silhouette", "outline", scene), at_least(1.1), at_least(1.0),
              otherwise=BESIDE if hierarchy == "cluster" else ""),
        Claim(f"{name}: outline planes need fewer operations than wedge planes", "none; expected above 1x",
              planes_ratio(hierarchy, "wedge", "outline", scene), at_least(1.1), at_least(1.0),
              otherwise=BESIDE if hierarchy == "cluster" else ""),
        Claim(f"{name}: outline planes are faster than the paper's own", "none; expected above 1x",
              planes_ratio(hierarchy, DEFAULT_PLANES[hierarchy], "outline", scene, "seconds"), at_least(1.1), at_least(1.0),
              otherwise="Setting up more planes per frustum takes what the traversal saves"),
        Claim(f"{name}: wedge planes beside outline planes save operations", "none; expected above 1x",
              planes_ratio(hierarchy, "outline", "outline+wedge", scene), at_least(1.1), at_least(1.0),
              otherwise="Both sets cut what lies beside the volume on the screen: few nodes pass one and not the other"))


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

GAMES = ("citadel", "gate")
GROUPS = (1, 8, 16, 32, 64)
DENSITIES = (25_000, 100_000, 400_000)
"""Triangles of the dense closed bodies."""


def grouped(hierarchy: str, group: int) -> Variant:
    """Name a hierarchy with back-face casters, outline planes and groups of frusta."""
    options = {"casters": "back_faces", "culling_planes": "outline"}
    return variant(hierarchy, **options) if group == 1 else variant(hierarchy, **options, group=group)


def gain(hierarchy: str, scene: str, triangles: int, column: str = "test_and_set") -> Value:
    """Column without groups over that with groups of 16."""
    where: dict[str, str | int] = {"scene": scene, "triangles": triangles} if triangles else {"scene": scene}
    return ratio(grouped(hierarchy, 1), grouped(hierarchy, 16), column, **where)


def group_series(rows: Sequence[Row], hierarchy: str, column: str, scale: float) -> dict[str, list[float]]:
    """Column over the group sizes, a series per scene and density."""
    labels = [grouped(hierarchy, group).label for group in GROUPS]
    found = {scene: [scale * mean(rows, column, method=label, scene=scene) for label in labels] for scene in GAMES}
    counts = sorted({int(row["triangles"]) for row in rows if "triangles" in row})
    return found | {f"fuzzy, {n:,}": [scale * mean(rows, column, method=label, scene="fuzzy", triangles=n)
                                      for label in labels] for n in counts}


def plot_groups(evidence: Evidence, folder: Path) -> None:
    """Operations and time of both hierarchies over the size of the groups."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(4, 3.6, 3.6)
    panels = [(hierarchy, *what) for hierarchy in HIERARCHIES
              for what in (("test_and_set", "million operations", 1e-6), ("seconds", "milliseconds", 1e3))]
    for panel, (hierarchy, column, unit, scale) in zip(axes, panels, strict=True):
        series = group_series(evidence.rows, hierarchy, column, scale)
        for color, (name, y) in zip(plots.COLORS, series.items(), strict=False):
            plots.draw_line(panel, GROUPS, y, name, color)
        panel.set(title=f"{hierarchy}: {unit}", xlabel="frusta per group", ylabel=unit, xscale="log", yscale="log")
        panel.set_xticks(GROUPS, [str(group) for group in GROUPS], minor=False)
        panel.minorticks_off()
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


def grouping(size: int, frames: tuple[int, ...], repeats: int) -> tuple[Measurement, ...]:
    """Both hierarchies with every size of group on each scene, and on the dense bodies with each number of triangles."""
    methods = tuple(grouped(hierarchy, group).spec for hierarchy in HIERARCHIES for group in GROUPS)
    where = [*((scene, 0) for scene in GAMES), *(("fuzzy", n) for n in DENSITIES)]
    return tuple(Measurement(scene, size, frames, methods, published_size=1024, repeats=repeats,
                             verify=False, triangles=n) for scene, n in where)


SPARSE = ("The gain grows with the number of triangles per sample: where triangles are large against the nodes, the "
          "bounding frustum of a group meets nodes that few of its members meet")


SMALL = ("Groups save operations here, see above, and with them a little time: most triangles (stones, merlons, leaves) are "
         "small against the nodes, and many members of a group need no planes of their own")


def group_claims(hierarchy: str) -> tuple[Claim, ...]:
    """Groups pay where triangles are dense, in operations and time; and not in game levels, in time."""
    return (
        *(Claim(f"{hierarchy}, {scene}: groups of 16 save operations", "none; expected above 1x", gain(hierarchy, scene, 0),
                at_least(1.1), at_least(1.0), otherwise=SPARSE) for scene in GAMES),
        *(Claim(f"{hierarchy}, {scene}: groups of 16 save no time", "none; expected at most 1x",
                gain(hierarchy, scene, 0, "seconds"), at_most(1.0), at_most(1.1), otherwise=SMALL) for scene in GAMES),
        *(Claim(f"{hierarchy}, fuzzy of {n:,} triangles: groups of 16 save {name}", "none; expected above 1x",
                gain(hierarchy, "fuzzy", n, column), at_least(1.1), at_least(1.0), otherwise=SPARSE)
          for column, name in (("test_and_set", "operations"), ("seconds", "time")) for n in DENSITIES))


N6 = Item(
    "N6", "new", "Grouped frusta: operations and time against the size of the groups", "not published",
    "PTSV and the cluster hierarchy with back-face casters and outline planes. The frusta of a group share a bounding "
    "frustum in the upper levels of the tree; its tests count as operations. `fuzzy`, dense closed bodies with fur, has "
    "three numbers of triangles.",
    full=grouping(1024, (0,), 2), quick=grouping(256, (0,), 1),
    rows=cell_rows("test_and_set", "node_tests", "group_tests", "sample_tests", "seconds", "stage.frustum_setup",
                   "stage.traversal"),
    claims=tuple(claim for hierarchy in HIERARCHIES for claim in group_claims(hierarchy)),
    plot=plot_groups)

ITEMS = (N1, N2, N3, N4, N5, N6)
