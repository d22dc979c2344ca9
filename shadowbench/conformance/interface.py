"""What the class of a method must declare, and what its counts must satisfy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from shadowbench.algorithms.base import Algorithm, AlgorithmParams
from shadowbench.conformance.cases import Case
from shadowbench.counters import COUNTERS
from shadowbench.geometry import Frame
from shadowbench.plugins import why_unusable
from shadowbench.probe import Probe

TOTALS = ("test_and_set", "all_work")


def check_class(method: type[Algorithm]) -> Iterator[str]:
    """Say what is wrong with a method's declarations, one sentence each."""
    reason = why_unusable(method)
    if reason:
        yield reason
        return
    for key in ("title", "paper"):
        if not isinstance(getattr(method, key), str) or not getattr(method, key).strip():
            yield f"`{key}` must be a text"
    if not isinstance(method.exact, bool):
        yield "`exact` must be True or False"
    for key in ("stages", "counters"):
        value = getattr(method, key)
        if not isinstance(value, tuple) or not all(isinstance(item, str) for item in value) or len(set(value)) < len(value):
            yield f"`{key}` must be a tuple of different names"
    for name in method.counters:
        if name in TOTALS:
            yield f"the counter {name} is a total: declare its terms"
        elif name not in COUNTERS:
            yield f"the counter {name!r} is not in the registry: see `shadowbench list counters`"
    yield from _check_params(method.Params)


def _check_params(params: type[AlgorithmParams]) -> Iterator[str]:
    """Say what is wrong with a model of parameters."""
    if not params.model_config.get("frozen") or params.model_config.get("extra") != "forbid":
        yield "its Params must stay frozen and must refuse unknown names, as AlgorithmParams does"
    for name, field in params.model_fields.items():
        if not field.description:
            yield f"the parameter {name} has no line of help: declare it with `parameter(default, help)`"


def check_buffer(shadow: Any, frame: Frame) -> Iterator[str]:
    """Say what is wrong with the form of a shadow buffer."""
    candidate = frame.samples.candidate
    if not isinstance(shadow, np.ndarray) or shadow.dtype != np.float32 or shadow.shape != candidate.shape:
        form = f"{shadow.dtype} {shadow.shape}" if isinstance(shadow, np.ndarray) else type(shadow).__name__
        yield f"the shadow buffer is {form}, but must be float32 {candidate.shape}"
        return
    if not np.all((shadow >= 0) & (shadow <= 1)):
        yield "the shadow buffer holds values outside 0 to 1"
    n_dark = int(np.count_nonzero(shadow[~candidate]))
    if n_dark:
        yield f"{n_dark} samples that are no lit candidates are not 0 in the shadow buffer"


def check_counts(method: type[Algorithm], probe: Probe, frame: Frame) -> Iterator[str]:
    """Say which rules the counts of one call break."""
    for name, value in probe.counts.items():
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
            yield f"the count of {name} is {value!r}: counts are integers from 0 up"
        if name not in method.counters:
            yield f"it counts {name}, which its `counters` do not declare"
    for name in probe.stages:
        if name not in method.stages:
            yield f"it passes the stage {name!r}, which its `stages` do not declare"
    for name, levels in probe.levels.items():
        if min(levels, default=0) < 0 or sum(levels) != probe.counts.get(name):
            yield f"the levels of {name} sum to {sum(levels):,}, but its total is {probe.counts.get(name, 0):,}"
    totals = {**probe.counts, **{name: probe.all_counts()[name] for name in TOTALS}}
    for name, per_triangle in probe.triangle_counts.items():
        if per_triangle.shape != (frame.mesh.n_triangles,):
            yield f"the counts per triangle of {name} have the shape {per_triangle.shape}, not ({frame.mesh.n_triangles},)"
        elif per_triangle.min(initial=0) < 0 or per_triangle.sum() != totals.get(name):
            yield f"{name} sums to {per_triangle.sum():,} over the triangles, but its total is {totals.get(name, 0):,}"
    if probe.heat is not None:
        if probe.heat.shape != frame.samples.candidate.shape:
            yield f"the heat map has the shape {probe.heat.shape}, not {frame.samples.candidate.shape}"
        elif probe.heat.min(initial=0) < 0:
            yield "the heat map holds negative numbers"


def check_capabilities(algorithm: Algorithm, case: Case) -> tuple[str | None, list[str]]:
    """Ask if a case is supported.

    Returns
    -------
    reason : why not, or None.
    problems : what is wrong with the answer itself.
    """
    scene: Any = case.scene()
    reason = algorithm.unsupported(scene)
    if reason is not None and (not isinstance(reason, str) or not reason.strip() or "\n" in reason):
        return "?", [f"`unsupported` must return None or one sentence, not {reason!r}"]
    return reason, []
