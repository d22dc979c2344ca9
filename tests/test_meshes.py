import gzip
import hashlib
import json
import struct
import warnings

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.geometry import Material
from shadowbench.scenes import SCENES
from shadowbench.scenes.meshes import absolute_obj_indices, load_mesh
from shadowbench.scenes.textures import load_texture
from tests.scene_examples import SCENE_ENTRIES
from tests.texture_examples import write_image

TRIANGLE_OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture(autouse=True)
def examples(monkeypatch):
    for scene in SCENE_ENTRIES:
        monkeypatch.setitem(SCENES, scene.name, scene)


def corners(mesh) -> np.ndarray:
    return mesh.vertices[mesh.triangles]


def glb(header: dict, blob: bytes) -> bytes:
    text = json.dumps({"asset": {"version": "2.0"}, "buffers": [{"byteLength": len(blob)}], **header}).encode()
    text += b" " * (-len(text) % 4)
    blob += b"\0" * (-len(blob) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def gltf_header(nodes: list[dict], **extra) -> tuple[dict, bytes]:
    """One mesh of one triangle with texture coordinates, placed by `nodes`."""
    blob = (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
            + np.array([[0, 0], [1, 0], [0, 1]], "<f4").tobytes() + np.array([0, 1, 2], "<u2").tobytes())
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24},
             {"buffer": 0, "byteOffset": 60, "byteLength": 6}]
    accessors = [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                 {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
                 {"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"}]
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
    header = {"scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes, "meshes": [{"primitives": [primitive]}],
              "materials": [{}], "accessors": accessors, "bufferViews": views, **extra}
    return header, blob


# Mesh files

def test_obj_keeps_vertices_faces_and_materials(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 0.7 0.1 0.2\nd 0.3\nnewmtl leaf\nKd 1 1 1\nmap_d leaf.png\n"
                                    "newmtl ghost\nTr 0.25\n")
    write_image(tmp_path / "leaf.png", np.full((2, 2, 4), 128, np.uint8))
    (tmp_path / "m.obj").write_text(
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
        "usemtl red\nf 1/1 2/2 3/3\nf 1/1 1/1 2/2\nusemtl leaf\nf 2/2 3/3 4/1\nusemtl ghost\nf 1 2 3 4\n")
    mesh, digest = load_mesh(tmp_path / "m.obj")
    by_name = {m.name: (i, m) for i, m in enumerate(mesh.materials)}
    assert by_name["red"][1] == Material("red", (0.7, 0.1, 0.2), 0.3)
    assert by_name["leaf"][1] == Material("leaf", (1.0, 1.0, 1.0), 1.0, load_texture(tmp_path / "leaf.png"))
    assert by_name["ghost"][1].alpha == 0.75
    red, leaf = (mesh.material == by_name[name][0] for name in ("red", "leaf"))
    assert (red.sum(), leaf.sum(), len(mesh.triangles)) == (2, 1, 5)       # the degenerate one stays, the quad is two
    np.testing.assert_array_equal(corners(mesh)[leaf], [[[1, 0, 0], [0, 1, 0], [0, 0, 0]]])
    np.testing.assert_array_equal(mesh.uv[leaf], [[[1, 0], [0, 1], [0, 0]]])
    assert mesh.vertices.dtype == np.float64 and mesh.triangles.dtype == mesh.material.dtype == np.int32
    assert digest == hashlib.sha256((tmp_path / "m.obj").read_bytes()).hexdigest()


def test_obj_and_mtl_need_not_be_utf_8(tmp_path):
    (tmp_path / "m.mtl").write_bytes("newmtl Blätter\nd 0.5\n".encode("latin-1"))
    (tmp_path / "m.obj").write_bytes(f"# café\nmtllib m.mtl\nusemtl Blätter\n{TRIANGLE_OBJ}".encode("latin-1"))
    assert load_mesh(tmp_path / "m.obj").mesh.materials == (Material("Blätter", alpha=0.5),)


def test_obj_without_its_materials_loads_plain(tmp_path):
    (tmp_path / "m.obj").write_text("mtllib none.mtl\nusemtl x\n" + TRIANGLE_OBJ)
    assert load_mesh(tmp_path / "m.obj").mesh.materials == (Material(),)


def test_obj_negative_indices_count_from_their_own_line(tmp_path):
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf -3/-1 -2/1 -1/1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3// -2 -1\n"
    assert absolute_obj_indices(text).splitlines()[4::4] == [b"f 1/1 2/1 3/1", b"f 4// 5 6"]
    (tmp_path / "m.obj").write_bytes(text.replace(b"/-1", b"").replace(b"/1", b"").replace(b"//", b""))
    np.testing.assert_array_equal(np.sort(corners(load_mesh(tmp_path / "m.obj").mesh)[:, :, 0].max(axis=1)), [1, 6])
    assert absolute_obj_indices(TRIANGLE_OBJ.encode()) == TRIANGLE_OBJ.encode()


@pytest.mark.parametrize(("kind", "text"), [
    ("off", "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 2 3\n"),
    ("ply", "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
            "element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
            "3 0 1 2\n3 0 2 3\n"),
    ("stl", "solid s\n" + "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {v}\n" for v in facet) + "endloop\nendfacet\n"
        for facet in (("0 0 0", "1 0 0", "0 1 0"), ("0 0 0", "0 1 0", "0 0 1"))) + "endsolid s\n"),
])
@pytest.mark.parametrize("packed", [False, True])
def test_plain_formats(kind, text, packed, tmp_path):
    file = tmp_path / f"m.{kind.upper()}{'.gz' if packed else ''}"
    file.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    mesh = load_mesh(file).mesh
    np.testing.assert_array_equal(corners(mesh), [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 1]]])
    assert mesh.uv is None and mesh.materials == (Material(),)


