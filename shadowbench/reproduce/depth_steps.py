"""Depth discontinuities of an image, and the tests that a method spends near them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench import image_io
from shadowbench.reproduce.cluster_rows import NEAR_STEP, STEP_OF_DEPTH


def tests_near_steps(files: Mapping[str, Path]) -> dict[str, float]:
    """Mean tests per lit candidate near a depth discontinuity and elsewhere, and the share of the candidates near one.

    Also, in per cent, how many of the candidates here and there lie at a shadow's edge: the tests that no tree can save.

    Parameters
    ----------
    files : one method's shadows and tests per sample, ``shadow_exr``, and its view samples, ``gbuffer_exr``.
    """
    samples, answer = image_io.read_exr(files["gbuffer_exr"]), image_io.read_exr(files["shadow_exr"])
    tests = answer["tests"]
    candidate = samples["candidate"] != 0
    edge = shadow_edges(answer["shadow"], candidate)
    near = near_steps(samples["depth"])
    near, elsewhere = near & candidate, ~near & candidate
    return {"near_share": round(float(near.sum() / candidate.sum()), 6),
            "tests_near": round(float(tests[near].mean()), 3), "tests_elsewhere": round(float(tests[elsewhere].mean()), 3),
            "edges_near": round(100.0 * float(edge[near].mean()), 3),
            "edges_elsewhere": round(100.0 * float(edge[elsewhere].mean()), 3)}


def shadow_edges(shadow: NDArray[np.floating], candidate: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which lit candidates have one beside, above or below them with another answer; all are (rows, columns)."""
    edge: NDArray[np.bool_] = np.zeros(shadow.shape, np.bool_)
    for axis in (0, 1):
        answer, known = np.moveaxis(shadow, axis, 0), np.moveaxis(candidate, axis, 0)
        differs = (answer[:-1] != answer[1:]) & known[:-1] & known[1:]
        along = np.moveaxis(edge, axis, 0)
        along[:-1] |= differs
        along[1:] |= differs
    return edge


def near_steps(depth: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Tell which samples lie within `NEAR_STEP` rows and columns of a depth discontinuity.

    Parameters
    ----------
    depth : (rows, columns), inf on background, which makes no discontinuity: no hierarchy holds it.
    """
    at: NDArray[np.bool_] = np.zeros(depth.shape, np.bool_)
    for axis in (0, 1):
        a, b = np.moveaxis(depth, axis, 0)[:-1], np.moveaxis(depth, axis, 0)[1:]
        step = np.isfinite(a) & np.isfinite(b) & (np.maximum(a, b) >= STEP_OF_DEPTH * np.minimum(a, b))
        along = np.moveaxis(at, axis, 0)
        along[:-1] |= step
        along[1:] |= step
    # Grow by whole rows, then by whole columns.
    for axis in (0, 1):
        padded = np.pad(at, [(NEAR_STEP, NEAR_STEP) if i == axis else (0, 0) for i in (0, 1)])
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEAR_STEP + 1, axis)
        at = np.asarray(windows.any(axis=-1))
    return at
