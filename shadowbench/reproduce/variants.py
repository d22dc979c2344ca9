"""What several papers' items share: methods with options, and ratios of columns between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from shadowbench.reproduce.items import Row
from shadowbench.reproduce.rows import mean, values

Value = Callable[[Sequence[Row]], float]
"""A claim's number, from the rows of ``data.csv``."""


class Variant(NamedTuple):
    """A method with options that are not its defaults.

    Attributes
    ----------
    spec : as on the command line.
    label : as in the column ``method``.
    """

    spec: str
    label: str


def variant(name: str, **options: str | int) -> Variant:
    """Name a method with some options; a method without any has its name as label."""
    given = [f"{key}={value}" for key, value in sorted(options.items())]
    return Variant(f"{name}[{','.join(given)}]" if given else name, "+".join([name, *given]))


def ratio(a: Variant, b: Variant, column: str = "test_and_set", **where: str | int) -> Value:
    """Column of method a over that of method b, means over the frames."""
    return lambda rows: mean(rows, column, method=a.label, **where) / mean(rows, column, method=b.label, **where)


def column_ratio(a: Variant, a_column: str, b: Variant, b_column: str, **where: str | int) -> Value:
    """One column of method a over another of method b, means over the frames."""
    return lambda rows: mean(rows, a_column, method=a.label, **where) / mean(rows, b_column, method=b.label, **where)


def by_frame(rows: Sequence[Row], method: Variant, column: str, **where: str | int) -> dict[int, float]:
    """Values of a column by frame."""
    return dict(zip(map(int, values(rows, "frame", method=method.label, **where)),
                    values(rows, column, method=method.label, **where), strict=True))


def frame_ratios(a: Variant, a_column: str, b: Variant, b_column: str, **where: str | int
                 ) -> Callable[[Sequence[Row]], list[float]]:
    """One column of method a over another of method b, frame by frame where both were measured."""
    def ratios(rows: Sequence[Row]) -> list[float]:
        high, low = by_frame(rows, a, a_column, **where), by_frame(rows, b, b_column, **where)
        return [high[frame] / low[frame] for frame in high if frame in low]
    return ratios


def share_at_most_one(ratios: Callable[[Sequence[Row]], list[float]]) -> Value:
    """Per cent of the frames in which the ratio is 1 or less."""
    def share(rows: Sequence[Row]) -> float:
        found = ratios(rows)
        return 100.0 * sum(value <= 1.0 for value in found) / len(found)
    return share
