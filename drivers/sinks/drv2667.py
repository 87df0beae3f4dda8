"""The DRV2667 piezo driver as a synthesiser: records, register writes and what its quantisation costs.

Texas Instruments SLOS751; the order of the writes is that of the WEBER_TACTILE_DISPLAY library.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import DriverError

__all__ = [
    "GAIN_VOLTS",
    "STEP_HZ",
    "BoardRefusal",
    "SynthRecord",
    "frequency_byte",
    "gain_for",
    "load_writes",
    "synth_records",
]

STEP_HZ = 7.8125
GAIN_VOLTS = (25.0, 50.0, 75.0, 100.0)  # peak, of amplitude byte 255 at gain 0..3
MOST_RECORDS = 60  # that fit behind the header on a page of 256 bytes
ENVELOPE_S = (0.0, *(0.032 * k for k in range(1, 9)), *(0.256 * k for k in range(2, 9)))  # of a nibble
DATA_AT = 6


class BoardRefusal(DriverError, ValueError):
    """The board cannot do what the waveform asks.

    Examples: a travelling wave, whose phases it cannot keep; coupled chains; frames shorter than it needs to
    load; more volts than its gain gives; a firmware that cannot show a grid.
    """


@dataclass(frozen=True)
class SynthRecord:
    """One chunk of a sinusoid: four bytes.

    Attributes
    ----------
    amplitude : 0..255, of the gain's peak volts.
    frequency : 1..255, in steps of 7.8125 Hz.
    cycles : 1..255.
    envelope : ramp-up nibble times 16 plus ramp-down nibble.
    """

    amplitude: int
    frequency: int
    cycles: int
    envelope: int = 0

    def __post_init__(self) -> None:
        for name, low in (("amplitude", 0), ("frequency", 1), ("cycles", 1), ("envelope", 0)):
            value = getattr(self, name)
            if not low <= value <= 255:
                raise BoardRefusal(f"synthesiser record: {name}: expected {low} to 255, got {value}")

    @property
    def hz(self) -> float:
        """Its frequency."""
        return STEP_HZ * self.frequency

    @property
    def duration_s(self) -> float:
        """How long it lasts."""
        return self.cycles / self.hz

    def volts(self, gain: int) -> float:
        """Its peak volts at gain 0..3."""
        return self.amplitude / 255 * GAIN_VOLTS[gain]

    def __bytes__(self) -> bytes:
        return bytes((self.amplitude, self.frequency, self.cycles, self.envelope))


def frequency_byte(hz: float) -> int:
    """The nearest step to `hz`.

    Raises
    ------
    BoardRefusal
        When it is outside 7.8125 .. 1992 Hz.
    """
    byte = round(hz / STEP_HZ)
    if not 1 <= byte <= 255:
        raise BoardRefusal(f"a DRV2667 makes {STEP_HZ} to {255 * STEP_HZ} Hz, not {hz:g} Hz")
    return byte


def gain_for(volts: float) -> int:
    """The least gain that gives `volts` peak: the amplitude bytes are then finest.

    Raises
    ------
    BoardRefusal
        When none does.
    """
    for gain, most in enumerate(GAIN_VOLTS):
        if volts <= most * (1 + 1e-9):
            return gain
    raise BoardRefusal(f"{volts:.4g} V are needed, a DRV2667 gives {GAIN_VOLTS[-1]:g} V; lower full_scale")


def synth_records(
    volts: float, frequency: int, duration_s: float, *, gain: int, ramp_s: float
) -> tuple[SynthRecord, ...]:
    """Records that sound for `duration_s` (to the nearest cycle), with ramps at both ends.

    `ramp_s` becomes the nearest length of an envelope. Silence is no record at all.

    Raises
    ------
    BoardRefusal
        When it takes more records than a page holds.
    """
    amplitude = round(255 * volts / GAIN_VOLTS[gain])
    if amplitude == 0:
        return ()
    cycles = max(1, round(duration_s * STEP_HZ * frequency))
    count = math.ceil(cycles / 255)
    if count > MOST_RECORDS:
        raise BoardRefusal(f"{duration_s:g} s take {count} records, a page holds {MOST_RECORDS}; show shorter frames")
    nibble = min(range(16), key=lambda k: abs(ENVELOPE_S[k] - ramp_s))
    parts = [255] * (count - 1) + [cycles - 255 * (count - 1)]
    up, down = {0: nibble << 4}, {count - 1: nibble}
    return tuple(SynthRecord(amplitude, frequency, part, up.get(k, 0) | down.get(k, 0)) for k, part in enumerate(parts))


def load_writes(records: Sequence[SynthRecord], gain: int) -> list[tuple[int, int]]:
    """The register writes that load `records` as sequence 1, ready for GO (0x02 <- 0x01).

    Returns
    -------
    (register, value) pairs. The stop address is that of the last byte, where the library (which is given a
    size in bytes and takes it for a number of rows) reads and writes past its array.
    """
    stop = DATA_AT + 4 * len(records) - 1
    head = [(0x02, 0x00), (0x01, gain), (0x03, 0x01), (0x04, 0x00), (0xFF, 0x01)]
    header = [(0x00, 0x05), (0x01, 0x80), (0x02, DATA_AT), (0x03, 0x00), (0x04, stop), (0x05, 0x01)]
    data = [(DATA_AT + at, value) for at, value in enumerate(b"".join(map(bytes, records)))]
    return [*head, *header, *data, (0xFF, 0x00)]
