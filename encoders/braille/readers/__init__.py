"""Text files: what can be read, and as what."""

__all__: list[str] = []
