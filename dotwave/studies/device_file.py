"""A device profile with what was found of its actuators, as a YAML file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from chainsim import Device
from drivers import atomic_file, naming

from ..errors import AppError

__all__ = ["check_device_path", "rounded", "write_device"]

DIGITS = 7


def check_device_path(out: Path | None) -> None:
    """Refuse a name that no profile has.

    Raises
    ------
    AppError
        When it does not end in .yaml or .yml.
    """
    if out is not None and out.suffix.lower() not in {".yaml", ".yml"}:
        raise AppError(f"{out}: a device profile ends in .yaml; name it so")


def write_device(out: Path, device: Device, entries: Sequence[dict[str, Any]]) -> None:
    """The profile with its actuators, one a line; entries it had for other actuators stay.

    Raises
    ------
    drivers.FileError
        When it cannot be written.
    """
    profile = device.as_dict() | {"name": out.stem[:80]}
    mine = {(entry["row"], entry["col"]) for entry in entries}
    before = [_known(entry) for entry in profile.pop("actuators", [])]
    others = [entry for entry in before if (entry["row"], entry["col"]) not in mine]
    everyone = sorted([*entries, *others], key=lambda entry: (entry["row"], entry["col"]))
    head = yaml.safe_dump(profile, sort_keys=False, allow_unicode=True, width=110)
    lines = [yaml.safe_dump(e, sort_keys=False, default_flow_style=True, width=10_000).strip() for e in everyone]
    text = head + "".join(["actuators:\n", *(f"  - {line}\n" for line in lines)])
    with atomic_file(out) as file, naming(out):
        file.write(text.encode())


def _known(entry: dict[str, Any]) -> dict[str, Any]:
    """An entry of a profile without what it leaves open."""
    kept = {name: value for name, value in entry.items() if value is not None}
    return kept | {"plus_minus": {n: v for n, v in (entry.get("plus_minus") or {}).items() if v is not None}}


def rounded(value: float) -> float:
    """To as many digits as a profile gives."""
    return float(f"{value:.{DIGITS}g}")
