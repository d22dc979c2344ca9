"""The certified reference for casters that let light through.

Which triangles a sample's light crosses is decided by the same predicate as every shadow, certified in the same way; the
transmittances of all of them are multiplied in float64.
"""

from __future__ import annotations

from contextlib import nullcontext
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import FloatArray, Mesh, cross, dot
from shadowbench.reference.certified import (
    LARGEST_BATCH,
    LIST_ENTRIES,
    PAIR_CAPACITY,
    Search,
    StageFactory,
    bias_floor,
    certified_shadows,
    checked,
)
from shadowbench.reference.crossings import Pairs, list_crossings
from shadowbench.reference.exact import exact_flags
from shadowbench.reference.frusta import Frusta
from shadowbench.reference.light_space import make_light_space
from shadowbench.reference.light_tree import build_light_tree
from shadowbench.reference.predicates import (
    BIAS_DOUBLED,
    BIAS_FLOOR,
    PLANES_IN,
    PLANES_OUT,
    SHADOWED,
)
from shadowbench.surfaces import look_up, texture_coordinates, transmittance

CUTOFF_TIE = 1e-6
"""An opacity this close to the cutoff of a masked material is a tie: float64 texture coordinates reach further."""


class TransparentResult(NamedTuple):
    """The truth about a set of samples.

    Attributes
    ----------
    transmittance : float64 (n, 1) or (n, 3), share of the light that arrives.
    ambiguous : bool (n,), True where it changes if side planes move by the tie distance or the bias within its range, or
        where a masked material is within `CUTOFF_TIE` of its cutoff.
    crossings : int64 (n,), transparent triangles between the sample and the light.
    """

    transmittance: FloatArray
    ambiguous: NDArray[np.bool_]
    crossings: NDArray[np.int64]


def certified_transmittance(mesh: Mesh, light: FloatArray, positions: FloatArray, bias: float, tie_distance: FloatArray,
                            colored: bool, casters: NDArray[np.bool_] | None = None, *,
                            stage: StageFactory = nullcontext) -> TransparentResult:
    """Find the light that arrives at each sample.

    Parameters
    ----------
    mesh : triangles with materials.
    colored : True for red, green and blue apart.
    (the others as in `certified_shadows`)

    Raises
    ------
    ValueError
        If an input is not finite or out of range.
    """
    corners, light, positions, tie_distance, casters = checked(mesh.corners, light, positions, bias, tie_distance, casters)
    opaque = np.array([m.is_opaque for m in mesh.materials], np.bool_)[mesh.material]
    dark = certified_shadows(corners, light, positions, bias, tie_distance, casters & opaque, stage=stage)
    arriving = np.repeat(np.where(dark.shadow, 0.0, 1.0)[:, None], 3 if colored else 1, axis=1)
    result = TransparentResult(arriving, dark.ambiguous.copy(), np.zeros(len(positions), np.int64))
    # What is surely in the shadow of something opaque needs no list
    waiting = np.flatnonzero(~dark.shadow | dark.ambiguous)
    clear = np.flatnonzero(casters & ~opaque)
    if len(waiting) and len(clear):
        _multiply(mesh, clear, light, positions, bias, tie_distance, colored, waiting, result, stage)
    return result


