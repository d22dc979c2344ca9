"""Mesh files through trimesh, with everything kept that decides a shadow.

Vertices are neither merged nor moved, degenerate triangles stay, and node transforms are applied in plain IEEE
operations. What can't be used is an error that names the file and the remedy.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import logging
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.geometry import FloatArray, Material, Mesh
from shadowbench.scenes.gltf import read_gltf
from shadowbench.scenes.obj_materials import obj_material, own_color_maps
from shadowbench.scenes.textures import check_texture_coordinates
from shadowbench.scenes.transforms import (
    IDENTITY,
    Matrix,
    determinant,
    multiply,
    transform_points,
)

EXTENSIONS = (".obj", ".ply", ".stl", ".off", ".gltf", ".glb", ".3mf")
"""Kinds of file that are read; each may also be compressed, as in ``.ply.gz``."""


class LoadedMesh(NamedTuple):
    """The triangles of a file.

    Attributes
    ----------
    mesh : one part, in the file's own axes and unit, node transforms applied. Texture coordinates have v upwards,
        and are zero on triangles without any in a file that has some.
    digest : sha256 of the file, hexadecimal.
    """

    mesh: Mesh
    digest: str


def load_mesh(path: str | Path) -> LoadedMesh:
    """Read a mesh file.

    Raises
    ------
    InputError
        If the file is missing, of an unknown kind, corrupt, or holds no usable triangles.
    """
    path = Path(path)
    suffixes = [s.lower() for s in path.suffixes]
    packed = suffixes[-1:] == [".gz"]
    kind = "".join(suffixes[-2:-1] if packed else suffixes[-1:])
    if kind not in EXTENSIONS:
        raise InputError(f"{path}: unknown kind of mesh file '{path.suffix}': convert it to one of "
                         f"{' '.join(EXTENSIONS)}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: can't be read: {error.strerror}: check the path") from error
    try:
        with _quiet():
            scene, local, materials = _parse(gzip.decompress(data) if packed else data, kind, path)
            pieces = list(_pieces(scene, local, materials, path))
    except InputError:
        raise
    except ModuleNotFoundError as error:
        raise InputError(f"{path}: reading {kind} needs the package '{error.name}': install it, or convert the "
                         "file to OBJ or GLB") from error
    except Exception as error:      # trimesh raises whatever its parsers stumble over
        message = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path}: not a readable {kind} file ({message}): export it again or convert it") from error
    return LoadedMesh(_join(pieces, path), hashlib.sha256(data).hexdigest())


class _Piece(NamedTuple):
    """One placed geometry of a file."""

    vertices: FloatArray
    triangles: NDArray[np.int64]
    material: Material
    uv: FloatArray | None


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep trimesh's log and warnings off the terminal: what matters is raised as an error."""
    log = logging.getLogger("trimesh")
    before, log.disabled = log.disabled, True
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        log.disabled = before


def _parse(data: bytes, kind: str, path: Path) -> tuple[Any, dict[str, Matrix], dict[str, Material]]:
    """Let trimesh decode a file.

    Returns
    -------
    scene : trimesh's scene.
    local : transforms to the parent by node name, where the file's own are known.
    materials : surfaces by trimesh's material name, where the file's own are known.
    """
    import trimesh

    local: dict[str, Matrix] = {}
    materials: dict[str, Material] = {}
    if kind in (".gltf", ".glb"):
        data, local, materials = read_gltf(data, path)
    elif kind == ".obj":
        data = absolute_obj_indices(_utf8(data))
    elif kind == ".3mf" and "3mf" not in trimesh.available_formats():
        raise InputError(f"{path}: reading .3mf needs the packages 'networkx' and 'lxml': install them, or convert "
                         "the file to OBJ or GLB")

    class Resolver(trimesh.resolvers.FilePathResolver):
        """Finds the files beside the mesh, with the text of materials in UTF-8."""

        def get(self, name: str) -> Any:
            data = super().get(name)
            return own_color_maps(_utf8(data)) if name.lower().endswith(".mtl") else data

    resolver = Resolver(str(path.absolute()))
    scene = trimesh.load_scene(io.BytesIO(data), file_type=kind[1:], resolver=resolver, process=False)
    return scene, local, materials


def _utf8(data: bytes) -> bytes:
    """Recode text that is not UTF-8, taking it for Latin-1: only names and comments can differ."""
    try:
        data.decode("utf-8")
        return data
    except UnicodeDecodeError:
        return data.decode("latin-1").encode("utf-8")


_BAD_INDEX = re.compile(rb"^[ \t]*f[^\n]*[ \t/](?:-|0+[ \t\r/\n])", re.MULTILINE)
"""A face line with an index that is negative or zero."""


def absolute_obj_indices(data: bytes) -> bytes:
    """Rewrite the negative face indices of an OBJ file, which count back from the line that they stand in.

    trimesh would count them back from the end of the file, and take index 0 for 1.

    Raises
    ------
    ValueError
        If an index is zero or points before the first vertex.
    """
    if _BAD_INDEX.search(data + b"\n") is None:
        return data
    counts = {b"v": 0, b"vt": 0, b"vn": 0}
    lines = data.split(b"\n")
    for number, line in enumerate(lines):
        words = line.split()
        if words and words[0] in counts:
            counts[words[0]] += 1
        elif words and words[0] == b"f":
            corners = [b"/".join(_absolute(index, n, number + 1) for index, n in
                                 zip(word.split(b"/"), counts.values(), strict=False)) for word in words[1:]]
            lines[number] = b" ".join([b"f", *corners])
    return b"\n".join(lines)


