"""What a cell's counters say in words: failures that a method is known to have, named as what they are."""

from __future__ import annotations

from shadowbench.results import CellResult


def remarks(cell: CellResult) -> list[str]:
    """Name the failures that a cell's counts give away, one sentence each; none if all went well."""
    return [sentence for sentence in (_stencil_overflow(cell), _ignored_eye_volumes(cell)) if sentence]


def _stencil_overflow(cell: CellResult) -> str:
    """A stencil value that wrapped around, and what it did."""
    wrapped, peak = cell.counts.get("stencil_overflows", 0), cell.counts.get("peak_stencil", 0)
    if not wrapped:
        return ""
    bits, lit = cell.params["stencil_bits"], cell.counts.get("stencil_overflows_lit", 0)
    return (f"the {bits}-bit stencil overflowed on {_samples(wrapped)}: a count of {peak} wrapped to {peak % 2**bits}; "
            f"{_samples(lit)} lit that should be dark")


def _ignored_eye_volumes(cell: CellResult) -> str:
    """Shadow volumes around the eye that z-pass did not start with, if that spoiled samples."""
    ignored = cell.counts.get("eye_volumes_ignored", 0)
    if not ignored or cell.accuracy is None:
        return ""
    wrong = cell.accuracy.false_shadow + cell.accuracy.false_light
    volumes = "1 shadow volume that was" if ignored == 1 else f"{ignored:,} shadow volumes that were"
    return f"the eye is in {volumes} not counted (eye_count=off); {_samples(wrong)} wrong" if wrong else ""


def _samples(n: int) -> str:
    return "1 sample" if n == 1 else f"{n:,} samples"
