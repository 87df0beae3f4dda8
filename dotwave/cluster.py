"""A dask.distributed scheduler whose workers have the same dotwave as this machine."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from .errors import AppError

__all__ = ["RETRIES", "Connection", "connect", "connected", "one_line_of"]

PACKAGES = ("chainsim", "dotwave", "drivers", "encoders", "planner")
CONNECT_S = 10.0

RETRIES = 3
"""How often work is tried again that ended its worker."""


class Connection(NamedTuple):
    """The library and a client of it."""

    distributed: Any
    client: Any


def connect(address: str) -> Connection:
    """Connect to the scheduler at `address`; whoever does closes the client.

    Raises
    ------
    AppError
        When dask.distributed is not installed, nobody answers, or workers have another dotwave.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise AppError("--scheduler needs dask.distributed: pip install 'dotwave[cluster]'") from None
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise AppError(
            f"{address}: no dask scheduler answers: {one_line_of(error)}; start one, or correct it"
        ) from None
    if set(client.run(_code_digest).values()) - {_code_digest()}:
        client.close(timeout=1)
        raise AppError(f"{address}: a worker has another version of dotwave; install the same one everywhere")
    return Connection(distributed, client)


@contextmanager
def connected(address: str) -> Iterator[Connection]:
    """`connect`, and the client closed at the end; raises as it does."""
    connection = connect(address)
    try:
        yield connection
    finally:
        connection.client.close(timeout=1)


def one_line_of(problem: BaseException | None) -> str:
    """Kind and words of an error."""
    return "" if problem is None else f"{type(problem).__name__}: {' '.join(str(problem).split())}"[:300]


@cache
def _code_digest() -> str:
    """Digest of the code that does the work: machines that share it must have the same."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[1]
    for path in (path for one in PACKAGES for path in sorted((root / one).rglob("*.py"))):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()
