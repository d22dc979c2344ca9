"""What the methods that test shadow frusta have in common: parameters, who casts, and the set-up of frusta and groups."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Mesh, parameter
from shadowbench.algorithms.transparency import ClearCasters, Transparency, make_optics, split_casters
from shadowbench.kernels import shadow_frustum
from shadowbench.kernels.caster_selection import closed_triangles, select_casters
from shadowbench.kernels.culling_planes import EYE_EDGES
from shadowbench.kernels.frustum_groups import group_triangles
from shadowbench.kernels.group_frustum import Groups, make_groups


class FrustumParams(AlgorithmParams):
    """Parameters of every `FrustumAlgorithm`, which adds `culling_planes` with its paper's default."""

    casters: Literal["all", "back_faces", "auto"] = parameter(
        "all", "triangles that cast: all, those facing away from the light, or the latter on closed bodies only")
    group: Literal[1, 8, 16, 32, 64] = parameter(1, "frusta of a group that share the walk through the upper levels")
    remove_unlit: bool = parameter(True, "leave samples that are no lit candidates out of the hierarchy")
    skip_shadowed: bool = parameter(True, "stop at tiles and samples that are already in shadow")
    transparency: Transparency = parameter(
        "alpha", "what materials let through: by alpha and its texture, by alpha alone, by colours, by chance, or nothing")
    seed: int = parameter(0, "of the chance", ge=0, lt=2**63)


class Casters(NamedTuple):
    """The casting triangles of a frame.

    Attributes
    ----------
    sides : int8 (n_triangles,), the side of each triangle that the light sees.
    view : camera, light, bias, reach of the samples.
    single : int64, opaque triangles that are walked by themselves; grouped : int64, the members of groups.
    clear : int64, triangles that let light through.
    groups : None, or the groups' bounding frusta; their frusta are numbered after the single ones.
    """

    sides: NDArray[np.int8]
    view: shadow_frustum.View
    single: NDArray[np.int64]
    grouped: NDArray[np.int64]
    groups: Groups | None
    clear: NDArray[np.int64]

    def first(self) -> NDArray[np.int64]:
        """Places of the groups' members in `grouped`, int64 (n_groups + 1,)."""
        return np.zeros(1, np.int64) if self.groups is None else self.groups.first - self.groups.first[0]


class FrustumAlgorithm(Algorithm):
    """Base of the methods that test samples and boxes against shadow frusta. Exact on any triangle soup."""

    exact = True

    def prepare(self, mesh: Mesh) -> NDArray[np.bool_] | None:
        """Find the closed bodies, if the choice of casters depends on them."""
        return closed_triangles(mesh.corners) if self.params.casters == "auto" else None

    def casters(self, frame: Frame) -> NDArray[np.bool_] | None:
        """Tell which triangles cast."""
        if self.params.casters == "all":
            return None
        return select_casters(self.params.casters, _sides(frame), self._closed(frame))

    def included(self, frame: Frame) -> NDArray[np.bool_]:
        """Samples that the hierarchy holds."""
        candidate = frame.samples.candidate
        return candidate if self.params.remove_unlit else np.ones_like(candidate)

    def find_casters(self, frame: Frame, reach: tuple[float, float, float], may_group: bool = True) -> Casters:
        """Find the casting triangles, and group them if the parameters say so.

        Parameters
        ----------
        reach : largest |x|, |y| and 1 / depth of a sample in proj space.
        """
        sides, corners = _sides(frame), frame.mesh.corners
        triangles = shadow_frustum.casting_triangles(
            sides, select_casters(self.params.casters, sides, self._closed(frame)))
        triangles, clear = split_casters(frame.mesh, self.params.transparency, triangles)
        view = shadow_frustum.View(*frame.camera[:4], frame.light.xyzw(), frame.bias, np.array(reach))
        if self.params.group == 1 or not may_group:
            return Casters(sides, view, triangles, triangles[:0], None, clear)
        units, faces = group_triangles(corners, triangles, view.light, self.params.group)
        single, grouped = units.order[:units.n_single], units.order[units.n_single:]
        return Casters(sides, view, single, grouped, make_groups(corners, units, faces, view), clear)

    def frusta(self, frame: Frame, casters: Casters, triangles: NDArray[np.int64]) -> shadow_frustum.Frusta:
        """Set up the frusta of some triangles, in their order."""
        planes = self.params.culling_planes
        return shadow_frustum.make_frusta(frame.mesh.corners, casters.sides, triangles, casters.view, EYE_EDGES[planes],
                                          "wedge" in planes)

    def clear_casters(self, frame: Frame, casters: Casters) -> ClearCasters | None:
        """Set up the frusta of the casters that let light through, and what they let through; None if there are none."""
        if len(casters.clear) == 0:
            return None
        optics = make_optics(frame.mesh, self.params.transparency, casters.clear, casters.view, self.params.seed)
        return ClearCasters(self.frusta(frame, casters, casters.clear), optics)

    def judged_as(self, frame: Frame) -> Transparency:
        """How the reference must take the materials, to judge this method."""
        return cast("Transparency", self.params.transparency)

    def _closed(self, frame: Frame) -> Any:
        """What `prepare` found, computed here if the frame does not bring it."""
        if self.params.casters == "auto" and frame.prepared is None:
            return self.prepare(frame.mesh)
        return frame.prepared


def _sides(frame: Frame) -> NDArray[np.int8]:
    """Which side of each triangle the light sees, int8 (n_triangles,)."""
    sides = np.empty(frame.mesh.n_triangles, np.int8)
    shadow_frustum.find_facing(frame.mesh.corners, frame.light.xyzw(), sides)
    return sides
