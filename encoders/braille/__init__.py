"""Text to frames of Braille cells, and back."""

__all__: list[str] = []
