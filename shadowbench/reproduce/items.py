"""What a reproduced figure, table or claim is made of. Records alone: importing this measures and draws nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    from shadowbench.results import CellResult

Row = Mapping[str, int | float | str]
"""One line of ``data.csv``, values by column."""

Outcome = Literal["holds", "holds in part", "does not hold"]


@dataclass(frozen=True)
class Measurement:
    """Cells to measure: every method on every frame.

    Attributes
    ----------
    scene : a built-in scene.
    size : width of the image, and its height unless `height` says otherwise.
    frames : frame numbers on the scene's path.
    methods : as on the command line, such as ``ptsv[casters=back_faces]``.
    n_frames : frames of the whole path.
    published_size : the width and height that the paper used, if `size` stands for another; 0 if they are the same.
    repeats : timed executions per cell; 0 for counts alone.
    warm_up : False to time the first execution too: for those that take many seconds.
    verify : False to leave out the comparison with the reference.
    images : True to keep the pictures.
    height : height of the image if it is not square, else 0.
    triangles : number of triangles if it is not the scene's own, else 0.
    settings : further ``dotted.key=value`` of the scene file, such as ``image.samples=4``.
    light : position of the light if it is not the scene's own, world, else None.
    """

    scene: str
    size: int
    frames: tuple[int, ...]
    methods: tuple[str, ...]
    n_frames: int = 48
    published_size: int = 0
    repeats: int = 0
    warm_up: bool = True
    verify: bool = True
    images: bool = False
    height: int = 0
    triangles: int = 0
    settings: tuple[str, ...] = ()
    light: tuple[float, float, float] | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Width and height of the image."""
        return self.size, self.height or self.size


class Measured(NamedTuple):
    """A cell that was measured, and what asked for it."""

    measurement: Measurement
    cell: CellResult


class Range(NamedTuple):
    """Numbers from `low` to `high`, both inclusive."""

    low: float
    high: float

    def __contains__(self, value: object) -> bool:
        return isinstance(value, int | float) and self.low <= value <= self.high

    def __str__(self) -> str:
        if math.isinf(self.high):
            return f"at least {self.low:.3g}"
        return f"at most {self.high:.3g}" if math.isinf(self.low) else f"{self.low:.3g} to {self.high:.3g}"


def at_least(low: float) -> Range:
    """Numbers from `low` up."""
    return Range(low, math.inf)


def at_most(high: float) -> Range:
    """Numbers up to `high`."""
    return Range(-math.inf, high)


def about(published: float, share: float) -> Range:
    """Numbers that differ from the published one by at most a share of it."""
    return Range(published * (1.0 - share), published * (1.0 + share))


@dataclass(frozen=True)
class Verdict:
    """What became of a claim; every field is computed from the rows of ``data.csv``.

    Attributes
    ----------
    claim : the published sentence, short.
    published, measured : the two numbers, as text.
    value : the measured number.
    verdict : the outcome.
    why : the ranges that decided, and what explains a difference.
    """

    claim: str
    published: str
    measured: str
    value: float
    verdict: Outcome
    why: str


@dataclass(frozen=True)
class Claim:
    """A published claim as one number and two ranges.

    Attributes
    ----------
    text : the claim in one sentence.
    published : the published number, with its unit.
    value : computes the number from the rows of ``data.csv``.
    holds, partly : the claim holds, or holds in part, if the number is in the range.
    unit : appended to the measured number.
    otherwise : what explains a number outside `holds`.
    """

    text: str
    published: str
    value: Callable[[Sequence[Row]], float]
    holds: Range
    partly: Range
    unit: str = "x"
    otherwise: str = ""

    def judge(self, rows: Sequence[Row]) -> Verdict:
        """Compare with the rows of ``data.csv``."""
        value = self.value(rows)
        text = f"{value:.3g}{self.unit}"
        if value in self.holds:
            outcome: Outcome = "holds"
            why = f"{text} is {_within(self.holds)}"
        else:
            outcome = "holds in part" if value in self.partly else "does not hold"
            also = f", but {_within(self.partly)}" if value in self.partly else (
                f", nor {_within(self.partly)}" if self.partly != self.holds else "")
            why = f"{text} is not {_within(self.holds)}{also}" + (f". {self.otherwise}" if self.otherwise else "")
        return Verdict(self.text, self.published, text, value, outcome, why)


def _within(numbers: Range) -> str:
    """Name a range after "is"."""
    text = str(numbers)
    return text if text.startswith("at") else f"within {text}"


Pictures = Mapping[str, Mapping[str, Path]]
"""Files by view and kind: PNG such as ``pictures["ptsv"]["heatmap"]``, and the EXR ``shadow_exr`` and ``gbuffer_exr``.

A view is a label, or, where an item has several scenes or frames, ``scene/frame/label``; see `view_key`.
"""


def view_key(scene: str, frame: int, label: str) -> str:
    """Name a view of `Pictures`."""
    return f"{scene}/{frame}/{label}"


class Evidence(NamedTuple):
    """What a plot is made from.

    Attributes
    ----------
    rows : of ``data.csv``.
    pictures : what was kept; empty where none were.
    """

    rows: Sequence[Row]
    pictures: Pictures


@dataclass(frozen=True)
class Item:
    """A figure, table or claim.

    Attributes
    ----------
    id : such as "S11.F5".
    paper : key of the paper.
    title : one line.
    source : place in the paper.
    shows : what the output shows and in what it differs from the paper, for the caption.
    full, quick : what is measured at full size, and in a few minutes.
    rows : turns the measured cells into rows of ``data.csv``; pure.
    claims : what is judged, from those rows alone.
    plot : draws the figure into a folder, or None for a table.
    from_pictures : adds columns that are computed from the pictures to the rows, or None.
    """

    id: str
    paper: str
    title: str
    source: str
    shows: str
    full: tuple[Measurement, ...]
    quick: tuple[Measurement, ...]
    rows: Callable[[Sequence[Measured]], list[Row]]
    claims: tuple[Claim, ...]
    plot: Callable[[Evidence, Path], None] | None = None
    from_pictures: Callable[[Sequence[Row], Pictures], list[Row]] | None = None

    @property
    def shows_pictures(self) -> bool:
        """True if the figure is made from pictures, not from ``data.csv`` alone."""
        return any(measurement.images for measurement in self.full)

    def judge(self, rows: Sequence[Row]) -> list[Verdict]:
        """Judge every claim."""
        return [claim.judge(rows) for claim in self.claims]
