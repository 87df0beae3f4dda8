"""The board's serial line: the `~` grammar, its two firmwares, an emulator of both, and frames sent by the clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from .drv2667 import BoardRefusal
from .serial_play import SerialLine

__all__ = ["BOARD_BAUD", "BoardEmulator", "Firmware", "grid_line", "play_grid_lines"]

Bools = NDArray[np.bool_]

BOARD_BAUD = 9600
TIMELY_S = 1e-4  # a tenth of a character's time on the line
LINE_END = b"\r\n"
INVALID = b"Invalid input string length." + LINE_END


class Firmware(StrEnum):
    """What runs on the board.

    `test-pixel` is the branch of that name as it is: it counts the `~` into the length, wants 64 characters for
    a grid of 36, and then draws nothing. `corrected` shows `~` and one digit an actuator.
    """

    TEST_PIXEL = "test-pixel"
    CORRECTED = "corrected"


def grid_line(dots: Bools, firmware: Firmware) -> bytes:
    """The line that shows `dots`, bool, shape (rows, cols).

    Raises
    ------
    BoardRefusal
        When the firmware cannot show any grid.
    """
    if firmware is Firmware.TEST_PIXEL:
        raise BoardRefusal(
            "the test-pixel firmware shows no grid: it rejects lines of any length but 64 and draws nothing of those; "
            "put the corrected firmware on the board and give --firmware corrected"
        )
    return b"~" + b"".join(b"1" if dot else b"0" for dot in dots.ravel()) + b"\n"


class BoardEmulator:
    """The Arduino's side of the serial line, on a clock that is given to it.

    Imitated with their faults: the scan at start-up, the 64-byte input buffer that overflows meanwhile and during
    the two-second delay after a character, lines that end by a second of silence, the length test that counts
    the `~`. Not imitated: which chips answer on I2C.

    Attributes
    ----------
    dots : bool, shape (rows, cols), what stands.
    characters : what was played as a character, in order.
    lost : bytes that found the input buffer full.
    """

    INPUT_BYTES = 64
    SILENCE_S = 1.0
    CHARACTER_S = 2.0

    def __init__(self, firmware: Firmware, *, now: float, rows: int = 6, cols: int = 6, boot_s: float = 2.0) -> None:
        self._firmware = firmware
        self._input = bytearray()
        self._out = bytearray()
        self._busy_until = now + boot_s
        self._last_byte = now
        self.dots: Bools = np.zeros((rows, cols), dtype=bool)
        self.characters: list[str] = []
        self.lost = 0

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that came at `now`."""
        self.tick(now)
        for byte in data:
            # Only while it does something else does the board leave bytes in the buffer.
            if now < self._busy_until and len(self._input) >= self.INPUT_BYTES:
                self.lost += 1
                continue
            self._input.append(byte)
            self._last_byte = now
            self.tick(now)

    def tick(self, now: float) -> None:
        """Let time pass: carry out lines while nothing else is being done."""
        while self._input and now >= self._busy_until:
            end = self._input.find(b"\n")
            if end < 0 and now - max(self._last_byte, self._busy_until) < self.SILENCE_S:
                return
            line = bytes(self._input if end < 0 else self._input[:end])
            del self._input[: len(self._input) if end < 0 else end + 1]
            self._carry_out(line, now)

    def outgoing(self) -> bytes:
        """The bytes to send to the host, once."""
        out = bytes(self._out)
        self._out.clear()
        return out

    def _carry_out(self, line: bytes, now: float) -> None:
        self._out += line + LINE_END
        if line[:1] == b"~":
            self._grid(line)
        elif line:
            self.characters.append(chr(line[0]))
            self._busy_until = now + self.CHARACTER_S

    def _grid(self, line: bytes) -> None:
        if self._firmware is Firmware.TEST_PIXEL:
            if len(line) != 64:
                self._out += INVALID
            return
        digits = np.frombuffer(line[1:], dtype=np.uint8)
        if len(digits) != self.dots.size:
            self._out += INVALID
            return
        self.dots = (digits == ord("1")).reshape(self.dots.shape)


def play_grid_lines(
    lines: Iterable[tuple[float, bytes]],
    line: SerialLine,
    *,
    silence: bytes,
    progress: Callable[[float], None] | None = None,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> int:
    """Send each line at its time; `silence` at the end, on Ctrl-C and on every error. Returns how many were sent.

    Parameters
    ----------
    lines : (seconds from now, bytes) in order; empty bytes only wait.
    progress : gets the seconds played.

    Raises
    ------
    LinkLost
        When the line goes away.
    """
    began, sent = clock(), 0
    try:
        for time_s, data in lines:
            while (rest := time_s - (clock() - began)) > TIMELY_S:
                sleep(min(rest, 0.1))
                if progress is not None:
                    progress(min(time_s, clock() - began))
            # What the firmware answers is an echo; unread it would fill the buffers.
            line.read(0.0)
            if data:
                line.write(data)
                sent += 1
    finally:
        line.write(silence)
    return sent
