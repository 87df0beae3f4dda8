"""A plan as samples, and the manifest beside them."""

__all__: list[str] = []
