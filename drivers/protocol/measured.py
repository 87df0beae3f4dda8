"""What the actuators sense of themselves: what a host asks for, what a controller answers, and the way to and fro."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from planner import Measured

from .packet import MAX_PAYLOAD, Kind, Packet

__all__ = ["Measure", "MeasuredFrames", "MeasuredPart", "parts_of", "turns_of"]

WHOLE_TURN = 1 << 64
EACH = 6  # numbers of an actuator


def turns_of(omega: float, dtau: float) -> int:
    """The phase of omega tau from one sample to the next (`dtau`), in turns / 2^64; below half a turn."""
    return round(omega * dtau / (2 * np.pi) * WHOLE_TURN) % WHOLE_TURN


@dataclass(frozen=True)
class Measure:
    """From sample `at` on, for `samples` samples, measure `frame`: the mean and what goes with a phase of each row.

    The phase at sample k of the session is ``turns * k`` modulo 2^64, 2^64 being a whole turn; 0: the mean only. The
    last of `turns` counts for all further rows.
    """

    at: int
    samples: int
    frame: int
    turns: tuple[int, ...]

    _struct: ClassVar = struct.Struct("<QII")

    def packet(self, number: int) -> Packet:
        """As bytes."""
        head = self._struct.pack(self.at, self.samples, self.frame)
        return Packet(Kind.MEASURE, number, head + struct.pack(f"<{len(self.turns)}Q", *self.turns))

    @classmethod
    def of(cls, packet: Packet) -> Measure:
        """From bytes."""
        rest = packet.payload[cls._struct.size :]
        return cls(*(*cls._struct.unpack_from(packet.payload), struct.unpack(f"<{len(rest) // 8}Q", rest)))

    @staticmethod
    def most(max_payload: int) -> int:
        """How many rows with a phase of their own fit into a packet."""
        return (min(max_payload, MAX_PAYLOAD) - Measure._struct.size) // 8


@dataclass(frozen=True)
class MeasuredPart:
    """What was measured of a frame, for as many actuators as fit into a packet.

    Attributes
    ----------
    session : in which it was asked for.
    frame : as in `Measured`.
    first : the first actuator, counted row by row.
    values : float32, shape (k, 6): mean, real and imaginary part of the harmonic and of its change, rest.
    """

    session: int
    frame: int
    first: int
    values: NDArray[np.float32]

    _struct: ClassVar = struct.Struct("<IIH")

    def packet(self) -> Packet:
        """As bytes."""
        head = self._struct.pack(self.session, self.frame, self.first)
        return Packet(Kind.MEASURED, 0, head + self.values.astype("<f4").tobytes())

    @classmethod
    def of(cls, packet: Packet) -> MeasuredPart:
        """From bytes."""
        flat = np.frombuffer(packet.payload, dtype="<f4", offset=cls._struct.size)
        values = flat.reshape(-1, EACH).astype(np.float32, copy=False)
        return cls(*(*cls._struct.unpack_from(packet.payload), values))


def parts_of(measured: Measured, session: int, max_payload: int = MAX_PAYLOAD) -> list[MeasuredPart]:
    """A frame cut into packets, its actuators in order; float32."""
    change = np.full_like(measured.harmonic, np.nan) if measured.change is None else measured.change
    rest = np.full_like(measured.mean, np.nan) if measured.rest is None else measured.rest
    parts = measured.mean, measured.harmonic.real, measured.harmonic.imag, change.real, change.imag, rest
    values = np.stack(parts, axis=1).astype(np.float32)
    most = max(1, (min(max_payload, MAX_PAYLOAD) - MeasuredPart._struct.size) // (4 * EACH))
    return [
        MeasuredPart(session, measured.frame, first, values[first : first + most])
        for first in range(0, len(values), most)
    ]


class MeasuredFrames:
    """Puts the parts of frames together, in whatever pieces, however often and with whatever gaps they come.

    A frame that is not whole when the next one begins is lost. Frames go up in a session; each is given once.

    Parameters
    ----------
    session : whose parts are taken; others are passed over.
    actuators : of the grid.
    """

    def __init__(self, session: int, actuators: int) -> None:
        self._session = session
        self._values = np.full((actuators, EACH), np.nan)
        self._here = np.zeros(actuators, dtype=bool)
        self._frame = -1

    def take(self, part: MeasuredPart) -> Measured | None:
        """The frame that this part completes."""
        whole = self._frame == part.frame and self._here.all()
        fits = part.session == self._session and part.first + len(part.values) <= len(self._here)
        if not fits or part.frame < self._frame or whole:
            return None
        if part.frame > self._frame:
            self._frame = part.frame
            self._here[:] = False
        place = slice(part.first, part.first + len(part.values))
        self._values[place], self._here[place] = part.values, True
        if not self._here.all():
            return None
        mean, real, imaginary, change, turning, rest = self._values.T
        return Measured(part.frame, mean.copy(), real + 1j * imaginary, change + 1j * turning, rest.copy())
