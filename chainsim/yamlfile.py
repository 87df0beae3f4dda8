"""Strict reading of the YAML files people write: every complaint names file, line and field."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from .errors import ProfileError

__all__ = ["Located", "parse_model", "read_located", "read_model"]

Model = TypeVar("Model", bound=BaseModel)
Place = tuple[str | int, ...]
MAX_BYTES = 4_000_000


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
        with path.open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
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
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        data = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ProfileError(_yaml_complaint(name, error)) from None
    except (ValueError, RecursionError) as error:
        raise ProfileError(f"{name}: not readable as YAML: {error}") from None
    if not isinstance(data, dict):
        raise ProfileError(f"{name}:1: expected keys and values ('key: value'), got {_shown(data)}")
    lines = _lines(root)
    repeated = lines.pop(("repeated",), None)
    if repeated is not None:
        raise ProfileError(f"{name}:{repeated}: a key is given twice in the same section; keep one")
    try:
        return Located(name, model.model_validate(data), lines)
    except ValidationError as error:
        raise ProfileError(_model_complaint(name, lines, error)) from None


def _yaml_complaint(name: str, error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    place = f"{name}:{mark.line + 1}" if mark is not None else name
    problem = getattr(error, "problem", None) or "a character YAML does not allow"
    return f"{place}: not YAML: {problem}"


def _lines(root: yaml.Node | None) -> dict[Place, int]:
    """Line number of every key and item; the pseudo-place ('repeated',) holds a key given twice."""
    found: dict[Place, int] = {}
    seen: set[int] = set()

    def walk(node: yaml.Node | None, place: Place) -> None:
        if node is None or id(node) in seen:
            return
        seen.add(id(node))
        found.setdefault(place, node.start_mark.line + 1)
        if isinstance(node, yaml.MappingNode):
            keys = [key.value for key, _ in node.value]
            for key, value in node.value:
                if keys.count(key.value) > 1:
                    found[("repeated",)] = key.start_mark.line + 1
                found[(*place, key.value)] = key.start_mark.line + 1
                walk(value, (*place, key.value))
        elif isinstance(node, yaml.SequenceNode):
            for index, value in enumerate(node.value):
                found[(*place, index)] = value.start_mark.line + 1
                walk(value, (*place, index))

    walk(root, ())
    return found


def _model_complaint(name: str, lines: dict[Place, int], error: ValidationError) -> str:
    complaints = [(_place(each["loc"]), each) for each in error.errors(include_url=False)]
    # Where a number or a list fits, both complain: the one that points into the list knows more.
    top = complaints[0][0]
    place, first = max((one for one in complaints if one[0][: len(top)] == top), key=lambda one: len(one[0]))
    return f"{_at(name, lines, place)}: {_sentence(first)}"


def _at(name: str, lines: Mapping[Place, int], place: Place) -> str:
    known = place
    while known and known not in lines:
        known = known[:-1]
    return f"{name}:{lines.get(known, 1)}: {'.'.join(map(str, place)) or 'file'}"


def _place(location: Place) -> Place:
    """Keys and items, without the names of the types a value was tried as."""
    return tuple(part for part in location if isinstance(part, int) or not _TYPE_NAME.fullmatch(part))


_TYPE_NAME = re.compile(r"(constrained-)?(float|int|str)|list\[.*\]")

_EXPECTED = {
    "missing": "this key is required and missing",
    "extra_forbidden": "unknown key; remove it or correct its spelling",
    "int_parsing": "expected a whole number, got {value}",
    "int_type": "expected a whole number, got {value}",
    "int_from_float": "expected a whole number, got {value}",
    "float_parsing": "expected a number, got {value}",
    "float_type": "expected a number, got {value}",
    "finite_number": "expected a finite number, got {value}",
    "greater_than": "expected a number > {gt}, got {value}",
    "greater_than_equal": "expected a number >= {ge}, got {value}",
    "less_than": "expected a number < {lt}, got {value}",
    "less_than_equal": "expected a number <= {le}, got {value}",
    "string_type": "expected text, got {value}",
    "list_type": "expected a list, got {value}",
    "model_type": "expected keys and values, got {value}",
    "bool_parsing": "expected true or false, got {value}",
    "literal_error": "expected {expected}, got {value}",
    "enum": "expected {expected}, got {value}",
}


def _sentence(error: Any) -> str:
    kind = error["type"]
    context = dict(error.get("ctx", {}))
    context["value"] = _shown(error["input"])
    if kind in _EXPECTED:
        return _EXPECTED[kind].format(**context)
    return str(error["msg"]).removeprefix("Value error, ")


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
