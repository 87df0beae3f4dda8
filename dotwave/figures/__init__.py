"""Pictures of results; whatever they show is also said in words."""

__all__: list[str] = []
