"""The registry of operation counters: the only place where a count gets its name and its meaning.

Two totals are reported for every method. ``test_and_set`` follows the papers' convention (Sintorn et al. 2011,
sec. 4): stencil updates for shadow volumes, node tests plus sample tests for the hierarchies. ``all_work`` is
symmetric: it adds every other memory or geometry operation that the papers leave out.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Counter:
    """One operation count.

    Attributes
    ----------
    name : identifier in every output.
    unit : what one step of the count is.
    definition : one sentence that says when the count grows.
    source : the paper and section that the definition follows, or "shadowbench".
    scope : "frame" for a total; such counts may also be attributed to samples, triangles or levels.
    in_test_and_set, in_all_work : True if the count is a term of that total.
    """

    name: str
    unit: str
    definition: str
    source: str
    scope: str = "frame"
    in_test_and_set: bool = False
    in_all_work: bool = False


ALL_COUNTERS: tuple[Counter, ...] = (
    Counter("test_and_set", "operation",
            "Sum of the counts that the papers compare: stencil updates, node tests and sample tests.",
            "Sintorn et al. 2011, sec. 4"),
    Counter("all_work", "operation",
            "Sum of all elementary operations, those that the papers leave out included.", "shadowbench"),
    Counter("node_tests", "test",
            "A child box or tile is tested against a shadow frustum.", "Sintorn et al. 2011, sec. 4",
            in_test_and_set=True, in_all_work=True),
    Counter("sample_tests", "test",
            "A view sample is tested against a shadow frustum.", "Sintorn et al. 2011, sec. 4",
            in_test_and_set=True, in_all_work=True),
    Counter("group_tests", "test",
            "A child box or tile is tested against the bounding frustum of a group of shadow frusta.", "shadowbench",
            in_test_and_set=True, in_all_work=True),
    Counter("trivial_accepts", "tile",
            "A child tile that is still to be tested lies wholly inside a shadow frustum.",
            "Sintorn et al. 2011, sec. 3.1"),
    Counter("trivial_rejects", "tile",
            "A child tile that is still to be tested lies wholly outside one plane of a shadow frustum or of its "
            "culling planes.", "Sintorn et al. 2011, sec. 3.1"),
    Counter("refinements", "tile",
            "A child tile is neither accepted nor rejected, so its own children or samples are tested.",
            "Sintorn et al. 2011, sec. 3.1"),
    Counter("iterations", "visit",
            "The children of a node, or the samples of a leaf, are tested together against one frustum or group.",
            "Sintorn et al. 2014, sec. 2.2"),
    Counter("occupied_nodes", "node",
            "A node of the hierarchy, or a cluster, holds view samples.", "Sintorn et al. 2014, sec. 3"),
    Counter("fruitless_refinements", "tile",
            "A refined tile turns out to hold nothing that the shadow frustum puts in shadow: a false positive of the "
            "tile test.", "Sintorn et al. 2011, sec. 3.5"),
    Counter("float64_sample_tests", "test",
            "A sample test that float32 left undecided is repeated in float64.", "shadowbench", in_all_work=True),
    Counter("stencil_fragments", "fragment",
            "A face of a shadow volume covers a view sample, once for each time that the face is drawn; divided by the "
            "number of samples, the overdraw.", "Chan and Durand 2004, sec. 5", in_all_work=True),
    Counter("depth_tests", "test",
            "A fragment that scissor, depth bounds and computation mask let through is compared with the sample's "
            "depth.",
            "Sintorn et al. 2011, sec. 4", in_all_work=True),
    Counter("stencil_updates", "update",
            "A fragment behind the sample (z-fail) or before it (z-pass) changes the sample's stencil value by one.",
            "Sintorn et al. 2011, sec. 4", in_test_and_set=True, in_all_work=True),
    Counter("eye_tests", "test",
            "A shadow frustum is tested for the eye, to find the number that z-pass starts from.", "shadowbench",
            in_all_work=True),
    Counter("eye_volumes", "volume",
            "A shadow frustum contains the eye, so z-pass must start with it.", "Sintorn et al. 2011, sec. 2"),
    Counter("eye_volumes_ignored", "volume",
            "A shadow frustum contains the eye and z-pass starts without it: if there is one, the whole image may be "
            "wrong.", "Sintorn et al. 2011, sec. 2"),
    Counter("peak_stencil", "volume",
            "The largest number of shadow volumes around a view sample, which the stencil buffer has to hold.",
            "Sintorn et al. 2011, sec. 4"),
    Counter("stencil_overflows", "sample",
            "A view sample is in more shadow volumes than the stencil's bits can count, so its value has wrapped.",
            "Sintorn et al. 2011, sec. 4"),
    Counter("stencil_overflows_lit", "sample",
            "A lit candidate's stencil value has wrapped to zero, so a shadow is lost.",
            "Sintorn et al. 2011, sec. 4"),
    Counter("map_fragments", "fragment",
            "A shadow-map texel centre is covered by a triangle during rasterisation of the map.",
            "Williams 1978", in_all_work=True),
    Counter("map_texels_written", "texel",
            "A shadow-map texel takes a nearer depth than the one it holds.", "Williams 1978", in_all_work=True),
    Counter("map_texels_read", "texel",
            "A shadow-map texel is read and compared with a view sample's depth.", "Williams 1978",
            in_all_work=True),
    Counter("corner_reads", "texel",
            "A shadow-map texel is read as one of the four around a view sample.", "Sen et al. 2003, sec. 3.2",
            in_all_work=True),
    Counter("silhouette_samples", "sample",
            "A lit candidate's depth comparisons with the four texels around it disagree; for silhouette maps, the "
            "paper's silhouette fill, whose share of the scene fill is P.", "Sen et al. 2003, Table 1"),
    Counter("scene_fill", "sample",
            "A view sample shows a surface, so it is shaded.", "Sen et al. 2003, Table 1"),
    Counter("silhouette_edges", "edge",
            "An edge separates triangles that cast from others, or those that face the light from those that face "
            "away, so its multiplicity is not zero.", "Sen et al. 2003, sec. 3.1"),
    Counter("silhouette_fragments", "texel",
            "A silhouette edge crosses a texel of the silhouette map.", "Sen et al. 2003, sec. 3.1", in_all_work=True),
    Counter("silhouette_points_written", "texel",
            "A texel of the silhouette map takes the point of an edge that is not hidden from the light.",
            "Sen et al. 2003, sec. 3.1", in_all_work=True),
    Counter("point_reads", "texel",
            "A silhouette point is read, of the texel that a view sample falls in or of one beside it.",
            "Sen et al. 2003, sec. 3.2", in_all_work=True),
    Counter("silhouette_samples_culled", "sample",
            "A silhouette sample is left out of the computation mask because its shadow-map texel is smaller than the "
            "pixel.", "Chan and Durand 2004, sec. 6.3"),
    Counter("mask_samples", "sample",
            "A view sample is in the computation mask, so shadow volumes are drawn on it.",
            "Chan and Durand 2004, sec. 6.2"),
    Counter("mask_tiles_rejected", "tile",
            "A tile of the computation mask holds no silhouette sample, so no shadow volume is drawn on it.",
            "Chan and Durand 2004, sec. 6.2"),
    Counter("stencil_updates_on_silhouettes", "update",
            "A stencil update falls on a silhouette sample.", "Chan and Durand 2004, sec. 3"),
    Counter("stencil_updates_beside", "update",
            "A stencil update falls on a sample that merely shares a tile of the computation mask with a silhouette "
            "sample.", "Chan and Durand 2004, sec. 6.2"),
    Counter("rays_cast", "ray",
            "A shadow ray is handed to a ray tracer.", "Hertel et al. 2009, sec. 4"),
    Counter("kd_nodes", "node",
            "A ray meets an inner node of the kd-tree and is compared with its splitting plane; restarts meet nodes again.",
            "Hertel et al. 2009, sec. 5", in_all_work=True),
    Counter("kd_leaves", "leaf", "A ray meets a leaf of the kd-tree, empty ones included.",
            "Hertel et al. 2009, sec. 5", in_all_work=True),
    Counter("triangle_tests", "test", "A ray is tested against a triangle of a leaf.", "Hertel et al. 2009, fig. 4",
            in_all_work=True),
    Counter("conservative_fragments", "fragment",
            "Conservative rasterisation looks at a texel for a triangle.", "Hertel et al. 2009, sec. 4.1", in_all_work=True),
    Counter("fragments_discarded", "fragment",
            "A conservative fragment turns out to be farther from its triangle than a texel's diagonal.",
            "Hertel et al. 2009, sec. 4.1"),
    Counter("stored_triangle_tests", "test",
            "A view sample is tested exactly against the triangle that its texel holds, or, if it would be lit, against "
            "one that rounding makes unfit for the map.", "Hertel et al. 2009, sec. 4.2", in_all_work=True),
    Counter("lit_by_map", "sample", "A view sample is lit by its texel's depth bounds alone.",
            "Hertel et al. 2009, sec. 4.2"),
    Counter("shadowed_by_map", "sample", "A view sample is shadowed by the triangle that its texel holds.",
            "Hertel et al. 2009, sec. 4.2"),
    Counter("light_updates", "update",
            "A transparent caster's share of light is multiplied into a tile or a view sample in its frustum, or drawn by "
            "chance.", "Sintorn et al. 2011, sec. 3.2", in_all_work=True),
    Counter("texture_lookups", "lookup", "A texture is looked up to shade a view sample.", "Sintorn et al. 2011, sec. 3.2",
            in_all_work=True),
    Counter("exact_tests", "test",
            "A sign that float64 left undecided is settled in rational arithmetic.", "shadowbench",
            in_all_work=True),
)

COUNTERS: dict[str, Counter] = {counter.name: counter for counter in ALL_COUNTERS}
