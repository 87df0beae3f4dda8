"""What else a real actuator does: hysteresis, creep, higher modes, an amplifier's limits, several tones."""

__all__: list[str] = []
