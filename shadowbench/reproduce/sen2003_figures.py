"""The figures of Sen et al. 2003 that show pictures: 1, 6 to 10.

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from shadowbench.reproduce.items import Claim, Item, Measurement, Pictures, Row, at_least, at_most, view_key
from shadowbench.reproduce.mosaic import MARKED, Crop, Tile, mosaic, wrong_of
from shadowbench.reproduce.rows import cell_rows, mean
from shadowbench.reproduce.variants import variant

PAPER = "sen2003"
GAMES = ("crowd", "jeep", "castle")
VOLUMES = "z_fail"

FAR_FEWER = 0.5
"""A silhouette map that is "substantially" better, or "close to" volumes, has at most this share of a shadow map's wrong
samples."""


def shadow_map(resolution: int) -> str:
    """Label of a shadow map."""
    return variant("shadow_map", resolution=resolution).label


def silhouette_map(resolution: int) -> str:
    """Label of a silhouette map."""
    return variant("silhouette_map", resolution=resolution).label


def both_maps(resolution: int) -> tuple[str, str]:
    """Specifications of both methods at a resolution."""
    return f"shadow_map[resolution={resolution}]", f"silhouette_map[resolution={resolution}]"


def pictures(scene: str, size: int, frame: int, methods: tuple[str, ...]) -> Measurement:
    """One view, with pictures."""
    return Measurement(scene, size, (frame,), methods, images=True)


def at_half_size(*full: Measurement) -> tuple[Measurement, ...]:
    """The same at half the size."""
    return tuple(replace(m, size=m.size // 2, height=m.height // 2, published_size=m.published_size or m.size) for m in full)


def wrong_ratio(resolution: int, **where: str | int) -> Callable[[Sequence[Row]], float]:
    """Wrong samples of the silhouette map over those of the shadow map."""
    return lambda rows: (mean(rows, "wrong", method=silhouette_map(resolution), **where)
                         / max(mean(rows, "wrong", method=shadow_map(resolution), **where), 1.0))


def better(text: str, published: str, resolution: int, **where: str | int) -> Claim:
    """The silhouette map has far fewer wrong samples than the shadow map."""
    return Claim(text, published, wrong_ratio(resolution, **where), at_most(FAR_FEWER), at_most(1.0))


def exact_volumes(**where: str | int) -> Claim:
    """Shadow volumes have no wrong sample."""
    return Claim("Shadow volumes: wrong samples", "none", lambda rows: mean(rows, "wrong", method=VOLUMES, **where),
                 at_most(0.0), at_most(0.0), "")


ROWS = cell_rows("wrong", "silhouette_samples", "silhouette_points_written", "test_and_set")
F1_CROP: Crop = (0.2, 0.28, 0.95, 0.72)
F1_FULL = pictures("crowd", 1024, 0, (*both_maps(512), VOLUMES))

F1 = Item(
    "Sen.F1", PAPER, "Shadow map, shadow volumes, silhouette map of the same resolution", "Figure 1",
    "Part of the crowd's shadow on the wall; both maps have 512 texels along the side. The paper's figure shows one of its "
    "characters from nearby, ours several of the stand-in's. " + MARKED + "Below: the same without marks.",
    full=(F1_FULL,), quick=at_half_size(F1_FULL), rows=ROWS,
    claims=(better("Wrong samples, silhouette map over shadow map: close to shadow volumes", "close to volumes", 512),
            exact_volumes()),
    plot=mosaic([[Tile(shadow_map(512), wrong_of(shadow_map(512), "shadow map"), crop=F1_CROP, marks=True),
                  Tile(VOLUMES, wrong_of(VOLUMES, "shadow volumes"), crop=F1_CROP, marks=True),
                  Tile(silhouette_map(512), wrong_of(silhouette_map(512), "silhouette map"), crop=F1_CROP, marks=True)],
                 [Tile(shadow_map(512), "", crop=F1_CROP), Tile(VOLUMES, "", crop=F1_CROP),
                  Tile(silhouette_map(512), "", crop=F1_CROP)]], (3.4, 2.3)))

F6_FULL = tuple(pictures(scene, 512, 0, both_maps(512)) for scene in GAMES)

F6 = Item(
    "Sen.F6", PAPER, "Three scenes with a shadow map and a silhouette map of 512", "Figure 6; sec. 4",
    "Crowd, jeep and castle at the paper's size of image and maps. The stand-ins have the paper's numbers of triangles, "
    "another look and other views. " + MARKED,
    full=F6_FULL, quick=at_half_size(*F6_FULL), rows=ROWS,
    claims=tuple(better(f"{scene}: wrong samples, silhouette map over shadow map: substantial improvement",
                        "substantial improvement", 512, scene=scene) for scene in GAMES),
    plot=mosaic([[Tile(view_key(scene, 0, label), wrong_of(label, f"{scene}, {name}", scene=scene), marks=True)
                  for label, name in ((shadow_map(512), "shadow map"), (silhouette_map(512), "silhouette map"))]
                 for scene in GAMES], (3.6, 3.8)))

PANELS = ("crossing", "parallel", "corner")
CLAIMED = ("two silhouettes cross in a texel", "two silhouettes pass through a texel", "a sharp corner is lost")
TEXELS = 36


def by_panel(rows: Sequence[Row], found: Pictures) -> list[Row]:
    """Split each row into the thirds of the image, with the wrong samples of each."""
    from shadowbench.reproduce import tiles

    split: list[Row] = []
    for row in rows:
        for k, panel in enumerate(PANELS):
            file = found[str(row["method"])]["shadow_exr"]
            shadow, light = tiles.count_errors(file, (k / 3.0, 0.0, (k + 1) / 3.0, 1.0))
            split.append({**row, "panel": panel, "wrong": shadow + light, "false_shadow": shadow, "false_light": light})
    return split


def _thirds(kind: str, marks: bool, label: str, name: str) -> list[Tile]:
    """The three artefacts in a row of tiles."""
    return [Tile(label, wrong_of(label, f"{name}, {panel}", panel=panel), kind, (k / 3.0, 0.0, (k + 1) / 3.0, 1.0), marks)
            for k, panel in enumerate(PANELS)]


F7_FULL = Measurement("lost_edges", 1080, (0,), both_maps(TEXELS), n_frames=1, height=360, images=True)

F7 = Item(
    "Sen.F7", PAPER, "The three artefacts: crossing, parallel, lost corner", "Figure 7",
    "Made for the purpose: shadows on a wall of 36 texels by 12, each artefact in a third. Above: silhouette points (red) "
    "over the shadows that the silhouette map finds. Middle: its wrong samples. Below: those of a shadow map of the same "
    "resolution. " + MARKED + "The paper draws outlines by hand; ours are shadows of polygons.",
    full=(F7_FULL,), quick=(replace(F7_FULL, size=540, height=180, published_size=1080),),
    rows=cell_rows("silhouette_samples"), from_pictures=by_panel,
    claims=tuple(Claim(f"Artefact where {text}: wrong samples", "shown", lambda rows,
                       panel=panel: mean(  # type: ignore[misc]
        rows, "wrong", method=silhouette_map(TEXELS), panel=panel), at_least(1.0), at_least(1.0), "")
        for panel, text in zip(PANELS, CLAIMED, strict=True)),
    plot=mosaic([_thirds("silhouette_points", False, silhouette_map(TEXELS), "silhouette map"),
                 _thirds("shaded", True, silhouette_map(TEXELS), "silhouette map"),
                 _thirds("shaded", True, shadow_map(TEXELS), "shadow map")], (3.4, 3.6)))

COARSE = 128
F8_CROP: Crop = (0.44, 0.5, 0.84, 0.9)
F8_FULL = pictures("jeep", 1024, 0, (*both_maps(COARSE), VOLUMES))

F8 = Item(
    "Sen.F8", PAPER, "Artefacts when the silhouette map is too coarse", "Figure 8",
    f"A close view of the jeep's front with maps of {COARSE} texels along the side; the paper does not say its resolution. "
    + MARKED,
    full=(F8_FULL,), quick=at_half_size(F8_FULL), rows=ROWS,
    claims=(Claim("Too coarse, the silhouette map has wrong samples", "artefacts",
                  lambda rows: mean(rows, "wrong", method=silhouette_map(COARSE)), at_least(1.0), at_least(1.0), ""),
            Claim("They are fewer than the shadow map's of the same resolution (ratio)", "improvement", wrong_ratio(COARSE),
                  at_most(1.0), at_most(1.1)),
            exact_volumes()),
    plot=mosaic([[Tile(label, wrong_of(label, name), crop=F8_CROP, marks=marks)
                  for label, name in ((shadow_map(COARSE), "shadow map"), (VOLUMES, "shadow volumes"),
                                      (silhouette_map(COARSE), "silhouette map"))] for marks in (False, True)], (3.2, 3.4)))

PINS: Crop = (0.3, 0.25, 0.8, 0.75)
NEAR_PINS: Crop = (0.42, 0.42, 0.72, 0.72)
F9_TEXELS = 128
F9_FULL = pictures("strike", 1024, 0, both_maps(F9_TEXELS))


def point_share(rows: Sequence[Row]) -> float:
    """Silhouette points over the texels of the map, in per cent."""
    return 100.0 * mean(rows, "silhouette_points_written", method=silhouette_map(F9_TEXELS)) / F9_TEXELS**2


F9 = Item(
    "Sen.F9", PAPER, "Silhouette points over the scene", "Figure 9; sec. 4",
    f"Pins and their shadows with maps of {F9_TEXELS} texels along the side; silhouette points are red circles on the map "
    "and so ellipses on pins. The paper's view is another; its resolution is not given.",
    full=(F9_FULL,), quick=at_half_size(F9_FULL), rows=ROWS,
    claims=(Claim("Texels with a silhouette point: many fewer than the others", "many fewer", point_share, at_most(25.0),
                  at_most(50.0), " %"),
            better("Wrong samples, silhouette map over shadow map", "substantial improvement", F9_TEXELS)),
    plot=mosaic([[Tile(shadow_map(F9_TEXELS), wrong_of(shadow_map(F9_TEXELS), "shadow map"), crop=NEAR_PINS),
                  Tile(silhouette_map(F9_TEXELS), "silhouette points", "silhouette_points", NEAR_PINS),
                  Tile(silhouette_map(F9_TEXELS), wrong_of(silhouette_map(F9_TEXELS), "silhouette map"), crop=NEAR_PINS)]],
                (3.6, 3.8)))

F10_TEXELS = 96
F10_FULL = pictures("strike", 1024, 0, both_maps(F10_TEXELS))

F10 = Item(
    "Sen.F10", PAPER, "The silhouette map as a warped grid", "Figure 10; sec. 5",
    f"Cells of depths, tinted like a chessboard, with {F10_TEXELS} texels along the side: cells beside a shadow's edge are "
    "warped until their borders follow it, all others stay square. The paper draws a diagram; ours is the grid itself, as "
    "it falls on the scene. Left: a shadow map, whose cells all stay square.",
    full=(F10_FULL,), quick=at_half_size(F10_FULL), rows=ROWS,
    claims=(better("Wrong samples of the warped grid over those of the square grid, the same depths", "matches better",
                   F10_TEXELS),),
    plot=mosaic([[Tile(shadow_map(F10_TEXELS), wrong_of(shadow_map(F10_TEXELS), "square grid"), crop=PINS, marks=True),
                  Tile(silhouette_map(F10_TEXELS), "warped grid", "warped_grid", PINS),
                  Tile(silhouette_map(F10_TEXELS), wrong_of(silhouette_map(F10_TEXELS), "warped grid"), crop=PINS,
                       marks=True)]], (3.6, 3.8)))

ITEMS = (F1, F6, F7, F8, F9, F10)
