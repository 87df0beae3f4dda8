"""Many settings of one chain at once, compiled."""

__all__: list[str] = []
