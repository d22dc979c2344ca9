"""The figures of Chan and Durand 2004 that show pictures: 5, 6, 8, 9 and 10.

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from shadowbench.reproduce.items import Claim, Item, Measurement, Range, Row, at_least, at_most, view_key
from shadowbench.reproduce.mosaic import MARKED, Crop, Tile, mosaic, wrong_of
from shadowbench.reproduce.rows import cell_rows, mean
from shadowbench.reproduce.variants import Variant, variant

PAPER = "chan2004"
SCENES = ("cubes", "dragon_cage", "tree")
VOLUMES = variant("z_fail")
RESOLUTIONS = (256, 512, 1024)

FEW = 0.1
"""Where volumes draw the edges, at most this share of a shadow map's wrong samples is left."""

STAND_IN_FACTOR = 2.0
"""A number that hangs on the shapes of a scene holds within this factor; in part within its square."""

COLORS = ("Red and blue: the map decides, shadow or light; black and green: volumes decide, shadow or light; gray: faces "
          "away from the light. ")
ROWS = cell_rows("wrong", "silhouette_samples", "stencil_fragments", "stencil_updates", "test_and_set")


def shadow_map(resolution: int) -> Variant:
    """Name a shadow map."""
    return variant("shadow_map", resolution=resolution) if resolution != 1024 else variant("shadow_map")


def hybrid(resolution: int) -> Variant:
    """Name the hybrid."""
    return variant("hybrid", resolution=resolution) if resolution != 1024 else variant("hybrid")


def view(scene: str, methods: Sequence[Variant], size: int = 1024, frame: int = 0) -> Measurement:
    """One view with pictures."""
    return Measurement(scene, size, (frame,), tuple(method.spec for method in methods), published_size=1024, images=True)


