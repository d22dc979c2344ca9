"""Digests of the sources that a module's code depends on: what compiled kernels and results are filed under.

A module depends on the package modules that it imports, on those that they import, and on the package's records:
a compiled kernel reads a field by its place, and the record may be defined in a module that the kernel's does not
import.
"""

import functools
import hashlib
import re
from pathlib import Path

PACKAGE = Path(__file__).parent

_IMPORT = re.compile(rf"^[ \t]*(?:from|import)[ \t]+({PACKAGE.name}(?:\.\w+)*)"
                     r"(?:[ \t]+import[ \t]+(\([^)]*\)|[^\n]*))?", re.MULTILINE)
_FOR_TYPES_ONLY = re.compile(r"^if TYPE_CHECKING:\n(?:(?:[ \t][^\n]*)?\n)*", re.MULTILINE)
_RECORD = re.compile(r"^class \w+\(NamedTuple\):\n(?:(?:[ \t][^\n]*)?\n)*", re.MULTILINE)
_FIELD = re.compile(r"^    \w+:", re.MULTILINE)


@functools.cache
def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@functools.cache
def _imported(path: Path) -> tuple[Path, ...]:
    """Files of the package modules that a file imports, with the packages that they lie in."""
    found: list[Path] = []
    for module, names in _IMPORT.findall(_FOR_TYPES_ONLY.sub("", _text(path))):
        parts = module.split(".")[1:]
        dotted = [parts[:n] for n in range(len(parts) + 1)] + [[*parts, name] for name in re.findall(r"\w+", names)]
        for place in dotted:
            base = PACKAGE.joinpath(*place)
            found += [file for file in (base.with_suffix(".py"), base / "__init__.py") if file.is_file()]
    return tuple(found)


@functools.cache
def record_fields() -> str:
    """Fields of every NamedTuple in the package, in order."""
    lines = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for record in _RECORD.findall(_text(path)):
            name = record.partition("(")[0]
            lines.append(f"{path.relative_to(PACKAGE).as_posix()} {name} {' '.join(_FIELD.findall(record))}")
    return "\n".join(lines)


@functools.cache
def source_digest(path: Path) -> str:
    """Digest of a module's file and of all package sources that its code depends on, as 16 hexadecimal digits.

    Parameters
    ----------
    path : the module's file, in the package or outside.
    """
    reached, waiting = {path}, [path]
    while waiting:
        for file in _imported(waiting.pop()):
            if file not in reached:
                reached.add(file)
                waiting.append(file)
    digest = hashlib.sha256(record_fields().encode())
    for file in sorted(reached, key=lambda file: (file.name, file)):
        name = file.relative_to(PACKAGE).as_posix() if file.is_relative_to(PACKAGE) else file.name
        digest.update(f"{name}\n{_text(file)}".encode())
    return digest.hexdigest()[:16]
