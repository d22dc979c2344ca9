"""Sintorn, Kämpe, Olsson, Assarsson: "Per-Triangle Shadow Volumes Using a View-Sample Cluster Hierarchy", 2014: Figures 1,
3 and 5 to 9, and the memory of section 3.

The ranges below were fixed before anything was measured at full size; the explanations were added afterwards.
"""

from __future__ import annotations

from dataclasses import replace

from shadowbench.reproduce import cluster_plots
from shadowbench.reproduce.cluster_methods import (
    ALL_CASTERS,
    CLUSTER,
    COMPACT,
    IMPLICIT,
    ONE_PASS,
    PTSV,
    SPLIT_3,
    SPLIT_4,
    STAGES,
    STEPS,
    WEDGE,
    Z_PASS,
    build_share,
    build_variation,
    growth,
    hd_over,
    largest_memory,
    largest_over_mean,
    lead,
    near_over_elsewhere,
    operations_per_sample,
    spikes,
    time_over_cluster,
    worst,
)
from shadowbench.reproduce.cluster_rows import NEAR_STEP, STEP_OF_DEPTH, add_tests_near_steps, counted, job_rows
from shadowbench.reproduce.items import Claim, Item, Measurement, Range, about, at_least, at_most
from shadowbench.reproduce.rows import cell_rows, values
from shadowbench.reproduce.variants import frame_ratios, ratio, share_at_most_one

PAPER = "sintorn2014"
EXPONENT_SHARE = 0.25
"""A ratio of two totals of one scene holds within this share: most of what the stand-in does differently cancels."""

MEMORY_SHARE = 0.05
"""Memory is arithmetic: it holds within the rounding of the published numbers."""

MIB = 2.0**20

SETTINGS = ("Back faces alone cast (front-face culling, FFC) unless said otherwise. `cluster` has the paper's settings but "
            "one: its slices of depth start near the nearest sample, not at the near plane, which is at 0.1 m in the "
            "stand-in scenes and would leave almost everything in the last slice. PTSV has the settings of 2011: 32 "
            "children a tile, two silhouette planes. ")
COUNTING = ("`cluster` counts tests of children that exist, and 64 samples per visited leaf tile; `ptsv` counts all 32 "
            "children of a visited tile. `open_tests` is the number for `ptsv` without children that hold no samples or are "
            "already in shadow, and claims are judged under both. ")
LITTLE_SAVED = ("In frames with little shadow the traversal saves less than the wedge planes cost more than PTSV's "
                "silhouette planes in the triangle setup (data.csv has the stages), and on a shared machine the load varied")
SHARED_MACHINE = "Times on a shared machine: the load varied"
GPU = "Times are of a CPU, the paper's of a GPU that rasterises shadow quads in hardware: compare ratios alone. "
NO_HARDWARE = "z-pass has no rasterisation hardware here"


GATE = Measurement("gate", 1024, (0,), (CLUSTER.spec, PTSV.spec), repeats=3, images=True)
GATE_Z_PASS = replace(GATE, methods=(Z_PASS.spec,), repeats=1, warm_up=False, images=False, verify=False)


def smaller(*measurements: Measurement) -> tuple[Measurement, ...]:
    """Measure the same at a quarter of the size."""
    return tuple(replace(m, size=m.size // 4, height=m.height // 4, published_size=m.published_size or m.size,
                         repeats=min(m.repeats, 1)) for m in measurements)


F1 = Item(
    "S14.F1", PAPER, "View through a gate: cluster hierarchy, PTSV, z-pass", "Figure 1",
    "The view, and the last four levels of the cluster hierarchy, every node in a colour of its own. " + SETTINGS + COUNTING
    + GPU + "The time of z-pass, which draws the silhouettes of all casters, leaves out the count of the volumes around the "
    "eye.",
    full=(GATE, GATE_Z_PASS), quick=smaller(GATE, GATE_Z_PASS),
    rows=counted("all_work", "seconds", "stage.hierarchy", "stage.traversal", "stage.eye_count"),
    claims=(
        Claim("PTSV takes 1.8 times as long as the cluster hierarchy", "1.8x", time_over_cluster(PTSV),
              about(1.8, EXPONENT_SHARE), at_least(1.0),
              otherwise="Here clusters gain more than published, in time as in operations (the next claim)"),
        Claim("z-pass takes 2.9 times as long as the cluster hierarchy", "2.9x", time_over_cluster(Z_PASS),
              about(2.9, EXPONENT_SHARE), at_least(1.0), otherwise=NO_HARDWARE),
        Claim("PTSV needs more operations than the cluster hierarchy", "not for this view; over 2x at steps of depth",
              ratio(PTSV, CLUSTER), at_least(2.0), at_least(1.0)),
        Claim("The same, PTSV's operations counted as `open_tests`", "not for this view; over 2x at steps of depth",
              ratio(PTSV, CLUSTER, "open_tests"), at_least(2.0), at_least(1.0)),
        Claim("z-pass needs more operations than the cluster hierarchy", "not published; expected above 1x",
              ratio(Z_PASS, CLUSTER), at_least(2.0), at_least(1.0))),
    plot=cluster_plots.gate_view)


