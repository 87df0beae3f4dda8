"""What stays: equilibria and periodic answers by closed forms and harmonic balance."""

__all__: list[str] = []
