"""Comparisons as tables: aligned text, Markdown, or CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from shadowbench.compare.pairs import CellKey, Comparison, Pair
from shadowbench.compare.times import TimeChange, compare_times, spread_text
from shadowbench.report.gather import Run

CSV_HEADER = ("scene", "frame", "label", "kind", "name", "a", "b", "verdict")

WRONG = ("false_shadow", "false_light")


@dataclass(frozen=True)
class Table:
    """A titled table; columns named in `words` are text, the others numbers."""

    title: str
    header: tuple[str, ...]
    rows: list[tuple[str, ...]]
    words: tuple[str, ...] = ("method", "counter", "verdict", "counts", "picture", "in", "class", "status A", "status B")


def tables(comparison: Comparison) -> list[Table]:
    """Everything that is worth a reader's attention: one line per method, then what changed, in detail."""
    groups: dict[tuple[str, str], list[Pair]] = {}
    for pair in comparison.pairs:
        groups.setdefault((pair.key[0], pair.key[2]), []).append(pair)
    several = len({scene for scene, _ in groups}) > 1
    named = {(f"{scene} / {label}" if several else label): pairs for (scene, label), pairs in groups.items()}
    found = [Table("Methods over the frames that both runs have",
                   ("method", "frames", "counts", "time A ms", "time B ms", "change", "verdict", "wrong A", "wrong B",
                    "pictures changed"), [_method_row(name, pairs) for name, pairs in named.items()]),
             Table("Counts that changed, over all frames", ("method", "counter", "A", "B", "change", "frames"),
                   [row for name, pairs in named.items() for row in _count_rows(name, pairs)]),
             Table("Answers that changed, over all frames", ("method", "class", "samples A", "samples B", "frames"),
                   [row for name, pairs in named.items() for row in _accuracy_rows(name, pairs)]),
             Table("Pictures that changed", ("method", "frame", "picture", "pixels"),
                   [row for name, pairs in named.items() for row in _picture_rows(name, pairs)]),
             Table("Memory that changed, largest frame", ("method", "KiB A", "KiB B", "change"),
                   [row for name, pairs in named.items() for row in _memory_rows(name, pairs)]),
             Table("Outcomes that changed", ("method", "frame", "status A", "status B"),
                   [(name, str(p.key[1]), *p.status) for name, pairs in named.items() for p in pairs
                    if p.status[0] != p.status[1]]),
             Table("Cells of one run only", ("method", "frames", "in"),
                   [*_lonely(comparison.only_a, "A"), *_lonely(comparison.only_b, "B")])]
    return [table for table in found if table.rows]


def method_time(pairs: Sequence[Pair]) -> TimeChange:
    """Add up each repeat over the frames that both runs timed, as if every repeat were one pass over them."""
    timed = [pair.time for pair in pairs if pair.time.a and pair.time.b]
    if not timed:
        return compare_times((), ())
    sums = [[sum(values[r] for values in side) for r in range(min(len(values) for values in side))]
            for side in ([t.a for t in timed], [t.b for t in timed])]
    return compare_times(*sums)


def _method_row(name: str, pairs: Sequence[Pair]) -> tuple[str, ...]:
    time = method_time(pairs)
    verified = [pair.accuracy for pair in pairs if pair.accuracy]
    wrong = [f"{sum(a[c][side] for a in verified for c in WRONG):,}" if verified else "" for side in (0, 1)]
    pictured = [pair for pair in pairs if pair.pictures]
    changed = f"{sum(bool(p.changed_pictures) for p in pictured)} of {len(pictured)}" if pictured else ""
    return (name, str(len(pairs)), _counts_phrase(pairs), spread_text(time.a), spread_text(time.b),
            "" if time.change is None else f"{100 * time.change:+.1f} %", time.verdict, *wrong, changed)


def _counts_phrase(pairs: Sequence[Pair]) -> str:
    """Say whether all counts agree, and how many do not."""
    if not any(pair.counts for pair in pairs):
        return "not counted"
    changed = {name for pair in pairs for name in pair.changed_counts}
    return f"{len(changed)} changed" if changed else "same"


