"""Carries out the conformance suite on one method: every case, twice, on several numbers of threads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench import accuracy, jit
from shadowbench.algorithms.base import Algorithm, ShadowBuffer, Transparency
from shadowbench.conformance.cases import CLEAR_CASES, HARD_CASES, LARGE_CASES, Case
from shadowbench.conformance.interface import check_buffer, check_capabilities, check_class, check_counts
from shadowbench.geometry import Frame
from shadowbench.judge import Judge, Truth, classify
from shadowbench.probe import Probe

THREADED = ("duplicates", "sun", "boxes sharing faces", *CLEAR_CASES)
"""Cases that are run with several numbers of threads, and again in another process."""

THREADS = (1, 2, 4)

_SMALL_CASES = {**HARD_CASES, **CLEAR_CASES}


@dataclass(frozen=True)
class Finding:
    """Something wrong with a method, in words; `case` is None if it is wrong everywhere."""

    case: str | None
    message: str


@dataclass
class Outcome:
    """What the suite found out about one method.

    Attributes
    ----------
    passed : number of cases that were measured.
    unsupported : sentences by case.
    findings : everything that is wrong.
    """

    passed: int = 0
    unsupported: dict[str, str] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)


class Cases:
    """Cases with their frames and the reference's answers, made once for all methods.

    Parameters
    ----------
    names : which cases.
    """

    def __init__(self, names: list[str]) -> None:
        self.names = names
        self._made: dict[str, tuple[Case, Frame]] = {}
        self._judges: dict[str, Judge] = {}

    def get(self, name: str) -> tuple[Case, Frame]:
        """Return a case and its frame."""
        if name not in self._made:
            case = _SMALL_CASES[name] if name in _SMALL_CASES else LARGE_CASES[name]()
            self._made[name] = case, case.frame()
        return self._made[name]

    def truth(self, name: str, casters: NDArray[np.bool_] | None, mode: Transparency) -> Truth:
        """Return the reference's answer, with materials taken in the same way."""
        if name not in self._judges:
            self._judges[name] = Judge(self.get(name)[1])
        return self._judges[name].truths(casters, mode)[0]


def examine(algorithm: Algorithm, cases: Cases) -> Outcome:
    """Run the whole suite on one method."""
    outcome, method = Outcome(), type(algorithm)
    outcome.findings += [Finding(None, message) for message in check_class(method)]
    counters: set[str] = set()
    stages: set[str] = set()
    for name in cases.names:
        try:
            case, frame = cases.get(name)
            reason, problems = check_capabilities(algorithm, case)
            if reason is None:
                problems = list(_examine_case(algorithm, name, frame, cases, counters, stages))
                outcome.passed += not problems
            elif not problems:
                outcome.unsupported[name] = reason
        except Exception as error:
            problems = [f"it raises {type(error).__name__}: {error}"]
        outcome.findings += [Finding(name, message) for message in problems]
    if len(cases.names) > len(THREADED) and outcome.passed:
        outcome.findings += [Finding(None, f"it declares the counter {name}, but no case filled it")
                             for name in method.counters if name not in counters]
        outcome.findings += [Finding(None, f"it declares the stage {name!r}, but no case passed it")
                             for name in method.stages if name not in stages]
    return outcome


def _examine_case(algorithm: Algorithm, name: str, frame: Frame, cases: Cases, counters: set[str], stages: set[str]
                  ) -> Iterator[str]:
    """Say what is wrong with a method on one case; notes the counters and stages that it fills."""
    inputs = _inputs(frame)
    prepared = Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, frame.bias,
                     algorithm.prepare(frame.mesh))
    probe = Probe(counting=True)
    buffer = algorithm.shadows(prepared, probe)
    shadow = buffer.shadow
    counters.update(probe.counts)
    stages.update(probe.stages)
    form = list(check_buffer(shadow, frame))
    yield from form
    yield from check_counts(type(algorithm), probe, frame)
    if form:
        return
    if type(algorithm).exact is True:
        truth = cases.truth(name, algorithm.casters(prepared), algorithm.judged_as(prepared))
        yield from _wrong_samples(algorithm, buffer, truth, frame)
    yield from _again(algorithm, prepared, shadow, probe)
    if name in THREADED:
        yield from _on_threads(algorithm, prepared, shadow, probe)
    if _inputs(frame) != inputs:
        yield "it changes its inputs: mesh or view samples are not what they were"


