"""What the items about clusters are computed with: variants, ratios by frame, jobs, tests near depth discontinuities."""

import numpy as np
import pytest

from shadowbench import image_io
from shadowbench.algorithm_specs import parse_algorithm_spec, validate_params
from shadowbench.reproduce import cluster_methods
from shadowbench.reproduce.cluster_rows import NEAR_STEP, STEP_OF_DEPTH, add_tests_near_steps, counted, job_rows
from shadowbench.reproduce.depth_steps import near_steps
from shadowbench.reproduce.items import Measured, Measurement
from shadowbench.reproduce.variants import (
    Variant,
    by_frame,
    column_ratio,
    frame_ratios,
    ratio,
    share_at_most_one,
    variant,
)
from shadowbench.results import CellResult, make_label

A, B = Variant("a", "a"), Variant("b", "b")
ROWS = [{"scene": "s", "frame": frame, "method": method, "v": v, "w": 2 * v, "rank": frame}
        for method, series in (("a", (6, 2, 4)), ("b", (3, 4))) for frame, v in enumerate(series)]


def cell(name, **fields):
    measurement = Measurement("gate", 64, (0,), (name,))
    return Measured(measurement, CellResult(key="k", scene="gate", frame=0, algorithm=name, label=name, params={},
                                            status="done", **fields))


@pytest.mark.parametrize("found", [value for value in vars(cluster_methods).values() if isinstance(value, Variant)],
                         ids=lambda found: found.label)
def test_labels_are_those_of_the_specs(found):
    """What a variant says its label is, is what its cells are labelled with; so no option is a default."""
    name, params = parse_algorithm_spec(found.spec)
    assert make_label(name, validate_params(name, params).model_dump(exclude_defaults=True)) == found.label


def test_variants_name_options_in_order():
    assert variant("cluster") == ("cluster", "cluster")
    expected = ("cluster[casters=all,passes=one]", "cluster+casters=all+passes=one")
    assert variant("cluster", passes="one", casters="all") == expected


def test_ratios_over_and_by_frames():
    assert ratio(A, B, "v", scene="s")(ROWS) == pytest.approx(4.0 / 3.5)
    assert column_ratio(A, "w", B, "v")(ROWS) == pytest.approx(8.0 / 3.5)
    assert by_frame(ROWS, A, "v") == {0: 6.0, 1: 2.0, 2: 4.0}
    assert frame_ratios(A, "v", B, "v")(ROWS) == [2.0, 0.5]
    assert share_at_most_one(frame_ratios(A, "v", B, "v"))(ROWS) == 50.0


def test_open_tests_of_ptsv_leave_out_what_is_empty_or_done():
    counts = {"test_and_set": 500, "trivial_accepts": 1, "trivial_rejects": 20, "refinements": 3, "sample_tests": 96}
    first, second = counted("sample_tests")([cell("ptsv", counts=counts), cell("cluster", counts=counts)])
    assert (first["test_and_set"], first["open_tests"], first["sample_tests"]) == (500, 120, 96)
    assert second["open_tests"] == 500


def test_jobs_by_rank():
    rows = job_rows([cell("cluster", largest={"iterations": [9, 4, 4]})])
    assert [(row["rank"], row["iterations"]) for row in rows] == [(1, 9), (2, 4), (3, 4)]
    assert cluster_methods.largest_over_mean(Variant("cluster", "cluster"))(rows) == pytest.approx(9 / (17 / 3))


def slow_near_steps(depth):
    """Twin of `near_steps`: every sample looks at every pair of neighbours in its window."""
    height, width = depth.shape
    found = np.zeros(depth.shape, bool)
    steps = []
    for i in range(height):
        for j in range(width):
            for k, m in ((i + 1, j), (i, j + 1)):
                if k < height and m < width:
                    pair = sorted((float(depth[i, j]), float(depth[k, m])))
                    if pair[1] < np.inf and pair[1] >= STEP_OF_DEPTH * pair[0]:
                        steps += [(i, j), (k, m)]
    for i, j in steps:
        found[max(i - NEAR_STEP, 0):i + NEAR_STEP + 1, max(j - NEAR_STEP, 0):j + NEAR_STEP + 1] = True
    return found


def test_samples_near_steps_of_depth():
    rng = np.random.default_rng(4)
    for kind in range(4):
        depth = 10.0 + 0.1 * rng.random((40, 56))
        for _ in range(kind):
            i, j = rng.integers(0, 40), rng.integers(0, 56)
            depth[i:i + 3, j:j + 5] = rng.choice([2.0, 14.0, 15.5, np.inf])
        found = near_steps(depth)
        assert np.array_equal(found, slow_near_steps(depth))
    assert not near_steps(np.where(np.arange(40)[:, None] < 9, np.inf, np.full((40, 5), 3.0))).any()
    assert near_steps(np.where(np.arange(40)[:, None] < 9, 4.5, np.full((40, 5), 3.0))).sum() == 5 * 17 + 5


def test_tests_near_and_elsewhere(tmp_path):
    depth = np.where(np.arange(40)[None] < 20, 3.0, np.full((30, 40), 9.0)).astype(np.float32)
    near = near_steps(depth)
    candidate = (np.arange(30)[:, None] < 20) & np.ones((30, 40), bool)
    image_io.write_exr(tmp_path / "g.exr", {"depth": depth, "candidate": candidate.astype(np.uint32)})
    shadow = np.zeros((30, 40), np.float32)
    shadow[5, 39], shadow[25, 39], shadow[0, 20] = 1.0, 1.0, 1.0         # 4 edge samples, none, 4 edge samples
    image_io.write_exr(tmp_path / "s.exr", {"tests": np.where(candidate, np.where(near, 7, 2), 99).astype(np.uint32),
                                            "shadow": shadow})
    files = {"gbuffer_exr": tmp_path / "g.exr", "shadow_exr": tmp_path / "s.exr"}
    row, = add_tests_near_steps([{"method": "ptsv", "test_and_set": 1}], {"ptsv": files})
    assert row == {"method": "ptsv", "test_and_set": 1, "near_share": pytest.approx(near[:20].sum() / 800, abs=1e-6),
                   "tests_near": 7.0, "tests_elsewhere": 2.0,
                   "edges_near": pytest.approx(100 * 4 / near[:20].sum(), abs=1e-3),
                   "edges_elsewhere": pytest.approx(100 * 4 / (~near[:20]).sum(), abs=1e-3)}
    assert cluster_methods.near_over_elsewhere(Variant("ptsv", "ptsv"))([row]) == 3.5
