"""Shadow rays traced by Embree, a float32 ray tracer that others maintain: a peer to compare with, not the truth.

Ingo Wald, Sven Woop, Carsten Benthin, Gregory S. Johnson, Manfred Ernst: "Embree: A Kernel Framework for Efficient
CPU Ray Tracing", ACM Transactions on Graphics 33(4) (SIGGRAPH 2014).

Idea: one occlusion query per lit candidate, from just off its surface to just before the light.

Stages
------
build : translate and round the mesh to float32, hand it over, let Embree build its hierarchy.
trace : make the rays and ask which are occluded.

Back ends
---------
open3d : ``RaycastingScene`` of Open3D; uses as many threads as Numba's kernels.
embreex : thin bindings; one thread.

Accuracy: float32 holds 24 bits, so coordinates are first moved to have the camera's eye as their origin: where pixels
are small, rounding is too. A ray starts a little off the surface (`ORIGIN_OFFSET`), along the normal that faces the
light. The shared definition ignores occluders within the bias; Embree does not, but samples on which that matters
are ambiguous, so such differences are edge ties. A ray ends `FAR_LIMIT` of the way to a point light, so that
geometry at the light itself does not count. Rays that pass near an edge may be answered differently from the truth,
and differently between versions and processors.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench import jit
from shadowbench.algorithms.base import Algorithm, AlgorithmParams, Frame, Probe, ShadowBuffer, parameter

if TYPE_CHECKING:
    from shadowbench.scenes.loader import Scene

Array = NDArray[Any]
Query = Callable[[Array, Array, bool], NDArray[np.bool_]]
"""Takes origins and directions, float32 (n_rays, 3), and whether the light lies at their ends; tells what is hit."""

ORIGIN_OFFSET = 2.0**-21
"""Distance of a ray's start from the surface, relative to the largest coordinate of the sample's triangle: four units
of float32 in the last place, as small as self-intersection allows, since it moves the ray sideways past the edges
of occluders too (a whole bias would be a twentieth of a pixel on the built-in scenes)."""
FAR_LIMIT = 1.0 - 2.0**-20
"""End of a ray to a point light, as a share of the distance: 16 units of float32 in the last place before it."""

_MODULES = {"open3d": "open3d", "embreex": "embreex.rtcore_scene"}


class Params(AlgorithmParams):
    """Parameters of `Embree`."""

    backend: Literal["auto", "open3d", "embreex"] = parameter(
        "auto", "library that brings Embree; auto is open3d where it can be imported, else embreex")


@cache
def import_error(backend: str) -> str | None:
    """Try to import a back end; return what went wrong, or None."""
    try:
        import_module(_MODULES[backend])
    except (ImportError, OSError) as error:
        return str(error)
    return None


class Embree(Algorithm):
    """One occlusion query per lit candidate."""

    name: ClassVar[str] = "embree"
    title: ClassVar[str] = "Embree"
    paper: ClassVar[str] = "Wald et al. 2014"
    exact: ClassVar[bool] = False
    stages: ClassVar[tuple[str, ...]] = ("build", "trace")
    counters: ClassVar[tuple[str, ...]] = ("rays_cast",)
    Params: ClassVar[type[AlgorithmParams]] = Params

    def unsupported(self, scene: Scene) -> str | None:
        """Say why no back end can be used, if so."""
        return self._missing()

    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Build the hierarchy and trace one ray per lit candidate.

        Raises
        ------
        RuntimeError
            If the back end cannot be imported (`unsupported` says so beforehand).
        """
        if reason := self._missing():
            raise RuntimeError(reason)
        candidates = np.flatnonzero(frame.samples.candidate)
        shadow = np.zeros(len(frame.samples.candidate), np.float32)
        eye = frame.camera.eye
        with probe.stage("build"):
            vertices = (frame.mesh.vertices - eye).astype(np.float32)
            query = _BUILDERS[self._backend()](vertices, frame.mesh.triangles) if len(candidates) else None
        with probe.stage("trace"):
            if query is not None:
                origin, direction = _rays(frame, candidates, eye, vertices)
                shadow[candidates] = query(origin, direction, not frame.light.is_directional)
        probe.count("rays_cast", len(candidates))
        probe.memory("mesh and rays handed over", vertices.nbytes + frame.mesh.triangles.nbytes + 24 * len(candidates))
        return ShadowBuffer(shadow)

    def _backend(self) -> str:
        """Resolve ``auto``."""
        if self.params.backend != "auto":
            return str(self.params.backend)
        return "embreex" if import_error("open3d") else "open3d"

    def _missing(self) -> str | None:
        """Say in one sentence why the back end cannot be used, or return None."""
        backend = self._backend()
        error = import_error(backend)
        if error is None:
            return None
        remedy = "install open3d" if backend == "open3d" else "install shadowbench[peers]"
        return f"{backend} cannot be imported ({error}): {remedy}"


def _rays(frame: Frame, candidates: NDArray[np.intp], eye: Array, vertices: Array) -> tuple[Array, Array]:
    """Origins and directions; a direction to a point light is as long as the way to it."""
    position, normal = frame.samples.position[candidates], frame.samples.normal[candidates]
    magnitude = np.abs(vertices).max(axis=1)[frame.mesh.triangles].max(axis=1)[frame.samples.triangle[candidates]]
    offset = ORIGIN_OFFSET * magnitude.astype(np.float64)
    origin = (position + offset[:, None] * normal - eye).astype(np.float32)
    light = frame.light.xyzw()
    if frame.light.is_directional:
        return origin, np.broadcast_to(light[:3], origin.shape).astype(np.float32)
    # From the rounded origin, so that the ray still ends at the light
    return origin, (light[:3] - eye - origin).astype(np.float32)


def _build_open3d(vertices: Array, triangles: Array) -> Query:
    """Build with Open3D. Its hierarchy is made at the first query, so one ray is asked here."""
    open3d = import_module("open3d")
    n_threads = jit.n_threads()
    scene = open3d.t.geometry.RaycastingScene(nthreads=n_threads)
    scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(triangles.astype(np.uint32)))

    def query(origin: Array, direction: Array, ends: bool) -> NDArray[np.bool_]:
        rays = open3d.core.Tensor(np.concatenate([origin, direction], axis=1))
        far = FAR_LIMIT if ends else float("inf")
        return np.asarray(scene.test_occlusions(rays, tnear=0.0, tfar=far, nthreads=n_threads).numpy())

    query(np.ones((1, 3), np.float32), np.ones((1, 3), np.float32), True)
    return query


def _build_embreex(vertices: Array, triangles: Array) -> Query:
    """Build with embreex. Its hierarchy is made at the first query, so one ray is asked here."""
    scene = import_module("embreex.rtcore_scene").EmbreeScene()
    mesh = import_module("embreex.mesh_construction").TriangleMesh(scene, vertices, triangles.astype(np.int32))

    def query(origin: Array, direction: Array, ends: bool, mesh: Any = mesh) -> NDArray[np.bool_]:
        # Without an end, rays are as long as embreex lets them be (1e37 directions)
        far = np.full(len(origin), FAR_LIMIT, np.float32) if ends else None
        answer = scene.run(origin, direction, dists=far, query="OCCLUDED")
        # 0 where something is hit, -1 elsewhere
        return np.asarray(answer) >= 0

    query(np.ones((1, 3), np.float32), np.ones((1, 3), np.float32), True)
    return query


_BUILDERS: dict[str, Callable[[Array, Array], Query]] = {"open3d": _build_open3d, "embreex": _build_embreex}
