"""What a command prints: plain JSON types, and lines of plain text."""

from __future__ import annotations

from typing import Any, Protocol

__all__ = ["Printable"]


class Printable(Protocol):
    """What every report can be shown as."""

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        ...

    def as_text(self) -> str:
        """Lines of plain text."""
        ...
