"""Actuators that differ from each other: what it costs, and what is measured of them."""

__all__: list[str] = []
