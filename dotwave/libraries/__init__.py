"""Folders of texts, rendered as one job."""

__all__: list[str] = []
