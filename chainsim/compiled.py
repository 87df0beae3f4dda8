"""The one way this package compiles a kernel."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

__all__ = ["compiled"]

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(function: Kernel) -> Kernel:
    """Compile `function` with numba on its first call and keep the machine code on disk.

    Kernels release the interpreter lock, so blocks can run on threads. Only fused multiply-add is allowed
    among the fast-math liberties: NaN and infinity keep their meaning, an escape has to be seen.
    """
    try:
        return cast(Kernel, njit(function, cache=True, nogil=True, fastmath={"contract"}, error_model="numpy"))
    except RuntimeError:
        # Neither the package's folder nor the user's cache folder can be written.
        return cast(Kernel, njit(function, nogil=True, fastmath={"contract"}, error_model="numpy"))
