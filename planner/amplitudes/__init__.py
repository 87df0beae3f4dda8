"""Patterns of amplitude or deflection: dots and levels."""

__all__: list[str] = []
