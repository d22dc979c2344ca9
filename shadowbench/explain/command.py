"""The `explain` command: which tests a pixel or a triangle cost, one by one."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import click
import numpy as np

from shadowbench.algorithm_specs import parse_algorithm_spec, validate_params
from shadowbench.algorithms import ALGORITHMS
from shadowbench.algorithms.base import Algorithm, Transparency, taken_materials
from shadowbench.errors import InputError
from shadowbench.explain.methods import WALKS, refusal
from shadowbench.explain.picture import page
from shadowbench.explain.trace import Corner, Trace, joined
from shadowbench.geometry import Frame
from shadowbench.probe import Probe
from shadowbench.report import pictures
from shadowbench.report.table import align
from shadowbench.results import make_label
from shadowbench.scenes.loader import Scene, load_scene
from shadowbench.view_samples import render_view_samples


def explain(scene_name: str, spec: str, pixel: tuple[int, int] | None, triangle: int | None, *, frame: int,
            overrides: Sequence[str], size: tuple[int, int] | None, output: Path | None, everything: bool) -> None:
    """Print every test of a pixel or a triangle, and write the page with the picture."""
    changes = [*overrides, *([f"image.width={size[0]}", f"image.height={size[1]}"] if size else [])]
    name, given = parse_algorithm_spec(spec)
    algorithm = ALGORITHMS[name].load()(validate_params(name, given))
    scene = load_scene(scene_name, changes)
    _check(scene, algorithm, pixel, triangle, frame)
    target = output or Path(f"explain-{_subject(pixel, triangle).replace(' ', '-')}.html")
    if not target.parent.is_dir():
        raise InputError(f"cannot write {target}: {target.parent} is no folder; choose another file with -o")
    rendered = _frame(scene, algorithm, frame)
    probe = Probe(counting=True)
    buffer = algorithm.shadows(rendered, probe)
    trace, measured = _trace(algorithm, rendered, probe, pixel, triangle)
    label = make_label(name, algorithm.params.model_dump(exclude_defaults=True))
    title = f"{label} at {_subject(pixel, triangle)} of {scene.name}, frame {frame}"
    facts = _facts(rendered, buffer.shadow, trace, measured, pixel, triangle)
    click.echo("\n".join([title, *(f"{key}: {text}" for key, text in facts.items()), "", listing(trace, everything)]))
    spot = _spot(rendered, pixel, triangle)
    grid = (rendered.samples.columns, rendered.samples.rows)
    target.write_text(page(trace, title, pictures.shaded(rendered, [buffer]), grid, spot, facts), encoding="utf-8")
    click.echo(f"\n{trace.note}\npicture: {target}")
    if trace.value != measured:
        raise RuntimeError(f"the walk lists {trace.value} tests and the method counted {measured}: please report this")


def _subject(pixel: tuple[int, int] | None, triangle: int | None) -> str:
    return f"triangle {triangle}" if pixel is None else f"pixel {pixel[0]},{pixel[1]}"


def _check(scene: Scene, algorithm: Algorithm, pixel: tuple[int, int] | None, triangle: int | None, frame: int) -> None:
    """Refuse what can't be explained.

    Raises
    ------
    InputError
        With the reason and what can be done.
    """
    if (pixel is None) == (triangle is None):
        raise InputError("say what to explain: either --pixel X,Y or --triangle T")
    refused = refusal(algorithm.name, getattr(algorithm.params, "group", 1), by_triangle=triangle is not None)
    if refused is not None:
        raise InputError(refused)
    if not 0 <= frame < scene.n_frames:
        raise InputError(f"{scene.name} has frames 0 to {scene.n_frames - 1}, not {frame}: set frames with -D frames=N")
    if pixel is not None and not (0 <= pixel[0] < scene.image.width and 0 <= pixel[1] < scene.image.height):
        raise InputError(f"pixel {pixel[0]},{pixel[1]} is outside the image of {scene.image.width} x {scene.image.height}")
    if scene.image.layers > 1:
        raise InputError("the nearest surfaces alone can be explained: add -D image.layers=1")
    mode: Transparency = getattr(algorithm.params, "transparency", "off")
    if not all(material.is_opaque for material in taken_materials(scene.mesh(frame), mode)):
        raise InputError(f"{scene.name} has materials that let light through, and the walks know opaque casters alone: "
                         f"explain {algorithm.name} with transparency=off")
    n_triangles = scene.mesh(frame).n_triangles
    if triangle is not None and not 0 <= triangle < n_triangles:
        raise InputError(f"{scene.name} has triangles 0 to {n_triangles - 1}, not {triangle}")
    reason = algorithm.unsupported(scene)
    if reason is not None:
        raise InputError(f"{algorithm.name} does not support {scene.name}: {reason}")


def _frame(scene: Scene, algorithm: Algorithm, number: int) -> Frame:
    """Render the view samples of a frame, and prepare the method."""
    mesh, light, image = scene.mesh(number), scene.light(number), scene.image
    samples = render_view_samples(mesh, scene.camera(number), light, image)
    basis = scene.camera(number).basis(image.width / image.height)
    return Frame(mesh, light, basis, image, samples, scene.bias, algorithm.prepare(mesh))


def _trace(algorithm: Algorithm, frame: Frame, probe: Probe, pixel: tuple[int, int] | None, triangle: int | None
           ) -> tuple[Trace, int]:
    """Walk, and look up what the method counted itself."""
    walk = import_module(f"shadowbench.explain.{WALKS[algorithm.name]}")
    if pixel is None:
        counted = next(iter(probe.triangle_counts.values()), np.zeros(frame.mesh.n_triangles, np.int64))
        return walk.explain_triangle(algorithm, frame, triangle), int(counted[triangle])
    samples = samples_of_pixel(frame, *pixel)
    heat = np.zeros(len(frame.samples.depth), np.int64) if probe.heat is None else probe.heat
    traces = [walk.explain_sample(algorithm, frame, sample) for sample in samples]
    return joined(traces, _subject(pixel, None)), int(heat[samples].sum())


def samples_of_pixel(frame: Frame, x: int, y: int) -> list[int]:
    """Numbers of a pixel's view samples."""
    across, down = frame.samples.columns // frame.image.width, frame.samples.rows // frame.image.height
    return [(y * down + j) * frame.samples.columns + x * across + i for j in range(down) for i in range(across)]