def smaller(*full: Measurement) -> tuple[Measurement, ...]:
    """The same at three eighths of the size."""
    return tuple(replace(m, size=3 * m.size // 8) for m in full)


def wrong_ratio(a: Variant, b: Variant, **where: str | int) -> Callable[[Sequence[Row]], float]:
    """Wrong samples of a method over those of another."""
    return lambda rows: (mean(rows, "wrong", method=a.label, **where) / max(mean(rows, "wrong", method=b.label, **where),
                                                                            1.0))


def share(column: str, method: Variant, **where: str | int) -> Callable[[Sequence[Row]], float]:
    """A count over the samples of the image."""
    return lambda rows: (mean(rows, column, method=method.label, **where) / mean(rows, "size", **where) ** 2)


def per_cent(column: str, method: Variant, **where: str | int) -> Callable[[Sequence[Row]], float]:
    """A count over the samples of the image, in per cent."""
    return lambda rows: 100.0 * share(column, method, **where)(rows)


CYLINDER: Crop = (0.28, 0.36, 0.62, 0.7)
F5_FULL = view("solids", (shadow_map(512), hybrid(256)))

F5 = Item(
    "Ch.F5", PAPER, "A shadow map of 512 against the hybrid with a map of 256", "Figure 5",
    "Part of a cylinder's shadow. The paper filters its shadow map with 2 x 2 comparisons; ours is not filtered, so that "
    "its samples can be right or wrong. " + MARKED,
    full=(F5_FULL,), quick=smaller(F5_FULL), rows=ROWS,
    claims=(Claim("Wrong samples, hybrid at 256 over shadow map at 512", "better", wrong_ratio(hybrid(256), shadow_map(512)),
                  at_most(FEW), at_most(1.0)),),
    plot=mosaic([[Tile(method.label, wrong_of(method.label, name), crop=CYLINDER, marks=marks)
                  for method, name in ((shadow_map(512), "shadow map, 512"), (hybrid(256), "hybrid, 256"))]
                 for marks in (False, True)], (3.6, 3.8)))

BALL: Crop = (0.42, 0.42, 0.86, 0.86)
F6_FULL = view("solids", (shadow_map(256), hybrid(256), hybrid(512)))

F6 = Item(
    "Ch.F6", PAPER, "What decides about each sample: map or volumes", "Figure 6",
    "Part of a ball's shadow: a shadow map of 256; what decides in the hybrid with maps of 256 and of 512; its answer. "
    + COLORS,
    full=(F6_FULL,), quick=smaller(F6_FULL), rows=ROWS,
    claims=(Claim("A finer map leaves fewer samples to volumes (512 over 256)", "fewer", lambda rows: (
                mean(rows, "silhouette_samples", method=hybrid(512).label)
                / mean(rows, "silhouette_samples", method=hybrid(256).label)), at_most(0.75), at_most(1.0)),
            Claim("Wrong samples, hybrid over shadow map, both at 256", "minimised", wrong_ratio(hybrid(256),
                                                                                                 shadow_map(256)),
                  at_most(FEW), at_most(1.0))),
    plot=mosaic([[Tile(shadow_map(256).label, wrong_of(shadow_map(256).label, "shadow map, 256"), crop=BALL),
                  Tile(hybrid(256).label, "what decides, 256", "classification", BALL)],
                 [Tile(hybrid(512).label, "what decides, 512", "classification", BALL),
                  Tile(hybrid(256).label, wrong_of(hybrid(256).label, "hybrid, 256"), crop=BALL)]], (3.6, 3.8)))

CROPS: dict[str, Crop] = {"cubes": (0.3, 0.45, 0.7, 0.85), "dragon_cage": (0.1, 0.5, 0.5, 0.9), "tree": (0.3, 0.48, 0.7,
                                                                                                         0.88)}
F8_FULL = tuple(view(scene, (shadow_map(1024), hybrid(1024), VOLUMES)) for scene in SCENES)

F8 = Item(
    "Ch.F8", PAPER, "Quality in three scenes: shadow map, hybrid, shadow volumes", "Figure 8; sec. 5.1",
    "Parts of one view of each scene; maps of 1024 texels along the side, or of each face of a cube where the light hangs "
    "in the scene (cubes, dragon cage). The paper also shows wrong self-shadowing of its maps, which the slope bias of "
    "ours prevents. " + MARKED,
    full=F8_FULL, quick=smaller(*F8_FULL), rows=ROWS,
    claims=tuple(claim for scene in SCENES for claim in (
        Claim(f"{scene}: wrong samples, hybrid over shadow map", "minimised",
              wrong_ratio(hybrid(1024), shadow_map(1024), scene=scene), at_most(FEW), at_most(1.0),
              otherwise="What is left are thin casters that the map misses altogether, so that no comparison disagrees"),
        Claim(f"{scene}: shadow volumes, wrong samples", "none", lambda rows, scene=scene: mean(  # type: ignore[misc]
            rows, "wrong", method=VOLUMES.label, scene=scene), at_most(0.0), at_most(0.0), ""))),
    plot=mosaic([[Tile(view_key(scene, 0, method.label), wrong_of(method.label, f"{scene}, {name}", scene=scene),
                       crop=CROPS[scene], marks=True)
                  for method, name in ((shadow_map(1024), "shadow map"), (hybrid(1024), "hybrid"), (VOLUMES, "volumes"))]
                 for scene in SCENES], (3.2, 3.4)))

TWIGS: Crop = (0.36, 0.52, 0.66, 0.82)
F9_FULL = (view("tree", (*map(hybrid, RESOLUTIONS), VOLUMES)),
           *(replace(view(scene, tuple(map(hybrid, RESOLUTIONS))), images=False) for scene in SCENES[:2]))


def resolution_ratio(scene: str, a: int, b: int) -> Callable[[Sequence[Row]], float]:
    """Wrong samples of the hybrid with one resolution over those with another."""
    return wrong_ratio(hybrid(a), hybrid(b), scene=scene)


def worst_step(scene: str) -> Callable[[Sequence[Row]], float]:
    """Wrong samples over those at half the resolution, the larger of the two ratios."""
    return lambda rows: max(resolution_ratio(scene, 512, 256)(rows), resolution_ratio(scene, 1024, 512)(rows))


F9 = Item(
    "Ch.F9", PAPER, "Wrong samples of the hybrid at three resolutions of the map", "Figure 9",
    "Above: part of the tree's shadow with maps of 256, 512 and 1024, and shadow volumes as the reference. Below: what "
    "decides. " + COLORS + MARKED + "The paper's view is another.",
    full=F9_FULL, quick=smaller(*F9_FULL), rows=ROWS,
    claims=(*(Claim(f"{scene}: wrong samples over those at half the resolution (larger of two steps)", "below 1x",
                    worst_step(scene), at_most(1.0), at_most(1.1)) for scene in SCENES),
            Claim("tree: thin branches are missed at 256: wrong samples", "shown",
                  lambda rows: mean(rows, "wrong", scene="tree", method=hybrid(256).label), at_least(1.0), at_least(1.0),
                  "")),
    plot=mosaic([[*(Tile(view_key("tree", 0, hybrid(r).label), wrong_of(hybrid(r).label, f"hybrid, {r}", scene="tree"),
                         crop=TWIGS, marks=True) for r in RESOLUTIONS),
                  Tile(view_key("tree", 0, VOLUMES.label), "shadow volumes", crop=TWIGS)],
                 [Tile(view_key("tree", 0, hybrid(r).label), "what decides", "classification", TWIGS) for r in RESOLUTIONS]],
                (3.0, 3.2)))

F10_FULL = view("dragon_cage", (VOLUMES, hybrid(1024)))

F10 = Item(
    "Ch.F10", PAPER, "Dragon cage: overdraw, silhouette samples, stencil buffer", "Figure 10; sec. 5.2",
    "The view; stencil updates per pixel of shadow volumes and of the hybrid on one logarithmic scale; what decides. "
    "Overdraw are fragments of shadow volumes over samples of the image. The paper shades overdraw yellow and shows the "
    "stencil buffer by itself: black and green samples here. " + COLORS,
    full=(F10_FULL,), quick=smaller(F10_FULL), rows=ROWS,
    claims=(Claim("Overdraw of shadow volumes", "79", share("stencil_fragments", VOLUMES),
                  Range(79.0 / STAND_IN_FACTOR, 79.0 * STAND_IN_FACTOR),
                  Range(79.0 / STAND_IN_FACTOR**2, 79.0 * STAND_IN_FACTOR**2), "",
                  otherwise="Overdraw is a property of the body and the view, and both are stand-ins"),
            Claim("Silhouette samples", "5 %", per_cent("silhouette_samples", hybrid(1024)),
                  Range(5.0 / STAND_IN_FACTOR, 5.0 * STAND_IN_FACTOR),
                  Range(5.0 / STAND_IN_FACTOR**2, 5.0 * STAND_IN_FACTOR**2), " %",
                  otherwise="The paper does not give the map's resolution here. With six maps round the light, texels are "
                            "small on the screen; the share at 256 and 512 is in Ch.F11, view A"),
            Claim("Stencil updates, hybrid over volumes", "far below 1x", lambda rows: (
                mean(rows, "stencil_updates", method=hybrid(1024).label)
                / mean(rows, "stencil_updates", method=VOLUMES.label)), at_most(0.25), at_most(1.0))),
    plot=mosaic([[Tile(VOLUMES.label, "dragon_cage (stand-in)"),
                  Tile(VOLUMES.label, lambda rows: f"volumes: overdraw {share('stencil_fragments', VOLUMES)(rows):.0f}",
                       "heatmap")],
                 [Tile(hybrid(1024).label, lambda rows: (
                     f"silhouettes: {per_cent('silhouette_samples', hybrid(1024))(rows):.1f} %"), "classification"),
                  Tile(hybrid(1024).label, "stencil updates of the hybrid", "heatmap")]], (4.0, 4.2)))

ITEMS = (F5, F6, F8, F9, F10)
