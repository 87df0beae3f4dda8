"""Packs: many icons, or a text, as events in one file that is read where it lies."""

__all__: list[str] = []
