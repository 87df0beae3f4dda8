"""How much is read of one picture, and what its decoders raise when it is malformed."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

__all__ = ["BROKEN", "PictureLimits"]

# What Pillow's decoders raise on malformed files, found by feeding them mutated ones.
BROKEN = (
    ArithmeticError, AssertionError, AttributeError, EOFError, LookupError, NotImplementedError, OSError,
    RuntimeError, SyntaxError, TypeError, ValueError, struct.error, zlib.error,
)  # fmt: skip


@dataclass(frozen=True)
class PictureLimits:
    """How much is read of one picture.

    Attributes
    ----------
    file_bytes : size of the file.
    pixels : width times height of a JPEG; three tenths of it for other kinds, an animation's frames together.
    frames : frames of an animation.
    svg_bytes : size of an SVG when unpacked.
    svg_elements : elements an SVG draws, those by reference counted each time.
    svg_points : points of its only path; of several paths the root of the sum of their squares, which is what the
        time to draw them grows with.
    """

    file_bytes: int = 64_000_000
    pixels: int = 40_000_000
    frames: int = 500
    svg_bytes: int = 1_000_000
    svg_elements: int = 20_000
    svg_points: int = 20_000
