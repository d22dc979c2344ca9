"""What a glTF file says beside its triangles: node transforms and materials, read without loss.

trimesh multiplies node matrices through BLAS and rounds colours and opacity to 8 bits. So the header is read here;
trimesh gets a copy in which nodes and materials are named by their index, and only decodes the triangles.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, NamedTuple

from shadowbench.geometry import Material
from shadowbench.scenes.gltf_textures import GltfFile
from shadowbench.scenes.transforms import (
    IDENTITY,
    Matrix,
    from_columns,
    from_quaternion,
    multiply,
    scaling,
    translation,
)

_MAGIC, _JSON_CHUNK = 0x46546C67, 0x4E4F534A
_TRIANGLE_FAN = 6
_UNSUPPORTED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_mesh_gpu_instancing")
"""Extensions that hold geometry where it would be lost without a word."""


class GltfHeader(NamedTuple):
    """A glTF file, taken apart.

    Attributes
    ----------
    data : the file with renamed nodes and materials, for trimesh.
    local : transform from each node to its parent, by the node's new name.
    materials : surfaces by their new name.
    """

    data: bytes
    local: dict[str, Matrix]
    materials: dict[str, Material]


def read_gltf(data: bytes, path: Path) -> GltfHeader:
    """Read the header of a ``.gltf`` or ``.glb`` file.

    Parameters
    ----------
    data : the whole file.
    path : the file, for its textures and for messages.

    Raises
    ------
    ValueError
        If geometry is stored in a way that can't be read; what a corrupt header raises otherwise passes through.
    """
    binary = len(data) >= 20 and struct.unpack_from("<I", data)[0] == _MAGIC
    if binary:
        length, kind = struct.unpack_from("<II", data, 12)
        if kind != _JSON_CHUNK:
            raise ValueError("the first chunk of the GLB file is not JSON")
        header, rest = json.loads(data[20:20 + length]), data[20 + length:]
    else:
        header, rest = json.loads(data), b""
    _refuse_unreadable(header)
    local = {f"node{i}": _local_transform(node) for i, node in enumerate(header.get("nodes", []))}
    file = GltfFile(header, rest, path)
    materials = {str(i): file.material(i) for i in range(len(header.get("materials", [])))}
    text = json.dumps(_renamed(header)).encode()
    if binary:
        text += b" " * (-len(text) % 4)
        size = 20 + len(text) + len(rest)
        text = struct.pack("<IIIII", _MAGIC, 2, size, len(text), _JSON_CHUNK) + text + rest
    return GltfHeader(text, local, materials)


def _refuse_unreadable(header: dict[str, Any]) -> None:
    """Refuse what trimesh would replace by nothing or by zeros."""
    used = [name for name in _UNSUPPORTED if name in header.get("extensionsUsed", [])]
    if used:
        raise ValueError(f"it uses {', '.join(used)}: export it without compression and instancing extensions")
    if any("sparse" in accessor for accessor in header.get("accessors", [])):
        raise ValueError("it uses sparse accessors: export it without them")
    primitives = [p for mesh in header.get("meshes", []) for p in mesh["primitives"]]
    if any(p.get("mode") == _TRIANGLE_FAN for p in primitives):
        raise ValueError("it uses triangle fans: export it as triangles")


def _local_transform(node: dict[str, Any]) -> Matrix:
    """Transform from a node to its parent: its matrix, or translation after rotation after scale."""
    if "matrix" in node:
        return from_columns(node["matrix"])
    x, y, z = (float(v) for v in node.get("translation", (0, 0, 0)))
    a, b, c = (float(v) for v in node.get("scale", (1, 1, 1)))
    turned = from_quaternion(*(float(v) for v in node["rotation"])) if "rotation" in node else IDENTITY
    return multiply(translation((x, y, z)), multiply(turned, scaling((a, b, c))))


def _renamed(header: dict[str, Any]) -> dict[str, Any]:
    """Copy a header with nodes and materials named by index, and without what is not geometry."""
    dropped = ("textures", "images", "samplers", "animations", "skins", "cameras")
    result = {key: value for key, value in header.items() if key not in dropped}
    result["materials"] = [{"name": str(i)} for i in range(len(header.get("materials", [])))]
    result["nodes"] = [
        {**{k: v for k, v in node.items() if k in ("children", "mesh")}, "name": f"node{i}"}
        for i, node in enumerate(header.get("nodes", []))]
    return result
