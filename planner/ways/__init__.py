"""From one pattern to the next."""

__all__: list[str] = []
