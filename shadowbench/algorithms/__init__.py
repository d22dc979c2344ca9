"""Every shadow algorithm, one file each, and the explicit list of them."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shadowbench.algorithms.base import Algorithm


@dataclass(frozen=True)
class Entry:
    """An algorithm's line in the list: enough to show it without importing its kernels.

    Attributes
    ----------
    name, title, paper, exact : as in the class (a test compares them).
    summary : one line.
    target : ``module:Class``.
    extra : the optional dependency group that it needs, or None.
    """

    name: str
    title: str
    paper: str
    exact: bool
    summary: str
    target: str
    extra: str | None = None

    def load(self) -> type[Algorithm]:
        """Import the class, and with it Numba."""
        module, _, name = self.target.partition(":")
        loaded: type[Algorithm] = getattr(import_module(module), name)
        return loaded


ALL_ALGORITHMS: tuple[Entry, ...] = (
    Entry("reference", "Certified reference", "shadowbench", True,
          "Error-bounded float64 with rational arithmetic where it can't decide: the truth",
          "shadowbench.algorithms.reference:Reference"),
    Entry("z_pass", "Stencil shadow volumes, z-pass", "Heidmann 1991", True,
          "Counts volume faces before each sample, starting from the volumes that contain the eye",
          "shadowbench.algorithms.z_pass:ZPass"),
    Entry("z_fail", "Stencil shadow volumes, z-fail", "Everitt and Kilgard 2002", True,
          "Counts volume faces behind each sample, caps included",
          "shadowbench.algorithms.z_fail:ZFail"),
    Entry("shadow_map", "Shadow map", "Williams 1978", False,
          "Nearest depth from the light, spot, cube or directional, with percentage-closer filtering",
          "shadowbench.algorithms.shadow_map:ShadowMap"),
    Entry("silhouette_map", "Shadow silhouette map", "Sen et al. 2003", False,
          "Shadow map whose edges run along stored points of the casters' silhouettes",
          "shadowbench.algorithms.silhouette_map:SilhouetteMap"),
    Entry("hybrid", "Shadow maps with volumes at edges", "Chan and Durand 2004", False,
          "Shadow map, and z-fail volumes on the samples where its four nearest texels disagree",
          "shadowbench.algorithms.hybrid:Hybrid"),
    Entry("ptsv", "Per-triangle shadow volumes", "Sintorn et al. 2011", True,
          "Every triangle's shadow frustum rasterised into a tree of screen tiles with depth bounds",
          "shadowbench.algorithms.ptsv:Ptsv"),
    Entry("cluster", "View-sample cluster hierarchy", "Sintorn et al. 2014", True,
          "Every triangle's shadow frustum walked through a tree over clusters of view samples",
          "shadowbench.algorithms.cluster:Cluster"),
    Entry("ray_traced", "Ray tracing, kd-tree", "Hertel et al. 2009", True,
          "One shadow ray per lit candidate through a kd-tree that is built beforehand",
          "shadowbench.algorithms.ray_traced:RayTraced"),
    Entry("conservative_map", "Conservative shadow map", "Hertel et al. 2009", True,
          "A map of depth bounds decides most samples and shortens the rays of the others",
          "shadowbench.algorithms.conservative_map:ConservativeMapMethod"),
    Entry("embree", "Embree", "Wald et al. 2014", False,
          "Occlusion rays by a float32 ray tracer: a peer, not the truth",
          "shadowbench.algorithms.embree:Embree", "peers"),
)

ALGORITHMS: dict[str, Entry] = {entry.name: entry for entry in ALL_ALGORITHMS}

PEERS: frozenset[str] = frozenset(entry.name for entry in ALL_ALGORITHMS if entry.extra == "peers")
"""Other people's ray tracers: measured beside the methods, but their answers may depend on the machine."""
