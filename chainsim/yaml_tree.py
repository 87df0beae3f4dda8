"""YAML text to a tree of nodes, and to plain values: bounded work, and complaints that do not quote the text."""

from __future__ import annotations

import re
from typing import Any

import yaml
from yaml.composer import Composer

__all__ = ["compose", "first_line", "values_of"]

DEEPEST = 60
# Values that aliases stand for once more; a file with none may have as many as fit into it.
MOST_REPEATED = 100_000
LONGEST_NUMBER = 400

_TAG = "tag:yaml.org,2002:"
_NUMBERS = {f"{_TAG}int", f"{_TAG}float"}
_SCALARS = {f"{_TAG}{kind}" for kind in ("null", "bool", "int", "float", "merge")}
_KINDS = (*_SCALARS, *(f"{_TAG}{kind}" for kind in ("str", "seq", "map")))
# libyaml where it was built in, with the same marks; ten times as quick.
_Parsing: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_Parsing):  # type: ignore[misc]
    """PyYAML with the few kinds of value that files of people need: dates, for one, are text."""

    yaml_implicit_resolvers = {  # noqa: RUF012 - as PyYAML has it
        first: [(tag, pattern) for tag, pattern in known if tag in _SCALARS]
        for first, known in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    yaml_constructors = {  # noqa: RUF012
        tag: make for tag, make in yaml.SafeLoader.yaml_constructors.items() if tag is None or tag in _KINDS
    }
    # libyaml's own composing would take any depth that its stack does.
    get_single_node = Composer.get_single_node
    compose_document = Composer.compose_document
    compose_scalar_node = Composer.compose_scalar_node
    compose_sequence_node = Composer.compose_sequence_node
    compose_mapping_node = Composer.compose_mapping_node

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.anchors: dict[str, yaml.Node] = {}
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """One node and what is in it."""
        self._depth += 1
        if self._depth > DEEPEST:
            raise _complaint(f"sections in sections, more than {DEEPEST} deep", self.peek_event())
        node: yaml.Node | None = Composer.compose_node(self, parent, index)
        self._depth -= 1
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """The value of a node."""
        if node.tag in _NUMBERS and len(node.value) > LONGEST_NUMBER:
            raise _complaint(f"a number of {len(node.value)} characters; write fewer", node)
        try:
            value = super().construct_object(node, deep)
            if isinstance(value, int):
                # Whoever takes it for a float later must find one.
                float(value)
            return value
        except (ValueError, LookupError, ArithmeticError):
            raise _complaint(f"not a value of the kind {node.tag.removeprefix(_TAG)}; correct it", node) from None


def compose(text: str) -> yaml.Node | None:
    """The tree of a document, its aliases and keys checked; None where there is nothing.

    Raises
    ------
    yaml.YAMLError
        When it is not YAML, is nested too deeply, repeats too much through aliases, or gives a key twice.
    ValueError
        When its characters cannot be encoded.
    """
    loader = _Loader(text)
    try:
        root: yaml.Node | None = loader.get_single_node()
    finally:
        loader.dispose()
    if root is not None:
        sizes: dict[int, int] = {}
        if _size(root, sizes) - len(sizes) > MOST_REPEATED:
            raise _complaint(f"its aliases repeat more than {MOST_REPEATED} values; write less with them", root)
    return root


def _size(node: yaml.Node, sizes: dict[int, int]) -> int:
    """How many values a node stands for, those of its aliases counted each time."""
    if id(node) in sizes:
        if not sizes[id(node)]:
            raise _complaint("an alias inside of what it stands for; write the value out", node)
        return sizes[id(node)]
    sizes[id(node)] = 0
    found = 1
    if isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _complaint("a key that is not plain text; a key is a word before a colon", key)
            if key.value in seen:
                raise _complaint("a key is given twice in the same section; keep one", key)
            seen.add(key.value)
            found += _size(key, sizes) + _size(value, sizes)
    elif isinstance(node, yaml.SequenceNode):
        found += sum(_size(value, sizes) for value in node.value)
    sizes[id(node)] = found
    return found


def values_of(root: yaml.Node | None) -> Any:
    """Plain values of a tree: dict, list, str, int, float, bool, None. Changes the tree: merges are resolved.

    Raises
    ------
    yaml.YAMLError
        When a value is not of the kind that its tag names.
    """
    if root is None:
        return None
    loader = _Loader("")
    try:
        return loader.construct_document(root)
    finally:
        loader.dispose()


def first_line(text: str, error: yaml.YAMLError) -> tuple[int, str]:
    """Where, and what is wrong, without words of the text (it may be anybody's)."""
    mark = getattr(error, "problem_mark", None)
    # The end of the last line may be counted as a line of its own.
    line = min(mark.line, text.rstrip("\n").count("\n")) + 1 if mark is not None else 1
    problem = getattr(error, "problem", None) or "a character YAML does not allow"
    if isinstance(error, _Refused):
        return line, problem
    if problem == "second occurrence":
        problem = "an anchor (&name) is given twice"
    return line, "not YAML: " + re.sub("'[^']*'", lambda word: word[0] if len(word[0]) == 3 else "...", problem)


class _Refused(yaml.MarkedYAMLError):
    """YAML, but not as these files have it."""


def _complaint(problem: str, at: Any) -> yaml.YAMLError:
    """What to raise about a node or an event."""
    return _Refused(problem=problem, problem_mark=at.start_mark)
