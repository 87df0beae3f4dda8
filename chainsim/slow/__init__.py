"""What moves slowly: complex amplitudes in place of the vibration itself."""

__all__: list[str] = []
