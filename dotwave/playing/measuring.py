"""Plans played on a controller that measures what its actuators do."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from drivers import write_waveform
from planner import Measured, Plan

from ..errors import AppError
from .play import play

__all__ = ["MeasuringPort"]

ATTEMPTS = 2


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
        """Play from rest to rest; once more where no measurement came, for a line may lose it.

        Raises
        ------
        AppError
            When the output was held up on its way, which spoils what is measured.
        DriverError
            When the gate refuses, the hardware does not fit, or the line is lost.
        """
        found: list[Measured] = []
        with TemporaryDirectory(prefix="dotwave-tune-") as folder:
            path = Path(folder) / "page.wav"
            write_waveform(plan, path)
            for _ in range(ATTEMPTS):
                report = play(path, live=True, port=self._port, baud=self._baud, on_measured=found.append)
                if found:
                    break
        if not found and not report.ok:
            raise AppError(f"{self._port}: the output was held up, and nothing was measured; {' '.join(report.notes)}")
        return found
