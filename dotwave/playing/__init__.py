"""Written waveforms on hardware, and a controller that is not there."""

__all__: list[str] = []
