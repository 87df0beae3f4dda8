"""What every report is: plain JSON types, and lines of plain text."""

from __future__ import annotations

from typing import Any, Protocol

__all__ = ["Report"]


class Report(Protocol):
    """What a command prints."""

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        ...

    def as_text(self) -> str:
        """Lines of plain text."""
        ...
