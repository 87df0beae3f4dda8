"""Patterns of carriers that are not felt themselves, but in how they swell."""

__all__: list[str] = []