def _facts(frame: Frame, shadow: np.ndarray, trace: Trace, measured: int, pixel: tuple[int, int] | None, triangle: int | None
           ) -> dict[str, str]:
    """What to say beforehand."""
    touched = sum(test.place != "a place of the tile off the image" for test in trace.tests)
    if pixel is None:
        return {"corners": " ".join(str(corner) for corner in np.round(frame.mesh.corners[triangle], 4).tolist()),
                "tests": f"{trace.value:,} listed; the method counted {measured:,}"}
    samples = samples_of_pixel(frame, *pixel)
    s = frame.samples
    kinds = ["background" if s.triangle[i] < 0 else "faces away from the light" if not s.candidate[i] else
             f"on triangle {s.triangle[i]}, {'in shadow' if shadow[i] > 0 else 'lit'}" for i in samples]
    return {"surface": "; ".join(dict.fromkeys(kinds)),
            "tests": f"{touched:,} touched it; {trace.value:,} are booked on it; the heat map's value is {measured:,}"}


def _spot(frame: Frame, pixel: tuple[int, int] | None, triangle: int | None) -> tuple[Corner, ...]:
    """Outline of what is explained, in columns and rows of samples; empty for a triangle that is not before the eye."""
    s = frame.samples
    if pixel is not None:
        across, down = s.columns // frame.image.width, s.rows // frame.image.height
        x, y = pixel[0] * across, pixel[1] * down
        return ((x, y), (x + across, y), (x + across, y + down), (x, y + down))
    relative = frame.mesh.corners[triangle] - frame.camera.eye
    depth = (relative * frame.camera.forward).sum(axis=1)
    if depth.min() <= frame.camera.near:
        return ()
    across_image = (relative * frame.camera.right).sum(axis=1) / depth / frame.camera.tan_x
    up_image = (relative * frame.camera.up).sum(axis=1) / depth / frame.camera.tan_y
    return tuple((float(a), float(b)) for a, b in zip((across_image + 1) / 2 * s.columns, (1 - up_image) / 2 * s.rows,
                                                      strict=True))


def listing(trace: Trace, everything: bool = False) -> str:
    """The tests as text: those that are booked, with their numbers; or all."""
    numbers, sums = trace.numbers(), np.cumsum([test.share for test in trace.tests])
    rows: list[tuple[str, ...]] = []
    waiting = 0
    for number, test, total in zip(numbers, trace.tests, sums, strict=True):
        if not number and not everything:
            waiting += 1
            continue
        if waiting:
            rows.append(("", "", f"... {waiting:,} more", "not booked here: --all lists them", ""))
            waiting = 0
        rows.append((str(number or ""), "" if test.triangle is None else str(test.triangle), test.place, test.outcome,
                     f"{total:.3f}"))
    if waiting:
        rows.append(("", "", f"... {waiting:,} more", "not booked here: --all lists them", ""))
    return align(("number", "triangle", "what", "outcome", "sum of shares"), rows, (2, 3))
