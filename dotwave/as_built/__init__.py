"""What a written waveform makes felt on many devices as they are built."""

__all__: list[str] = []
