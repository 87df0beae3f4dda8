"""Which amplifier output is wired to what: the order of the channels in a written waveform."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import product
from typing import Any

from chainsim import Device

__all__ = ["Channel", "Role", "channels_of"]


class Role(StrEnum):
    """What an output does: drive the first actuator of a chain, or bias one actuator."""

    DRIVE = "drive"
    BIAS = "bias"


@dataclass(frozen=True)
class Channel:
    """One output of the amplifier.

    Attributes
    ----------
    index : position in every sample, from 0.
    row, col : the actuator; col is None for the one drive of a row.
    volts_per_unit : volts at the actuator for a stored sample of 1.
    """

    index: int
    role: Role
    row: int
    col: int | None
    volts_per_unit: float

    def __str__(self) -> str:
        col = "" if self.col is None else f", col {self.col}"
        return f"channel {self.index} ({self.role}, row {self.row}{col})"

    def as_dict(self) -> dict[str, Any]:
        """The channel in plain JSON types, as it stands in a manifest."""
        col = {} if self.col is None else {"col": self.col}
        place = {"index": self.index, "role": self.role.value, "row": self.row}
        return {**place, **col, "volts_per_unit": self.volts_per_unit}


def channels_of(device: Device) -> tuple[Channel, ...]:
    """The channels of `device`: the drives, then a bias for every actuator that has one."""

    def places() -> Iterator[tuple[Role, tuple[int, int | None]]]:
        several = device.grid or device.chains_per_row > 1
        for row, col in device.driven:
            yield Role.DRIVE, (row, col if several else None)
        if device.bias == "actuator":
            for row, actuator in product(range(device.rows), range(device.cols)):
                yield Role.BIAS, (row, actuator)

    volts = device.amplifier.volts
    return tuple(Channel(index, role, row, col, volts) for index, (role, (row, col)) in enumerate(places()))
