"""The one way this package compiles a kernel."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

from numba import njit
from numba.extending import is_jitted

__all__ = ["compiled", "sources_stamp"]

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(function: Kernel) -> Kernel:
    """Compile `function` with numba on its first call and keep the machine code on disk.

    Kernels release the interpreter lock, so blocks can run on threads. Only fused multiply-add is allowed
    among the fast-math liberties: NaN and infinity keep their meaning, an escape has to be seen. Machine code is read
    from disk only when no file whose helpers it calls has changed since.
    """
    try:
        made = njit(function, cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
    except RuntimeError:
        # Neither the package's folder nor the user's cache folder can be written.
        return cast(Kernel, njit(function, nogil=True, fastmath={"contract"}, error_model="numpy"))
    stored = getattr(getattr(made, "_cache", None), "_cache_file", None)
    if stored is not None and hasattr(stored, "_source_stamp"):
        # numba looks at the kernel's own file; the helpers compiled into it may stand in others.
        stored._source_stamp = sources_stamp(function)
    return cast(Kernel, made)


def sources_stamp(function: Callable[..., object]) -> tuple[tuple[str, int, int], ...]:
    """Name, time of change (ns) and size of every source file whose helpers a kernel may call, its own included."""
    files: set[str] = set()
    _collect(function, files)
    found = sorted((Path(name).name, os.stat(name)) for name in files if Path(name).exists())
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in found)


def _collect(function: Callable[..., object], files: set[str]) -> None:
    if function.__code__.co_filename in files:
        return
    files.add(function.__code__.co_filename)
    for value in function.__globals__.values():
        if is_jitted(value):
            _collect(value.py_func, files)