F3 = Item(
    "S14.F3", PAPER, "Tests per pixel: PTSV hot along depth discontinuities, clusters not", "Figure 3",
    "Tests per sample on one logarithmic scale. A depth discontinuity is where one of two neighbouring samples is "
    f"{STEP_OF_DEPTH} times as far away as the other; near it are lit candidates within {NEAR_STEP} pixels. " + SETTINGS
    + "The tests of a node are shared out evenly: with `cluster` over its samples, with PTSV over the pixels of its tile. "
    "data.csv also says how many per cent of the candidates near discontinuities and elsewhere lie at a shadow's edge.",
    full=(GATE,), quick=smaller(GATE), rows=counted(),
    claims=(
        Claim("PTSV: tests near discontinuities over those elsewhere", "hot along discontinuities",
              near_over_elsewhere(PTSV), at_least(2.0), at_least(1.25)),
        Claim("Clusters: tests near discontinuities over those elsewhere", "about 1x", near_over_elsewhere(CLUSTER),
              at_most(1.5), at_most(2.0), otherwise="Near discontinuities of this view about four times as many candidates "
              "lie at a shadow's edge (edges_near, edges_elsewhere), so any method needs more tests there"),
        Claim("Near discontinuities, PTSV tests a sample more often than clusters do", "far more",
              ratio(PTSV, CLUSTER, "tests_near"), at_least(2.0), at_least(1.0)),
        Claim("PTSV's excess near discontinuities over that of clusters", "far more",
              lambda rows: near_over_elsewhere(PTSV)(rows) / near_over_elsewhere(CLUSTER)(rows), at_least(2.0),
              at_least(1.25))),
    plot=cluster_plots.heat_maps, from_pictures=add_tests_near_steps)

TIMED = tuple(range(0, 48, 9))


def fly_through(scene: str, z_pass: tuple[int, ...]) -> tuple[Measurement, ...]:
    """Frames along a path, timed; z-pass, which takes many seconds a frame, on fewer."""
    timed = Measurement(scene, 1024, TIMED, (CLUSTER.spec, ALL_CASTERS.spec, PTSV.spec), repeats=2, verify=False)
    return (timed, *(replace(timed, frames=(frame,), methods=(Z_PASS.spec,), repeats=1, warm_up=False) for frame in z_pass))


F5_FULL = (*fly_through("villa", (0,)), *fly_through("citadel", (0, 27)), *fly_through("fuzzy", ()))

F5 = Item(
    "S14.F5", PAPER, "Time of every stage along three fly-throughs", "Figure 5; sec. 3",
    "Milliseconds per frame by stage: building the hierarchy, triangle setup, traversal, merge; the whole time with and "
    "without FFC; PTSV; z-pass on few frames (on none of `fuzzy`: minutes each), the time to count the volumes around the "
    "eye included. " + SETTINGS + GPU,
    full=F5_FULL, quick=smaller(*(replace(m, frames=m.frames[:4:2]) for m in F5_FULL)),
    rows=counted("seconds", *(f"stage.{name}" for name in STAGES)),
    claims=tuple(claim for scene in ("villa", "citadel", "fuzzy") for claim in (
        Claim(f"{scene}: building the hierarchy is a small part of the whole", "fairly low", build_share(scene),
              at_most(25.0), at_most(50.0), " %", SHARED_MACHINE),
        Claim(f"{scene}: the time to build it is constant (coefficient of variation)", "constant",
              build_variation(scene), at_most(0.25), at_most(0.5), "", SHARED_MACHINE),
        Claim(f"{scene}: frames in which clusters are faster than PTSV", "all", lead(PTSV, scene), at_least(90.0),
              at_least(50.0), " %", LITTLE_SAVED),
        *((Claim(f"{scene}: frames in which clusters are faster than z-pass", "all but those with few volumes",
                 lead(Z_PASS, scene), at_least(90.0), at_least(50.0), " %"),) if scene != "fuzzy" else ()),
        Claim(f"{scene}: without FFC the whole takes longer", "significantly",
              ratio(ALL_CASTERS, CLUSTER, "seconds", scene=scene), at_least(1.25), at_least(1.0)))),
    plot=cluster_plots.stage_times)

