"""Which answer a start reaches, and the cheapest rung for a tolerance."""

__all__: list[str] = []
