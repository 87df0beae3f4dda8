"""Multipliers of a known periodic motion."""

__all__: list[str] = []
