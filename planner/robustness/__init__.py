"""Actuators that differ from each other, and plans that allow for it."""

__all__: list[str] = []
