"""The interface that every shadow algorithm implements."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from shadowbench.geometry import Frame, Light, Material, Mesh
from shadowbench.probe import Probe

if TYPE_CHECKING:
    from shadowbench.scenes.loader import Scene

__all__ = ["Algorithm", "AlgorithmParams", "Frame", "Light", "Mesh", "Probe", "ShadowBuffer", "Transparency", "parameter",
           "taken_materials"]


Transparency = Literal["alpha", "constant", "color", "stochastic", "off"]
"""What materials let through: by alpha and its texture, by alpha alone, by colours, by chance, or nothing."""


def taken_materials(mesh: Mesh, mode: Transparency) -> tuple[Material, ...]:
    """Materials as a mode takes them: opaque with ``off``, without textures with ``constant``."""
    if mode == "off":
        return tuple(Material(m.name, m.color) for m in mesh.materials)
    if mode == "constant":
        return tuple(replace(m, alpha_texture=None, color_texture=None) for m in mesh.materials)
    return mesh.materials


def parameter(default: Any, help: str, *, paper: Any = None, **limits: Any) -> Any:
    """Declare a field of a `Params` model.

    Parameters
    ----------
    default : value when nothing is said.
    help : one line for the command line and the manual.
    paper : the value that the paper uses, if it differs from the default.
    **limits : pydantic limits such as ``ge``, ``le``.
    """
    return Field(default, description=help, json_schema_extra={"paper": default if paper is None else paper},
                 **limits)


class AlgorithmParams(BaseModel):
    """Base of every algorithm's parameters: frozen, unknown names refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)


@dataclass(frozen=True, eq=False)
class ShadowBuffer:
    """Result of one frame.

    Attributes
    ----------
    shadow : float32 (n_samples,), 1 = in shadow, 0 = lit; 0 for samples that are no lit candidates.
        Between them, one less the share of the light that arrives.
    images : extra pictures by name, uint8 (rows, columns, 3), such as a classification of the samples.
    arriving : float32 (n_samples, 3), shares of red, green and blue that arrive, or None where all are alike; then
        `shadow` is one less their mean.
    """

    shadow: NDArray[np.float32]
    images: dict[str, NDArray[np.uint8]] = field(default_factory=dict)
    arriving: NDArray[np.float32] | None = None


class Algorithm(ABC):
    """One way to compute shadows. Built from its parameters alone; keeps no state between calls.

    Attributes
    ----------
    name : identifier, also of the module.
    title : the name in plots and tables.
    paper : the publication, short.
    exact : True if every sample must agree with the reference.
    stages : names of the stages that `shadows` passes through, in order.
    counters : names of the counters that it fills.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    paper: ClassVar[str]
    exact: ClassVar[bool]
    stages: ClassVar[tuple[str, ...]]
    counters: ClassVar[tuple[str, ...]]
    Params: ClassVar[type[AlgorithmParams]] = AlgorithmParams

    def __init__(self, params: AlgorithmParams | None = None) -> None:
        self.params: Any = self.Params() if params is None else params

    def unsupported(self, scene: Scene) -> str | None:
        """Say in one sentence why this algorithm can't run on `scene`, or return None if it can."""
        return None

    def prepare(self, mesh: Mesh) -> Any:
        """Do the work that depends on neither light nor camera; the result comes back as `frame.prepared`."""
        return None

    def casters(self, frame: Frame) -> NDArray[np.bool_] | None:
        """Tell which triangles cast, bool (n_triangles,), or None for all: the set that exactness is judged over."""
        return None

    def judged_as(self, frame: Frame) -> Transparency:
        """Tell how transparent materials are taken: what exactness is judged over. Without support, all are opaque."""
        return "off"

    @abstractmethod
    def shadows(self, frame: Frame, probe: Probe) -> ShadowBuffer:
        """Compute the shadow buffer of one frame, as named stages around one kernel call each."""
