"""Branches of answers along a parameter: folds, critical coupling, locking."""

__all__: list[str] = []
