"""Patterns with phase: waves, and bars that walk."""

__all__: list[str] = []
