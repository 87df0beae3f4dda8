"""Screen readers as they are: what they write becomes windows of cells, and keys go back to them."""

__all__: list[str] = []
