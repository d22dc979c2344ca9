"""Methods from outside the package: entry points of installed packages, and single files.

Installed plug-ins are listed from their metadata and imported only when they are used. A plug-in that is broken is
unavailable, with its reason, and never breaks the others.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.algorithms import ALGORITHMS, Entry
from shadowbench.errors import InputError

if TYPE_CHECKING:
    from shadowbench.algorithms.base import Algorithm

GROUP = "shadowbench.algorithms"
"""Entry point group: ``my_method = "my_package.my_module:MyMethod"``."""


@dataclass(frozen=True)
class PluginEntry(Entry):
    """A plug-in's line in the list; `origin` is the file or the package that it comes from."""

    origin: str = ""

    def load(self) -> type[Algorithm]:
        """Import the class and check that it can be used.

        Raises
        ------
        InputError
            Saying what is wrong with the plug-in.
        """
        try:
            loaded = super().load()
        except (Exception, SystemExit) as error:
            raise InputError(f"plug-in {self.name} ({self.origin}) can't be loaded: {_one_line(error)}") from error
        reason = why_unusable(loaded)
        if not reason and loaded.name != self.name:
            reason = f"its class is called {loaded.name}"
        if reason:
            raise InputError(f"plug-in {self.name} ({self.origin}) can't be used: {reason}")
        return loaded


@dataclass(frozen=True)
class Unavailable:
    """A plug-in that can't be used, and why."""

    name: str
    origin: str
    reason: str


_unavailable: list[Unavailable] = []
_files: list[Path] = []


def unavailable() -> tuple[Unavailable, ...]:
    """Plug-ins that can't be used."""
    return tuple(_unavailable)


def plugin_files() -> tuple[Path, ...]:
    """Files that were loaded as plug-ins."""
    return tuple(_files)


def plugin_names() -> list[str]:
    """Names of the plug-ins that are known."""
    return [name for name, entry in ALGORITHMS.items() if isinstance(entry, PluginEntry)]


def find_installed() -> None:
    """List the plug-ins of installed packages, from their metadata alone."""
    from importlib.metadata import entry_points

    for point in entry_points(group=GROUP):
        origin = point.dist.name if point.dist is not None else point.module
        reason = ""
        if point.name in ALGORITHMS:
            if getattr(ALGORITHMS[point.name], "target", "") == point.value:
                continue                                        # found before, in this process
            reason = f"the name {point.name} is taken"
        elif not re.fullmatch(r"[\w.]+:\w+", point.value):
            reason = f"'{point.value}' is no module:Class"
        elif not _exists(point.module.partition(".")[0]):
            reason = f"there is no module {point.module}"
        if reason:
            _unavailable.append(Unavailable(point.name, origin, reason))
        else:
            ALGORITHMS[point.name] = PluginEntry(point.name, point.name, origin, False, f"plug-in of {origin}", point.value,
                                                 origin=origin)


def _exists(module: str) -> bool:
    """True if a top-level module can be found, without importing it."""
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def load_files(files: Iterable[Path]) -> None:
    """Load plug-in files, each once: each may hold one or more classes derived from `Algorithm`."""
    for file in files:
        if file.absolute() in _files:
            continue
        try:
            found = _classes_in(file.absolute())
        except (Exception, SystemExit) as error:
            _unavailable.append(Unavailable(file.stem, str(file), _one_line(error)))
            continue
        _files.append(file.absolute())
        if not found:
            _unavailable.append(Unavailable(file.stem, str(file), "holds no class derived from "
                                                                  "shadowbench.algorithms.base.Algorithm"))
        for each in found:
            name = getattr(each, "name", None)
            reason = why_unusable(each) or (f"the name {name} is taken" if name in ALGORITHMS else "")
            if reason:
                _unavailable.append(Unavailable(str(name or each.__name__), str(file), reason))
                continue
            summary = (each.__doc__ or "").strip().partition("\n")[0] or f"plug-in of {file.name}"
            ALGORITHMS[each.name] = PluginEntry(each.name, each.title, each.paper, each.exact, summary,
                                                f"{each.__module__}:{each.__name__}", origin=str(file))


def _classes_in(file: Path) -> list[type[Algorithm]]:
    """Execute a file as a module and find the methods that it defines."""
    if not file.is_file():
        raise FileNotFoundError(f"no such file: {file}")
    module_name = f"shadowbench_plugin_{re.sub(r'[^A-Za-z0-9_]', '_', file.stem)}_{_digest(str(file))}"
    spec = importlib.util.spec_from_file_location(module_name, file)
    if spec is None or spec.loader is None:
        raise ImportError("is no Python file (its name must end in .py)")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[module_name]
        raise
    from shadowbench.algorithms.base import Algorithm

    return [value for value in vars(module).values() if isinstance(value, type) and issubclass(value, Algorithm)
            and value.__module__ == module_name]


def why_unusable(loaded: Any) -> str:
    """Say in one sentence why a class can't serve as a method; empty if it can."""
    from shadowbench.algorithms.base import Algorithm, AlgorithmParams

    if not isinstance(loaded, type) or not issubclass(loaded, Algorithm):
        return "it is no class derived from shadowbench.algorithms.base.Algorithm"
    missing = [key for key in ("name", "title", "paper", "exact", "stages", "counters") if not hasattr(loaded, key)]
    if missing:
        return f"the class {loaded.__name__} lacks {', '.join(missing)}"
    if not isinstance(loaded.name, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", loaded.name):
        return f"its name {loaded.name!r} is no word of small letters, digits and '_'"
    if getattr(loaded, "__abstractmethods__", None):
        return f"the class {loaded.__name__} lacks the method {', '.join(sorted(loaded.__abstractmethods__))}"
    if not isinstance(loaded.Params, type) or not issubclass(loaded.Params, AlgorithmParams):
        return "its Params is not derived from AlgorithmParams"
    return ""


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def _one_line(error: BaseException) -> str:
    """Write an exception as one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
