"""YAML text to plain Python values, with the line and column of every key and value.

Nothing here knows what a scene file means. Reading never fails: whatever is wrong becomes a `Problem`, so that all
problems of a file can be reported together. YAML 1.2 through ruamel.yaml: ``1e-4`` is a number, ``no`` is text.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    MappingEndEvent,
    MappingStartEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

KeyPath = tuple[str | int, ...]

MAX_BYTES = 1_000_000
"""Largest file read: scene files are a few kilobytes; a larger one is a mesh or a picture given by mistake."""
MAX_DEPTH = 32
"""Deepest nesting: the format needs 6; the limit keeps recursion shallow."""
MAX_VALUES = 50_000
"""Most values after aliases are written out: far above any real file, and a stop to aliases of aliases."""
MAX_INTEGER = 2**63 - 1
"""Largest magnitude of an integer: what an array element can hold."""

_TAG = "tag:yaml.org,2002:"
_TEXT_TAGS = {_TAG + name for name in ("str", "timestamp", "value")}
_TYPED_TAGS = {_TAG + name for name in ("int", "float", "bool", "null")}


class Mark(NamedTuple):
    """A place in a text: line and column, both from 1."""

    line: int
    column: int


START = Mark(1, 1)


class Problem(NamedTuple):
    """One thing wrong with a document: its place in the text, its key path, and what to do about it."""

    mark: Mark
    path: KeyPath
    message: str
    override: str | None = None      # the text of the override that could not be applied


@dataclass
class Document:
    """A parsed file, and where its parts stand.

    Attributes
    ----------
    file : the name shown in messages.
    value : mappings, lists and scalars; None where nothing could be read.
    values, keys : place of the value and of the key at each key path.
    problems : what is wrong with the text itself.
    unreadable : paths of the values that are missing because of that.
    overrides : key paths that were set from outside the file, with the text that set them.
    folder : the folder that relative paths start from.
    text : what was parsed.
    """

    file: str
    folder: Path = field(default_factory=Path)
    text: str = ""
    value: Any = None
    values: dict[KeyPath, Mark] = field(default_factory=dict)
    keys: dict[KeyPath, Mark] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    unreadable: set[KeyPath] = field(default_factory=set)
    overrides: dict[KeyPath, str] = field(default_factory=dict)

    def mark(self, path: KeyPath, *, of_key: bool = False) -> Mark:
        """Place of the value (or the key) at a path, or of the nearest thing around it that the text has."""
        if of_key and path in self.keys:
            return self.keys[path]
        while path and path not in self.values:
            path = path[:-1]
        return self.values.get(path, START)

    def line(self, problem: Problem) -> str:
        """Format a problem as ``file:line:col key.path message``, or with the override that caused it."""
        depths = range(len(problem.path), 0, -1)
        override = problem.override or next(
            (self.overrides[problem.path[:depth]] for depth in depths if problem.path[:depth] in self.overrides), None)
        where = f"-D {override}:" if override else f"{self.file}:{problem.mark.line}:{problem.mark.column}"
        return " ".join(part for part in (where, path_text(problem.path), problem.message) if part)


def path_text(path: KeyPath) -> str:
    """Write a key path as ``geometry[0].scale``."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += ("." if text else "") + (part if part.isprintable() and part else repr(part))
    return text


def parse_text(text: str, file: str, folder: Path | None = None) -> Document:
    """Parse YAML text.

    Parameters
    ----------
    text : the whole text.
    file : its name in messages.
    folder : where relative paths in it start; the current folder if None.
    """
    document = Document(file, folder or Path(), text)
    try:
        node = _compose(text)
    except _TextError as error:
        document.problems.append(Problem(error.mark, (), error.message))
        return document
    if node is None:
        document.problems.append(Problem(START, (), "the file is empty: it needs at least 'geometry'"))
        return document
    size = _expanded_size(node, {})
    if size > MAX_VALUES:
        message = f"holds more than {MAX_VALUES:,} values once aliases are written out"
        document.problems.append(Problem(START, (), message))
    else:
        document.value = _Builder(document).build(node, ())
    return document


def parse_value(text: str) -> Any:
    """Parse one YAML value, such as ``16``, ``back_faces`` or ``[1, 2]``.

    Raises
    ------
    ValueError
        With a one-line message, if the text is no YAML value or breaks a rule of `parse_text`.
    """
    if not text.strip():
        raise ValueError("the value is missing")
    document = parse_text(text, "")
    if document.problems:
        raise ValueError(document.problems[0].message)
    return document.value


class _TextError(Exception):
    """The text is no YAML that this module accepts."""

    def __init__(self, mark: Mark, message: str) -> None:
        super().__init__(message)
        self.mark, self.message = mark, message


def _mark(mark: Any) -> Mark:
    """Convert ruamel's mark, which counts from 0."""
    return START if mark is None else Mark(mark.line + 1, mark.column + 1)


