"""Vibrations for displays of others: HJIF, AHAP and Meta's .haptic, written and read."""

__all__: list[str] = []