ALONG = tuple(range(0, 48, 2))
ANIMATED = ("villa", "citadel", "gate")
F6_FULL = tuple(Measurement(scene, 1024, ALONG, (IMPLICIT.spec, WEDGE.spec, CLUSTER.spec, PTSV.spec), verify=False)
                for scene in ANIMATED)


def operations(scene: str) -> tuple[Claim, ...]:
    """Claims of Figure 6 that are the same for every scene, under both ways to count."""
    ways = (("test_and_set", ""), ("open_tests", ", PTSV's as `open_tests`"))
    return tuple(claim for column, way in ways for claim in (
        Claim(f"{scene}: frames in which explicit bounds need no more operations than PTSV{way}", "all",
              share_at_most_one(frame_ratios(CLUSTER, column, PTSV, column, scene=scene)), at_least(100.0), at_least(90.0),
              " %"),
        Claim(f"{scene}: PTSV over explicit bounds where it is worst{way}", "over 2x", worst(PTSV, CLUSTER, column, scene),
              at_least(2.0), at_least(1.25)),
        Claim(f"{scene}: implicit bounds need more operations than PTSV{way}", "above 1x",
              ratio(IMPLICIT, PTSV, column, scene=scene), at_least(1.0), at_least(0.8))))


F6 = Item(
    "S14.F6", PAPER, "Test-and-set operations along fly-throughs", "Figure 6; sec. 2.1 and 3",
    "Test-and-set operations per frame: implicit bounds without further planes, with wedge planes, explicit bounds with "
    "wedge planes, PTSV as published and (dashed) as `open_tests`. The gate is not in the paper's figure. " + SETTINGS
    + COUNTING,
    full=F6_FULL, quick=smaller(*(replace(m, frames=ALONG[::6]) for m in F6_FULL)), rows=counted(),
    claims=(
        *(claim for scene in ANIMATED for claim in operations(scene)),
        Claim("villa: wedge planes help implicit bounds much", "significantly", ratio(IMPLICIT, WEDGE, scene="villa"),
              at_least(1.5), at_least(1.1)),
        Claim("citadel: wedge planes help implicit bounds little", "modest", ratio(IMPLICIT, WEDGE, scene="citadel"),
              Range(1.0, 1.25), Range(1.0, 1.5),
              otherwise="The stand-in's triangles are smaller than a game level's (stones, merlons, leaves): with fewer and "
              "larger triangles of the same town the factor falls, and in scenes of few large triangles it is near 1")),
    plot=cluster_plots.operations)


F7_FULL = Measurement("gate", 1024, (0,), (ONE_PASS.spec, CLUSTER.spec, SPLIT_3.spec, SPLIT_4.spec), verify=False)

F7 = Item(
    "S14.F7", PAPER, "Iterations of the 1024 largest jobs, one pass against two", "Figure 7; sec. 2.2",
    "Iterations (visits of nodes and leaves) of the 1024 largest jobs by rank. With one pass a job is a triangle; with two, "
    "also a triangle and a node of the level at which the traversal is split: 2 by default; the paper does not say. "
    + SETTINGS,
    full=(F7_FULL,), quick=smaller(F7_FULL), rows=job_rows,
    claims=(
        Claim("One pass: the largest job over the mean of the 1024 largest", "about 10x", largest_over_mean(ONE_PASS),
              Range(5.0, 20.0), at_least(2.0)),
        Claim("Two passes: the largest job over the mean of the 1024 largest", "not many more than the average",
              largest_over_mean(CLUSTER), at_most(2.0), at_most(5.0),
              otherwise="The excess falls with the level of the split (data.csv has levels 3 and 4), while the mean of the "
              "largest falls as well; what is left is the first pass over the upper levels, which this split does not cut"),
        Claim("Two passes make the largest job smaller", "no spike",
              lambda rows: (values(rows, "iterations", method=ONE_PASS.label)[0]
                            / values(rows, "iterations", method=CLUSTER.label)[0]), at_least(2.0), at_least(1.0))),
    plot=cluster_plots.jobs)

F8_FULL = tuple(Measurement(scene, 1024, TIMED, tuple(step.spec for step in STEPS), repeats=2, verify=False)
                for scene in ("villa", "citadel"))


F8 = Item(
    "S14.F8", PAPER, "Time of the traversal by optimisation", "Figure 8; sec. 3",
    "Milliseconds of the traversal: implicit bounds without further planes; with wedge planes; with explicit bounds; in two "
    "passes. " + SETTINGS + GPU,
    full=F8_FULL, quick=smaller(*(replace(m, frames=TIMED[::3]) for m in F8_FULL)),
    rows=counted("seconds", "stage.traversal"),
    claims=tuple(claim for scene in ("villa", "citadel") for claim in (
        *(Claim(f"{scene}: {name} make the traversal faster", "above 1x",
                ratio(before, after, "stage.traversal", scene=scene), at_least(1.1), at_least(0.95))
          for name, before, after in (("wedge planes", *STEPS[:2]), ("explicit bounds", *STEPS[1:3]))),
        Claim(f"{scene}: two passes remove spikes (slowest frame over the median, one pass over two)", "spikes gone",
              spikes(scene), at_least(1.1), at_least(0.95),
              otherwise="The slowest frame is as slow with two passes: it has more work in all, not one job that holds up "
              "the others, which is what two passes cut"))),
    plot=cluster_plots.traversal)

