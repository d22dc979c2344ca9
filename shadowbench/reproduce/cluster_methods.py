"""The methods that Sintorn et al. 2014 compare, their names and colours in figures, and numbers of claims about them."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from shadowbench.reproduce.items import Row
from shadowbench.reproduce.rows import mean, values, variation
from shadowbench.reproduce.variants import Value, Variant, by_frame, column_ratio, frame_ratios, share_at_most_one, variant

CULLED = "back_faces"
CLUSTER, ALL_CASTERS = variant("cluster", casters=CULLED), variant("cluster")
PTSV, Z_PASS = variant("ptsv", casters=CULLED), variant("z_pass")
IMPLICIT = variant("cluster", bounds="implicit", casters=CULLED, culling_planes="none")
WEDGE = variant("cluster", bounds="implicit", casters=CULLED)
ONE_PASS = variant("cluster", casters=CULLED, passes="one")
SPLIT_3, SPLIT_4 = (variant("cluster", casters=CULLED, split_level=level) for level in (3, 4))
COMPACT = variant("cluster", casters=CULLED, layout="compact")
STEPS = (variant("cluster", bounds="implicit", casters=CULLED, culling_planes="none", passes="one"),
         variant("cluster", bounds="implicit", casters=CULLED, passes="one"), ONE_PASS, CLUSTER)
"""Figure 8: the baseline, with wedge planes, with explicit bounds, with two passes."""

STEP_NAMES = ("baseline", "+ wedge planes", "+ explicit bounds", "+ two passes")
STAGES = {"hierarchy": "build hierarchy", "frustum_setup": "triangle setup", "traversal": "traversal", "merge": "merge"}
"""Stages of `cluster` and their names in Figure 5."""


def worst(a: Variant, b: Variant, column: str, scene: str) -> Value:
    """Largest ratio of method a to method b over the frames."""
    return lambda rows: max(frame_ratios(a, column, b, column, scene=scene)(rows))


def time_over_cluster(method: Variant) -> Value:
    """Time of a method over that of the cluster hierarchy; z-pass without the time to count the volumes around the eye."""
    return lambda rows: ((mean(rows, "seconds", method=method.label) - mean(rows, "stage.eye_count", method=method.label))
                         / mean(rows, "seconds", method=CLUSTER.label))


def near_over_elsewhere(method: Variant) -> Value:
    """Mean tests per sample near a depth discontinuity over the mean elsewhere."""
    return column_ratio(method, "tests_near", method, "tests_elsewhere")


def build_share(scene: str) -> Value:
    """Share of the building of the hierarchy in the whole time, in per cent."""
    return lambda rows: 100.0 * mean(rows, "stage.hierarchy", method=CLUSTER.label, scene=scene) / mean(
        rows, "seconds", method=CLUSTER.label, scene=scene)


def lead(other: Variant, scene: str) -> Value:
    """Per cent of the frames in which the cluster hierarchy is at least as fast as another method."""
    return share_at_most_one(frame_ratios(CLUSTER, "seconds", other, "seconds", scene=scene))


def largest_over_mean(method: Variant) -> Value:
    """Iterations of the largest job over the mean of the 1024 largest."""
    return lambda rows: values(rows, "iterations", method=method.label)[0] / mean(rows, "iterations", method=method.label)


def build_variation(scene: str) -> Value:
    """Coefficient of variation of the time to build the hierarchy, along the path."""
    return lambda rows: variation(rows, "stage.hierarchy", method=CLUSTER.label, scene=scene)


def spikes(scene: str) -> Value:
    """Slowest traversal over the median one along the path: with one pass over with two."""
    return lambda rows: _slowest(rows, ONE_PASS, scene) / _slowest(rows, CLUSTER, scene)


def _slowest(rows: Sequence[Row], method: Variant, scene: str) -> float:
    """Longest traversal over the median one along the path."""
    found = list(by_frame(rows, method, "stage.traversal", scene=scene).values())
    return max(found) / statistics.median(found)


def hd_over(size: int, column: str) -> Value:
    """Column at 1920 x 1080 over that at a lower resolution, which its width names."""
    return lambda rows: mean(rows, column, published_size=1920) / mean(rows, column, published_size=size)


def growth(column: str, other: str, size: int) -> Value:
    """Growth of a column over that of another between a resolution, which its width names, and 1920 x 1080."""
    return lambda rows: hd_over(size, column)(rows) / hd_over(size, other)(rows)


def operations_per_sample(width: int, height: int) -> Value:
    """Operations per sample at 1920 x 1080 over those at a lower resolution."""
    return lambda rows: hd_over(width, "test_and_set")(rows) * (width * height) / (1920 * 1080)


def largest_memory(name: str, unit: float) -> Value:
    """Largest size of a structure of the compact layout, in a unit of bytes."""
    return lambda rows: max(values(rows, f"memory.{name}", method=COMPACT.label)) / unit