def _wrong_samples(algorithm: Algorithm, buffer: ShadowBuffer, truth: Truth, frame: Frame) -> Iterator[str]:
    """Compare an exact method with the reference."""
    candidate, columns = frame.samples.candidate, frame.samples.columns
    errors = classify(algorithm, buffer, truth, frame)
    measured = accuracy.measure(buffer.shadow, errors, truth.ambiguous, candidate)
    if not measured.wrong:
        return
    classes = (accuracy.ErrorClass.FALSE_SHADOW, accuracy.ErrorClass.FALSE_LIGHT)
    row, column = divmod(int(np.flatnonzero(np.isin(errors, classes))[0]), columns)
    text = (f"{measured.wrong:,} of {measured.lit_candidates:,} lit candidates are wrong ({measured.false_shadow:,} dark "
            f"that are lit, {measured.false_light:,} lit that are dark), the first at column {column}, row {row}")
    for (down, right), words in _SHIFTS.items():
        moved = np.roll(buffer.shadow.reshape(-1, columns), (-down, -right), (0, 1)).reshape(-1)
        errors = accuracy.classify(moved, truth.shadow, truth.ambiguous, candidate)
        again = accuracy.measure(moved, errors, truth.ambiguous, candidate).wrong
        if again < SHIFT_SHARE * measured.wrong:
            text += f"; the shadow looks moved by one sample {words}"
    yield text


_SHIFTS = {(0, 1): "to the right", (0, -1): "to the left", (1, 0): "down", (-1, 0): "up"}

SHIFT_SHARE = 0.5
"""The shadow is called moved if moving it back leaves less than this share of the wrong samples: its borders alone, where
the image ends or samples are no candidates, stay wrong."""


def _again(algorithm: Algorithm, frame: Frame, shadow: NDArray[np.float32], probe: Probe) -> Iterator[str]:
    """Run once more, counting and not counting."""
    second = Probe(counting=True)
    if not np.array_equal(algorithm.shadows(frame, second).shadow, shadow):
        yield "it is not deterministic: a second call on the same input gives other shadows"
    elif _facts(second) != _facts(probe):
        difference = _first_difference(probe, second)
        yield f"it is not deterministic: a second call on the same input counts otherwise ({difference})"
    elif not np.array_equal(algorithm.shadows(frame, Probe()).shadow, shadow):
        yield "it gives other shadows when it does not count"


def _on_threads(algorithm: Algorithm, frame: Frame, shadow: NDArray[np.float32], probe: Probe) -> Iterator[str]:
    """Run on several numbers of threads."""
    before = jit.n_threads()
    try:
        for n_threads in THREADS:
            jit.set_threads(n_threads)
            other = Probe(counting=True)
            if not np.array_equal(algorithm.shadows(frame, other).shadow, shadow):
                yield f"its shadows depend on the number of threads ({n_threads} against {before})"
            elif _facts(other) != _facts(probe):
                yield f"its counts depend on the number of threads ({_first_difference(probe, other)})"
    finally:
        jit.set_threads(before)


def _facts(probe: Probe) -> tuple[Any, ...]:
    """All that a probe holds and that must not vary."""
    return (probe.counts, probe.levels, probe.largest, None if probe.heat is None else probe.heat.tobytes(),
            {name: values.tobytes() for name, values in probe.triangle_counts.items()})


def _first_difference(a: Probe, b: Probe) -> str:
    """Name a count that differs."""
    for name in sorted({*a.counts, *b.counts}):
        if a.counts.get(name) != b.counts.get(name):
            return f"{name}: {a.counts.get(name)} and {b.counts.get(name)}"
    return "the totals agree, their attribution differs"


def _inputs(frame: Frame) -> str:
    """Digest of what a method is given."""
    digest = hashlib.sha256()
    for array in (frame.mesh.vertices, frame.mesh.triangles, frame.samples.position, frame.samples.depth,
                  frame.samples.normal, frame.samples.candidate):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def fingerprint(algorithm: Algorithm, cases: Cases) -> str:
    """Digest of a method's shadows and counts on the threaded cases, to be compared between processes."""
    digest = hashlib.sha256()
    for name in THREADED:
        case, frame = cases.get(name)
        if check_capabilities(algorithm, case)[0] is None:
            prepared = Frame(frame.mesh, frame.light, frame.camera, frame.image, frame.samples, frame.bias,
                             algorithm.prepare(frame.mesh))
            probe = Probe(counting=True)
            digest.update(algorithm.shadows(prepared, probe).shadow.tobytes())
            digest.update(repr(_facts(probe)).encode())
    return digest.hexdigest()
