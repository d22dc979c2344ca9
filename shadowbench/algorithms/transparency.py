"""What the methods that shade by frusta share about transparent casters: who is opaque, and what the others let through.

`transparency` says how materials are taken. ``alpha``: their opacity and its texture. ``constant``: the opacity alone,
textures ignored. ``color``: red, green and blue apart, dyed by base colour and its texture. ``stochastic``: as ``alpha``,
but a sample is in shadow or not by chance, one bit each. ``off``: every caster is opaque.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Mesh, ShadowBuffer, Transparency, taken_materials
from shadowbench.geometry import Texture
from shadowbench.kernels import transparency
from shadowbench.kernels.shadow_frustum import Frusta, View
from shadowbench.kernels.transparency import NO_CUTOFF, NO_TEXTURE, ClearCounts, Optics, Through

_WRAPS = {"repeat": transparency.REPEAT, "clamp": transparency.CLAMP, "mirror": transparency.MIRROR}


class ClearCasters(NamedTuple):
    """Casters that let light through: their frusta, and what they let through."""

    frusta: Frusta
    optics: Optics


class Shaded(NamedTuple):
    """What a traversal by transparent casters has come to."""

    clear: ClearCasters
    light: Through
    counts: ClearCounts | None


def split_casters(mesh: Mesh, mode: Transparency, triangles: NDArray[np.int64]
                  ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Tell opaque casters from those that let some light through; what lets all light through is in neither.

    Parameters
    ----------
    triangles : int64, triangles that cast, increasing.
    """
    materials, colored = taken_materials(mesh, mode), mode == "color"
    if all(m.is_opaque for m in materials):
        return triangles, triangles[:0]
    opaque = np.array([m.is_opaque for m in materials])[mesh.material[triangles]]
    clear = np.array([not m.varies(colored) and min(m.transmittance(colored)) == 1.0 for m in materials])
    return triangles[opaque], triangles[~opaque & ~clear[mesh.material[triangles]]]


def make_optics(mesh: Mesh, mode: Transparency, triangles: NDArray[np.int64], view: View, seed: int) -> Optics:
    """Look up what transparent casters let through, and where on a texture a sample's light crosses them.

    Parameters
    ----------
    triangles : int64 (n_frusta,), in the order of the frusta.
    view : what the frusta were set up with.
    seed : of the chance.
    """
    materials, colored = taken_materials(mesh, mode), mode == "color"
    textures: dict[Texture, int] = {}

    def number(texture: Texture | None, wanted: bool) -> int:
        return NO_TEXTURE if texture is None or not wanted else textures.setdefault(texture, len(textures))

    opacity = [number(m.alpha_texture, True) for m in materials]
    color = [number(m.color_texture, colored and m.varies(True) and m.alpha_cutoff is None) for m in materials]
    passing = np.array([np.broadcast_to(m.transmittance(colored), 3) for m in materials], np.float64)
    varies = np.array([m.varies(colored) for m in materials])
    surface = mesh.material[triangles].astype(np.int64)
    optics = Optics(
        triangle=triangles, surface=surface, uv_rows=np.zeros((len(triangles), 3, 4)), passing=passing, varies=varies,
        alpha=np.array([m.alpha for m in materials]),
        cutoff=np.array([NO_CUTOFF if m.alpha_cutoff is None else m.alpha_cutoff for m in materials]),
        opacity_texture=np.array(opacity, np.int64), color_texture=np.array(color, np.int64),
        textures=_pack(list(textures)), n_channels=3 if colored else 1, by_chance=mode == "stochastic",
        seed=np.uint64(seed))
    if varies[surface].any() and mesh.uv is not None:
        transparency.fill_uv_rows(mesh.corners, mesh.uv, view, optics)
    return optics


def _pack(textures: list[Texture]) -> transparency.Textures:
    """Put textures into one array."""
    texels = [np.zeros((0, 4), np.float32), *(t.pixels.reshape(-1, 4) for t in textures)]
    first = np.cumsum([0] + [len(t) for t in texels[1:]])[:len(textures)]
    shapes = np.array([t.pixels.shape[:2] for t in textures], np.int64).reshape(-1, 2)
    wraps = np.array([[_WRAPS[w] for w in t.wrap] for t in textures], np.int64).reshape(-1, 2)
    return transparency.Textures(np.concatenate(texels), first.astype(np.int64), *np.ascontiguousarray(shapes.T[::-1]),
                                 *np.ascontiguousarray(wraps.T))


def shadow_buffer(dark: NDArray[np.float32], arriving: NDArray[np.float32] | None, candidate: NDArray[np.bool_]
                  ) -> ShadowBuffer:
    """Put the answer together.

    Parameters
    ----------
    dark : float32 (n_samples,), 1 for samples in the shadow of opaque casters or, by chance, of others.
    arriving : float32 (n_samples, n_channels), share of the light that arrives, or (0, 1) or None if `dark` says it all.
    candidate : bool (n_samples,), lit candidates.
    """
    if arriving is None or len(arriving) == 0:
        return ShadowBuffer(dark)
    arriving[~candidate] = 1.0
    if arriving.shape[1] == 1:
        return ShadowBuffer(1.0 - arriving[:, 0])
    mean = (arriving[:, 0] + arriving[:, 1] + arriving[:, 2]) / np.float32(3.0)
    return ShadowBuffer(1.0 - mean, arriving=arriving)
