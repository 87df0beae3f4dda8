"""A stream of samples without an end: what stands, and ways to what comes."""

__all__: list[str] = []