def test_gltf_places_instances_and_keeps_materials_exactly(tmp_path):
    nodes = [
        {"children": [1, 2, 3], "translation": [10, 0, 0]},
        {"mesh": 0, "scale": [2, 2, 2], "name": "same"},
        {"children": [4], "rotation": [0, 0, 0.7071067811865476, 0.7071067811865476], "name": "same"},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
        {"mesh": 0, "translation": [3, 0, 0], "camera": 0}]
    material = {"name": "glass", "alphaMode": "BLEND",
                "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.45]}}
    (tmp_path / "m.glb").write_bytes(glb(*gltf_header(nodes, materials=[material], cameras=[
        {"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}])))
    mesh = load_mesh(tmp_path / "m.glb").mesh
    assert mesh.materials == (Material("glass", (0.1, 0.2, 0.3), 0.45),)       # not rounded to 8 bits
    placed = {tuple(t[0].round(12)): (t, uv) for t, uv in zip(corners(mesh), mesh.uv, strict=True)}
    np.testing.assert_allclose(placed[10, 0, 0][0], [[10, 0, 0], [12, 0, 0], [10, 2, 0]], atol=1e-12)
    np.testing.assert_allclose(placed[10, 3, 0][0], [[10, 3, 0], [10, 4, 0], [9, 3, 0]], atol=1e-12)
    # The mirrored instance is turned round, so that its normal still points along +z.
    [mirrored] = [c for c in corners(mesh) if c[0, 2] == 5]
    normal = np.cross(mirrored[1] - mirrored[0], mirrored[2] - mirrored[0])
    assert normal[2] > 0 and len(mesh.triangles) == 3
    np.testing.assert_array_equal(placed[10, 0, 0][1], [[0, 1], [1, 1], [0, 0]])      # v upwards


@pytest.mark.parametrize(("material", "expected"), [
    ({"alphaMode": "MASK"}, Material("material 0", alpha_cutoff=0.5)),
    ({"alphaMode": "MASK", "alphaCutoff": 0.2, "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.9]}},
     Material("material 0", alpha=0.9, alpha_cutoff=0.2)),
    ({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.9]}}, Material("material 0")),
])
def test_gltf_alpha_modes(material, expected, tmp_path):
    (tmp_path / "m.glb").write_bytes(glb(*gltf_header([{"mesh": 0}], materials=[material])))
    assert load_mesh(tmp_path / "m.glb").mesh.materials == (expected,)


def test_gltf_with_files_beside_it(tmp_path):
    header, blob = gltf_header([{"mesh": 0}], materials=[
        {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        textures=[{"source": 0}], images=[{"uri": "my%20leaf.png"}])
    header |= {"asset": {"version": "2.0"}, "buffers": [{"uri": "m.bin", "byteLength": len(blob)}]}
    (tmp_path / "m.bin").write_bytes(blob)
    (tmp_path / "m.gltf").write_text(json.dumps(header))
    write_image(tmp_path / "my leaf.png", np.full((2, 2, 4), 128, np.uint8))
    [material] = load_mesh(tmp_path / "m.gltf").mesh.materials
    assert material.alpha_texture == load_texture(tmp_path / "my leaf.png") == material.color_texture


@pytest.mark.parametrize(("name", "data", "expected"), [
    ("no.obj", None, "can't be read: No such file or directory"),
    ("m.blend", b"x", "unknown kind of mesh file '.blend': convert it to one of .obj .ply"),
    ("m", b"x", "unknown kind of mesh file ''"),
    ("m.gz", b"x", "unknown kind of mesh file '.gz'"),
    ("m.ply", b"nonsense", "not a readable .ply file"),
    ("m.ply.gz", b"nonsense", "not a readable .ply file"),
    ("m.glb", b"nonsense", "not a readable .glb file"),
    ("m.glb", b"glTF\2\0\0\0\0\0\0\0\0\0\0\0JSON", "not a readable .glb file"),
    ("m.gltf", b"{}", "m.gltf"),
    ("m.stl", b"\0" * 90, "m.stl"),
    ("m.off", b"OFF\n3 1 0\n0 0 0\n", "not a readable .off file"),
    ("m.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n", "face index"),
    ("m.obj", b"", "no triangles"),
    ("m.obj", b"v 0 0 0\n", "no triangles"),
    ("m.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n", "not a readable .obj file"),
    ("m.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4: the face index 0 refers to nothing"),
    ("m.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n", "line 4: the face index -4 refers to nothing"),
    ("m.obj", b"v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "vertices have 2 coordinates instead of 3"),
    ("m.obj", b"v 0 0 0\nv nan 0 0\nv 0 inf 0\nf 1 2 3\n",
     "vertex 1 (counted from 0) is NaN or infinite, 2 such vertices in use: repair the mesh"),
    ("m.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
              b"end_header\n0 0 0\n", "no triangles: it holds points or lines only"),
    ("m.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
              b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 5\n",
     "a face refers to vertex 5, but there are 3 vertices (counted from 0)"),
])
def test_bad_mesh_files(name, data, expected, tmp_path, capfd):
    file = tmp_path / name
    if data is not None:
        file.write_bytes(data)
    with pytest.raises(InputError) as caught:
        load_mesh(file)
    assert str(caught.value).startswith(str(file)) and expected in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("change", "expected"), [
    ({"extensionsUsed": ["KHR_draco_mesh_compression"]}, "it uses KHR_draco_mesh_compression"),
    ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}]}, "it uses triangle fans"),
    ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]}]}, "no triangles"),
    ({"accessors": [{"sparse": {}, "componentType": 5126, "count": 3, "type": "VEC3"}]}, "it uses sparse accessors"),
    ({"nodes": [{"mesh": 0, "scale": [1e308, 1e308, 1e308], "children": []}, {}]}, None),
    ({"nodes": [{"children": [1], "scale": [1e308] * 3}, {"mesh": 0, "scale": [1e308] * 3}]},
     "after its node transforms: vertex 0"),
])
def test_gltf_files_that_would_lose_geometry(change, expected, tmp_path):
    header, blob = gltf_header([{"mesh": 0}])
    (tmp_path / "m.glb").write_bytes(glb(header | change, blob))
    if expected is None:
        assert len(load_mesh(tmp_path / "m.glb").mesh.triangles) == 1
        return
    with pytest.raises(InputError, match=expected):
        load_mesh(tmp_path / "m.glb")