def _compose(text: str) -> Node | None:
    """Turn text into a node graph, translating every way in which the parser can fail."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")      # an anchor defined twice is legal: the later one wins
            _check_depth(text)
            node: Node | None = YAML(typ="safe", pure=True).compose(text)
            return node
    except MarkedYAMLError as error:
        message = " ".join((error.problem or error.context or "cannot be parsed").split())
        if message == "but found another document":
            message = "a second document starts here: a scene file holds one"
        raise _TextError(_mark(error.problem_mark or error.context_mark), f"YAML: {message}") from error
    except ReaderError as error:
        before = text[:error.position]
        mark = Mark(before.count("\n") + 1, error.position - before.rfind("\n"))
        raise _TextError(mark, f"YAML: the character U+{ord(text[error.position]):04X} is not allowed") from error
    except (YAMLError, ValueError, LookupError, TypeError, AttributeError, AssertionError) as error:
        # The scanner passes on what chr() and int() raise for impossible escapes and directives.
        message = " ".join(str(error).split()) or type(error).__name__
        raise _TextError(START, f"YAML: {message}") from error


def _check_depth(text: str) -> None:
    """Refuse deep nesting while the text is still a flat row of events: composing it would recurse."""
    depth = 0
    for event in YAML(typ="safe", pure=True).parse(text):
        if isinstance(event, MappingStartEvent | SequenceStartEvent):
            depth += 1
            if depth > MAX_DEPTH:
                raise _TextError(_mark(event.start_mark), f"nested more than {MAX_DEPTH} levels deep")
        elif isinstance(event, MappingEndEvent | SequenceEndEvent):
            depth -= 1


def _expanded_size(node: Node, sizes: dict[int, int]) -> int:
    """Number of values below a node with aliases written out; endless for a node that holds itself."""
    if id(node) in sizes:
        return sizes[id(node)]
    sizes[id(node)] = MAX_VALUES + 1            # met again before it is known: an alias of an enclosing node
    size = 1
    if isinstance(node, SequenceNode):
        size += sum(_expanded_size(child, sizes) for child in node.value)
    elif isinstance(node, MappingNode):
        size += sum(1 + _expanded_size(child, sizes) for _, child in node.value)
    sizes[id(node)] = size
    return size


class _Builder:
    """Turns a node graph into values, noting places and problems in a document."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.constructor = YAML(typ="safe", pure=True).constructor

    def problem(self, node: Node, path: KeyPath, message: str) -> None:
        """Note a problem at the start of a node."""
        self.document.problems.append(Problem(_mark(node.start_mark), path, message))

    def lost(self, node: Node, path: KeyPath, message: str) -> None:
        """Note a problem that leaves the value at `path` missing."""
        self.problem(node, path, message)
        self.document.unreadable.add(path)

    def build(self, node: Node, path: KeyPath) -> Any:
        """Make the value of a node; None, with a problem noted, where there is none."""
        self.document.values[path] = _mark(node.start_mark)
        if isinstance(node, SequenceNode) and node.tag == _TAG + "seq":
            return [self.build(child, (*path, i)) for i, child in enumerate(node.value)]
        if isinstance(node, MappingNode) and node.tag == _TAG + "map":
            return self.mapping(node, path)
        if isinstance(node, ScalarNode):
            return self.scalar(node, path)
        return self.lost(node, path, f"the tag {_tag_text(node.tag)} is not supported: remove it")

    def mapping(self, node: MappingNode, path: KeyPath) -> dict[str, Any]:
        """Make a mapping; a key that comes twice keeps its first value."""
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if key_node.tag == _TAG + "merge":
                self.problem(key_node, (*path, "<<"), "merge keys are not part of YAML 1.2: write the keys out, "
                                                      "or use an alias for a whole value")
                continue
            if not isinstance(key_node, ScalarNode) or key_node.tag not in _TEXT_TAGS:
                self.problem(key_node, path, "a key must be text")
                continue
            key = str(key_node.value)
            if key in result:
                first = self.document.keys[(*path, key)]
                self.problem(key_node, (*path, key), f"duplicate key: first given in line {first.line}")
                continue
            self.document.keys[(*path, key)] = _mark(key_node.start_mark)
            result[key] = self.build(value_node, (*path, key))
        return result

    def scalar(self, node: ScalarNode, path: KeyPath) -> Any:
        """Make a number, a truth value, text or None."""
        if node.tag in _TEXT_TAGS:
            if any(0xD800 <= ord(c) < 0xE000 for c in node.value):
                return self.lost(node, path, "half of a surrogate pair is no character")
            return str(node.value)
        if node.tag not in _TYPED_TAGS:
            return self.lost(node, path, f"the tag {_tag_text(node.tag)} is not supported: remove it")
        try:
            value = self.constructor.construct_object(node)
        except (ValueError, LookupError, OverflowError):
            return self.lost(node, path, f"{shorten(node.value)!r} can't be read as {node.tag[len(_TAG):]}")
        if isinstance(value, float):
            value = float(value)        # ruamel makes a subclass that remembers its spelling
            if not math.isfinite(value):
                return self.lost(node, path, f"must be a finite number, not {shorten(node.value)}")
        if isinstance(value, int) and abs(value) > MAX_INTEGER:
            return self.lost(node, path, f"{shorten(node.value)} is too large a number")
        return value


def _tag_text(tag: str | None) -> str:
    """Write a tag as the user did."""
    tag = str(tag)
    return "!!" + tag[len(_TAG):] if tag.startswith(_TAG) else tag


def shorten(text: str, limit: int = 40) -> str:
    """Cut long text for a message."""
    return text if len(text) <= limit else text[:limit - 1] + "…"
