"""What a model finds wrong with a person's values, in our own words: a place and one sentence."""

from __future__ import annotations

import re
import reprlib
from typing import Any, NamedTuple

from pydantic import ValidationError

__all__ = ["Complaint", "Place", "complaint_of", "shown", "words_of"]

Place = tuple[str | int, ...]
LONGEST, LONGEST_SENTENCE = 60, 400


class Complaint(NamedTuple):
    """The field, keys and numbers of items from the outermost in, and what is wrong with it."""

    place: Place
    sentence: str


def complaint_of(error: ValidationError) -> Complaint:
    """The first of the complaints, where it is most exact."""
    complaints = [(_place(each["loc"]), each) for each in error.errors(include_url=False)]
    # Where a number or a list fits, both complain: the one that points into the list knows more.
    top = complaints[0][0]
    place, first = max((one for one in complaints if one[0][: len(top)] == top), key=lambda one: len(one[0]))
    return Complaint(place, _sentence(first))


def shown(value: object) -> str:
    """A value for a message: one line of at most 60 characters, however large it is."""
    text = _REPR.repr(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


_REPR = reprlib.Repr()
_REPR.maxlevel, _REPR.maxstring, _REPR.maxother, _REPR.maxlong = 3, 4 * LONGEST, 4 * LONGEST, 4 * LONGEST


def words_of(place: Place) -> str:
    """A place as ``key.2.key``; ``file`` where it is all of it."""
    parts = map(str, place)
    return ".".join(part if len(part) <= LONGEST and part.isprintable() else shown(part) for part in parts) or "file"


def _place(location: Place) -> Place:
    """Keys and items, without the names of the types a value was tried as."""
    return tuple(part for part in location if isinstance(part, int) or not _TYPE_NAME.fullmatch(part))


_TYPE_NAME = re.compile(r"(constrained-)?(float|int|str)|list\[.*\]")

_NUMBER, _WHOLE, _TEXT = (
    "expected a number, got {value}",
    "expected a whole number, got {value}",
    "expected text, got {value}",
)
_LIST, _KEYS = "expected a list, got {value}", "expected keys and values, got {value}"
_EXPECTED = {
    "missing": "this key is required and missing",
    "extra_forbidden": "unknown key; remove it or correct its spelling",
    "invalid_key": "a key that is not text; put it in quotes, or remove it",
    "int_parsing": _WHOLE,
    "int_parsing_size": _WHOLE,
    "int_type": _WHOLE,
    "int_from_float": _WHOLE,
    "float_parsing": _NUMBER,
    "float_type": _NUMBER,
    "finite_number": "expected a finite number, got {value}",
    "greater_than": "expected a number > {gt}, got {value}",
    "greater_than_equal": "expected a number >= {ge}, got {value}",
    "less_than": "expected a number < {lt}, got {value}",
    "less_than_equal": "expected a number <= {le}, got {value}",
    "string_type": _TEXT,
    "string_sub_type": _TEXT,
    "string_unicode": "expected text of whole characters, got {value}",
    "string_too_short": "expected text of {min_length} characters or more, got {value}",
    "string_too_long": "expected text of at most {max_length} characters, got {value}",
    "string_pattern_mismatch": "expected text such as {pattern}, got {value}",
    "list_type": _LIST,
    "tuple_type": _LIST,
    "too_short": "expected {min_length} items or more, got {actual_length}",
    "too_long": "expected at most {max_length} items, got {actual_length}",
    "model_type": _KEYS,
    "model_attributes_type": _KEYS,
    "dict_type": _KEYS,
    "bool_type": "expected true or false, got {value}",
    "bool_parsing": "expected true or false, got {value}",
    "literal_error": "expected {expected}, got {value}",
    "enum": "expected {expected}, got {value}",
    "none_required": "expected nothing, got {value}",
    "value_error": "{error}",
    "assertion_error": "{error}",
}
_OTHERWISE = "expected another kind of value, got {value}"


def _sentence(error: Any) -> str:
    context = dict(error.get("ctx", {})) | {"value": shown(error["input"])}
    text = " ".join(_EXPECTED.get(error["type"], _OTHERWISE).format(**context).split())
    return text if len(text) <= LONGEST_SENTENCE else text[: LONGEST_SENTENCE - 3] + "..."
