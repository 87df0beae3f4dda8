"""What an answer needs and costs: terms of the model, time, accuracy."""

__all__: list[str] = []
