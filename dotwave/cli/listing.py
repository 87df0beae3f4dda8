"""What `dotwave devices` and `dotwave tables` print."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from chainsim import Device, device_names, load_device

from ..errors import AppError

if TYPE_CHECKING:
    from encoders import TableInfo

__all__ = ["DeviceListing", "TableListing", "list_devices", "list_translation_tables"]

_DRIVES = {"corner": "the first actuator", "column": "the first column", "border": "the first row and column"}
_SCOPES = {
    "none": "actuators not coupled",
    "fixed": "one built-in lam",
    "device": "one lam for the whole device",
    "chain": "one lam per chain",
    "link": "a lam on every link",
}


@dataclass(frozen=True)
class DeviceListing:
    """Device profiles to print; `detailed` prints every value of each."""

    devices: tuple[Device, ...]
    detailed: bool

    def as_dict(self) -> dict[str, Any]:
        """Whole profiles under ``devices``."""
        return {"devices": [device.as_dict() for device in self.devices]}

    def as_text(self) -> str:
        """One paragraph per profile."""
        shown = _all_values if self.detailed else _summary
        return "\n\n".join("\n".join(shown(device)) for device in self.devices)


@dataclass(frozen=True)
class TableListing:
    """Translation tables to print."""

    tables: tuple[TableInfo, ...]

    def as_dict(self) -> dict[str, Any]:
        """The tables under ``tables``; ``recommended`` is the grade that each is given for, empty for the others."""
        return {"tables": [dict(zip(_TABLE_KEYS, _row(table), strict=True)) for table in self.tables]}

    def as_text(self) -> str:
        """One line per table: file, language, grade, what it is recommended for, name."""
        rows = [[value or "-" for value in _row(table)] for table in self.tables]
        widths = [max(len(row[column]) for row in rows) for column in range(len(_TABLE_KEYS))]
        return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)


_TABLE_KEYS = ("file", "language", "grade", "recommended", "name")


def _row(table: TableInfo) -> tuple[str, ...]:
    from encoders import recommended_tables

    return table.file, table.language, table.grade, recommended_tables().get(table.file, ""), table.name


def list_devices(name: str | None) -> DeviceListing:
    """The built-in profiles, or every value of the one called `name` (or in the YAML file of that path).

    Raises
    ------
    chainsim.ProfileError
        When there is no such profile, or its file does not fit.
    """
    names = device_names() if name is None else [name]
    return DeviceListing(tuple(load_device(each) for each in names), detailed=name is not None)


def list_translation_tables(wanted: str | None) -> TableListing:
    """The installed translation tables whose file, language or name contains `wanted` (any case).

    Raises
    ------
    AppError
        When none fits.
    encoders.EncodeError
        When liblouis is missing.
    """
    from encoders import list_tables

    key = (wanted or "").casefold()
    shown = {table: f"{table.file} {table.language} {table.name}".casefold() for table in list_tables()}
    found = [table for table, words in shown.items() if key in words]
    if not found:
        close = get_close_matches(key, {word for words in shown.values() for word in words.split()}, n=1)
        meant = f"did you mean {close[0]}?" if close else "`dotwave tables` lists all"
        raise AppError(f"no table has {wanted!r} in its file, language or name; {meant}")
    return TableListing(tuple(found))


def _summary(device: Device) -> Iterator[str]:
    yield f"{device.name}: {device.description}".rstrip(": ")
    chains = device.chains
    yield f"  grid: {device.rows} x {device.cols} actuators, {1e3 * device.pitch_m:g} mm apart"
    coupling = device.coupling
    scope = _SCOPES[coupling.scope]
    span = "" if coupling.scope == "none" else f", {coupling.lam.min:g} to {coupling.lam.max:g}"
    kind = f"{coupling.closure} chain{'' if chains == 1 else 's'}"
    yield f"  chains: {chains} {kind} of {device.chain_length}; {scope}{span}"
    if coupling.lam_y is not None:
        down = f"{coupling.lam_y.min:g} to {coupling.lam_y.max:g}"
        yield f"  in two dimensions: the same downwards, {down}; driven: {_DRIVES[coupling.drives or 'corner']}"
    yield f"  bias: {'one per actuator' if device.bias == 'actuator' else 'none'}"
    drive = f"{device.omega.min * device.f0_hz:.0f} to {device.omega.max * device.f0_hz:.0f} Hz"
    shared = "common to all chains" if device.drive == "device" else "one per chain"
    yield f"  drive: {shared}, {drive}, up to {device.amplifier.volts:g} V at {device.amplifier.rate_hz} samples/s"
    if device.modulation is not None:
        from ..reports.modulated import modulation_words

        yield f"  modulation: {modulation_words(device)}"
    assumed = sorted(name for name, note in device.notes.items() if note.assumed)
    yield f"  assumed: {', '.join(assumed) or 'nothing'}"


def _all_values(device: Device) -> Iterator[str]:
    yield from _summary(device)
    for name, value in device.as_dict().items():
        if name in {"schema", "name", "description", "notes"}:
            continue
        if name == "surroundings":
            for part, inner in value.items():
                yield _with_source(device, f"surroundings.{part}", inner)
        else:
            yield _with_source(device, name, value)


def _with_source(device: Device, name: str, value: object) -> str:
    note = device.notes.get(name)
    source = "" if note is None else f"  ({'assumed' if note.assumed else 'given'}: {note.why})"
    return f"  {name}: {_flat(value)}{source}"


def _flat(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_flat(item)}" for key, item in value.items())
    return f"{value:g}" if isinstance(value, float) else str(value)
