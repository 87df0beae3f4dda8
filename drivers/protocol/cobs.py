"""Consistent overhead byte stuffing (Cheshire and Baker 1999): bytes without a zero, so that a zero ends a frame."""

from __future__ import annotations

from ..errors import DriverError

__all__ = ["DELIMITER", "FrameError", "FrameSplitter", "cobs_decode", "cobs_encode"]

DELIMITER = b"\0"
RUN = 254  # most bytes one code byte can announce


class FrameError(DriverError, ValueError):
    """Bytes between two zeros are not a stuffed frame.

    Examples: noise on the line; a frame whose middle was lost.
    """


def cobs_encode(data: bytes) -> bytes:
    """`data` with every zero taken out; the result holds none and is at most len // 254 + 1 bytes longer."""
    out = bytearray()
    runs = data.split(DELIMITER)
    for run in runs[:-1]:
        if len(run) >= RUN:
            run = _long(run, out)
        out.append(len(run) + 1)
        out += run
    last = runs[-1]
    if len(last) >= RUN:
        last = _long(last, out)
        if not last:
            # The code of a full run at the very end says everything.
            return bytes(out)
    out.append(len(last) + 1)
    out += last
    return bytes(out)


def _long(run: bytes, out: bytearray) -> bytes:
    """Put the full runs of `run` into `out`; returns what is left."""
    full = len(run) // RUN * RUN
    for at in range(0, full, RUN):
        out.append(0xFF)
        out += run[at : at + RUN]
    return run[full:]


def cobs_decode(stuffed: bytes) -> bytes:
    """The bytes that `cobs_encode` made `stuffed` of.

    Raises
    ------
    FrameError
        When no bytes stuff to this: it is empty, holds a zero, or a code points past the end.
    """
    if not stuffed or 0 in stuffed:
        raise FrameError("a stuffed frame has at least one byte and no zero")
    out = bytearray()
    at, end = 0, len(stuffed)
    while True:
        code = stuffed[at]
        at += 1
        if code > 1:
            stop = at + code - 1
            if stop > end:
                raise FrameError(f"code {code} at byte {at - 1} points past the end, at {end}")
            out += stuffed[at:stop]
            at = stop
        if at == end:
            return bytes(out)
        if code != 0xFF:
            out.append(0)


class FrameSplitter:
    """Cuts a stream of bytes at its zeros; holds at most `longest` bytes of an unfinished frame.

    Attributes
    ----------
    overlong : how many frames were thrown away for their length.
    """

    def __init__(self, longest: int) -> None:
        self._longest = longest
        self._pending = bytearray()
        self._skipping = False
        self.overlong = 0

    def feed(self, data: bytes) -> list[bytes]:
        """Take the next bytes; returns the frames that they end, without zeros and never empty."""
        frames = []
        *whole, rest = data.split(DELIMITER)
        for part in whole:
            self._append(part)
            if self._pending and not self._skipping:
                frames.append(bytes(self._pending))
            self._pending.clear()
            self._skipping = False
        self._append(rest)
        return frames

    def _append(self, part: bytes) -> None:
        if not self._skipping and len(self._pending) + len(part) > self._longest:
            self._skipping = True
            self.overlong += 1
        if self._skipping:
            self._pending.clear()
        else:
            self._pending += part
