"""Types of the command line's arguments, which check, convert and complete; and the option that all plug-ins need."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from shadowbench.algorithms import ALGORITHMS
from shadowbench.scenes import ALL_SCENES


class SceneArgument(click.ParamType):
    """A scene file, or the name of a built-in scene; completes both."""

    name = "scene"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer built-in names, then files."""
        names = [CompletionItem(s.name, help=s.summary) for s in ALL_SCENES if s.name.startswith(incomplete)]
        return names or [CompletionItem(incomplete, type="file")]


class AlgorithmArgument(click.ParamType):
    """``NAME`` or ``NAME[key=value,...]``; completes names."""

    name = "algorithm"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer the names of all algorithms."""
        return [CompletionItem(a.name, help=a.summary) for a in ALGORITHMS.values() if a.name.startswith(incomplete)]


class FrameRange(click.ParamType):
    """``A:B[:STEP]`` as in Python (B is left out), or one number."""

    name = "A:B[:STEP]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> slice:
        """Turn text into a slice."""
        if isinstance(value, slice):
            return value
        try:
            parts = [int(part) if part else None for part in value.split(":")]
            if len(parts) == 1 and parts[0] is not None:
                return slice(parts[0], parts[0] + 1)
            if not 2 <= len(parts) <= 3 or (len(parts) == 3 and parts[2] == 0):
                raise ValueError
        except ValueError:
            self.fail(f"{value!r} is no frame range: write A:B, A:B:STEP or one number", param, ctx)
        if any(part is not None and part < 0 for part in parts):
            self.fail(f"{value!r}: frames and steps count from 0 up", param, ctx)
        return slice(*parts)


class ImageSizeArgument(click.ParamType):
    """``WIDTHxHEIGHT``."""

    name = "WxH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Turn ``640x480`` into two numbers."""
        if isinstance(value, tuple):
            return value
        width, cross, height = value.lower().partition("x")
        if not (cross and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
            self.fail(f"{value!r} is no image size: write WIDTHxHEIGHT, such as 1024x1024", param, ctx)
        return int(width), int(height)


class OutputSet(click.ParamType):
    """A comma-separated subset of counts, timings and images."""

    name = "counts,timings,images"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> frozenset[str]:
        """Turn the text into a set."""
        if isinstance(value, frozenset):
            return value
        chosen = frozenset(value.split(","))
        unknown = chosen - {"counts", "timings", "images"}
        if unknown:
            self.fail(f"unknown output {sorted(unknown)[0]!r}: choose from counts, timings, images", param, ctx)
        return chosen


class PixelArgument(click.ParamType):
    """``X,Y``, from the top left."""

    name = "X,Y"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Turn ``160,120`` into two numbers."""
        if isinstance(value, tuple):
            return value
        x, comma, y = value.partition(",")
        if not (comma and x.strip().isdecimal() and y.strip().isdecimal()):
            self.fail(f"{value!r} is no pixel: write X,Y, counted from 0 at the top left", param, ctx)
        return int(x), int(y)


class ItemArgument(click.ParamType):
    """What `reproduce` takes; completes papers and items."""

    name = "item"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Offer the words, the papers and their items."""
        from shadowbench.reproduce import ALL_PAPERS, all_items

        known = [CompletionItem("list", help="what there is"), CompletionItem("all", help="everything"),
                 *(CompletionItem(paper.name, help=paper.title) for paper in ALL_PAPERS),
                 *(CompletionItem(f"{item.paper}/{item.id}", help=item.title) for item in all_items())]
        return [item for item in known if item.value.startswith(incomplete)]


def _find_plugins(ctx: click.Context, param: click.Parameter, files: tuple[Path, ...]) -> None:
    """List installed plug-ins and load those given as files, before any other option is looked at."""
    from shadowbench import plugins

    plugins.find_installed()
    plugins.load_files(files)
    if ctx.info_name != "list":
        for each in plugins.unavailable():
            click.echo(f"warning: plug-in {each.name} ({each.origin}) is unavailable: {each.reason}", err=True)


with_plugins = click.option("--plugin", multiple=True, metavar="FILE.py", type=click.Path(path_type=Path), is_eager=True,
                            expose_value=False, callback=_find_plugins,
                            help="File with a method of your own; repeat for several.")
