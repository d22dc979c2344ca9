"""Sen, Cammarano, Hanrahan: "Shadow Silhouette Maps", 2003: Table 1, the bandwidth model of section 4, and errors against
the map's resolution.

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from shadowbench.reproduce import sen2003_figures
from shadowbench.reproduce.items import Claim, Evidence, Item, Measured, Measurement, Range, Row, at_least, at_most
from shadowbench.reproduce.rows import cell_rows, mean, values

PAPER = "sen2003"
SCENES = ("strike", "cubes", "citadel")
METHODS = ("shadow_map", "silhouette_map")
RESOLUTIONS, FEW_RESOLUTIONS = (128, 256, 512, 1024, 2048, 4096), (128, 256, 512, 1024)

STAND_IN_FACTOR = 2.0
"""A share that hangs on the shapes of a scene holds within this factor of the published ones; in part within its square."""

SLACK = 1.1
"""A claim of "less" or "faster" holds in part if it fails by less than this factor."""


def errors(size: int, resolutions: Sequence[int]) -> tuple[Measurement, ...]:
    """Both maps at every resolution on every scene."""
    methods = tuple(f"{method}[resolution={resolution}]" for method in METHODS for resolution in resolutions)
    return tuple(Measurement(scene, size, (0,), methods, published_size=size) for scene in SCENES)


def wrong_by_resolution(rows: Sequence[Row], scene: str, method: str) -> dict[int, float]:
    """Wrong samples of a method on a scene, by resolution in rising order."""
    return {resolution: mean(rows, "wrong_samples", scene=scene, method=method, resolution=resolution)
            for resolution in sorted({int(value) for value in values(rows, "resolution", scene=scene)})}


def error_rows(measured: Sequence[Measured]) -> list[Row]:
    """One row per cell, with the method's name and its resolution in columns of their own."""
    rows = cell_rows("wrong")(measured)
    return [{**{name: row[name] for name in ("scene", "size", "published_size", "frame")}, "method": each.cell.algorithm,
             "resolution": int(each.cell.params["resolution"]), "wrong_samples": row["wrong"]}
            for row, each in zip(rows, measured, strict=True)]


def worst_ratio(scene: str) -> Callable[[Sequence[Row]], float]:
    """Wrong samples of the silhouette map over those of the shadow map, the largest ratio of all resolutions."""
    def value(rows: Sequence[Row]) -> float:
        shadow, silhouette = (wrong_by_resolution(rows, scene, method) for method in METHODS)
        return max(silhouette[resolution] / max(shadow[resolution], 1.0) for resolution in shadow)
    return value


def fall(scene: str) -> Callable[[Sequence[Row]], float]:
    """Wrong samples at the lowest over those at the highest resolution: the silhouette map's ratio over the shadow map's."""
    def value(rows: Sequence[Row]) -> float:
        falls = []
        for method in METHODS:
            wrong = list(wrong_by_resolution(rows, scene, method).values())
            falls.append(wrong[0] / max(wrong[-1], 1.0))
        return falls[1] / falls[0]
    return value


def plot_errors(evidence: Evidence, folder: Path) -> None:
    """One panel per scene, one line per method, both scales logarithmic."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(len(SCENES))
    for panel, scene in zip(axes, SCENES, strict=True):
        series = {method: wrong_by_resolution(evidence.rows, scene, method) for method in METHODS}
        resolutions = list(series[METHODS[0]])
        plots.draw_lines(panel, resolutions, {method: list(wrong.values()) for method, wrong in series.items()},
                         f"{scene} (stand-in)", "wrong samples")
        panel.set_xscale("log", base=2)
        panel.set(xlabel="resolution of the map", xticks=resolutions, xticklabels=[str(r) for r in resolutions])
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


C2 = Item(
    "Sen.C2", PAPER, "Wrong samples against resolution: silhouette map and shadow map", "sec. 4 and 5",
    "Samples whose answer differs from the certified reference, ambiguous ones left out. Both methods have the same depth "
    "map, bias and projection; in `cubes` the light hangs amid the cubes, so each of six faces has the resolution given.",
    full=errors(1024, RESOLUTIONS), quick=errors(512, FEW_RESOLUTIONS), rows=error_rows,
    claims=tuple(claim for scene in SCENES for claim in (
        Claim(f"{scene}: the silhouette map is wrong on fewer samples at every resolution (largest ratio of all)",
              "below 1x", worst_ratio(scene), at_most(1.0), at_most(SLACK)),
        Claim(f"{scene}: wrong samples fall faster with resolution (ratio of falls, lowest over highest resolution)",
              "above 1x", fall(scene), at_least(1.0), at_least(1.0 / SLACK)))),
    plot=plot_errors)

MAP, VOLUMES = "silhouette_map", "z_fail"
DRAWN = "z_fail[casters=back_faces]"
"""Shadow volumes as the paper draws them: each silhouette edge of a closed body once."""

ALL = ("crowd", "jeep", "castle", *SCENES)
"""Scenes of the bandwidth model: the paper's three, and those of `C2`."""

