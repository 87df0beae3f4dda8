"""Pictures to patterns: read, found, fitted to the grid, judged."""

__all__: list[str] = []
