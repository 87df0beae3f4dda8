"""Strict reading of the YAML files people write: every complaint names file, line and field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from .complaints import Place, complaint_of, words_of
from .errors import ProfileError
from .reading import first_bytes
from .yaml_tree import compose, first_line, values_of

__all__ = ["Located", "parse_model", "read_located", "read_model"]

Model = TypeVar("Model", bound=BaseModel)
MAX_BYTES = 4_000_000
KINDS = {str: "text", list: "a list", bool: "true or false", int: "a number", float: "a number", type(None): "nothing"}


@dataclass(frozen=True)
class Located(Generic[Model]):
    """A model that was read, and the lines of its keys and items; `name` stands for the file in messages."""

    name: str
    model: Model
    lines: Mapping[Place, int]

    def at(self, *place: str | int) -> str:
        """``file:line: key.key`` of a place in the model; the line is that of the innermost key the file has."""
        return _at(self.name, self.lines, place)


def read_model(path: Path, model: type[Model]) -> Model:
    """Read the YAML file `path` as one `model`; raises as `read_located` does."""
    return read_located(path, model).model


def read_located(path: Path, model: type[Model]) -> Located[Model]:
    """Read the YAML file `path` as one `model`, for complaints about it that come later.

    Raises
    ------
    ProfileError
        When the file cannot be read, is not YAML, or does not fit the model.
    """
    try:
        raw = first_bytes(path, MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ProfileError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if len(raw) > MAX_BYTES:
        raise ProfileError(f"{path}: more than {MAX_BYTES} bytes; such a file has at most so many")
    try:
        return _parsed(raw.decode("utf-8-sig"), str(path), model)
    except UnicodeDecodeError as error:
        raise ProfileError(f"{path}: not UTF-8 at byte {error.start}; save it as UTF-8") from None


def parse_model(text: str, name: str, model: type[Model]) -> Model:
    """Read YAML `text` as one `model`; `name` stands for the file in messages.

    Raises
    ------
    ProfileError
        When the text is not YAML or does not fit the model.
    """
    return _parsed(text, name, model).model


def _parsed(text: str, name: str, model: type[Model]) -> Located[Model]:
    try:
        root = compose(text)
        lines = _lines(root)
        data = values_of(root)
    except yaml.YAMLError as error:
        line, problem = first_line(text, error)
        raise ProfileError(f"{name}:{line}: {problem}") from None
    except UnicodeEncodeError:
        raise ProfileError(f"{name}: not UTF-8; save it as UTF-8") from None
    if not isinstance(data, dict):
        raise ProfileError(f"{name}:1: expected keys and values ('key: value'), got {KINDS[type(data)]}")
    try:
        return Located(name, model.model_validate(data), lines)
    except ValidationError as error:
        complaint = complaint_of(error)
        raise ProfileError(f"{_at(name, lines, complaint.place)}: {complaint.sentence}") from None


def _at(name: str, lines: Mapping[Place, int], place: Place) -> str:
    known = place
    while known and known not in lines:
        known = known[:-1]
    return f"{name}:{lines.get(known, 1)}: {words_of(place)}"


def _lines(root: yaml.Node | None) -> dict[Place, int]:
    """Line number of every key and item; of what an alias repeats, where it stands first."""
    found: dict[Place, int] = {}
    seen: set[int] = set()

    def walk(node: yaml.Node | None, place: Place) -> None:
        if node is None or id(node) in seen:
            return
        seen.add(id(node))
        found.setdefault(place, node.start_mark.line + 1)
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                found[(*place, key.value)] = key.start_mark.line + 1
                walk(value, (*place, key.value))
        elif isinstance(node, yaml.SequenceNode):
            for index, value in enumerate(node.value):
                found[(*place, index)] = value.start_mark.line + 1
                walk(value, (*place, index))

    walk(root, ())
    return found
