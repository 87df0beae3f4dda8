"""Live playing: what comes is felt a moment later, for as long as it stays true."""

__all__: list[str] = []