def _multiply(mesh: Mesh, triangles: NDArray[np.int64], light: FloatArray, positions: FloatArray, bias: float,
              tie_distance: FloatArray, colored: bool, waiting: NDArray[np.int64], result: TransparentResult,
              stage: StageFactory) -> None:
    """Multiply what all crossed triangles let through into the waiting samples."""
    floor = min(bias_floor(mesh.corners, positions), bias)
    with stage("hierarchy"):
        space = make_light_space(light, positions[waiting])
        tree = build_light_tree(space, positions[waiting], tie_distance[waiting])
    search = _CrossingSearch(tree, space, np.array([floor, bias, 2.0 * bias]), False, stage)
    search.start(mesh, colored, waiting, result)
    size = max(1, min(LARGEST_BATCH, LIST_ENTRIES // search.n_work))
    for first in range(0, len(triangles), size):
        search.add_batch(triangles[first:first + size])


class _CrossingSearch(Search):
    """The reference's search, listing every crossing instead of stopping at the first."""

    def start(self, mesh: Mesh, colored: bool, waiting: NDArray[np.int64], result: TransparentResult) -> None:
        """Say what is looked at and where the answers go."""
        self.mesh, self.colored, self.result = mesh, colored, result
        self.sample = waiting[self.tree.order]
        shape = (self.n_work, PAIR_CAPACITY)
        self.pairs = Pairs(np.empty(shape, np.int32), np.empty(shape, np.int32), np.empty(shape, np.uint8),
                           np.empty(shape, np.uint8), np.zeros(self.n_work, np.int64))

    def add_batch(self, triangles: NDArray[np.int64]) -> None:
        """Let a batch of the mesh's triangles cast."""
        self.triangles = triangles
        corners = np.ascontiguousarray(self.mesh.corners[triangles])
        self.add_triangles(corners, np.ones(len(corners), np.bool_))

    def _walk(self, frusta: Frusta, corners: FloatArray, lists: NDArray[np.int32], ends: NDArray[np.int64]) -> None:
        list_crossings(self.tree, frusta, corners, self.space, self.biases, lists, ends, self.work.next_item, self.pairs)

    def _settle(self, frusta: Frusta, corners: FloatArray) -> None:
        """Settle what is undecided, and multiply what the crossed triangles let through."""
        filled = np.arange(PAIR_CAPACITY) < self.pairs.filled[:, None]
        samples, triangles, flags, undecided = (pairs[filled] for pairs in self.pairs[:4])
        unsure = np.flatnonzero(undecided)
        self.exact_tests += len(unsure)
        which = triangles[unsure]
        flags[unsure] |= exact_flags(corners[which], frusta.facing[which], self.space.light,
                                     self.tree.position[samples[unsure]], self.tree.tie[samples[unsure]], self.biases)
        crossed = (flags & SHADOWED) != 0
        tie = np.where(crossed, (flags & (PLANES_IN | BIAS_DOUBLED)) != PLANES_IN | BIAS_DOUBLED,
                       (flags & (PLANES_OUT | BIAS_FLOOR)) != 0)
        passing, on_cutoff = self._passing(self.triangles[triangles], self.tree.position[samples])
        result, where = self.result, self.sample[samples]
        np.multiply.at(result.transmittance, where[crossed], passing[crossed])
        np.add.at(result.crossings, where[crossed], 1)
        result.ambiguous[where[on_cutoff | (tie & (passing < 1.0).any(axis=1))]] = True

    def _passing(self, triangles: NDArray[np.int64], positions: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """What each triangle lets through on the way to a sample, and whether that hangs on a cutoff."""
        mesh, n = self.mesh, len(triangles)
        passing, on_cutoff = np.ones((n, 3 if self.colored else 1)), np.zeros(n, np.bool_)
        of_material = mesh.material[triangles]
        for index in np.unique(of_material):
            material, mine = mesh.materials[index], np.flatnonzero(of_material == index)
            uv = np.zeros((len(mine), 2))
            if material.varies(self.colored):
                crossing = self._crossing_points(mesh.corners[triangles[mine]], positions[mine])
                uv = texture_coordinates(mesh, triangles[mine], crossing)
            passing[mine] = transmittance(material, uv, self.colored)
            if material.alpha_cutoff is not None and material.alpha_texture is not None:
                opacity = look_up(material.alpha_texture, uv)[:, 3] * material.alpha
                on_cutoff[mine] = np.abs(opacity - material.alpha_cutoff) < CUTOFF_TIE
        return passing, on_cutoff

    def _crossing_points(self, corners: FloatArray, positions: FloatArray) -> FloatArray:
        """Where the light's way to each sample crosses a triangle's plane, world."""
        light = self.space.light
        a = corners[:, 0]
        normal = cross(corners[:, 1] - a, corners[:, 2] - a)
        to_light = light[:3] - light[3] * positions
        step = dot(normal, a - positions) / dot(normal, to_light)
        return np.asarray(positions + step[:, None] * to_light)
