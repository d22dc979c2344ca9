"""The lane tests against NumPy, bit for bit."""

import os
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.jit import kernel
from shadowbench.kernels import lanes

SIXTY_FOUR = np.uint64(0xFFFFFFFFFFFFFFFF)


class Planes(NamedTuple):
    rows: np.ndarray


class Boxes(NamedTuple):
    y: np.ndarray
    x: np.ndarray
    r: np.ndarray


@kernel
def run_all(planes, row, boxes, n_chunks, x0, x_step, y0, r0, alive):
    eye = lanes.outside_eye_planes(planes, row, boxes, n_chunks, x0, x_step, y0, r0, alive)
    wedge = lanes.outside_wedge_planes(planes, row, boxes, n_chunks, x0, x_step, y0, r0, alive)
    outside, partial = lanes.classify_boxes(planes, row, boxes, n_chunks, x0, x_step, y0, r0, alive)
    samples = lanes.classify_samples(planes, row, boxes, n_chunks, x0, x_step, y0, r0, alive)
    return eye, wedge, outside, partial, samples[0], samples[1]


def to_mask(flags):
    return sum(1 << i for i, flag in enumerate(flags) if flag)


def twin(rows, axes, n_rows, n_coordinates, accept):
    """Largest float32 value over the rows at one corner of each box; `accept` is None for samples."""
    largest = None
    for a, b, c, d in rows[:n_rows]:
        corner = []
        for coefficient, (low, high) in zip((a, b, c), axes, strict=True):
            at_low = accept is None or np.signbit(coefficient) == accept
            corner.append(low if at_low else high)
        value = a * corner[0] + (b * corner[1] + d)
        value = value + c * corner[2] if n_coordinates == 3 else value
        largest = value if largest is None else np.maximum(largest, value)
    return largest


def expected(rows, axes, alive):
    """The six masks of `run_all`; chunks without a lane alive give zero."""
    limit = np.float32(lanes.UNDECIDED)
    masks = [twin(rows, axes, lanes.N_EYE_PLANES, 2, False) > limit,
             twin(rows, axes, lanes.N_WEDGE_PLANES, 3, False) > limit,
             twin(rows, axes, lanes.N_FRUSTUM_PLANES, 3, False) > limit,
             twin(rows, axes, lanes.N_FRUSTUM_PLANES, 3, True) >= -limit,
             twin(rows, axes, lanes.N_FRUSTUM_PLANES, 3, None) > limit,
             twin(rows, axes, lanes.N_FRUSTUM_PLANES, 3, None) >= -limit]
    chunks = to_mask(np.repeat([alive >> (8 * c) & 255 != 0 for c in range(8)], lanes.LANES))
    return [to_mask(mask) & chunks for mask in masks]


def example(seed, n_chunks, shared_x):
    """Random rows and boxes, small values included so that all three outcomes occur; places offset in the arrays."""
    rng = np.random.default_rng(seed)
    n = n_chunks * lanes.LANES
    rows = (rng.normal(size=(7, 4)) * rng.choice([0.0, 1.0, 1.0, 1e-7], (7, 4))).astype(np.float32)
    boxes = []
    for _ in range(3):
        a = (rng.normal(size=n) * rng.choice([1.0, 1e-7])).astype(np.float32)
        boxes.append((a, a + np.abs(rng.normal(size=n) * 0.2).astype(np.float32)))
    if shared_x:
        boxes[0] = tuple(np.tile(v[: lanes.LANES], n_chunks) for v in boxes[0])
    pad = np.full(3, np.nan, np.float32)
    stored = [np.concatenate([pad[:k + 1], *([v[: lanes.LANES] for v in box] if shared_x and k == 0 else box)])
              for k, box in enumerate(boxes)]
    flat = np.concatenate([pad, rows.reshape(-1)])
    x, y, r = stored
    arguments = (Planes(flat), 3, Boxes(y, x, r), n_chunks, 1, 0 if shared_x else lanes.LANES, 2, 3)
    return rows, boxes, arguments


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 10**6), st.sampled_from([1, 2, 4, 8]), st.booleans(),
       st.one_of(st.just(2**64 - 1), st.integers(0, 2**64 - 1), st.sampled_from([0, 1 << 9, 255 << 16])))
def test_masks_equal_numpy(seed, n_chunks, shared_x, alive):
    alive &= (1 << 8 * n_chunks) - 1
    rows, boxes, arguments = example(seed, n_chunks, shared_x)
    masks = run_all(*arguments, np.uint64(alive))
    assert [int(m) for m in masks] == expected(rows, boxes, alive)


@kernel
def bits_of(mask):
    return lanes.lowest_bit(mask), lanes.count_bits(mask)


@pytest.mark.parametrize("mask", [1, 2, 3 << 40, 1 << 63, 2**64 - 1, 0b10110000])
def test_bits(mask):
    assert bits_of(np.uint64(mask)) == ((mask & -mask).bit_length() - 1, mask.bit_count())


def digest():
    """All masks of many examples, as text."""
    results = []
    for seed in range(40):
        _, _, arguments = example(seed, (1, 2, 4, 8)[seed % 4], seed % 3 == 0)
        results += [int(m) for m in run_all(*arguments, SIXTY_FOUR)]
    return " ".join(map(str, results))


@pytest.mark.parametrize("cpu", ["generic", "host"])
def test_same_bits_on_any_cpu(cpu, tmp_path):
    environment = dict(os.environ, NUMBA_CPU_NAME=cpu, NUMBA_CACHE_DIR=str(tmp_path))
    if cpu == "generic":
        environment["NUMBA_CPU_FEATURES"] = ""
    root = os.path.dirname(os.path.dirname(__file__))
    code = f"import sys; sys.path.insert(0, {root!r}); from tests import test_lanes; print(test_lanes.digest())"
    out = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert out.stdout.strip() == digest()


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 10**6))
def test_undecided_bounds_the_error(seed):
    """The exact value of a scaled row differs from the float32 value by less than `UNDECIDED`."""
    rng = np.random.default_rng(seed)
    n = 500
    reach = np.exp(rng.uniform(-8, 8, 3))
    x, y = (rng.uniform(-1, 1, n) * reach[k] for k in (0, 1))
    depth = 1 / (reach[2] * rng.uniform(0, 1, n) ** 3)
    row = rng.normal(size=4) * np.exp(rng.uniform(-6, 6, 4))
    weights = np.array([lanes.A_WEIGHT * reach[0], lanes.B_WEIGHT * reach[1], lanes.C_WEIGHT * reach[2],
                        lanes.D_WEIGHT])
    row /= (np.abs(row) * weights).sum()
    a, b, c, d = row.astype(np.float32)
    x32, y32, r32 = x.astype(np.float32), y.astype(np.float32), np.float32(1) / depth.astype(np.float32)
    value = (a * x32 + (b * y32 + d)) + c * r32
    exact = row[0] * x + row[1] * y + row[2] / depth + row[3]
    assert np.abs(value - exact).max() < lanes.UNDECIDED
