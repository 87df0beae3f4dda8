"""The one scaled chain: stiffness, links, the basis of its series, the composition of its flow."""

__all__: list[str] = []
