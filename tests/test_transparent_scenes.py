"""Scenes with casters that let light through: exact counts, same bytes every time, textures where they belong."""

import hashlib
from functools import cache

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes import SCENES, alpha_tree, citadel, stained_glass
from shadowbench.scenes.procedural import GRID_STEPS
from shadowbench.scenes.textures import check_texture_coordinates

MINIMUM = {"alpha_tree": alpha_tree.MINIMUM,
           "stained_glass": citadel.MINIMUM + stained_glass.n_window_triangles()}
NAMES = tuple(MINIMUM)


@cache
def mesh_of(name, triangles=None, seed=1):
    return SCENES[name].load()(triangles or SCENES[name].triangles, seed).mesh


def test_the_counts_are_those_of_the_paper():
    assert mesh_of("alpha_tree").n_triangles == 35_000 and mesh_of("stained_glass").n_triangles == 60_000


@pytest.mark.parametrize("name", NAMES)
def test_counts_are_exact(name):
    for triangles, seed in ((MINIMUM[name], 5), (MINIMUM[name] + 777, 3), (SCENES[name].triangles + 1, 2), (200_000, 1)):
        mesh = mesh_of(name, triangles, seed)
        assert mesh.n_triangles == triangles == len(mesh.part) == len(mesh.material)
        assert mesh.uv is None or mesh.uv.shape == (triangles, 3, 2)
    with pytest.raises(InputError, match=f"{name} needs at least {MINIMUM[name]} triangles"):
        mesh_of(name, MINIMUM[name] - 1)


@pytest.mark.parametrize("name", NAMES)
def test_generation_repeats_follows_the_seed_and_stays_on_the_grid(name):
    first, other = mesh_of(name), mesh_of(name, seed=2)
    again = SCENES[name].load()(SCENES[name].triangles, 1).mesh
    for key in ("vertices", "triangles", "part", "material"):
        np.testing.assert_array_equal(getattr(first, key), getattr(again, key))
    assert not np.array_equal(first.vertices, other.vertices)
    np.testing.assert_array_equal(first.vertices * GRID_STEPS, np.rint(first.vertices * GRID_STEPS))


def test_bytes_are_those_of_the_machine_where_the_digest_was_noted():
    mesh = mesh_of("alpha_tree", alpha_tree.MINIMUM)
    data = b"".join(array.tobytes() for array in (mesh.vertices, mesh.triangles, mesh.material, mesh.uv,
                                                  alpha_tree.leaf_texture().pixels))
    assert hashlib.sha256(data).hexdigest()[:16] == "4c72897dcf068adb"


def test_leaves_are_squares_with_a_sprig():
    mesh = mesh_of("alpha_tree")
    [leaf] = [i for i, m in enumerate(mesh.materials) if m.alpha_texture is not None]
    of_leaf, texture = mesh.material == leaf, mesh.materials[leaf].alpha_texture
    check_texture_coordinates(mesh, "alpha_tree")
    assert 0.6 < of_leaf.mean() < 0.9 and not mesh.uv[~of_leaf].any()
    assert mesh.materials[leaf].alpha == 0.5 and 0.2 < texture.pixels[..., 3].mean() < 0.5
    assert not texture.pixels[[0, -1], :, 3].any() or texture.wrap == ("clamp", "clamp")
    quads = mesh.corners[of_leaf].reshape(-1, 6, 3)
    # Both triangles share a diagonal, and opposite sides are equal: a square up to the vertex grid
    np.testing.assert_array_equal(quads[:, 0], quads[:, 3])
    np.testing.assert_array_equal(quads[:, 2], quads[:, 4])
    np.testing.assert_allclose(quads[:, 1] - quads[:, 0], quads[:, 2] - quads[:, 5], atol=4 / GRID_STEPS)


def test_panes_are_coloured_glass():
    mesh = mesh_of("stained_glass")
    panes = [i for i, m in enumerate(mesh.materials) if not m.is_opaque]
    assert len(panes) == 6 and all(mesh.materials[i].alpha == stained_glass.GLASS_ALPHA for i in panes)
    assert len({mesh.materials[i].color for i in panes}) == 6
    assert 1000 < np.isin(mesh.material, panes).sum() < 4000 and set(np.unique(mesh.material)) > set(panes)