def _absolute(index: bytes, n_so_far: int, line: int) -> bytes:
    """Turn one face index into a positive one."""
    if not index:
        return index
    value = int(index)
    if value == 0 or value < -n_so_far:
        raise ValueError(f"line {line}: the face index {value} refers to nothing")
    return index if value > 0 else str(n_so_far + 1 + value).encode()


def _pieces(scene: Any, local: dict[str, Matrix], materials: dict[str, Material], path: Path) -> Iterator[_Piece]:
    """Place every instance of every geometry that has triangles."""
    surfaces: dict[int, Material] = {}
    for node in scene.graph.nodes_geometry:
        geometry = scene.geometry[scene.graph.transforms.node_data[node]["geometry"]]
        triangles = np.asarray(getattr(geometry, "faces", ()), np.int64).reshape(-1, 3)
        if len(triangles) == 0:
            continue
        vertices = np.asarray(geometry.vertices, np.float64)
        if vertices.shape[1] != 3:      # trimesh cuts every vertex to the shortest one of the file
            raise ValueError(f"vertices have {vertices.shape[1]} coordinates instead of 3")
        check_vertices(vertices, triangles, str(path))
        matrix = _world_transform(scene, node, local)
        surface = getattr(geometry.visual, "material", None)
        if id(surface) not in surfaces:
            surfaces[id(surface)] = materials.get(surface.name) or obj_material(surface, path) if surface else Material()
        uv = getattr(geometry.visual, "uv", None)
        uv = None if uv is None or len(uv) != len(vertices) else np.asarray(uv, np.float64)[:, :2][triangles]
        material = surfaces[id(surface)]
        if uv is None and (material.alpha_texture or material.color_texture):
            raise InputError(f"{path}: the material '{material.name}' has a texture, but faces without texture coordinates "
                             "use it: export the coordinates, or take the texture out of the material")
        if determinant(matrix) < 0.0:       # a mirror turns the winding round: turn it back
            triangles = triangles[:, ::-1]
            uv = None if uv is None else uv[:, ::-1]
        yield _Piece(transform_points(matrix, vertices), triangles, material, uv)


def _world_transform(scene: Any, node: str, local: dict[str, Matrix]) -> Matrix:
    """Multiply the transforms from the root of the scene down to a node."""
    forest = scene.graph.transforms
    matrix = IDENTITY
    while node in forest.parents:
        parent = forest.parents[node]
        step = local.get(node)
        if step is None:
            rows = np.asarray(forest.edge_data[parent, node].get("matrix", np.eye(4)), np.float64)
            step = tuple(tuple(float(v) for v in row) for row in rows[:3])
        matrix = multiply(step, matrix)
        node = parent
    return matrix


def check_vertices(vertices: FloatArray, triangles: NDArray[np.integer], where: str) -> None:
    """Refuse triangles that can't be placed in space.

    Raises
    ------
    InputError
        If a triangle refers to a vertex that does not exist, or uses one that is not finite.
    """
    low, high = int(triangles.min()), int(triangles.max())
    if low < 0 or high >= len(vertices):
        wrong = low if low < 0 else high
        raise InputError(f"{where}: a face refers to vertex {wrong}, but there are {len(vertices)} vertices "
                         "(counted from 0): export the mesh again")
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        used = np.zeros(len(vertices), bool)
        used[triangles] = True
        bad = np.flatnonzero(used & ~finite)
        if len(bad):
            raise InputError(f"{where}: vertex {bad[0]} (counted from 0) is NaN or infinite, {len(bad)} such vertices "
                             "in use: repair the mesh")


def _join(pieces: list[_Piece], path: Path) -> Mesh:
    """Concatenate the pieces of a file."""
    if not pieces:
        raise InputError(f"{path}: no triangles: it holds points or lines only, or nothing "
                         "(triangle strips are not read from PLY): export it as a triangle mesh")
    index: dict[Material, int] = {}
    material = [index.setdefault(piece.material, len(index)) for piece in pieces]
    sizes = [len(piece.triangles) for piece in pieces]
    first = np.cumsum([0] + [len(piece.vertices) for piece in pieces[:-1]])
    vertices = np.concatenate([piece.vertices for piece in pieces])
    triangles = np.concatenate([piece.triangles + start for piece, start in zip(pieces, first, strict=True)])
    check_vertices(vertices, triangles, f"{path}: after its node transforms")
    uv = None
    if any(piece.uv is not None for piece in pieces):
        uv = np.concatenate([np.zeros((len(p.triangles), 3, 2)) if p.uv is None else p.uv for p in pieces])
    mesh = Mesh(
        vertices=np.where(np.isfinite(vertices), vertices, 0.0),     # vertices that no triangle uses
        triangles=np.ascontiguousarray(triangles, np.int32),
        part=np.zeros(len(triangles), np.int32),
        material=np.repeat(np.array(material, np.int32), sizes),
        materials=tuple(index), uv=uv)
    check_texture_coordinates(mesh, str(path))
    return mesh
