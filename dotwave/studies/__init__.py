"""What a chain, a device or a plan is asked beside being played: sweeps, calibration, accuracy against cost."""

__all__: list[str] = []
