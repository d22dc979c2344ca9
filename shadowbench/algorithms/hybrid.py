"""Shadow maps with shadow volumes at shadow edges.

Eric Chan, Fredo Durand: "An Efficient Hybrid Shadow Rendering Algorithm", Eurographics Symposium on Rendering 2004, pp.
185-195.

Idea: a shadow map tells which samples lie near a shadow edge: those whose comparisons with the four nearest depths
disagree. Shadow volumes, which are exact but cost much fill, are drawn on these samples alone. For all others the map
decides.

Stages
------
casters, edges : which triangles cast, and the silhouettes of their shadow volumes.
fit : choose the projection for the lit candidates (the paper leaves the view to the user).
map : sec. 3, step 1: nearest depth per texel.
classify : sec. 3, step 2: find silhouette samples among the lit candidates.
mask : sec. 4, sec. 6.2: the computation mask, in tiles.
volumes, stencil : sec. 3, step 3: z-fail shadow volumes, drawn where the mask is on.
resolve : sec. 3, step 4: the stencil value decides where the mask is on, the map everywhere else.

Differences from the paper
--------------------------
* The mask is kept per tile (`mask_tile`): volumes are drawn on every sample of a tile that holds a silhouette sample, and
  their answer, which is exact, is used on all of them. The paper's hardware rejects tiles early, too, but then drops the
  tile's other samples one by one, which is `mask_tile: 1` here.
* Volumes are those of the z-fail method, with edge multiplicities: any triangle soup will do, not closed meshes alone.
* Point lights inside the scene get the faces of a cube; the paper is restricted to one map (sec. 6.1).
* The receiver is taken as a plane, as in the shadow map method. The paper gives a smaller bias and lets volumes repair
  wrong self-shadowing; lower `slope_bias` does that.
* `undersampled_only` leaves out silhouette samples with r < 1 (sec. 6.3). There the nearest depth decides.

Limits: on the mask the answer is exact. Every error lies outside it, where four comparisons agree on the wrong answer: a
caster that the map misses, or a bias that hides one. (With `undersampled_only`, also where samples were left out.)
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Mesh, Probe, ShadowBuffer, parameter
from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels import stencil_volumes
from shadowbench.kernels.depth_maps import (
    ALL_LIT,
    ALL_SHADOWED,
    CELL_BORDER,
    TEXEL_REACH,
    Receivers,
    compare_corners,
    render_depth,
)
from shadowbench.kernels.edges import edge_multiplicities
from shadowbench.kernels.light_maps import LightMaps, cell, fit_light_maps, locate
from shadowbench.kernels.projection import N_WORKERS, chunk
from shadowbench.kernels.shadow_volumes import find_casters
from shadowbench.kernels.volume_extrusion import VolumeKind, make_faces
from shadowbench.kernels.volume_faces import Faces
from shadowbench.kernels.volume_limits import no_limits
from shadowbench.kernels.volume_polygons import volume_view

STENCIL_BITS = 32
CORNERS_PER_SAMPLE = 4

SHADOWED_BY_MAP, LIT_BY_MAP = (215, 48, 39), (69, 117, 180)
SHADOWED_BY_VOLUMES, LIT_BY_VOLUMES = (0, 0, 0), (26, 152, 80)
UNLIT, BACKGROUND = (90, 90, 90), (255, 255, 255)
"""Colours of the classification picture (Fig. 6): red, blue, black and green, and two grays."""


class Params(AlgorithmParams):
    """Parameters of `Hybrid`."""

    resolution: int = parameter(1024, "texels along the side of the map, or of each face of the cube", ge=1, le=16384)
    projection: Literal["auto", "spot", "cube"] = parameter(
        "auto", "view of a point light; auto is spot if the lit candidates fit a cone of 120 degrees, else cube",
        paper="spot")
    mask_tile: Literal[1, 8, 16] = parameter(
        1, "side of the tiles, in samples, in which the computation mask rejects samples")
    undersampled_only: bool = parameter(
        False, "draw volumes only where a texel of the map is larger than a pixel")
    casters: Literal["all", "back_faces", "auto"] = parameter(
        "all", "triangles that cast: all, those facing away from the light, or the latter on closed bodies only")
    bias: float = parameter(1.0, "depth bias of the map, in units of the scene's bias", ge=0.0, paper=None)
    slope_bias: float = parameter(
        1.0, "scales the reach, in texels, within which a receiver's own plane can't shadow it; 0: constant bias only",
        ge=0.0, paper=0.0)


class Classified(NamedTuple):
    """What the map says about the samples.

    Attributes
    ----------
    silhouette : bool (n_samples,), candidates whose four comparisons disagree.
    culled : bool (n_samples,), those among them that get no volumes (sec. 6.3).
    shadow : float32 (n_samples,), the map's answer.
    """

    silhouette: NDArray[np.bool_]
    culled: NDArray[np.bool_]
    shadow: NDArray[np.float32]


class Hybrid(Algorithm):
    """A shadow map, and shadow volumes where its four nearest depths disagree."""

    name = "hybrid"
    title = "Shadow maps with volumes at edges"
    paper = "Chan and Durand 2004"
    exact = False
    stages = ("casters", "edges", "fit", "map", "classify", "mask", "volumes", "stencil", "resolve")
    counters = ("map_fragments", "map_texels_written", "corner_reads", "silhouette_samples", "silhouette_samples_culled",
                "mask_samples", "mask_tiles_rejected", "stencil_fragments", "depth_tests", "stencil_updates",
                "stencil_updates_on_silhouettes", "stencil_updates_beside")
    Params = Params

    def prepare(self, mesh: Mesh) -> stencil_volumes.PreparedVolumes:
        """Find the edges, and the closed bodies if the choice of casters depends on them."""
        return stencil_volumes.prepare_volumes(mesh, self.params.casters, False)

    def casters(self, frame: Frame) -> NDArray[np.bool_] | None:
        """Tell which triangles cast."""
        prepared = frame.prepared or self.prepare(frame.mesh)
        return stencil_volumes.choose_casters(frame.mesh.corners, frame.light.xyzw(), self.params.casters,
                                              prepared.closed)

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame."""
        params, mesh, samples, light = self.params, frame.mesh, frame.samples, frame.light.xyzw()
        adjacency = (frame.prepared or self.prepare(mesh)).adjacency
        view = volume_view(frame.camera, samples, stencil_volumes.NEAREST_BEHIND * frame.camera.near)
        with probe.stage("casters"):
            casting = self.casters(frame)
            casters = find_casters(adjacency, light, casting, frame.bias, view)
        with probe.stage("edges"):
            multiplicity = edge_multiplicities(adjacency, casters.facing)
        with probe.stage("fit"):
            maps = fit_light_maps(light, samples.position, samples.candidate, params.projection, params.resolution,
                                  CELL_BORDER)
        with probe.stage("map"):
            rendered = render_depth(maps, mesh.vertices, mesh.triangles, casting, probe.counting)
        with probe.stage("classify"):
            receivers = Receivers(samples.position, samples.normal, samples.candidate, params.bias * frame.bias,
                                  params.slope_bias)
            nearer = compare_corners(maps, rendered.depth, receivers)
            classified = _classify(frame, maps, nearer, params.undersampled_only)
        with probe.stage("mask"):
            wanted = (classified.silhouette & ~classified.culled).reshape(samples.rows, samples.columns)
            mask, n_rejected = computation_mask(wanted, params.mask_tile)
        with probe.stage("volumes"):
            kind = VolumeKind(False, not frame.light.is_directional)
            faces = make_faces(view, adjacency, light, casters, multiplicity, frame.bias, kind)
        with probe.stage("stencil"):
            target = stencil_volumes.empty_stencil(samples)
            drawn = stencil_volumes.draw_volumes(view, faces, True, target, no_limits(mesh.n_triangles, samples), mask,
                                                 counting=probe.counting)
        with probe.stage("resolve"):
            by_volumes = stencil_volumes.resolve_stencil(target, STENCIL_BITS, samples.candidate)
            shadow = np.where(mask.reshape(-1), by_volumes, classified.shadow)
        _tell_memory(frame, rendered.n_bytes, faces, mask, probe)
        if drawn is None:
            return ShadowBuffer(shadow)
        probe.count("map_fragments", rendered.n_fragments)
        probe.count("map_texels_written", rendered.n_written)
        probe.count("mask_tiles_rejected", n_rejected)
        _count_samples(frame, classified, mask, drawn, probe)
        return ShadowBuffer(shadow, {"classification": _classification(frame, mask, shadow)})


