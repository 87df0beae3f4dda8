"""Long work of the pages, each module with ``do(folder, asked)``; done in a process of its own."""

__all__: list[str] = []
