"""The geometry of a scene: entries loaded or generated once, placed in the world frame by frame."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry import FloatArray, Material, Mesh, Vector
from shadowbench.scene_models import GenerateEntry, MaterialConfig, MeshEntry, Placement
from shadowbench.scenes import SCENES
from shadowbench.scenes.meshes import check_vertices, load_mesh
from shadowbench.scenes.paths import Pose, pose_at
from shadowbench.scenes.procedural import ProceduralScene
from shadowbench.scenes.textures import check_texture_coordinates, load_texture
from shadowbench.scenes.transforms import Matrix, multiply, rotation, scaling, transform_points, translation


@dataclass(frozen=True, eq=False)
class Body:
    """One geometry entry in its own space, and how it is placed.

    Attributes
    ----------
    mesh : scale and rotation not yet applied; parts numbered from 0.
    scaled : the entry's scale followed by its rotation.
    offset : the entry's translation, after any pose.
    moments, poses : rigid key frames; empty for a body that stands still.
    """

    mesh: Mesh
    scaled: Matrix
    offset: Vector
    moments: tuple[float, ...] = ()
    poses: tuple[Pose, ...] = ()

    def vertices(self, frame: int) -> FloatArray:
        """Vertices in the world at a frame, float64 (n_vertices, 3)."""
        placed = self.scaled
        if self.poses:
            pose = pose_at(self.moments, self.poses, frame)
            placed = multiply(translation(pose.translate), multiply(rotation(pose.rotate), placed))
        return transform_points(multiply(translation(self.offset), placed), self.mesh.vertices)


def load_body(entry: Placement, n_frames: int, folder: Path) -> tuple[Body, ProceduralScene | None, dict[str, str]]:
    """Load or generate the geometry of an entry.

    Parameters
    ----------
    entry : a `MeshEntry` or a `GenerateEntry`.
    n_frames : length of the sequence, for key frames given by time.
    folder : the folder of the scene file, to name mesh files from.

    Returns
    -------
    body : the geometry.
    generated : what brings a default camera and light, or None for a mesh file.
    digests : sha256 of the file, or of the generator's name and parameters; and of each texture that is a file.
    """
    generated: ProceduralScene | None = None
    if isinstance(entry, MeshEntry):
        loaded = load_mesh(entry.mesh)
        mesh = loaded.mesh
        digests = {_relative(entry.mesh, folder): loaded.digest}
    else:
        assert isinstance(entry, GenerateEntry)
        name, count = entry.generate, entry.triangles or SCENES[entry.generate].triangles
        generated = SCENES[name].load()(count, entry.seed)
        mesh = generated.mesh
        label = f"{name}[triangles={count},seed={entry.seed}]"
        digests = {label: hashlib.sha256(label.encode()).hexdigest()}
    if entry.material is not None:
        mesh = replace(mesh, materials=tuple(_override(m, entry.material) for m in mesh.materials))
        check_texture_coordinates(mesh, "the geometry")
    digests |= _texture_digests(mesh, folder)
    moments, poses = _key_frames(entry, n_frames)
    placed = multiply(rotation(entry.rotate), scaling(entry.scale))
    return Body(mesh, placed, entry.translate, moments, poses), generated, digests


def _relative(file: str, folder: Path) -> str:
    """Name a mesh file from the scene's folder, so that the name is the same on every machine."""
    try:
        return Path(os.path.relpath(file, folder.absolute())).as_posix()
    except ValueError:                  # another drive
        return file


def _texture_digests(mesh: Mesh, folder: Path) -> dict[str, str]:
    """sha256 of the image files that the materials use."""
    names = {texture.name for m in mesh.materials for texture in (m.alpha_texture, m.color_texture) if texture}
    return {_relative(name, folder): hashlib.sha256(Path(name).read_bytes()).hexdigest()
            for name in sorted(names) if Path(name).is_file()}


def _override(material: Material, given: MaterialConfig) -> Material:
    """Replace what an entry's ``material`` says about a surface."""
    said = given.model_dump(exclude_none=True)
    for key in {"alpha_texture", "color_texture"} & set(said):
        said[key] = load_texture(said[key], needs_alpha=key == "alpha_texture")
    return replace(material, **said)


def _key_frames(entry: Placement, n_frames: int) -> tuple[tuple[float, ...], tuple[Pose, ...]]:
    """Turn an entry's key frames into frame numbers and poses."""
    keys = () if entry.animate is None else entry.animate.path
    moments = tuple(float(k.frame) if k.frame is not None else (k.time or 0.0) * (n_frames - 1) for k in keys)
    return moments, tuple(Pose(k.rotate, k.translate) for k in keys)


def join(bodies: Sequence[Body], frame: int, like: Mesh | None = None) -> Mesh:
    """Concatenate bodies at a frame. Arrays are read-only.

    Parameters
    ----------
    bodies : at least one; their parts are numbered on.
    frame : when.
    like : the mesh of another frame, to share all but the vertices with.

    Raises
    ------
    InputError
        If a vertex lands beyond the range of numbers.
    """
    vertices = _frozen(np.concatenate([body.vertices(frame) for body in bodies]))
    if like is not None:
        mesh = replace(like, vertices=vertices)
    else:
        mesh = _concatenate([body.mesh for body in bodies], vertices)
    check_vertices(mesh.vertices, mesh.triangles, f"frame {frame}: after scaling and moving")
    return mesh


def _concatenate(meshes: Sequence[Mesh], vertices: FloatArray) -> Mesh:
    """Number vertices, parts and materials on from mesh to mesh."""
    first_vertex = np.cumsum([0] + [len(m.vertices) for m in meshes])
    first_material = np.cumsum([0] + [len(m.materials) for m in meshes])
    first_part = np.cumsum([0] + [int(m.part.max(initial=-1)) + 1 for m in meshes])

    def numbered_on(arrays: Sequence[NDArray[np.int32]], first: NDArray[np.int64]) -> NDArray[np.int32]:
        joined = np.concatenate([array + start for array, start in zip(arrays, first, strict=False)])
        return _frozen(np.ascontiguousarray(joined, np.int32))

    uv = None
    if any(m.uv is not None for m in meshes):
        uv = _frozen(np.concatenate([np.zeros((m.n_triangles, 3, 2)) if m.uv is None else m.uv for m in meshes]))
    return Mesh(vertices=vertices,
                triangles=numbered_on([m.triangles for m in meshes], first_vertex),
                part=numbered_on([m.part for m in meshes], first_part),
                material=numbered_on([m.material for m in meshes], first_material),
                materials=tuple(material for m in meshes for material in m.materials),
                uv=uv)


def _frozen(array: NDArray) -> NDArray:
    """Make an array contiguous and read-only."""
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
