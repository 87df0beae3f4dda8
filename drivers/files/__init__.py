"""Files that appear whole or not at all, alone or in groups that belong together."""

__all__: list[str] = []