def _count_rows(name: str, pairs: Sequence[Pair]) -> Iterator[tuple[str, ...]]:
    for counter in sorted({counter for pair in pairs for counter in pair.changed_counts}):
        values = [pair.counts[counter] for pair in pairs if counter in pair.counts]
        a, b = (sum(value[side] or 0 for value in values) for side in (0, 1))
        frames = sum(counter in pair.changed_counts for pair in pairs)
        yield name, counter, f"{a:,}", f"{b:,}", _share(a, b), str(frames)


def _accuracy_rows(name: str, pairs: Sequence[Pair]) -> Iterator[tuple[str, ...]]:
    for kind in dict.fromkeys(kind for pair in pairs for kind in pair.accuracy):
        values = [pair.accuracy[kind] for pair in pairs if kind in pair.accuracy]
        if any(a != b for a, b in values):
            yield (name, kind, f"{sum(a for a, _ in values):,}", f"{sum(b for _, b in values):,}",
                   str(sum(a != b for a, b in values)))


def _picture_rows(name: str, pairs: Sequence[Pair]) -> Iterator[tuple[str, ...]]:
    for pair in pairs:
        for picture, n in pair.changed_pictures.items():
            yield name, str(pair.key[1]), picture, "other size" if n is None else f"{n:,}"


def _memory_rows(name: str, pairs: Sequence[Pair]) -> Iterator[tuple[str, ...]]:
    a, b = (max(pair.memory[side] for pair in pairs) for side in (0, 1))
    if a != b and all(pair.status == ("done", "done") for pair in pairs):
        yield name, f"{a / 1024:,.0f}", f"{b / 1024:,.0f}", _share(a, b)


def _lonely(keys: Sequence[CellKey], run: str) -> Iterator[tuple[str, ...]]:
    for label in dict.fromkeys(label for _, _, label in keys):
        yield label, str(sum(key[2] == label for key in keys)), run


def _share(a: float, b: float) -> str:
    return f"{100.0 * (b / a - 1.0):+.2f} %" if a else "new"


def heading(run: Run) -> str:
    """One line about a run: what, when, which sources, where."""
    d = run.document
    commit = d["git"]["commit"][:12] if d["git"]["commit"] else "no commit"
    return (f"{run.path}: {d['scene']}, {d['image']['width']} x {d['image']['height']}, {d['created']}, {commit}, "
            f"{d['processor']['model']}, {d['threads']} thread(s)")


def as_csv(comparison: Comparison) -> str:
    """Every value of every pair in long form, the unchanged ones included."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CSV_HEADER)
    for pair in comparison.pairs:
        for row in _long_rows(pair):
            writer.writerow((*pair.key, *row))
    for keys, run in ((comparison.only_a, "A"), (comparison.only_b, "B")):
        writer.writerows((*key, "cell", "", "", "", f"only in {run}") for key in keys)
    return text.getvalue()


def _long_rows(pair: Pair) -> Iterator[tuple[str, str, object, object, str]]:
    def verdict(a: float | None, b: float | None) -> str:
        return "same" if a == b else "changed" if a is None or b is None else "more" if b > a else "fewer"

    yield "status", "", pair.status[0], pair.status[1], "same" if pair.status[0] == pair.status[1] else "changed"
    for name, (a, b) in pair.counts.items():
        yield "count", name, "" if a is None else a, "" if b is None else b, verdict(a, b)
    for name, values in pair.accuracy.items():
        yield "accuracy", name, *values, verdict(*values)
    yield "memory", "bytes", *pair.memory, verdict(*pair.memory)
    for n, (time_a, time_b) in enumerate(zip(pair.time.a, pair.time.b, strict=False)):
        yield "time", f"repeat {n}", f"{time_a:.9f}", f"{time_b:.9f}", pair.time.verdict
    for name, count in pair.pictures.items():
        yield "picture", name, "", "" if count is None else count, "same" if count == 0 else "changed"
