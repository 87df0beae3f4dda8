"""The libraries that documents need, imported when one is read; where they are missing the cure is named."""

from __future__ import annotations

import zipfile
import zlib
from importlib import import_module
from types import ModuleType

from ..errors import DocumentsMissing

__all__ = ["STUMBLES", "extra"]

STUMBLES = (
    ArithmeticError, AssertionError, AttributeError, EOFError, LookupError, OSError, RuntimeError, TypeError,
    ValueError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What a library that trusts its files raises of one that is broken, beside errors of its own."""


def extra(module: str) -> ModuleType:
    """A module of the extra ``documents``.

    Raises
    ------
    DocumentsMissing
        When it is not installed.
    """
    try:
        return import_module(module)
    except ImportError:
        library = module.partition(".")[0]
        raise DocumentsMissing(
            f"this kind of document needs {library}, which is not installed; pip install 'dotwave[documents]'"
        ) from None
