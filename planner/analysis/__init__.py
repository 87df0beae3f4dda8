"""Accuracy against cost, and which terms of the model a scene needs."""

__all__: list[str] = []
