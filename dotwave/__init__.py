"""Braille, textures and icons for grids of coupled piezoelectric actuators: ``import dotwave as dw``.

Every name is imported when it is first used.
"""

import os

import lazy_loader

# Matrices here have at most some hundred rows. Threads of BLAS gain nothing on them, and lose much where cores are
# busy; they are asked for before numpy is first imported, and whoever sets the variable keeps the say.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
