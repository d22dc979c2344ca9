"""What an explanation consists of: tests in order, each with its outcome and its share in a heat map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

Corner = tuple[float, float]


@dataclass(frozen=True)
class Shape:
    """Something to draw over the image.

    Attributes
    ----------
    points : corners of a polygon in columns and rows of samples; two for a line.
    css : what it is: "accept", "reject", "refine", "leaf", "face" or "ray".
    title : what it is in words.
    """

    points: tuple[Corner, ...]
    css: str
    title: str


@dataclass(frozen=True)
class Test:
    """One test.

    Attributes
    ----------
    triangle : the mesh's triangle that caused it, or None.
    place : where: a node of which level, a sample, a leaf, a face.
    outcome : what came of it.
    share : how much of it the heat map books on the sample: 1 for a test of this sample alone, less for one that is shared
        by all samples of a box, 0 for work that the heat map leaves out.
    shape : number of its shape, or None.
    """

    triangle: int | None
    place: str
    outcome: str
    share: float = 1.0
    shape: int | None = None


@dataclass
class Trace:
    """Every test that touched a sample, or that a triangle caused.

    Attributes
    ----------
    subject : what is explained.
    tests : in the order in which the method makes them.
    value : their number as the method reports it: the heat map's value at the sample, or the triangle's count.
    shapes : what the tests looked at.
    note : how tests become that number.
    parts : the samples of a pixel, each with shares and a rounded sum of its own; empty for one sample.
    """

    subject: str
    tests: list[Test] = field(default_factory=list)
    value: int = 0
    shapes: list[Shape] = field(default_factory=list)
    note: str = ""
    parts: tuple[Trace, ...] = ()
    _places: dict[Shape, int] = field(default_factory=dict, repr=False)

    def add(self, test: Test) -> None:
        """Append a test.

        A share above 1 stems from places of a tile that are off the image: their tests are made and counted like the others,
        and the samples of the image bear them. They are listed as tests of their own.
        """
        self.tests.append(replace(test, share=min(test.share, 1.0)))
        rest = test.share - 1.0
        while rest > 1e-9:
            self.tests.append(Test(test.triangle, "a place of the tile off the image", "nothing there", min(rest, 1.0)))
            rest -= 1.0

    def add_shape(self, shape: Shape) -> int:
        """Keep a shape once; return its number."""
        if shape not in self._places:
            self._places[shape] = len(self.shapes)
            self.shapes.append(shape)
        return self._places[shape]

    def numbers(self) -> list[int]:
        """Number the tests that are booked: 1, 2 and so on up to `value`; 0 for the others.

        A shared test is booked on the sample that it completes a whole test for: shares are added up in order, and where the
        rounded sum reaches the next number, the test gets that number. So exactly `value` tests have one.
        """
        if self.parts:
            numbers: list[int] = []
            before = 0
            for part in self.parts:
                numbers += [n + before if n else 0 for n in part.numbers()]
                before += part.value
            return numbers
        if not self.tests:
            return []
        # Halves round up, so that a share of 1 always reaches one number more; the sums' own rounding is taken off before
        sums = np.round(np.cumsum([test.share for test in self.tests]), 9)
        reached = np.minimum(np.floor(sums + 0.5), self.value).astype(np.int64)
        earlier = np.concatenate([[0], reached[:-1]])
        return [int(n) if n > e else 0 for n, e in zip(reached, earlier, strict=True)]


def joined(traces: Sequence[Trace], subject: str) -> Trace:
    """Put the explanations of a pixel's samples one after the other.

    Raises
    ------
    ValueError
        If there are none.
    """
    if not traces:
        raise ValueError("no samples")
    if len(traces) == 1:
        return traces[0]
    whole = Trace(subject, note=traces[0].note, parts=tuple(traces))
    for trace in traces:
        places = [whole.add_shape(shape) for shape in trace.shapes]
        whole.tests += [Test(t.triangle, f"{trace.subject}: {t.place}", t.outcome, t.share,
                             None if t.shape is None else places[t.shape]) for t in trace.tests]
        whole.value += trace.value
    return whole
