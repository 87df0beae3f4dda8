"""Devices whose actuators are coupled in two dimensions: one chain of all of them, row by row."""

__all__: list[str] = []
