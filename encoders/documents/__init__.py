"""Documents: what is in a file, as blocks of runs that know where they come from."""

__all__: list[str] = []
