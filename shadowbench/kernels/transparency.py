"""What lets light through: textures looked up where a sample's light crosses a triangle, and chance.

**Texture coordinates.** The distances of a sample from the planes through the light and an edge of the triangle, each
times the length of its unscaled normal, are barycentric coordinates of the crossing times one common factor (Sintorn,
Olsson, Assarsson 2011, sec. 3.2). So u and v times that factor, and the factor, are planes too: three rows in proj space,
made once per triangle, give texture coordinates at any sample inside the frustum.

**Products.** The paper adds logarithms, which a GPU can do atomically. A product of the same factors needs no logarithm,
whose last digits differ between C libraries, and an opaque texel is the factor 0 instead of minus infinity.

**Chance.** Whether a sample is in the shadow of a transparent triangle is drawn from a counter: seed, sample and triangle
are hashed (the finaliser of SplitMix64, Steele et al. 2014), so the draw depends on nothing else.
"""

from typing import NamedTuple

import numpy as np

from shadowbench.jit import kernel, parallel_kernel, prange
from shadowbench.kernels.lanes import lowest_bit
from shadowbench.kernels.vectors import add, corner, cross, dot, minus, scaled, store_row, vector

N_WORKERS = 64
"""Parts that the frusta are cut into."""

NO_TEXTURE, NO_CUTOFF = -1, -1.0

REPEAT, CLAMP, MIRROR = 0, 1, 2
"""What lies beyond the edge of a texture."""

_ONE = np.uint64(1)
_GOLDEN, _MIX1, _MIX2 = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


class Textures(NamedTuple):
    """All textures, texel by texel.

    Attributes
    ----------
    texels : float32 (n_texels, 4), linear RGB and opacity.
    first : int64 (n_textures,), the first texel of each; columns, rows : int64, its size.
    wrap_x, wrap_y : int64, what lies beyond its edges.
    """

    texels: np.ndarray
    first: np.ndarray
    columns: np.ndarray
    rows: np.ndarray
    wrap_x: np.ndarray
    wrap_y: np.ndarray


class Optics(NamedTuple):
    """What the transparent casters let through.

    Attributes
    ----------
    triangle : int64 (n_frusta,), the mesh's triangle of each frustum.
    surface : int64 (n_frusta,), its material.
    uv_rows : float64 (n_frusta, 3, 4), rows of u, v and the factor that both are multiplied by, in proj space.
    passing : float64 (n_materials, 3), share of red, green and blue that passes where the texture covers all.
    varies : bool (n_materials,), True if a texture must be looked up.
    alpha, cutoff : float64 (n_materials,); the cutoff is `NO_CUTOFF` where there is none.
    opacity_texture, color_texture : int64 (n_materials,), or `NO_TEXTURE`.
    textures : of the scene.
    n_channels : 1, or 3 for red, green and blue apart.
    by_chance : True if samples are in shadow or not by chance.
    seed : uint64, of the chance.
    """

    triangle: np.ndarray
    surface: np.ndarray
    uv_rows: np.ndarray
    passing: np.ndarray
    varies: np.ndarray
    alpha: np.ndarray
    cutoff: np.ndarray
    opacity_texture: np.ndarray
    color_texture: np.ndarray
    textures: Textures
    n_channels: int
    by_chance: bool
    seed: np.uint64


class Through(NamedTuple):
    """Shares of the light that pass: the hierarchical shadow buffer of transparent casters.

    Attributes
    ----------
    nodes : float32 (n_nodes, n_channels), of the casters whose frusta hold all of a node.
    samples : float32 (n_samples, n_channels), of the casters that were tested against the sample itself.
    """

    nodes: np.ndarray
    samples: np.ndarray


class ClearCounts(NamedTuple):
    """Operation counts of a traversal by transparent casters: int64 (n_nodes,), and by worker and frustum.

    Attributes
    ----------
    visits : times that a node's children (or samples) were tested; tests : children or samples tested.
    accepts, rejects, refinements : a node's children wholly inside a frustum, outside one of its planes, and neither.
    fruitful : refinements of a node's children below which the frustum reached something.
    retries : samples tested again in float64.
    updates : shares multiplied, of children or samples; lookups : of these, with a texture.
    frustum_visits : int32 (n_workers, n_frusta); frustum_tests : int64 (n_workers, n_frusta).
    root : int64 (n_workers, 4), accepts, rejects, refinements and fruitful ones among the root's children.
    """

    visits: np.ndarray
    tests: np.ndarray
    accepts: np.ndarray
    rejects: np.ndarray
    refinements: np.ndarray
    fruitful: np.ndarray
    retries: np.ndarray
    updates: np.ndarray
    lookups: np.ndarray
    frustum_visits: np.ndarray
    frustum_tests: np.ndarray
    root: np.ndarray


