"""What a live grid shows now, for mirrors."""

from __future__ import annotations

from dataclasses import dataclass

from encoders import Frame

__all__ = ["LiveState"]


@dataclass(frozen=True)
class LiveState:
    """A moment of live playing.

    Attributes
    ----------
    stands : what is felt now, with its `pattern`, `cells` and `text` (the note); None: the grid is at rest.
    coming : what the grid is on its way to; None when it is not on a way, or on the way to rest.
    waiting : whether something newer than that has come.
    resting : whether the grid is at rest, or on its way there.
    connected : whether the sink is heard.
    latency_s : from `show` to the moment the pattern stood, of the last change; None before the first.
    shown : patterns that stood so far.
    coalesced : windows that were passed over because a newer one came.
    refused : one sentence on the last pattern that cannot be made or was not safe, empty when there was none since.
    underruns : how often the controller ran dry.
    """

    stands: Frame | None = None
    coming: Frame | None = None
    waiting: bool = False
    resting: bool = True
    connected: bool = False
    latency_s: float | None = None
    shown: int = 0
    coalesced: int = 0
    refused: str = ""
    underruns: int = 0
