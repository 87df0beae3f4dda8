"""From one pattern to the next: rise, fall, and what lies between."""

__all__: list[str] = []
