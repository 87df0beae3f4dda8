"""The pages, one module each, with a `PAGE`."""

__all__: list[str] = []
