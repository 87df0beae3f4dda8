"""What a chain holds, as a key that equal wishes share."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Held"]


class Held(NamedTuple):
    """What a chain holds: a wish as bytes (of amplitudes alone, or of a `ChainWish`), and its turn in radians.

    `kind` : where chains have numbers of their own, which of the kinds there are it is.
    """

    key: bytes
    turn: float = 0.0
    kind: int = 0
