"""A piece of a cubic on a carrier, which goes on where a tone cannot: sent as one event, played by itself."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from .measured import WHOLE_TURN
from .packet import Kind, Packet

__all__ = ["LONGEST_PIECE", "Envelope", "EnvelopeMix"]

Floats = NDArray[np.float64]

LONGEST_PIECE = 65536  # samples
CUBIC = 4  # points


@dataclass(frozen=True)
class Envelope:
    """From sample `at` on, what `channel` has at a carrier follows a cubic for `ramp` samples, and then stands.

    At sample k it gives ``Re(E e^{i phase})`` volts, the phase being ``turns * k`` modulo 2^64, 2^64 a whole turn.

    Attributes
    ----------
    at : sample.
    channel : it adds to what else the channel has, and takes the place of an envelope at the same carrier.
    ramp : samples, 1 to LONGEST_PIECE; 0 with one point.
    turns : of the carrier from a sample to the next, in turns / 2^64; 0 stands still, as a bias does.
    points : volts; four Bezier points of E over the ramp, the first at `at`; one: E stands there.
    """

    at: int
    channel: int
    ramp: int
    turns: int
    points: tuple[complex, ...]

    _struct: ClassVar = struct.Struct("<QHIQ")
    _point: ClassVar = struct.Struct("<ff")

    def packet(self, number: int) -> Packet:
        """As bytes."""
        points = b"".join(self._point.pack(point.real, point.imag) for point in self.points)
        return Packet(Kind.ENVELOPE, number, self._struct.pack(self.at, self.channel, self.ramp, self.turns) + points)

    @classmethod
    def of(cls, packet: Packet) -> Envelope:
        """From bytes."""
        rest = packet.payload[cls._struct.size :]
        points = tuple(complex(*values) for values in cls._point.iter_unpack(rest))
        return cls(*(*cls._struct.unpack_from(packet.payload), points))

    def fits(self, full_volts: float) -> bool:
        """Whether it is a piece that stays within `full_volts`; a cubic stays between its points."""
        piece = len(self.points) == CUBIC and 1 <= self.ramp <= LONGEST_PIECE
        stands = len(self.points) == 1 and self.ramp == 0
        return (piece or stands) and all(p.real**2 + p.imag**2 <= full_volts**2 for p in self.points)

    def at_samples(self, index: NDArray[np.intp]) -> NDArray[np.complex128]:
        """E at samples `index`, none before `at`; complex128, shape (S,), volts."""
        if len(self.points) == 1:
            return np.full(len(index), self.points[0])
        s = ((index - self.at) / self.ramp).clip(max=1.0)
        a, b, c, d = self.points
        rest = 1 - s
        bent: NDArray[np.complex128] = a * rest**3 + 3 * b * s * rest**2 + 3 * c * s**2 * rest + d * s**3
        return bent

    @property
    def silent(self) -> bool:
        """Whether nothing is left after it."""
        return not self.points[-1]


@dataclass
class EnvelopeMix:
    """The envelopes of a channel: the newest of each carrier."""

    pieces: dict[int, Envelope] = field(default_factory=dict)

    @property
    def any(self) -> bool:
        """Whether anything sounds."""
        return bool(self.pieces)

    def change(self, piece: Envelope) -> None:
        """From its sample on, `piece` is what its carrier has."""
        ended = [turns for turns, old in self.pieces.items() if old.silent and old.at + old.ramp <= piece.at]
        for turns in ended:
            del self.pieces[turns]
        self.pieces[piece.turns] = piece

    def at(self, index: NDArray[np.intp]) -> Floats:
        """Volts at samples `index`; float64, shape (S,)."""
        volts = np.zeros(len(index))
        for turns, piece in self.pieces.items():
            phase = (index.astype(np.uint64) * np.uint64(turns)).astype(np.float64) * (2 * np.pi / WHOLE_TURN)
            volts += (piece.at_samples(index) * np.exp(1j * phase)).real
        return volts
