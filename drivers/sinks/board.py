"""The board of 36 DRV2667 as a sink: what it would load, and on/off dots over its serial line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..formats.samples import SampleReader
from ..waveform.manifest import Manifest
from .base import SinkError, SinkReport
from .board_serial import BOARD_BAUD, Firmware, grid_line, play_grid_lines
from .tactile_board import BoardPlan, plan_board
from .uart import Uart

__all__ = ["Board"]


@dataclass(frozen=True)
class Board:
    """A sink: the board at `port`.

    Attributes
    ----------
    port : such as /dev/ttyUSB0.
    baud : bits per second.
    firmware : what runs on the board.
    """

    port: str
    baud: int = BOARD_BAUD
    firmware: Firmware = Firmware.TEST_PIXEL

    def check(self, manifest: Manifest, samples: SampleReader) -> SinkReport:
        """What each chip would load.

        Raises
        ------
        BoardRefusal
            As `plan_board`.
        """
        return _said(plan_board(manifest, samples))

    def play(self, manifest: Manifest, samples: SampleReader, progress: Callable[[float], None]) -> SinkReport:
        """Send the dots of each frame at its time.

        Raises
        ------
        BoardRefusal
            As `plan_board`, and when the firmware shows no grid.
        LinkLost, PortUnavailable, SerialMissing
            When there is no line, or it goes away.
        """
        if not self.port:
            raise SinkError("drv2667: give its port, as in drv2667:/dev/ttyUSB0; `dotwave ports` lists ports")
        plan = plan_board(manifest, samples)
        lines = [(frame.start_s, grid_line(frame.dots, self.firmware)) for frame in plan.frames]
        dark = lines[0][1].replace(b"1", b"0") if lines else b""
        line = Uart(self.port, self.baud)
        try:
            play_grid_lines([*lines, (manifest.duration_s, b"")], line, silence=dark, progress=progress)
        finally:
            line.close()
        return _said(
            plan,
            "The board got on/off dots and makes its own waveform: no firmware yet loads the records over this line.",
        )

    def close(self) -> None:
        """Nothing stays open after `play`."""


def _said(plan: BoardPlan, *notes: str) -> SinkReport:
    line = (
        f"board: gain {plan.gain}, frequency off by {plan.frequency_error_hz:.2f} Hz, level off by "
        f"{plan.level_error:.1%}, loading {1e3 * plan.load_s:.0f} ms of I2C, start skew {1e3 * plan.skew_s:.1f} ms"
    )
    return SinkReport(facts={"board": _plain(plan)}, lines=(line,), notes=notes)


def _plain(plan: BoardPlan) -> dict[str, Any]:
    frames = [
        {
            "start_s": frame.start_s,
            "duration_s": frame.duration_s,
            "load_s": frame.load_s,
            "skew_s": frame.skew_s,
            "records": [
                {"mux": mux, "port": port, "bytes": [list(bytes(record)) for record in records]}
                for (mux, port), records in sorted(frame.records.items())
            ],
        }
        for frame in plan.frames
    ]
    return {
        "gain": plan.gain, "frequency_error_hz": plan.frequency_error_hz, "level_error": plan.level_error,
        "load_s": plan.load_s, "skew_s": plan.skew_s, "frames": frames,
    }  # fmt: skip