def computation_mask(wanted: NDArray[np.bool_], tile: int) -> tuple[NDArray[np.bool_], int]:
    """Grow samples to the tiles that hold them.

    Parameters
    ----------
    wanted : bool (rows, columns).
    tile : side of a tile, in samples; tiles at the right and lower border may be cut.

    Returns
    -------
    mask : bool (rows, columns).
    n_rejected : tiles that hold none of the wanted samples.
    """
    rows, columns = wanted.shape
    tiles = np.zeros((-(-rows // tile), tile, -(-columns // tile), tile), np.bool_)
    padded = tiles.reshape(tiles.shape[0] * tile, -1)
    padded[:rows, :columns] = wanted
    on = tiles.any(axis=(1, 3))
    mask = np.ascontiguousarray(on.repeat(tile, axis=0).repeat(tile, axis=1)[:rows, :columns])
    return mask, int(on.size - np.count_nonzero(on))


def _classify(frame: Frame, maps: LightMaps, nearer: NDArray[np.uint8], undersampled_only: bool) -> Classified:
    """Find the silhouette samples and what the map says about all others."""
    silhouette = (nearer != ALL_LIT) & (nearer != ALL_SHADOWED)
    shadow, culled = (nearer == ALL_SHADOWED).astype(np.float32), np.zeros(len(nearer), np.bool_)
    if undersampled_only:
        chosen = np.flatnonzero(silhouette)
        ratio, nearest = np.zeros(len(chosen)), np.zeros(len(chosen), np.uint8)
        samples = frame.samples
        _measure_all(maps, samples.position, samples.normal, frame.camera.eye, chosen, ratio, nearest)
        culled[chosen] = ratio < frame.pixel_footprint * samples.depth[chosen]
        by_nearest = (nearer[chosen] & nearest) != 0
        shadow[chosen] = np.where(culled[chosen], by_nearest, False)
    return Classified(silhouette, culled, shadow)


@kernel
def _measure_chunk(worker, maps, position, normal, eye, chosen, size, nearest):
    """Measure texels for one worker's share of the chosen samples; see `_measure_all`."""
    light, axes, half, fitted, perspective = maps.eye, maps.axes, maps.half, maps.fitted, maps.perspective
    first, end = chunk(worker, len(chosen))
    for k in range(first, end):
        i = chosen[k]
        to_x, to_y, to_z = position[i, 0] - light[0], position[i, 1] - light[1], position[i, 2] - light[2]
        face, u, v, depth = locate(axes, half, fitted, perspective, to_x, to_y, to_z)
        if not perspective:
            to_x, to_y, to_z = axes[0, 2, 0], axes[0, 2, 1], axes[0, 2, 2]
        from_x, from_y, from_z = position[i, 0] - eye[0], position[i, 1] - eye[1], position[i, 2] - eye[2]
        # Seen at a right angle, the texel has this side; surface and eye tilt it (Stamminger, Drettakis 2002, eq. 1)
        side = 2.0 * half[face] / maps.resolution * (depth if perspective else 1.0)
        to_light = abs(to_x * normal[i, 0] + to_y * normal[i, 1] + to_z * normal[i, 2])
        to_eye = abs(from_x * normal[i, 0] + from_y * normal[i, 1] + from_z * normal[i, 2])
        to_light /= np.sqrt(to_x * to_x + to_y * to_y + to_z * to_z)
        to_eye /= np.sqrt(from_x * from_x + from_y * from_y + from_z * from_z)
        size[k] = side * to_eye / to_light
        _, _, y, x = cell(u, v, half[face], maps.resolution, maps.border)
        nearest[k] = 1 << (2 * (y >= TEXEL_REACH) + (x >= TEXEL_REACH))


@parallel_kernel
def _measure_all(maps, position, normal, eye, chosen, size, nearest):
    """Measure how large a texel of the map looks from the eye, and find the corner nearest to a sample.

    Parameters
    ----------
    maps : LightMaps.
    position, normal : float64 (n_samples, 3), world.
    eye : float64 (3,), world.
    chosen : int64 (n_chosen,), samples.
    size : float64 (n_chosen,), written: world units across the line of sight.
    nearest : uint8 (n_chosen,), written: the bit of the nearest corner.
    """
    for worker in prange(N_WORKERS):
        _measure_chunk(worker, maps, position, normal, eye, chosen, size, nearest)


def _tell_memory(frame: Frame, map_bytes: int, faces: Faces, mask: NDArray[np.bool_], probe: Probe) -> None:
    """Record the size of what lives during the frame."""
    probe.memory("maps", map_bytes)
    probe.memory("mask", mask.nbytes)
    for name, n_bytes in stencil_volumes.memory(faces, frame.samples, STENCIL_BITS).items():
        probe.memory(name, n_bytes)


def _count_samples(frame: Frame, classified: Classified, mask: NDArray[np.bool_], drawn: stencil_volumes.Drawn,
                   probe: Probe) -> None:
    """Count what was classified and drawn, and where."""
    updates = drawn.per_sample.updates.reshape(-1)
    on_silhouettes = int(updates[classified.silhouette & ~classified.culled].sum())
    probe.count("corner_reads", CORNERS_PER_SAMPLE * np.count_nonzero(frame.samples.candidate))
    probe.count("silhouette_samples", np.count_nonzero(classified.silhouette))
    probe.count("silhouette_samples_culled", np.count_nonzero(classified.culled))
    probe.count("mask_samples", np.count_nonzero(mask))
    probe.count("stencil_fragments", drawn.per_sample.fragments.sum())
    probe.count("depth_tests", drawn.per_sample.depth_tests.sum())
    probe.count("stencil_updates", updates.sum())
    probe.count("stencil_updates_on_silhouettes", on_silhouettes)
    probe.count("stencil_updates_beside", int(updates.sum()) - on_silhouettes)
    probe.count_triangles("stencil_updates", drawn.per_triangle)
    probe.count_samples(updates)


def _classification(frame: Frame, mask: NDArray[np.bool_], shadow: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colour samples by what decided about them, and how (Fig. 6): uint8 (rows, columns, 3)."""
    samples = frame.samples
    picture = np.empty((len(shadow), 3), np.uint8)
    picture[:] = BACKGROUND
    picture[samples.triangle >= 0] = UNLIT
    drawn, dark = mask.reshape(-1), shadow > 0
    for by_volumes, in_shadow, color in ((False, True, SHADOWED_BY_MAP), (False, False, LIT_BY_MAP),
                                         (True, True, SHADOWED_BY_VOLUMES), (True, False, LIT_BY_VOLUMES)):
        picture[samples.candidate & (drawn == by_volumes) & (dark == in_shadow)] = color
    return picture.reshape(samples.rows, samples.columns, 3)
