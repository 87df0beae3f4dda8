"""The full equations in time, and the periodic motions they settle to."""

__all__: list[str] = []
