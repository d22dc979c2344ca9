"""Robustness of z-pass and z-fail against PTSV (Sintorn et al. 2011, sections 1 and 4).

The ranges below were fixed before anything was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from shadowbench.reproduce.items import Claim, Item, Measurement, Row, at_least, at_most, view_key
from shadowbench.reproduce.mosaic import MARKED, Tile, mosaic, wrong_of
from shadowbench.reproduce.rows import cell_rows, mean
from shadowbench.reproduce.variants import Variant, variant

PAPER = "sintorn2011"
PTSV = variant("ptsv")
UNAWARE = variant("z_pass", eye_count="off")
AWARE = variant("z_pass")
PASS_8, FAIL_8, FAIL_32 = variant("z_pass", stencil_bits=8), variant("z_fail", stencil_bits=8), variant("z_fail")

AMONG_SHADOWS = 28
"""A frame of the citadel at which the eye stands in two shadow volumes."""

WHOLE_SCREEN, PART_OF_IT = 50.0, 1.0
"""A failure is on the whole screen if so many per cent of the lit candidates are wrong; in part, so many."""


def views(size: int) -> tuple[Measurement, ...]:
    """The eye in shadow, and more volumes than 8 bits count, with pictures."""
    citadel = Measurement("citadel", size, (AMONG_SHADOWS,), (UNAWARE.spec, AWARE.spec, PTSV.spec), published_size=1024,
                          images=True)
    methods = tuple(method.spec for method in (PASS_8, FAIL_8, FAIL_32, PTSV))
    return citadel, replace(citadel, scene="sheets", frames=(0,), n_frames=2, methods=methods)


def wrong(method: Variant, scene: str) -> Callable[[Sequence[Row]], float]:
    """Wrong samples of the image's, in per cent."""
    return lambda rows: (100.0 * mean(rows, "wrong", method=method.label, scene=scene)
                         / max(mean(rows, "lit_candidates", scene=scene), 1.0))


def fails(text: str, method: Variant, scene: str) -> Claim:
    """A method fails on the whole screen."""
    return Claim(text, "whole-screen errors", wrong(method, scene), at_least(WHOLE_SCREEN), at_least(PART_OF_IT), " %")


def right(text: str, method: Variant, scene: str) -> Claim:
    """A method has no wrong sample."""
    return Claim(text, "none", wrong(method, scene), at_most(0.0), at_most(0.0), " %")


TILES = [[Tile(view_key("citadel", AMONG_SHADOWS, method.label), wrong_of(method.label, name, scene="citadel"))
          for method, name in ((UNAWARE, "z-pass from zero"), (AWARE, "z-pass, eye counted"), (PTSV, "PTSV"))],
         [Tile(view_key("sheets", 0, method.label), wrong_of(method.label, name, scene="sheets"), marks=method is not PTSV)
          for method, name in ((FAIL_8, "z-fail, 8 bits"), (FAIL_32, "z-fail, 32 bits"), (PTSV, "PTSV"))]]

C3 = Item(
    "S11.C3", PAPER, "Robustness: the eye in shadow, stencil overflow", "sec. 1, 2 and 4",
    "Above: the citadel with the eye in two shadow volumes; z-pass that starts its count at zero, as the classical method "
    "does, with the robust count of this project, which the paper calls unsolved, and PTSV. Below: 256 sheets over the "
    "eye, more volumes than a stencil buffer of 8 bits counts; the paper names the failure and shows no scene for it. "
    "Below alone: " + MARKED[0].lower() + MARKED[1:],
    full=views(1024), quick=views(256),
    rows=cell_rows("wrong", "false_shadow", "false_light", "lit_candidates", "eye_volumes", "peak_stencil",
                   "stencil_overflows"),
    claims=(fails("z-pass with the eye in shadow, its count starting at zero: wrong samples", UNAWARE, "citadel"),
            right("z-pass with the volumes around the eye counted: wrong samples", AWARE, "citadel"),
            right("PTSV with the eye in shadow: wrong samples", PTSV, "citadel"),
            fails("z-pass with 8 bits in 256 volumes: wrong samples", PASS_8, "sheets"),
            fails("z-fail with 8 bits in 256 volumes: wrong samples", FAIL_8, "sheets"),
            right("z-fail with 32 bits: wrong samples", FAIL_32, "sheets"),
            right("PTSV in 256 volumes: wrong samples", PTSV, "sheets")),
    plot=mosaic(TILES, (3.4, 3.6)))
