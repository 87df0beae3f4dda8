"""What was built and what is chosen for it: chains, settings, devices, and what comes out."""

__all__: list[str] = []