COLUMNS = {MAP: cell_rows("silhouette_edges", "scene_fill", "silhouette_samples"), VOLUMES: cell_rows("stencil_fragments")}


PUBLISHED = {"crowd": (4_800, 13.3, 154.2), "jeep": (729, 12.6, 5.55), "castle": (466, 7.2, 4.03)}
"""Table 1: silhouette edges, silhouette fill P in per cent and overdraw O."""


def fills(size: int, scenes: Sequence[str]) -> tuple[Measurement, ...]:
    """A silhouette map of the paper's resolution, and shadow volumes."""
    return tuple(Measurement(scene, size, (0,), (f"{MAP}[resolution=512]", DRAWN), published_size=512, verify=False)
                 for scene in scenes)


def fill_rows(measured: Sequence[Measured]) -> list[Row]:
    """One row per cell, with the columns that its method counts."""
    return [{**row, "method": each.cell.algorithm} for each in measured for row in COLUMNS[each.cell.algorithm]([each])]


def silhouette_share(rows: Sequence[Row], scene: str) -> float:
    """The paper's P, in per cent."""
    return 100.0 * (mean(rows, "silhouette_samples", scene=scene, method=MAP)
                    / mean(rows, "scene_fill", scene=scene, method=MAP))


def overdraw(rows: Sequence[Row], scene: str) -> float:
    """The paper's O."""
    return (mean(rows, "stencil_fragments", scene=scene, method=VOLUMES) / mean(rows, "scene_fill", scene=scene, method=MAP))


def over_scenes(choose: Callable[[Sequence[float]], float], value: Callable[[Sequence[Row], str], float]
                ) -> Callable[[Sequence[Row]], float]:
    """The largest or the smallest value of all scenes."""
    return lambda rows: choose([value(rows, scene) for scene in ALL])


def traffic(a: str, b: str) -> Callable[[Sequence[Row], str], float]:
    """Bytes of one method over those of another on a scene, by the paper's model."""
    def value(rows: Sequence[Row], scene: str) -> float:
        from shadowbench.algorithms.silhouette_map import bandwidth_model

        counts = [int(mean(rows, column, scene=scene, method=method)) for column, method in (
            ("scene_fill", MAP), ("silhouette_samples", MAP), ("stencil_fragments", VOLUMES))]
        by_method = bandwidth_model(*counts)._asdict()
        return float(by_method[a] / by_method[b])
    return value


def factor_of(published: float, share: float = STAND_IN_FACTOR) -> Range:
    """Numbers within a factor of the published one."""
    return Range(published / share, published * share)


def plot_fills(evidence: Evidence, folder: Path) -> None:
    """P and O by scene, published beside measured."""
    from shadowbench.reproduce import plots

    figure, axes = plots.panels(2, 4.2, 3.2)
    rows, scenes = evidence.rows, list(PUBLISHED)
    for panel, value, k, title in ((axes[0], silhouette_share, 1, "silhouette fill P, %"),
                                   (axes[1], overdraw, 2, "overdraw O of shadow volumes")):
        series = {"published": [PUBLISHED[scene][k] for scene in scenes], "measured": [value(rows, scene)
                                                                                       for scene in scenes]}
        plots.draw_groups(panel, scenes, series, title, title, logarithmic=k == 2)
    plots.legend_below(figure, axes[0])
    plots.save(figure, folder)


