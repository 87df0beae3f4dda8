"""A device profile as fields of a form, each with its unit, its range and where its value comes from; and back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import yaml

from chainsim import Device

from ..errors import AppError

__all__ = ["ProfileField", "profile_fields", "profile_of"]

LISTS = ("actuators", "notes", "surroundings", "spread")
"""Kept as YAML: how many there are is open."""

UNITS = {
    "pitch_m": "metres", "length_m": "metres for an amplitude of 1", "f0_hz": "hertz", "name": "words",
    "epsilon_per_volt": "force for one volt", "bias_per_volt": "force for one volt", "description": "words",
    "omega.min": "over f0", "omega.max": "over f0", "amplifier.volts": "volts", "rows": "actuators",
    "cols": "actuators",
    "amplifier.slew_v_per_s": "volts a second", "amplifier.rate_hz": "samples a second", "chain_length": "actuators",
    "amplifier.bits": "bits; empty for any", "coupling.bits": "bits; empty for any", "modulation.hz": "hertz",
}  # fmt: skip


@dataclass(frozen=True)
class ProfileField:
    """A field of the form.

    Attributes
    ----------
    name : with dots for what stands inside another, as complaints name it.
    value : as typed.
    unit, span : in words.
    choices : empty where anything in the range may be typed.
    source : where the value comes from.
    lines : it is typed as several lines of YAML.
    """

    name: str
    value: str
    unit: str
    span: str
    choices: tuple[str, ...]
    source: str
    lines: bool

    @property
    def key(self) -> str:
        """For the form: an id has no dots."""
        return self.name.replace(".", "-")


def profile_fields(profile: Mapping[str, Any]) -> list[ProfileField]:
    """The fields of a profile as `Device.as_dict` gives it."""
    return list(_fields(profile, _schema(), profile.get("notes") or {}, ""))


@cache
def _schema() -> dict[str, Any]:
    return Device.model_json_schema()


def _fields(
    profile: Mapping[str, Any] | None, schema: Mapping[str, Any], notes: Mapping[str, Any], inside: str
) -> Iterator[ProfileField]:
    """Those of one section; None: it is left out, and so are its usual values."""
    for key, given in schema["properties"].items():
        name, rule = inside + key, _resolved(given)
        value = None if profile is None else profile.get(key, rule.get("default"))
        if key == "schema":
            continue
        if "properties" in rule and name not in LISTS:
            yield from _fields(value if _optional(given) else value or {}, rule, notes, f"{name}.")
            continue
        note = notes.get(name) or notes.get(name.split(".")[0]) or {}
        source = f"{'assumed' if note['assumed'] else 'given'} because: {note['why']}" if note else ""
        lines = name in LISTS
        usual = "YAML" if lines else "a choice" if "enum" in rule else "dimensionless"
        shown = yaml.safe_dump(value, sort_keys=False, allow_unicode=True) if lines and value else _typed(value)
        yield ProfileField(
            name, shown, UNITS.get(name, usual), _span(rule), tuple(rule.get("enum", ())), source, lines,
        )  # fmt: skip


def _typed(value: Any) -> str:
    return "" if value in (None, [], {}, ()) else f"{value:.10g}" if isinstance(value, float) else str(value)


def _resolved(rule: Mapping[str, Any]) -> dict[str, Any]:
    """A rule without references; of a choice with nothing, the other."""
    for one in rule.get("anyOf", ()):
        if one.get("type") != "null":
            return _resolved(one)
    if "$ref" in rule:
        return dict(_schema()["$defs"][rule["$ref"].rsplit("/", 1)[1]])
    return dict(rule)


def _optional(rule: Mapping[str, Any]) -> bool:
    """Whether there may be nothing in its place."""
    return any(one.get("type") == "null" for one in rule.get("anyOf", ()))


def _span(rule: Mapping[str, Any]) -> str:
    words = {"minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below"}
    return ", ".join(f"{said} {rule[key]:g}" for key, said in words.items() if key in rule)


def profile_of(given: Mapping[str, str]) -> dict[str, Any]:
    """The profile that was typed; whether it will do is for whoever reads the file.

    Raises
    ------
    AppError
        When a field of YAML is none.
    """
    profile: dict[str, Any] = {"schema": "dotwave/device/1"}
    for field in profile_fields({}):
        words = given.get(field.key, "").strip()
        if not words and field.name != "description":
            continue
        *inside, last = field.name.split(".")
        place = profile
        for name in inside:
            place = place.setdefault(name, {})
        place[last] = _meant(field, words)
    return profile


def _meant(field: ProfileField, words: str) -> Any:
    if field.unit == "words" or field.choices:
        return words
    if not field.lines:
        for kind in (int, float):
            try:
                return kind(words)
            except ValueError:
                continue
        return words
    try:
        return yaml.safe_load(words)
    except (yaml.YAMLError, RecursionError) as error:
        raise AppError(f"{field.name}: is not YAML: {' '.join(str(error).split())[:200]}") from None
