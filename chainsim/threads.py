"""Compiled kernels on every core."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

__all__ = ["in_threads"]


def in_threads(work: Callable[[slice], None], count: int, block: int) -> None:
    """Call `work` on slices of ``range(count)``, whole blocks each, on every core; kernels release the lock."""
    blocks = -(-count // block)
    workers = min(os.cpu_count() or 1, blocks)
    if workers <= 1:
        work(slice(0, count))
        return
    edges = [min(count, block * (blocks * k // workers)) for k in range(workers + 1)]
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(work, [slice(a, b) for a, b in pairwise(edges)]))
