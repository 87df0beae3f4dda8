"""Errors of the application itself, and which errors are a person's bad input."""

from __future__ import annotations

__all__ = ["AppError", "Declined", "NotMade", "Terminated", "bad_input"]


class AppError(Exception):
    """Root of everything `dotwave` raises on purpose; the command line ends with exit code 2.

    Cases: an argument looks like a file that does not exist; a picture cannot be written because
    its folder is read-only.

    Examples
    --------
    >>> import dotwave as dw
    >>> try:
    ...     dw.plan(dw.text("Hello"))
    ... except dw.AppError as error:
    ...     print(error)
    plan: no device was given; give the one that the scene was laid out for
    """


class NotMade(AppError):
    """A frame cannot be made as asked, so nothing was written.

    Examples
    --------
    >>> import dotwave as dw
    >>> ring = dw.device("paper-6x6-ring")
    >>> try:
    ...     dw.plan(dw.text("Hello", ring), ring).waveform().samples(0.0, 0.1)
    ... except dw.NotMade as error:
    ...     print(error)
    Frame 1: paper-6x6-ring cannot make this pattern: ...
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
