"""What a live session needs of the grid it shows its windows on."""

from __future__ import annotations

from typing import Protocol

from encoders import Frame

__all__ = ["GridState", "LiveGrid"]


class GridState(Protocol):
    """What a grid says of itself."""

    @property
    def stands(self) -> Frame | None:
        """What is felt now; None at rest."""

    @property
    def waiting(self) -> bool:
        """Whether something newer has come."""

    @property
    def resting(self) -> bool:
        """Whether it is at rest, or on its way there."""

    @property
    def latency_s(self) -> float | None:
        """From `show` to the moment the last pattern stood, in seconds."""

    @property
    def shown(self) -> int:
        """Patterns that stood so far."""

    @property
    def refused(self) -> str:
        """Why the last pattern is not shown, empty where it is."""


class LiveGrid(Protocol):
    """A grid that shows what comes, the latest before all; `dotwave.live` has one."""

    def show(self, what: str, note: str | None = None) -> None:
        """Show cells, Unicode Braille in reading order, next; `note` is their text."""

    def hold(self) -> None:
        """Nobody is left to say what to show."""

    @property
    def state(self) -> GridState:
        """What stands."""