def empty_counts(n_nodes, n_workers, n_frusta):
    """Allocate counts of zero."""
    return ClearCounts(*(np.zeros(n_nodes, np.int64) for _ in range(9)), np.zeros((n_workers, n_frusta), np.int32),
                       np.zeros((n_workers, n_frusta), np.int64), np.zeros((n_workers, 4), np.int64))


def add_root_counts(counts):
    """Add what the workers counted at the root to the root's counts."""
    for of_root, of_workers in zip((counts.accepts, counts.rejects, counts.refinements, counts.fruitful), counts.root.T,
                                   strict=True):
        of_root[0] += of_workers.sum()


def all_light(n_nodes, n_samples, optics):
    """Allocate a buffer in which all light passes; one bit per sample is enough for chance, so nothing then."""
    if optics.by_chance:
        return Through(np.empty((0, 1), np.float32), np.empty((0, 1), np.float32))
    return Through(np.ones((n_nodes, optics.n_channels), np.float32), np.ones((n_samples, optics.n_channels), np.float32))


@kernel
def _edge_plane(a, b, ray, eye):
    """Unscaled plane through the light and the edge from a to b: normal, and value at the eye."""
    m = cross(ray, minus(b, a))
    return m, -dot(m, minus(a, eye))


@kernel
def _from_light(v, light):
    """Direction in which the light travels at v."""
    return light[3] * v[0] - light[0], light[3] * v[1] - light[1], light[3] * v[2] - light[2]


