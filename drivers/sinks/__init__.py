"""Where samples can be played: controllers and boards on serial ports, sound cards."""

__all__: list[str] = []
