"""Actuators fitted to what was measured of them."""

__all__: list[str] = []