HD = Measurement("citadel", 1920, TIMED, (COMPACT.spec,), repeats=3, verify=False, height=1080)
F9_FULL = (HD, replace(HD, size=1280, height=720), replace(HD, size=1024, height=0))


F9 = Item(
    "S14.F9", PAPER, "1920 x 1080 against 1280 x 720 and 1024 x 1024", "Figure 9; sec. 3",
    "Milliseconds by stage with the compact layout, and operations. " + SETTINGS + GPU,
    full=F9_FULL, quick=smaller(*(replace(m, frames=TIMED[::3]) for m in F9_FULL)),
    rows=counted("seconds", *(f"stage.{name}" for name in STAGES)),
    claims=tuple(claim for size, height in ((1280, 720), (1024, 1024)) for claim in (
        Claim(f"Building takes about twice as long as at {size} x {height}", "about 2x", hd_over(size, "stage.hierarchy"),
              about(2.0, EXPONENT_SHARE), Range(1.0, 4.0),
              otherwise="Times at 1024 x 1024 scatter most over the frames (data.csv): the machine was shared. The fastest "
              "frames of either size give a ratio within the range"),
        Claim(f"Traversal grows less than building against {size} x {height}", "much less",
              growth("stage.traversal", "stage.hierarchy", size), at_most(0.75), at_most(1.0),
              otherwise="An image as high but wider sees more of the scene, so it has new work, not only finer samples"),
        Claim(f"Operations grow less than samples against {size} x {height}", "much less",
              operations_per_sample(size, height), at_most(0.75), at_most(1.0),
              otherwise="An image as high but wider sees more of the scene, so it has new work, not only finer samples"))),
    plot=cluster_plots.resolutions)

C1_FULL = tuple(Measurement(scene, 1024, TIMED[::2], (CLUSTER.spec, COMPACT.spec), repeats=5, verify=False)
                for scene in ("villa", "citadel", "fuzzy"))


C1 = Item(
    "S14.C1", PAPER, "Memory of the full and the compact layout", "sec. 3",
    "Memory as the paper models it: a bit per possible node; six floats per box; in the compact layout a pointer per "
    "possible node and a box per occupied one. Sizes are of 1024 x 1024 samples, in MiB. " + SETTINGS + GPU,
    full=C1_FULL, quick=tuple(replace(m, frames=TIMED[:1], repeats=1) for m in C1_FULL),
    rows=cell_rows("seconds", "occupied_nodes", "memory.child_bits", "memory.modelled_full", "memory.modelled_compact",
                   "memory.boxes", "memory.box_places"),
    claims=(
        Claim("Nodes of the full tree", "8.65 M", largest_memory("modelled_full", 24e6),
              about(8.65, MEMORY_SHARE), about(8.65, EXPONENT_SHARE), " M"),
        Claim("Bits", "1 MB", largest_memory("child_bits", MIB),
              about(1.0, MEMORY_SHARE), about(1.0, EXPONENT_SHARE), " MiB"),
        Claim("Boxes of the full layout", "198 MB", largest_memory("modelled_full", MIB),
              about(198.0, MEMORY_SHARE), about(198.0, EXPONENT_SHARE), " MiB"),
        Claim("Pointers of the compact layout", "33 MB", largest_memory("modelled_full", 6.0 * MIB),
              about(33.0, MEMORY_SHARE), about(33.0, EXPONENT_SHARE), " MiB"),
        Claim("Occupied nodes at most", "52,000", lambda rows: max(values(rows, "occupied_nodes")) / 1e3, at_most(52.0),
              at_most(104.0), " thousand", "Villa and citadel stay below; the fur of `fuzzy` spreads the samples of a tile "
              "over many slices, which from the nearest sample on are finer than from the near plane on"),
        Claim("Boxes of the compact layout at most", "25 MB in the worst case",
              lambda rows: max(values(rows, "occupied_nodes")) * 24 / MIB, at_most(25.0), at_most(25.0), " MiB"),
        Claim("The compact layout takes at most 5 % more time", "at most 1.05x", ratio(COMPACT, CLUSTER, "seconds"),
              at_most(1.05), at_most(1.1))))

ITEMS = (F1, F3, F5, F6, F7, F8, F9, C1)
