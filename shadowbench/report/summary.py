"""Figures of each method over all frames of a run, as the summary table and the plots show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shadowbench.algorithms import ALGORITHMS
from shadowbench.report.gather import Series
from shadowbench.results import CellResult


@dataclass(frozen=True)
class MethodSummary:
    """One method over all its frames. Means are per frame; None where nothing was measured.

    Attributes
    ----------
    series : the method.
    n_done, n_failed, n_unsupported : cells.
    candidates : samples that had to be decided, over all frames.
    wrong, ties, worst_frame : samples that differ from the reference, in all; the frame with most wrong ones.
    counts : mean of every count.
    milliseconds : mean over the frames of each frame's median time.
    memory : largest memory of a frame, bytes.
    verdict : "right", "ties", "wrong", "unverified", "failed" or "unsupported".
    """

    series: Series
    n_done: int
    n_failed: int
    n_unsupported: int
    candidates: int
    wrong: int | None
    ties: int | None
    worst_frame: int | None
    counts: dict[str, float]
    milliseconds: float | None
    memory: int | None
    verdict: str

    @property
    def exact(self) -> bool:
        """True if the method is meant to agree with the reference on every sample."""
        entry = ALGORITHMS.get(self.series.algorithm)
        return entry is not None and entry.exact


def wrong_samples(cell: CellResult) -> int | None:
    """Samples whose answer is wrong, ties left out; None if the cell was not verified."""
    return None if cell.accuracy is None else cell.accuracy.false_shadow + cell.accuracy.false_light


def median_ms(cell: CellResult) -> float | None:
    """Median time of a cell in milliseconds."""
    return 1e3 * float(np.median(cell.total_seconds)) if cell.total_seconds else None


def memory_held(cell: CellResult) -> int:
    """Bytes that the method held; modelled sizes are left out."""
    return sum(size for name, size in cell.memory_bytes.items() if not name.startswith("modelled_"))


def summarise(series: Series) -> MethodSummary:
    """Sum up one method."""
    done = series.done
    verified = [cell for cell in done if cell.accuracy is not None]
    wrong = {cell.frame: wrong_samples(cell) or 0 for cell in verified}
    names = sorted({name for cell in done for name in cell.counts})
    counts = {name: float(np.mean([cell.counts.get(name, 0) for cell in done])) for name in names}
    times = [ms for cell in done if (ms := median_ms(cell)) is not None]
    states = [cell.status for cell in series.cells.values()]
    total, ties = sum(wrong.values()), sum(cell.accuracy.edge_tie for cell in verified if cell.accuracy)
    return MethodSummary(
        series, len(done), states.count("failed"), states.count("unsupported"),
        sum(cell.accuracy.lit_candidates for cell in verified if cell.accuracy),
        total if verified else None, ties if verified else None,
        max(wrong, key=lambda frame: wrong[frame]) if total else None, counts,
        float(np.mean(times)) if times else None, max((memory_held(cell) for cell in done), default=None),
        _verdict(states, bool(verified), total, ties))


def _verdict(states: Sequence[str], verified: bool, wrong: int, ties: int) -> str:
    """One word for the worst that happened."""
    if "failed" in states:
        return "failed"
    if "done" not in states:
        return "unsupported"
    if not verified:
        return "unverified"
    return "wrong" if wrong else "ties" if ties else "right"


def sentences(methods: Sequence[MethodSummary]) -> list[str]:
    """Say in a few sentences which methods are right and which of those cost least."""
    right = [m for m in methods if m.verdict in ("right", "ties") and m.series.algorithm != "reference"]
    wrong = sorted((m for m in methods if m.verdict == "wrong" and m.wrong), key=lambda m: m.wrong or 0)
    told = []
    if right:
        told.append(f"{_list([m.series.title for m in right])} {'gives' if len(right) == 1 else 'give'} the reference's "
                    f"answer on every sample whose answer is certain.")
    if wrong:
        told.append("Wrong samples: " + "; ".join(
            f"{m.series.title} {m.wrong:,} of {m.candidates:,} ({100.0 * (m.wrong or 0) / max(m.candidates, 1):.2g}\u00a0%)"
            for m in wrong) + ".")
    timed = [m for m in right if m.milliseconds is not None]
    if len(timed) > 1:
        best = min(timed, key=lambda m: m.milliseconds or 0.0)
        told.append(f"Of the right ones, {best.series.title} is the fastest here: {best.milliseconds:.1f} ms per frame.")
    worked = [m for m in right if m.counts.get("all_work")]
    if len(worked) > 1:
        least = min(worked, key=lambda m: m.counts["all_work"])
        told.append(f"{least.series.title} does the least work: {least.counts['all_work']:,.0f} operations per frame, on "
                    "every machine.")
    return told


def _list(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
