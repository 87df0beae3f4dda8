"""Where waveforms are played: a controller, a board, a sound card."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from os import PathLike
from typing import TYPE_CHECKING, Any, Self

from ..errors import AppError
from .memory import MEMORY, Playable, on_disk

if TYPE_CHECKING:
    from ..playing.play import PlayReport

__all__ = ["Player", "open"]


def open(address: str, **options: Any) -> Player:
    """What plays waveforms: a controller, the DRV2667 board, or a sound card.

    Nothing is sent before `play`.

    Parameters
    ----------
    address : str
        ``controller:/dev/ttyACM0``, ``drv2667:/dev/ttyUSB0``, ``audio:NAME``, or a sink that another package offers;
        `dotwave ports` lists serial ports.
    **options
        Of `dotwave play`: `baud`, `patience_s` (seconds), `firmware` of a board, `mapping` of a sound card. And of a
        controller that measures `on_measured`, called with each `planner.Measured`.

    Returns
    -------
    Player
        A context manager with `check` and `play`.

    Raises
    ------
    AppError
        When the address names no such thing.

    Examples
    --------
    >>> import dotwave as dw
    >>> wave = dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6").waveform()
    >>> with dw.open("controller:/dev/ttyACM0") as sink:
    ...     print(sink.check(wave).ok)
    True
    """
    from drivers import sink_names

    name, colon, _ = address.partition(":")
    if name not in sink_names() or not colon:
        known = ", ".join(f"{each}:..." for each in sink_names())
        raise AppError(f"{address}: expected one of {known}, such as controller:/dev/ttyACM0")
    return Player(address, options)


@dataclass(frozen=True)
class Player:
    """Plays waveforms at one place; each is held against the safety gate before anything is sent.

    Attributes
    ----------
    address : str
        Where.
    options : dict
        What `dotwave play` is given.

    Examples
    --------
    >>> import dotwave as dw
    >>> dw.open("audio:", mapping="0:2").address
    'audio:'
    """

    address: str
    options: dict[str, Any] = field(default_factory=dict, repr=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is left open between waveforms."""

    def check(self, wave: Playable) -> PlayReport:
        """Hold a waveform against the safety gate and say what playing would do; nothing is sent.

        Parameters
        ----------
        wave : path, ScenePlan or PlanWaveform
            A written waveform, a plan, or its waveform.

        Returns
        -------
        PlayReport
            With `ok`, `gate` (volts, volts per second, amperes, joules) and `notes`.

        Raises
        ------
        drivers.DriverError
            When a sample is over a limit, or the waveform does not fit.

        Examples
        --------
        >>> import dotwave as dw
        >>> plan = dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6")
        >>> dw.open("controller:/dev/ttyACM0").check(plan).live
        False
        """
        return self._run(wave, live=False)

    def play(self, wave: Playable) -> PlayReport:
        """Play a waveform to its end; on every error, and on Ctrl-C, the output goes to zero.

        Parameters
        ----------
        wave : path, ScenePlan or PlanWaveform
            A written waveform, a plan, or its waveform.

        Returns
        -------
        PlayReport
            Its `ok` is False when the output was held up on its way.

        Raises
        ------
        drivers.DriverError
            When a sample is over a limit, the port cannot be opened, or the line is lost.

        Examples
        --------
        >>> import dotwave as dw
        >>> plan = dw.plan(dw.text("Hi", "paper-6x6"), "paper-6x6")
        >>> try:
        ...     dw.open("controller:/dev/nowhere").play(plan)
        ... except dw.DriverError as error:
        ...     print("not played")
        not played
        """
        return self._run(wave, live=True)

    def _run(self, wave: Playable, *, live: bool) -> PlayReport:
        from ..playing.play import play

        with on_disk(wave) as path:
            report = play(path, live=live, to=self.address, **self.options)
        return report if isinstance(wave, str | PathLike) else replace(report, path=MEMORY)