def test_a_bad_vertex_that_nothing_uses_is_harmless(tmp_path):
    (tmp_path / "m.off").write_text("OFF\n4 1 0\n0 0 0\n1 0 0\nnan 0 0\n0 1 0\n3 0 1 3\n")
    mesh = load_mesh(tmp_path / "m.off").mesh
    assert np.isfinite(mesh.vertices).all() and len(mesh.triangles) == 1


def test_a_missing_alpha_texture_is_named(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl leaf\nmap_d leaf.png\n")
    (tmp_path / "m.obj").write_text("mtllib m.mtl\nusemtl leaf\n" + TRIANGLE_OBJ)
    with pytest.raises(InputError, match=r"m.obj: material 'leaf' \(map_d\): the texture .*leaf.png is missing"):
        load_mesh(tmp_path / "m.obj")


MODELS = {
    "samurai_monastery/samurai_monastry.obj": 124_789, "genesis_plaza/street.glb": 171_574,
    "genesis_plaza/shell.glb": 52_704, "trees/oak_and_pine_mask.glb": 1_624, "trees/grove_252.glb": 195_376,
    "engine/2CylinderEngine.glb": 121_496, "scans/bunny00.off": 75_408, "scans/camel.off": 19_536,
    "scans/triceratops.off": 5_660, "scans/boeing.off": 2_564, "common/stanford-bunny.obj": 69_451,
    "common/teapot.obj": 6_320, "common/beetle.obj": 2_053, "common/suzanne.obj": 968,
    "common/cheburashka.obj": 13_334}


@pytest.mark.parametrize(("file", "n_triangles"), MODELS.items())
def test_real_models(models, file, n_triangles):
    mesh = load_mesh(models / file).mesh
    assert len(mesh.triangles) == n_triangles == len(mesh.material)
    assert np.isfinite(mesh.vertices).all() and mesh.triangles.max() < len(mesh.vertices)
    assert mesh.uv is None or mesh.uv.shape == (n_triangles, 3, 2)


@pytest.mark.slow
def test_the_dragon(models):
    assert len(load_mesh(models / "scans" / "dragon_vrip.ply.gz").mesh.triangles) == 871_414


def test_real_alpha_masks_are_kept(models):
    mesh = load_mesh(models / "trees" / "oak_and_pine_mask.glb").mesh
    masked = [i for i, m in enumerate(mesh.materials) if m.alpha_cutoff is not None]
    assert len(masked) == 3 and all(mesh.materials[i].alpha_cutoff == 128 / 255 for i in masked)
    assert np.ptp(mesh.uv[np.isin(mesh.material, masked)]) > 0.5


def test_node_transforms_agree_with_trimesh(models):
    import trimesh

    file = models / "genesis_plaza" / "street.glb"
    scene = trimesh.load_scene(file, process=False)
    boxes = []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        points = scene.geometry[name].vertices @ matrix[:3, :3].T + matrix[:3, 3]
        boxes.append((points.min(axis=0), points.max(axis=0)))
    mesh = load_mesh(file).mesh
    used = corners(mesh).reshape(-1, 3)
    np.testing.assert_allclose(used.min(axis=0), np.min([low for low, _ in boxes], axis=0), atol=1e-6)
    np.testing.assert_allclose(used.max(axis=0), np.max([high for _, high in boxes], axis=0), atol=1e-6)


# Scenes


def test_loading_is_repeatable_and_silent(tmp_path, capfd):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        header, blob = gltf_header([{"children": [1, 2]}, {"mesh": 0}, {"mesh": 0, "translation": [0.1, 0.2, 0.3]}])
        header["meshes"][0]["primitives"] *= 2
        (tmp_path / "m.glb").write_bytes(glb(header, blob))
        first, second = (load_mesh(tmp_path / "m.glb").mesh for _ in range(2))
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.triangles, second.triangles)
    assert len(first.triangles) == 4 and capfd.readouterr() == ("", "")
