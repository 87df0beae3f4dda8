"""Sets of icons: read, encoded, told apart, planned, written."""

__all__: list[str] = []
