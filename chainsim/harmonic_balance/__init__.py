"""Periodic answers as Fourier series; equilibria and linear response are its lowest orders."""

__all__: list[str] = []