FROM_AFAR = ("Ruled out: the map's resolution and the image's (the paper's), the count (four depths disagree, as in the "
             "paper). What is left is the view: P grows with the size of a texel on the screen, and the paper zooms in on "
             "the shadow")

FROM_ANOTHER_SIDE = (
    "Ruled out: the number of silhouette edges (about the paper's), drawing edges twice (each is drawn once; twice would "
    "give about double), z-fail's caps (z-pass has within a few per cent the same number of fragments). What is left is "
    "the view: O hangs on how much of the screen the volumes cross, and the stand-ins' cameras look along them")

SHOWN = ("A silhouette map of 512 texels along the side, and z-fail shadow volumes, in an image of 512 x 512, each "
         "silhouette edge of a closed body drawn once. Scene fill: samples that show a surface. P: samples whose four "
         "depths disagree, as a share of it. O: fragments of shadow volumes over it. ")

T1 = Item(
    "Sen.T1", PAPER, "Silhouette edges, silhouette fill P and overdraw O of shadow volumes", "Table 1",
    SHOWN + "The stand-ins have the paper's numbers of triangles; its frames per second are left out, for they are "
    "limited by its host. The paper looks at each shadow from nearby (it calls its P artificially high for that), the "
    "stand-ins' views show the whole scene.",
    full=fills(512, tuple(PUBLISHED)), quick=fills(256, tuple(PUBLISHED)), rows=fill_rows,
    claims=tuple(claim for scene, (edges, share, layers) in PUBLISHED.items() for claim in (
        Claim(f"{scene}: silhouette edges", f"{edges:,}", lambda rows, scene=scene: mean(  # type: ignore[misc]
            rows, "silhouette_edges", scene=scene, method=MAP), factor_of(edges), factor_of(edges, STAND_IN_FACTOR**2), "",
            otherwise="Edges of all bodies are counted, hidden inside others or not: the stand-ins are built of more and "
            "simpler bodies than the paper's models"),
        Claim(f"{scene}: silhouette fill P", f"{share} %", partial(silhouette_share, scene=scene), factor_of(share),
              factor_of(share, STAND_IN_FACTOR**2), " %", otherwise=FROM_AFAR),
        Claim(f"{scene}: overdraw O", f"{layers}", partial(overdraw, scene=scene), factor_of(layers),
              factor_of(layers, STAND_IN_FACTOR**2), "",
              otherwise=FROM_ANOTHER_SIDE))),
    plot=plot_fills)

C1 = Item(
    "Sen.C1", PAPER, "Memory traffic by the bandwidth model", "sec. 4",
    SHOWN + "Bytes per frame: 4 per sample of the scene fill; 24 more per sample of the silhouette fill; 5.5 per fragment "
    "of a shadow volume. Strike, cubes and citadel are not in the paper's Table 1.",
    full=fills(512, ALL), quick=fills(256, ALL), rows=fill_rows,
    claims=(
        Claim("P is below 1/6 on every scene (largest P)", "below 16.7 %", over_scenes(max, silhouette_share),
              at_most(100.0 / 6.0), at_most(100.0 / 6.0 * SLACK), " %"),
        Claim("A silhouette map takes less than twice the traffic of a shadow map on every scene (largest ratio)",
              "below 2x", over_scenes(max, traffic("silhouette_map", "shadow_map")), at_most(2.0), at_most(2.0 * SLACK)),
        Claim("Shadow volumes take more traffic than a shadow map on every scene (smallest ratio)", "above 1x",
              over_scenes(min, traffic("shadow_volumes", "shadow_map")), at_least(1.0), at_least(1.0 / SLACK)),
        Claim("Shadow volumes take more traffic than a silhouette map on every scene (smallest ratio)", "above 1x",
              over_scenes(min, traffic("shadow_volumes", "silhouette_map")), at_least(1.0), at_least(1.0 / SLACK))))

ITEMS = (*sen2003_figures.ITEMS[:1], T1, C1, *sen2003_figures.ITEMS[1:], C2)
