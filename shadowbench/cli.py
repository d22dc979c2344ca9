"""The command line: parse, call one function, print. Commands import what they need when they run, so that
``--help``, ``list`` and shell completion stay fast."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import click

from shadowbench import __version__
from shadowbench.algorithms import ALGORITHMS
from shadowbench.cli_types import (
    AlgorithmArgument,
    FrameRange,
    ImageSizeArgument,
    ItemArgument,
    OutputSet,
    PixelArgument,
    SceneArgument,
    with_plugins,
)
from shadowbench.errors import InputError
from shadowbench.scenes import ALL_SCENES, SCENES

EXIT_OK, EXIT_INTERNAL, EXIT_USAGE, EXIT_REGRESSION, EXIT_SOME_FAILED, EXIT_NOTHING = range(6)
EXIT_INTERRUPTED = 130


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="shadowbench")
def cli() -> None:
    """Run hard-shadow algorithms on a scene: certified correctness, exact operation counts, timings, pictures."""


@cli.command()
@click.argument("scenes", metavar="SCENE...", nargs=-1, required=True, type=SceneArgument())
@click.option("-a", "--algorithm", "specs", multiple=True, type=AlgorithmArgument(),
              help="Algorithm to run, such as 'shadow_map[resolution=512]'; repeat for several. Default: the scene "
                   "file's list, or all that support the scene.")
@click.option("-D", "--define", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Override a value of the scene file, such as image.width=512.")
@click.option("--frames", type=FrameRange(), help="Frames to run. Default: all of the scene's.")
@click.option("--size", type=ImageSizeArgument(), help="Image size, overriding the scene file's.")
@click.option("--repeats", type=click.IntRange(1), help="Timed executions per cell. Default: 3.")
@click.option("--threads", type=click.IntRange(1), help="Threads. Default: all processors.")
@click.option("--out", type=click.Path(path_type=Path), help="Run folder. Default: results/runs/<time>-<scene>.")
@click.option("--only", type=OutputSet(), help="Produce only some of: counts,timings,images.")
@click.option("--timeout", type=click.FloatRange(0, min_open=True), metavar="SECONDS",
              help="Give up a cell after so long, compiling left out, and go on with the next.")
@click.option("--resume", is_flag=True, help="Go on with the run in --out: what it finished is kept.")
@click.option("--quick", is_flag=True, help="First frame, at most 256 pixels high, one repeat.")
@click.option("--dry-run", is_flag=True, help="List the cells, and how long they took before, and stop.")
@click.option("--keep-going/--fail-fast", default=True, help="After a failed cell, go on or stop. Default: go on.")
@with_plugins
def run(**options: Any) -> None:
    """Measure algorithms on scenes.

    SCENE is a scene file, or the name of a built-in scene (see `shadowbench list scenes`).
    """
    from shadowbench.run_command import run as command

    sys.exit(command(sys.argv[1:], **options))


@cli.command()
@click.argument("suite", metavar="[SUITE.yaml]", default=Path("configs/ci.yaml"), type=click.Path(path_type=Path))
@click.option("--baseline", type=click.Path(path_type=Path, dir_okay=False), default=Path("results/counts.lock"),
              show_default=True, help="File of expected counts.")
@click.option("--update", is_flag=True, help="Make the baseline anew and list what changed. Refused where CI is set.")
@click.option("--tolerance", "tolerances", multiple=True, metavar="COUNTER=PERCENT",
              help="Let a counter change by so much; repeat for several. Default: no change at all.")
@click.option("--format", "style", type=click.Choice(["text", "md"]), default="text", show_default=True,
              help="Text, or Markdown for a CI summary (also added to $GITHUB_STEP_SUMMARY where that is set).")
@click.option("--threads", type=click.IntRange(1), help="Threads. Default: all processors.")
@with_plugins
def check(suite: Path, **options: Any) -> None:
    """Compare operation counts with the committed baseline.

    Fails (exit code 3) if a count of work grew, if a method did something else than before, if a count is missing from
    either side, or if an exact method has a wrong sample. Fewer operations are listed as improvements and do not fail.
    SUITE.yaml is configs/ci.yaml unless another is named.
    """
    from shadowbench.check.run import check as command

    sys.exit(command(suite, **options))


@cli.command()
@click.argument("algorithms", metavar="[ALG[key=value,...]]...", nargs=-1, type=AlgorithmArgument())
@click.option("--case", metavar="NAME", help="Run one case alone.")
@click.option("--quick", is_flag=True, help="Leave out the large image and the large mesh.")
@with_plugins
def verify(algorithms: tuple[str, ...], case: str | None, quick: bool) -> None:
    """Examine methods: interface, counts, determinism, and hard cases against the reference.

    Without ALG, all methods and plug-ins. Ends with exit code 3 if something is wrong, and says what, and how to run that
    case again.
    """
    from shadowbench.conformance.run import verify as command

    sys.exit(command(algorithms, case, quick))


@cli.command()
@click.argument("what", metavar="list|all|PAPER[/ITEM]", type=ItemArgument())
@click.option("--quick", is_flag=True, help="Small sizes and few frames: minutes in all.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("results"), show_default=True,
              help="Folder for PAPER/ITEM/ and for the measured cells, runs/reproduce/.")
@click.option("--redraw", is_flag=True, help="Measure nothing: judge and draw anew from each data.csv that is there.")
def reproduce(what: str, quick: bool, out: Path, redraw: bool) -> None:
    """Measure published figures, tables and claims again, and say which hold.

    Each item's folder gets data.csv, the figure or table, caption.md and verdict.json; README.md lists them all. Measured
    cells are kept: the same command goes on where it was stopped.
    """
    from shadowbench.reproduce import all_items, find_items

    if what == "list":
        items = all_items()
        widths = [max(len(text) for text in column) for column in zip(*((i.paper, i.id) for i in items), strict=True)]
        for item in items:
            click.echo(f"{item.paper:<{widths[0]}}  {item.id:<{widths[1]}}  {item.title}")
        return
    chosen = find_items(what)
    from shadowbench.reproduce import run as command

    sys.exit(command.redraw(chosen, out) if redraw else command.reproduce(chosen, quick, out))


@cli.command()
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="FILE",
              help="File to write. Default: report.html in the run folder, or in the current one for several runs.")
@with_plugins
def report(runs: tuple[Path, ...], output: Path | None) -> None:
    """Make one offline HTML file about runs: correctness, counts, times, pictures, failures, raw data.

    RUN is a run folder. Where the pictures of all frames take more than 20 MB, a zip file is written instead; unpack it and
    open its report.html.
    """
    from shadowbench.report.command import report as command

    click.echo(command(runs, output))


@cli.command()
@click.argument("run_a", type=click.Path(path_type=Path))
@click.argument("run_b", type=click.Path(path_type=Path))
@click.option("--format", "style", type=click.Choice(["table", "md", "csv"]), default="table", show_default=True,
              help="Aligned text, Markdown, or every value as CSV.")
def compare(run_a: Path, run_b: Path, style: str) -> None:
    """Compare two runs: counts, times with their spread, accuracy, pictures.

    Says which differences of time are noise. Ends with exit code 5 if the runs have nothing in common.
    """
    from shadowbench.compare.command import compare as command

    sys.exit(command(run_a, run_b, style))


@cli.command()
@click.argument("scene", type=SceneArgument())
@click.option("-a", "--algorithm", "spec", required=True, type=AlgorithmArgument(),
              help="Method, such as 'ptsv[branching=8]'.")
@click.option("--pixel", type=PixelArgument(), help="Pixel to explain, from 0,0 at the top left.")
@click.option("--triangle", type=click.IntRange(0), help="Triangle to explain, by its number in the scene's mesh.")
@click.option("--frame", type=click.IntRange(0), default=0, show_default=True, help="Frame.")
@click.option("-D", "--define", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a value of the scene file.")
@click.option("--size", type=ImageSizeArgument(), help="Image size, overriding the scene file's.")
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="FILE",
              help="Page with the picture. Default: explain-pixel-X,Y.html or explain-triangle-T.html.")
@click.option("--all", "everything", is_flag=True, help="List also the tests that the heat map books on other samples.")
@with_plugins
def explain(scene: str, spec: str, pixel: tuple[int, int] | None, triangle: int | None, frame: int,
            overrides: tuple[str, ...], size: tuple[int, int] | None, output: Path | None, everything: bool) -> None:
    """List every test that touched a pixel, or that a triangle caused, with its outcome.

    As many tests are numbered as the method's heat map says at that pixel. Also writes a page with the picture of the nodes,
    cells or faces that were walked.
    """
    from shadowbench.explain.command import explain as command

    command(scene, spec, pixel, triangle, frame=frame, overrides=overrides, size=size, output=output, everything=everything)


@cli.command("list")
@click.argument("kind", type=click.Choice(["algorithms", "scenes", "counters"]))
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@with_plugins
def list_command(kind: str, as_json: bool) -> None:
    """List algorithms, built-in scenes or counters."""
    from shadowbench.counters import ALL_COUNTERS
    from shadowbench.plugins import unavailable

    rows: list[dict[str, Any]]
    if kind == "algorithms":
        rows = [{"name": a.name, "paper": a.paper, "exact": a.exact, "summary": a.summary}
                for a in ALGORITHMS.values()]
        rows += [{"name": p.name, "summary": f"unavailable ({p.origin}): {p.reason}"} for p in unavailable()]
    elif kind == "scenes":
        rows = [{"name": s.name, "triangles": s.triangles, "summary": s.summary} for s in ALL_SCENES]
    else:
        rows = [{"name": c.name, "unit": c.unit, "definition": c.definition, "source": c.source,
                 "in_test_and_set": c.in_test_and_set, "in_all_work": c.in_all_work} for c in ALL_COUNTERS]
    if as_json:
        click.echo(json.dumps(rows, indent=2))
        return
    width = max(len(row["name"]) for row in rows)
    for row in rows:
        click.echo(f"{row['name']:<{width}}  {row.get('summary') or row['definition']}")


@cli.command()
@click.argument("what", metavar="ALG|SCENE|RUN")
@with_plugins
def show(what: str) -> None:
    """Show an algorithm's parameters and stages, a built-in scene, a scene file, or the results in a run folder."""
    from shadowbench import commands

    if what in ALGORITHMS:
        click.echo(commands.describe_algorithm(what))
    elif what in SCENES or Path(what).suffix in (".yaml", ".yml"):
        click.echo(commands.describe_scene(what))
    elif Path(what).is_dir():
        click.echo(commands.describe_run(Path(what)))
    else:
        raise InputError(commands.not_found(what))


