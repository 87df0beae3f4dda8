"""Errors of the application itself, and which errors are a person's bad input."""

from __future__ import annotations

__all__ = ["AppError", "Declined", "Terminated", "bad_input"]


class AppError(Exception):
    """Root of everything `dotwave` raises on purpose; the command line ends with exit code 2.

    Examples: an argument looks like a file that does not exist; a picture cannot be written because
    its folder is read-only.
    """


class Declined(SystemExit):
    """A person was asked whether to go on, and said no; the exit code is 1."""

    def __init__(self) -> None:
        super().__init__(1)


class Terminated(SystemExit):
    """The process was asked to end (SIGTERM, SIGHUP); raised so that files written aside are removed."""


def bad_input() -> tuple[type[Exception], ...]:
    """The error roots that stand for bad input: one per package, and this package's own."""
    from chainsim import ChainError
    from drivers import DriverError
    from encoders import EncodeError
    from planner import PlanError

    return (AppError, ChainError, DriverError, EncodeError, PlanError)
