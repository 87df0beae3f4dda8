"""Chain files and sweep files: YAML in, JSON out."""

__all__: list[str] = []
