"""What the hardware does: devices, coupled-chain systems and the ladder of solvers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
