"""Helpers of kernels, compiled into their callers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

__all__ = ["inlined"]

Helper = TypeVar("Helper", bound=Callable[..., object])


def inlined(function: Helper) -> Helper:
    """Compile `function` into every kernel that calls it, under the rules of `compiled`.

    A helper compiled apart exists twice, alone and within its caller, optimised differently; which of the two runs
    depends on whether the caller was compiled just now or read from disk, and the last bit of an answer with it.
    """
    made = njit(function, forceinline=True, nogil=True, fastmath={"contract"}, error_model="numpy")
    return cast(Helper, made)
