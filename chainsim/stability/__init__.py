"""What lasts: eigenvalues, multipliers, folds, locking."""

__all__: list[str] = []
