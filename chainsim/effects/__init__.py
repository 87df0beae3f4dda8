"""What a real actuator does beside its chain's equation: hysteresis, creep, higher modes, amplifiers, several tones."""

__all__: list[str] = []