@kernel
def _uv_part(corners, uv, view, optics, worker):
    """Write the rows of u, v and their factor for a share of the frusta."""
    n, triangles, rows, light = len(optics.triangle), optics.triangle, optics.uv_rows, view.light
    eye, right, up, forward = vector(view.eye), vector(view.right), vector(view.up), vector(view.forward)
    for k in range(n * worker // N_WORKERS, n * (worker + 1) // N_WORKERS):
        t = triangles[k]
        v = corner(corners, t, 0), corner(corners, t, 1), corner(corners, t, 2)
        # Plane i is opposite vertex i: its value is that vertex's barycentric coordinate times the common factor
        m0, c0 = _edge_plane(v[1], v[2], _from_light(v[1], light), eye)
        m1, c1 = _edge_plane(v[2], v[0], _from_light(v[2], light), eye)
        m2, c2 = _edge_plane(v[0], v[1], _from_light(v[0], light), eye)
        for row in range(3):
            w0, w1, w2 = 1.0, 1.0, 1.0
            if row < 2:
                w0, w1, w2 = uv[t, 0, row], uv[t, 1, row], uv[t, 2, row]
            m = add(add(scaled(m0, w0), scaled(m1, w1)), scaled(m2, w2))
            c = (c0 * w0 + c1 * w1) + c2 * w2
            store_row(rows, 3 * k + row, (dot(m, right), dot(m, up), c, dot(m, forward)))


@parallel_kernel
def fill_uv_rows(corners, uv, view, optics):
    """Fill in `Optics.uv_rows`.

    Parameters
    ----------
    corners : float64 (n_triangles, 3, 3), world; uv : float64 (n_triangles, 3, 2).
    view : `shadow_frustum.View`.
    """
    for worker in prange(N_WORKERS):
        _uv_part(corners, uv, view, optics, worker)


@kernel
def _texel(index, size, wrap):
    """Texel that stands at a place beyond the edge."""
    if wrap == CLAMP:
        return min(max(index, 0), size - 1)
    if wrap == REPEAT:
        return index % size
    index = index % (2 * size)
    return index if index < size else 2 * size - 1 - index


@kernel
def texel_places(columns, rows, wrap_x, wrap_y, u, v):
    """The four texels of a bilinear lookup, row by row from the first, and how far the point lies from the first of them.

    Texel centres are at half-integers.
    """
    x, y = u * columns - 0.5, (1.0 - v) * rows - 0.5
    column, row = np.floor(x), np.floor(y)
    left, above = np.int64(column), np.int64(row)
    x0, x1 = _texel(left, columns, wrap_x), _texel(left + 1, columns, wrap_x)
    y0, y1 = _texel(above, rows, wrap_y) * columns, _texel(above + 1, rows, wrap_y) * columns
    return y0 + x0, y0 + x1, y1 + x0, y1 + x1, x - column, y - row


@kernel
def _mix(h):
    """Finaliser of SplitMix64."""
    h = (h ^ (h >> _S30)) * _MIX1
    h = (h ^ (h >> _S27)) * _MIX2
    return h ^ (h >> _S31)


@kernel
def draw(seed, sample, triangle):
    """A number in 0..1 (1 excluded) that depends on seed, sample and triangle alone."""
    h = _mix(np.uint64(seed) + _GOLDEN)
    h = _mix((h ^ np.uint64(sample)) + _GOLDEN)
    h = _mix((h ^ np.uint64(triangle)) + _GOLDEN)
    return np.float64(h >> _S11) * 2.0**-53


@kernel
def shade_samples(optics, through, k, inside, x0, y0, width, plane_x, plane_y, depth):
    """Let a caster shade samples of its frustum; returns the bits of those that are in shadow by chance.

    One function, because a call takes a reference count for each array in the records that it passes.

    Parameters
    ----------
    k : the caster's frustum.
    inside : uint64, bits of the samples of a tile, row by row.
    x0, y0, width : the tile's first column and row of samples, and its columns.
    plane_x, plane_y, depth : float64, position of each column and row of samples, and depth of each sample.
    """
    m, rows, textures, samples = optics.surface[k], optics.uv_rows, optics.textures, through.samples
    whole0, whole1, whole2 = optics.passing[m, 0], optics.passing[m, 1], optics.passing[m, 2]
    varies, cutoff, alpha = optics.varies[m], optics.cutoff[m], optics.alpha[m]
    opacity_texture, color_texture = optics.opacity_texture[m], optics.color_texture[m]
    texels, n_columns, dark = textures.texels, len(plane_x), np.uint64(0)
    u0, u1, u2, u3 = rows[k, 0, 0], rows[k, 0, 1], rows[k, 0, 2], rows[k, 0, 3]
    v0, v1, v2, v3 = rows[k, 1, 0], rows[k, 1, 1], rows[k, 1, 2], rows[k, 1, 3]
    w0, w1, w2, w3 = rows[k, 2, 0], rows[k, 2, 1], rows[k, 2, 2], rows[k, 2, 3]
    while inside != 0:
        lane = lowest_bit(inside)
        inside &= inside - _ONE
        column, row = x0 + lane % width, y0 + lane // width
        sample = row * n_columns + column
        p0, p1, p2 = whole0, whole1, whole2
        if varies:
            # Where the sample's light crosses the triangle
            x, y, r = plane_x[column], plane_y[row], 1.0 / depth[sample]
            factor = (w0 * x + (w1 * y + w3)) + w2 * r
            u, v = ((u0 * x + (u1 * y + u3)) + u2 * r) / factor, ((v0 * x + (v1 * y + v3)) + v2 * r) / factor
            if color_texture != NO_TEXTURE:
                t = color_texture
                a, b, c, d, fx, fy = texel_places(textures.columns[t], textures.rows[t], textures.wrap_x[t],
                                                  textures.wrap_y[t], u, v)
                a, b, c, d = a + textures.first[t], b + textures.first[t], c + textures.first[t], d + textures.first[t]
                gx, gy = 1.0 - fx, 1.0 - fy
                p0 *= (texels[a, 0] * gx + texels[b, 0] * fx) * gy + (texels[c, 0] * gx + texels[d, 0] * fx) * fy
                p1 *= (texels[a, 1] * gx + texels[b, 1] * fx) * gy + (texels[c, 1] * gx + texels[d, 1] * fx) * fy
                p2 *= (texels[a, 2] * gx + texels[b, 2] * fx) * gy + (texels[c, 2] * gx + texels[d, 2] * fx) * fy
            if opacity_texture != NO_TEXTURE:
                t = opacity_texture
                a, b, c, d, fx, fy = texel_places(textures.columns[t], textures.rows[t], textures.wrap_x[t],
                                                  textures.wrap_y[t], u, v)
                a, b, c, d = a + textures.first[t], b + textures.first[t], c + textures.first[t], d + textures.first[t]
                gx, gy = 1.0 - fx, 1.0 - fy
                covered = (texels[a, 3] * gx + texels[b, 3] * fx) * gy + (texels[c, 3] * gx + texels[d, 3] * fx) * fy
                if cutoff != NO_CUTOFF:
                    covered, p0, p1, p2 = 1.0 if covered * alpha >= cutoff else 0.0, 0.0, 0.0, 0.0
                clear = 1.0 - covered
                p0, p1, p2 = clear + covered * p0, clear + covered * p1, clear + covered * p2
        if optics.by_chance:
            if draw(optics.seed, sample, optics.triangle[k]) < 1.0 - p0:
                dark |= _ONE << np.uint64(lane)
            continue
        samples[sample, 0] *= np.float32(p0)
        if optics.n_channels == 3:
            samples[sample, 1] *= np.float32(p1)
            samples[sample, 2] *= np.float32(p2)
    return dark


@kernel
def shade_node(optics, through, k, node):
    """Let a caster without texture shade a node that lies in its frustum."""
    for channel in range(optics.n_channels):
        through.nodes[node, channel] *= np.float32(optics.passing[optics.surface[k], channel])
