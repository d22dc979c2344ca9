"""What changed between a baseline and a measurement, and which of it is for the better."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from shadowbench.check.baseline import Place
from shadowbench.counters import ALL_COUNTERS

TOTALS = ("test_and_set", "all_work")
ERRORS = ("false_shadow", "false_light", "edge_tie")
COSTS = frozenset([*TOTALS, *ERRORS, *(c.name for c in ALL_COUNTERS if c.in_test_and_set or c.in_all_work)])
"""Fewer are better. Of any other count neither more nor fewer is: it only says how the work was done."""

ANSWERS = frozenset(["samples", "lit_candidates", "ambiguous", "caster_difference", "transparency_difference",
                     "antialiasing_difference"])
"""These belong to the scene and the reference, so no improvement of a method changes them."""

ALL_NAMES = sorted({counter.name for counter in ALL_COUNTERS} | set(ERRORS) | ANSWERS | {"shadowed"})


class Verdict(Enum):
    """What a change means."""

    REGRESSION = "regressions"
    ADDED = "not in the baseline"
    MISSING = "in the baseline, but not measured"
    TOLERATED = "within tolerance"
    IMPROVEMENT = "improvements"

    @property
    def fails(self) -> bool:
        """True if the check fails on such a change."""
        return self in (Verdict.REGRESSION, Verdict.ADDED, Verdict.MISSING)


@dataclass(frozen=True)
class Change:
    """A count that differs; None where one side lacks it."""

    place: Place
    before: int | None
    after: int | None
    verdict: Verdict


def compare(before: Mapping[Place, int], after: Mapping[Place, int], tolerances: Mapping[str, float]) -> list[Change]:
    """List every difference, in the order of places.

    A cost that grew is a regression, one that shrank an improvement. A count that is no cost is an improvement if its
    cell has one and no cost of that cell grew: it moved with the work. Otherwise it is a regression, for the method did
    something else than before.

    Parameters
    ----------
    before, after : counts of the baseline and of this measurement.
    tolerances : percent by which a counter may change.
    """
    changed = [place for place in sorted({*before, *after}) if before.get(place) != after.get(place)]
    both = [place for place in changed if place in before and place in after]
    worse = {place.cell for place in both
             if _moved(place, before, after) > 0 and not _tolerated(place, before, after, tolerances)}
    better = {place.cell for place in both if _moved(place, before, after) < 0} - worse

    def verdict(place: Place) -> Verdict:
        if place not in before:
            return Verdict.ADDED
        if place not in after:
            return Verdict.MISSING
        moved = _moved(place, before, after)
        if moved < 0:
            return Verdict.IMPROVEMENT
        if _tolerated(place, before, after, tolerances):
            return Verdict.TOLERATED
        with_the_work = moved == 0 and place.counter not in ANSWERS and place.cell in better
        return Verdict.IMPROVEMENT if with_the_work else Verdict.REGRESSION

    return [Change(place, before.get(place), after.get(place), verdict(place)) for place in changed]


def _moved(place: Place, before: Mapping[Place, int], after: Mapping[Place, int]) -> int:
    """1 if a cost grew, -1 if it shrank, 0 for a count that is no cost."""
    return 0 if place.counter not in COSTS else 1 if after[place] > before[place] else -1


def _tolerated(place: Place, before: Mapping[Place, int], after: Mapping[Place, int], tolerances: Mapping[str, float]
               ) -> bool:
    """True if a change is within its counter's tolerance."""
    return 100 * abs(after[place] - before[place]) <= tolerances.get(place.counter, -1.0) * before[place]
