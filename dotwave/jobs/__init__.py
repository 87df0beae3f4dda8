"""Job files: read strictly, and turned into scenes."""

__all__: list[str] = []
