"""Plans played on a controller that measures what its actuators do."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from drivers import write_waveform
from planner import Measured, Plan

from .play import play

__all__ = ["MeasuringPort"]


class MeasuringPort:
    """A line to a controller: plays a plan, behind the safety gate, and gives what was measured of its frames.

    Parameters
    ----------
    port : serial port of the controller.
    baud : bits per second; None: the controller's own.
    """

    def __init__(self, port: str, baud: int | None = None) -> None:
        self._port, self._baud = port, baud

    def __call__(self, plan: Plan) -> list[Measured]:
        """Play from rest to rest.

        Raises
        ------
        DriverError
            When the gate refuses, the hardware does not fit, or the line is lost.
        """
        found: list[Measured] = []
        with TemporaryDirectory(prefix="dotwave-tune-") as folder:
            path = Path(folder) / "page.wav"
            write_waveform(plan, path)
            play(path, live=True, port=self._port, baud=self._baud, on_measured=found.append)
        return found