@cli.command()
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@with_plugins
def validate(files: tuple[Path, ...]) -> None:
    """Check scene files and suites and print every problem with its line and column."""
    from shadowbench.commands import validate_file

    problems = []
    for file in files:
        try:
            validate_file(file)
            click.echo(f"{file}: ok")
        except InputError as error:
            problems.append(str(error))
    if problems:
        raise InputError("\n".join(problems))


@cli.command()
@click.argument("kind", type=click.Choice(["scene", "result"]))
def schema(kind: str) -> None:
    """Print the JSON schema of scene files, or of one line of results.jsonl."""
    if kind == "scene":
        from shadowbench.config import scene_schema

        document = scene_schema()
    else:
        from shadowbench.results import CellResult

        document = CellResult.model_json_schema(by_alias=True)
    click.echo(json.dumps(document, indent=2))


@cli.command()
@click.argument("name", default="scene", type=SceneArgument())
@click.option("--mesh", type=click.Path(path_type=Path), metavar="FILE",
              help="A mesh of your own: the scene shows it, with a camera and a light around it.")
def init(name: str, mesh: Path | None) -> None:
    """Write a commented scene file, NAME.yaml, to start from."""
    from shadowbench import commands

    file = commands.write_template(name, mesh)
    click.echo(file)
    click.echo(f"Next: edit it, then `shadowbench run {file}`", err=True)


def main() -> None:
    """Entry point: turn every way to end into its exit code."""
    try:
        cli.main(standalone_mode=False)
    except click.exceptions.Exit as error:
        sys.exit(error.exit_code)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except InputError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(EXIT_USAGE)
    except (KeyboardInterrupt, click.Abort):
        click.echo("interrupted", err=True)
        sys.exit(EXIT_INTERRUPTED)
    except BrokenPipeError:                      # the reader of stdout went away, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
