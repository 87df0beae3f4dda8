"""Where windows come from: the one face that sockets, terminals, standard input and recordings show to a session."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from .window import BrailleWindow, Key

__all__ = ["WindowPort"]


class WindowPort(ABC):
    """Moves the bytes of one bridge; opened, used and closed on one asyncio loop.

    A subclass calls `changed` whenever `window` may have changed, and sets `ended` and calls it when no more comes.

    Attributes
    ----------
    kind : the word for it on the command line.
    how : lines that tell a person how to connect, known once it is open.
    ended : nothing will come any more.
    settle_s : how long the parts of one window may be apart.
    """

    kind = ""
    settle_s = 0.0

    def __init__(self) -> None:
        self.how: tuple[str, ...] = ()
        self.ended = False
        self.changed: Callable[[], None] = lambda: None

    @property
    @abstractmethod
    def window(self) -> BrailleWindow | None:
        """What is to be felt now; None when there is nobody to say."""

    @abstractmethod
    async def open(self) -> None:
        """Begin to listen.

        Raises
        ------
        AppError, DriverError
            When that cannot be.
        """

    @abstractmethod
    def press(self, key: Key) -> None:
        """Hand a key to whoever wrote the window."""

    @abstractmethod
    async def close(self) -> None:
        """Listen no more."""
