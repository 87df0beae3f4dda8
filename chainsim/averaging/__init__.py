"""Averaged equations (slow flow, after Krylov and Bogoliubov): complex amplitudes in place of the vibration itself."""

__all__: list[str] = []
