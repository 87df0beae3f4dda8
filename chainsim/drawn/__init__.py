"""Many devices of one profile, drawn at random, with what acts on them, under one waveform."""

__all__: list[str] = []
