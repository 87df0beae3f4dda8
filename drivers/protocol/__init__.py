"""The wire between host and controller: packets, both ends, and a controller that is not there."""

__all__: list[str] = []
