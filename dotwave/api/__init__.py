"""The functions and objects of `import dotwave as dw`."""

__all__: list[str] = []
