"""What work says while it goes on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

__all__ = ["Tell"]

Tell = Callable[[Mapping[str, Any]], None]
"""Takes what there is to see now, plain JSON types."""
