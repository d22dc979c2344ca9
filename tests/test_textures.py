"""Textures of materials: from image files, from glTF files and scene files, and what is wrong with them."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.geometry import Material
from shadowbench.scenes.loader import load_scene
from shadowbench.scenes.meshes import load_mesh
from shadowbench.scenes.textures import LARGEST_UV, check_texture_coordinates, load_texture
from shadowbench.surfaces import surface_opacity, transmittance
from tests.test_meshes import glb, gltf_header
from tests.texture_examples import texels, write_image
from tests.transparent_examples import transparent_soup


def linear(encoded):
    """Decode sRGB, 8 bits."""
    value = encoded / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("channels", [1, 2, 4])
def test_opacity_is_the_last_channel_and_colours_are_decoded(channels, tmp_path):
    image = texels(3, 5)[..., :channels]
    texture = load_texture(write_image(tmp_path / "t.png", image))
    np.testing.assert_allclose(texture.pixels[..., 3], image[..., -1] / 255.0, atol=1e-6)
    color = image[..., :3] if channels == 4 else np.repeat(image[..., :1], 3, axis=2)
    np.testing.assert_allclose(texture.pixels[..., :3], linear(color), atol=1e-6)
    assert not texture.pixels.flags.writeable and texture == load_texture(tmp_path / "t.png")


def test_a_texture_without_opacity_serves_for_colours_alone(tmp_path):
    file = write_image(tmp_path / "t.png", texels(2, 2)[..., :3])
    assert np.all(load_texture(file, needs_alpha=False).pixels[..., 3] == 1.0)
    with pytest.raises(InputError, match=r"t\.png has no alpha channel: save it as RGBA"):
        load_texture(file)


def test_missing_and_unreadable_images_are_named(tmp_path):
    with pytest.raises(InputError, match=r"the texture .*no\.png is missing: put it there"):
        load_texture(tmp_path / "no.png")
    (tmp_path / "bad.png").write_bytes(b"not an image")
    with pytest.raises(InputError, match=r"bad\.png is not a readable image"):
        load_texture(tmp_path / "bad.png")


def textured_gltf(tmp_path, where, image, **surface):
    """A triangle whose material has an image: a file, a data URI, or part of the GLB file."""
    data = write_image(tmp_path / "t.png", image).read_bytes()
    material = {"name": "leaf", "alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, **surface}
    header, blob = gltf_header([{"mesh": 0}], materials=[material], textures=[{"source": 0, "sampler": 0}],
                               samplers=[{"wrapS": 33071, "wrapT": 33648}])
    if where == "file":
        header["images"] = [{"uri": "t.png"}]
    elif where == "uri":
        header["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(data).decode()}]
    else:
        blob += b"\0" * (-len(blob) % 4)
        header["bufferViews"].append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        header["images"] = [{"bufferView": 3, "mimeType": "image/png"}]
        blob += data
    (tmp_path / "m.glb").write_bytes(glb(header, blob))
    return tmp_path / "m.glb"


@pytest.mark.parametrize("where", ["file", "uri", "view"])
def test_gltf_textures_are_read_wherever_they_are(where, tmp_path):
    image = texels(4, 3)
    [material] = load_mesh(textured_gltf(tmp_path, where, image)).mesh.materials
    np.testing.assert_allclose(material.alpha_texture.pixels[..., 3], image[..., 3] / 255.0, atol=1e-6)
    assert material.alpha_texture is material.color_texture and material.alpha_texture.wrap == ("clamp", "mirror")
    assert material.alpha_cutoff == 0.5


@pytest.mark.parametrize(("surface", "expected"), [
    ({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1.5]}},
     r"m\.glb: material 'leaf' has the alpha 1\.5: give it one within 0\.\.1"),
    ({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}},
     r"m\.glb: material 'leaf': its base colour texture has a transform or a second set of coordinates"),
])
def test_gltf_materials_that_can_not_be_read(surface, expected, tmp_path):
    with pytest.raises(InputError, match=expected):
        load_mesh(textured_gltf(tmp_path, "view", texels(2, 2), **surface))


def test_gltf_images_that_are_missing_or_broken(tmp_path):
    file = textured_gltf(tmp_path, "file", texels(2, 2))
    (tmp_path / "t.png").unlink()
    with pytest.raises(InputError, match=r"m\.glb: material 'leaf': the texture .*t\.png is missing"):
        load_mesh(file)
    material = {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    header, blob = gltf_header([{"mesh": 0}], materials=[material], textures=[{"source": 0}],
                               images=[{"uri": "data:image/png;base64,AAAA"}])
    file.write_bytes(glb(header, blob))
    with pytest.raises(InputError, match=r"material 'material 0': m\.glb#image0 is not a readable image"):
        load_mesh(file)


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"


@pytest.mark.parametrize(("mtl", "face", "expected"), [
    ("d 1.5", "f 1/1 2/2 3/3", r"m\.obj: material 'leaf' has the alpha 1\.5: give d or Tr a value within 0\.\.1"),
    ("Tr -0.5", "f 1/1 2/2 3/3", r"m\.obj: material 'leaf' has the alpha 1\.5"),
    ("map_d rgb.png", "f 1/1 2/2 3/3", r"m\.obj: material 'leaf' \(map_d\): the texture .*rgb\.png has no alpha channel"),
    ("d 0.5\nmap_Kd no.png", "f 1/1 2/2 3/3", r"m\.obj: material 'leaf' \(map_Kd\): the texture .*no\.png is missing"),
    ("map_d t.png", "f 1 2 3", r"m\.obj: the material 'leaf' has a texture, but faces without texture coordinates use it"),
])
def test_obj_materials_that_can_not_be_used(mtl, face, expected, tmp_path):
    write_image(tmp_path / "t.png", texels(2, 2))
    write_image(tmp_path / "rgb.png", texels(2, 2)[..., :3])
    (tmp_path / "m.mtl").write_text(f"newmtl leaf\n{mtl}\n")
    (tmp_path / "m.obj").write_text(f"mtllib m.mtl\n{TRIANGLE}usemtl leaf\n{face}\n")
    with pytest.raises(InputError, match=expected):
        load_mesh(tmp_path / "m.obj")


def test_obj_colours_are_looked_up_where_light_passes(tmp_path):
    image = texels(2, 2)
    write_image(tmp_path / "t.png", image)
    (tmp_path / "m.mtl").write_text("newmtl leaf\nKd 1 1 1\nd 0.25\nmap_Kd t.png\n")
    (tmp_path / "m.obj").write_text(f"mtllib m.mtl\n{TRIANGLE}usemtl leaf\nf 1/1 2/2 3/3\n")
    [material] = load_mesh(tmp_path / "m.obj").mesh.materials
    assert material.alpha_texture is None and material.varies(True) and not material.varies(False)
    # The middle of the upper left texel
    np.testing.assert_allclose(transmittance(material, np.array([[0.25, 0.75]]), True)[0], 0.75 * linear(image[0, 0, :3]),
                               atol=1e-6)
    np.testing.assert_array_equal(transmittance(material, np.array([[0.25, 0.75]]), False), [[0.75]])


@pytest.mark.parametrize("bad", [np.nan, np.inf, 2 * LARGEST_UV])
def test_texture_coordinates_out_of_range(bad):
    mesh = transparent_soup(1, 10, None).mesh
    uv = mesh.uv.copy()
    textured = np.flatnonzero([mesh.materials[m].alpha_texture is not None for m in mesh.material])[-1]
    check_texture_coordinates(mesh, "here")
    uv[textured, 1, 0] = bad
    with pytest.raises(InputError, match=rf"here: triangle {textured} .*that are not numbers within 65536, 1 such"):
        check_texture_coordinates(replace(mesh, uv=uv), "here")
    with pytest.raises(InputError, match="has a texture, but the mesh has no texture coordinates"):
        check_texture_coordinates(replace(mesh, uv=None), "here")
    opaque = replace(mesh, uv=uv, materials=(Material(),) * len(mesh.materials))
    check_texture_coordinates(opaque, "here")


def test_scene_files_give_textures_and_their_digests(tmp_path):
    write_image(tmp_path / "t.png", texels(2, 2))
    (tmp_path / "m.obj").write_text(TRIANGLE + "f 1/1 2/2 3/3\n")
    scene = {"geometry": [{"mesh": "m.obj", "material": {"alpha": 0.5, "color_texture": "t.png", "alpha_texture": "t.png"}}],
             "camera": {"eye": [0, 0, 5], "target": [0, 0, 0]}, "light": {"position": [0, 5, 0]}}
    (tmp_path / "s.yaml").write_text(json.dumps(scene))
    loaded = load_scene(tmp_path / "s.yaml")
    [material] = loaded.mesh().materials
    assert material.alpha_texture == material.color_texture == load_texture(tmp_path / "t.png") and material.alpha == 0.5
    assert sorted(loaded.digests) == ["m.obj", "t.png"]
    before = loaded.digests["t.png"]
    write_image(tmp_path / "t.png", texels(2, 2, seed=1))
    changed = load_scene(tmp_path / "s.yaml")
    assert changed.digests["t.png"] != before
    assert not np.array_equal(changed.mesh().materials[0].alpha_texture.pixels, material.alpha_texture.pixels)


def test_what_materials_let_through():
    assert Material().is_opaque and Material(alpha=0.6, alpha_cutoff=0.5).is_opaque
    assert Material(alpha=0.4, alpha_cutoff=0.5).transmittance(True) == (1.0, 1.0, 1.0)
    assert Material(color=(1.0, 0.5, 0.0), alpha=0.25).transmittance(True) == (0.75, 0.375, 0.0)
    assert Material(color=(1.0, 0.5, 0.0), alpha=0.25).transmittance(False) == (0.75,)
    mesh = transparent_soup(6, 20).mesh
    opacity = surface_opacity(mesh, np.append(np.arange(22), -1), np.vstack([mesh.corners.mean(axis=1), [[0, 0, 0]]]))
    constant = np.array([m.opacity for m in mesh.materials])[mesh.material]
    varies = np.array([m.varies(False) for m in mesh.materials])[mesh.material]
    np.testing.assert_allclose(opacity[:22][~varies], constant[~varies], atol=1e-15)
    assert opacity[22] == 1.0 and np.all((opacity >= 0) & (opacity <= 1)) and len(np.unique(opacity[:22][varies])) > 3


def test_embedded_masks_of_real_foliage(models):
    mesh = load_mesh(models / "trees" / "oak_and_pine_mask.glb").mesh
    masked = [m for m in mesh.materials if m.alpha_cutoff is not None]
    assert len(masked) == 3 and all(m.alpha_texture is m.color_texture for m in masked)
    clear = [float((m.alpha_texture.pixels[..., 3] < m.alpha_cutoff).mean()) for m in masked]
    assert all(0.2 < share < 0.95 for share in clear)
