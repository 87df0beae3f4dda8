"""The command line: thin commands, help, completion, and how a run ends."""

__all__: list[str] = []
